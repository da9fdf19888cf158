"""Columns of the streams "robot", for people, and "engine", with every number that the law was given."""

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
    ("torque_estimate", "N*m"),
    ("torque_half_width", "N*m"),
)
"""Columns for people, with their units; efforts of a sensor that says nothing are NaN."""

RAW_FIELDS = (
    "number", "cycle", "time", "deadline", "now_us", "valid", "flags", "law", "token", "effort", "fault", "mode",
    "enable", "state", "beat", "challenge", "task", "task_kind", "target", "adjusted_field", "adjusted_value",
    "velocity", "limb_position", "limb_velocity", "muscle_torque", "flexor", "extensor", "drive_torque", "compute",
)  # fmt: skip
"""Fields of a record, kept as numbers of 64 bits: integers up to 2^53 keep their value, and numbers their bits."""

RAW_COLUMNS = (
    *RAW_FIELDS,
    *(f"value.{name}" for name in layout.VALUE_NAMES),
    *(f"stamp_us.{name}" for name in layout.VALUE_NAMES),
    *(f"sequence.{name}" for name in layout.VALUE_NAMES),
)
"""Names of the columns of the stream "engine": a replay needs nothing else."""


def robot_values(records: np.ndarray) -> np.ndarray:
    """Return the values of the stream "robot", shape (n, k), in the order of `READABLE_COLUMNS`."""
    valid = (records["valid"][:, None] >> np.arange(6, dtype=np.uint32) & 1).astype(bool)
    shown = np.where(valid, records["value"], np.nan)
    columns = [
        shown[:, 0], records["velocity"], records["effort"], records["value"][:, 2], shown[:, 3],
        records["drive_torque"], records["target"], records["limb_position"], records["task"], records["law"],
        records["state"], records["mode"], records["fault"], records["flags"] & layout.FLAG_LATE,
        records["torque_estimate"], records["torque_half_width"],
    ]  # fmt: skip
    return np.column_stack([np.asarray(column, float) for column in columns])


def raw_values(records: np.ndarray) -> np.ndarray:
    """Return the values of the stream "engine", shape (n, k), in the order of `RAW_COLUMNS`."""
    wide = np.column_stack([np.asarray(records[name], float) for name in RAW_FIELDS])
    return np.column_stack(
        [wide, records["value"], records["stamp_us"].astype(float), records["sequence"].astype(float)]
    )


def records_of(values: np.ndarray) -> np.ndarray:
    """Return records of the stream's values, shape (n, k), as the engine wrote them; other fields are 0."""
    records = np.zeros(len(values), layout.RECORD_TYPE)
    for i, name in enumerate(RAW_FIELDS):
        records[name] = values[:, i]
    for j, name in enumerate(("value", "stamp_us", "sequence")):
        first = len(RAW_FIELDS) + j * len(layout.VALUE_NAMES)
        records[name] = values[:, first : first + len(layout.VALUE_NAMES)]
    return records
