"""Compute a recorded session's commands again: the law of the core's Python module is given every number that the
engine's law was given, and what both asked of the drive is compared bit by bit.

Columns of the streams "robot", for people, and "engine", with every number that the law was given.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._errors import PellucidError
from ..controllers.control_law import LAWS, ControlLaw
from ..controllers.supervised import SUPERVISOR_NAMES, SupervisedLaw
from ..controllers.supervisor_faults import FAULT_NAMES
from ..files.xdf_writer import SAMPLES_TAG, WrittenXdf, chunks, sample_block, scan_xdf
from . import layout
from .setup import Condition

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


def record_channels(records: np.ndarray) -> dict[str, np.ndarray]:
    """Return the channels of records by name, each shape (n,), SI."""
    valid = (records["valid"][:, None] >> np.arange(6, dtype=np.uint32) & 1).astype(bool)
    values = np.where(valid, records["value"], np.nan)
    return {
        "position": values[:, 0],
        "velocity": records["velocity"],
        "torque": records["effort"],
        "interaction": records["value"][:, 2],
        "muscle": values[:, 3],
        "drive": records["drive_torque"],
        "target": records["target"],
        "limb": records["limb_position"],
        "flexor": records["flexor"],
        "extensor": records["extensor"],
        "state": records["state"].astype(float),
        "mode": records["mode"].astype(float),
        "fault": records["fault"].astype(float),
        "condition": records["law"].astype(float),
        "task": records["task"].astype(float),
        "late": (records["flags"] & layout.FLAG_LATE).astype(float),
        "lateness": 1e-9 * (records["time"] - records["deadline"]),
        "compute": 1e-9 * records["compute"],
        "estimate": records["torque_estimate"],
        "estimate_low": records["torque_estimate"] - records["torque_half_width"],
        "estimate_high": records["torque_estimate"] + records["torque_half_width"],
    }


def robot_values(records: np.ndarray) -> np.ndarray:
    """Return the values of the stream "robot", shape (n, k), in the order of `READABLE_COLUMNS`."""
    channels = record_channels(records)
    channels |= {name: records[name] for name in ("torque_estimate", "torque_half_width")}
    return np.column_stack([np.asarray(channels[name], float) for name, _ in READABLE_COLUMNS])


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


XDF_START = b"XDF:"
"""First bytes of an XDF file."""

ENGINE_STREAM = "engine"
"""Name of the stream that a replay reads."""


@dataclass(frozen=True)
class Replay:
    """A session computed again."""

    cycles: int  # cycles of the recording
    compared: int  # cycles in which a law was stepped, from its beginning on
    unknown: int  # cycles in which a law was stepped whose beginning the recording lacks
    wrong_bits: int  # bits that differ in commands, and in the supervisor's modes and faults
    first_wrong: int | None  # number of the first cycle that differs
    gaps: int  # places where records are missing, after which the law's state is unknown

    @property
    def is_equal(self) -> bool:
        """Whether every command was computed again bit for bit."""
        return self.wrong_bits == 0 and self.compared > 0


def conditions_of(settings: str) -> list[Condition]:
    """Return the conditions in the text of an engine's numbers.

    Raises
    ------
    PellucidError
        If the text is none of a known version.
    """
    lines = [line.split() for line in settings.splitlines() if line.strip()]
    if not lines or lines[0] != ["pellucid-engine", "1"]:
        raise PellucidError('settings: expected "pellucid-engine 1" in the first line')
    found: list[list] = []
    for key, *words in lines:
        if key == "condition":
            found.append([words[0], words[1], words[2] == "1", [], []])
        elif key in ("law", "supervisor"):
            found[-1][3 if key == "law" else 4] = [float.fromhex(word) for word in words[1:]]
    made = []
    for name, kind, worn, numbers, supervisor in found:
        law = None
        if kind != "none":
            known = ControlLaw(kind, dict(zip(LAWS[kind].parameters, numbers, strict=True)))
            law = SupervisedLaw(known, dict(zip(SUPERVISOR_NAMES, supervisor, strict=True)))
        made.append(Condition(name, law, worn))
    return made


def has_engine_records(path: str | Path) -> bool:
    """Return whether a file is one of a session, with every number that its law was given."""
    path = Path(path)
    with path.open("rb") as file:
        if file.read(4) != XDF_START:
            return False
    return _engine_stream(scan_xdf(path)) is not None


def read_session(path: str | Path) -> tuple[list[Condition], np.ndarray]:
    """Return the conditions of a session's file and its records; the file need not have been ended.

    Raises
    ------
    PellucidError
        If the file is missing or has no stream "engine".
    """
    path = Path(path)
    try:
        data, found = path.read_bytes(), scan_xdf(path)
    except OSError as error:
        raise PellucidError(f"{path}: {error.strerror or error}") from None
    identity = _engine_stream(found)
    if identity is None:
        raise PellucidError(f'{path}: found no stream "{ENGINE_STREAM}"; expected the file of a session, session.xdf')
    stream, blocks = found.streams[identity], []
    if stream.channels != len(RAW_COLUMNS):
        raise PellucidError(f"{path}: found {stream.channels} columns, expected {len(RAW_COLUMNS)} of this version")
    for chunk in chunks(data):
        if chunk.tag == SAMPLES_TAG and int.from_bytes(chunk.content[:4], "little") == identity:
            block = sample_block(chunk.content, stream)
            assert block is not None
            blocks.append(block["value"])
    settings = found.headers[identity].findtext("desc/settings") or ""
    return conditions_of(settings), records_of(np.concatenate(blocks) if blocks else np.zeros((0, len(RAW_COLUMNS))))


def _engine_stream(found: WrittenXdf) -> int | None:
    return next((identity for identity in found.headers if found.name(identity) == ENGINE_STREAM), None)


def replay_session(path: str | Path) -> Replay:
    """Compute every command of a session's file again.

    Parameters
    ----------
    path : path
        File ``session.xdf`` of a live session, ended or not.

    Returns
    -------
    Replay

    Raises
    ------
    PellucidError
        If the file is missing or is no session's.
    """
    conditions, records = read_session(path)
    return replay_records(conditions, records)


def replay_records(conditions: list[Condition], records: np.ndarray) -> Replay:
    """Compute the commands of an engine's records again."""
    law = None
    names: dict[int, list[float]] = {}
    compared = unknown = wrong = gaps = 0
    first: int | None = None
    before = 0
    for record in records:
        number, flags = int(record["number"]), int(record["flags"])
        if before and number != before + 1:
            gaps += 1
            law = None
        before = number
        if not flags & layout.FLAG_STEPPED:
            law = law if flags & layout.FLAG_BEGAN else None
            continue
        index = int(record["law"])
        condition = conditions[index].law
        if flags & layout.FLAG_BEGAN and condition is not None:
            law, names[index] = condition.start(), condition.parameters.tolist()
        if law is None or condition is None:
            unknown += 1
            continue
        if flags & layout.FLAG_STOP_ASKED:
            law.stop()
        if flags & layout.FLAG_ADJUSTED:
            names[index][int(record["adjusted_field"])] = float(record["adjusted_value"])
            law.adjust(np.array(names[index]))
        effort = law.step_samples(int(record["now_us"]), _samples(condition, record), int(record["token"]))
        compared += 1
        differs = _differing_bits(effort, float(record["effort"]))
        differs += layout.MODES.index(law.mode) != int(record["mode"])
        differs += FAULT_NAMES.index(law.fault) != int(record["fault"])
        if differs and first is None:
            first = number
        wrong += differs
    return Replay(len(records), compared, unknown, wrong, first, gaps)


def _samples(law: SupervisedLaw, record: np.void) -> list[tuple[float, int, int, bool]]:
    """Return what a law's `step_samples` takes: its sensors, the drive and the second encoder."""
    names = [*law.sensors, "drive", "joint"]
    places = [layout.VALUE_NAMES.index(name) for name in names]
    valid = int(record["valid"])
    return [
        (float(record["value"][i]), int(record["sequence"][i]), int(record["stamp_us"][i]), bool(valid >> i & 1))
        for i in places
    ]


def _differing_bits(a: float, b: float) -> int:
    (left,), (right,) = struct.unpack("<Q", struct.pack("<d", a)), struct.unpack("<Q", struct.pack("<d", b))
    return (left ^ right).bit_count()
