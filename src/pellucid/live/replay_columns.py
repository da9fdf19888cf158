"""Columns of the stream "robot": what people read, and then every number that the law was given."""

from __future__ import annotations

import numpy as np

from . import layout

READABLE_COLUMNS = (
    ("position", "rad"),
    ("velocity", "rad/s"),
    ("torque", "N*m"),
    ("interaction", "N*m"),
    ("muscle", "N*m"),
    ("drive", "N*m"),
    ("target", "rad"),
    ("limb", "rad"),
    ("task", ""),
    ("condition", ""),
    ("state", ""),
    ("mode", ""),
    ("fault", ""),
    ("late", ""),
)
"""Columns for people, with their units; efforts of a sensor that says nothing are NaN."""

RAW_FIELDS = (
    "number", "cycle", "time", "now_us", "valid", "flags", "token", "challenge", "beat", "enable", "adjusted_field",
    "adjusted_value", "task_kind", "limb_velocity", "muscle_torque", "flexor", "extensor", "compute",
)  # fmt: skip
"""Fields of a record that follow as they are, as numbers of 64 bits; integers up to 2^53 keep their bits."""

RAW_COLUMNS = (
    *(f"raw.{name}" for name in RAW_FIELDS),
    *(f"raw.value.{name}" for name in layout.VALUE_NAMES),
    *(f"raw.stamp_us.{name}" for name in layout.VALUE_NAMES),
    *(f"raw.sequence.{name}" for name in layout.VALUE_NAMES),
)
"""Names of the columns that a replay needs."""

ROBOT_COLUMNS = (*READABLE_COLUMNS, *((name, "") for name in RAW_COLUMNS))
"""All columns of the stream, with their units."""


def robot_values(records: np.ndarray) -> np.ndarray:
    """Return the stream's values of records, shape (n, k)."""
    valid = (records["valid"][:, None] >> np.arange(6, dtype=np.uint32) & 1).astype(bool)
    shown = np.where(valid, records["value"], np.nan)
    columns = [
        shown[:, 0], records["velocity"], records["effort"], records["value"][:, 2], shown[:, 3], records["drive_torque"],
        records["target"], records["limb_position"], records["task"], records["law"], records["state"], records["mode"],
        records["fault"], records["flags"] & layout.FLAG_LATE, *(records[name] for name in RAW_FIELDS),
    ]  # fmt: skip
    wide = np.column_stack([np.asarray(column, float) for column in columns])
    return np.column_stack([wide, records["value"], records["stamp_us"].astype(float), records["sequence"].astype(float)])


def records_of(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Return records of the stream's columns by name, as the engine wrote them, what a replay does not need left 0."""
    n = len(columns["raw.number"])
    records = np.zeros(n, layout.RECORD)
    for name in RAW_FIELDS:
        records[name] = columns[f"raw.{name}"]
    for i, name in enumerate(layout.VALUE_NAMES):
        records["value"][:, i] = columns[f"raw.value.{name}"]
        records["stamp_us"][:, i] = columns[f"raw.stamp_us.{name}"]
        records["sequence"][:, i] = columns[f"raw.sequence.{name}"]
    for name, column in (("effort", "torque"), ("law", "condition"), ("state", "state"), ("mode", "mode"), ("fault", "fault")):
        records[name] = columns[column]
    return records
