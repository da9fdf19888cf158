"""Compute a recorded session's commands again, and hold any lab's log against a supervisor.

A replay gives the law of the core's Python module every number that the engine's law was given, and compares what both
asked of the drive bit by bit. A log of another lab has no such numbers: its angle, and its torque if there is one, are
given to a supervised law as its encoder and its drive, which says at which sample it would have stopped, and how much
energy the torque gave to the person until then and after.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._errors import PellucidError
from ..control.control_law import LAWS, ControlLaw
from ..control.supervised import SUPERVISOR_NAMES, SupervisedLaw
from ..control.supervisor_faults import FAULT_NAMES, NO_FAULT
from ..recordings.xdf_writer import SAMPLES_TAG, WrittenXdf, chunks, sample_block, scan_xdf
from . import layout
from .replay_columns import RAW_COLUMNS, records_of
from .setup import Condition

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


@dataclass(frozen=True)
class LogVerdict:
    """What a supervisor would have made of a log."""

    samples: int
    stopped_at: int | None  # sample at which it would have stopped; None: it would not have
    fault: str  # why, "none" where it would not
    response: str  # what it would have done: "damped_stop" or "zero"
    energy_before: float | None  # energy that the torque gave to the joint until then [J]; None without a torque
    energy_after: float | None  # energy that it gave in the rest of the log [J]
    energy_largest: float | None  # largest energy given to the joint from any sample on to a later one [J]
    duration: float | None  # of the log [s]; None for one without a clock

    def sentence(self) -> str:
        """Return the verdict as a sentence."""
        at = "" if self.duration is None else f" of {self.duration:.3g} s"
        if self.stopped_at is None:
            said = f"The supervisor would not have stopped this log of {self.samples} samples{at}."
        else:
            said = (
                f'The supervisor would have stopped at sample {self.stopped_at} of {self.samples}{at}: "{self.fault}", '
                f"answered by {self.response}."
            )
        if self.energy_before is not None and self.energy_after is not None:
            said += f" The torque gave {self.energy_before:.3g} J to the joint before"
            said += f" and {self.energy_after:.3g} J in what followed." if self.stopped_at is not None else " its end."
        return said


def given_energy(angle: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Return the energy that a torque has given to a joint at each sample, shape (n,) [J].

    It needs no clock: each step of the angle [rad] takes the mean of the torques [N m] at its ends.
    """
    work = 0.5 * (torque[1:] + torque[:-1]) * np.diff(angle)
    return np.concatenate([[0.0], np.cumsum(np.nan_to_num(work))])


def largest_rise(energy: np.ndarray) -> float:
    """Return the largest rise of an energy from any sample to a later one [J]."""
    return float(np.max(energy - np.minimum.accumulate(energy))) if len(energy) else 0.0


def replay_log(
    angle: np.ndarray,
    law: SupervisedLaw,
    *,
    torque: np.ndarray | None = None,
    drive: np.ndarray | None = None,
    time: np.ndarray | None = None,
    samples: Mapping[str, np.ndarray] | None = None,
) -> LogVerdict:
    """Give a lab's log to a supervised law, and say where the supervisor would have stopped.

    Parameters
    ----------
    angle : ndarray, shape (n,)
        Joint angle [rad].
    law : SupervisedLaw
        Law with the supervisor that judges; it is begun anew.
    torque : ndarray, shape (n,), optional
        Torque that the robot gave to the joint [N m], for the energy.
    drive : ndarray, shape (n,), optional
        The drive's measured torque, for the supervisor [N m].
    time : ndarray, shape (n,), optional
        [s]; left out, samples are taken to be one control period apart, and nothing is said in seconds.
    samples : mapping, optional
        Further sensors of the law by name, each shape (n,), SI.

    Returns
    -------
    LogVerdict

    Raises
    ------
    PellucidError
        If arrays have different lengths, fewer than two samples, or the law has no such sensor.
    """
    angle = np.asarray(angle, float)
    more = dict(samples or {})
    arrays = {"torque": torque, "drive": drive, "time": time, **more}
    for name, values in arrays.items():
        if values is not None and np.shape(values) != angle.shape:
            raise PellucidError(f'log: found {np.shape(values)} values of "{name}", expected {angle.shape} as of the angle')
    if angle.ndim != 1 or len(angle) < 2:
        raise PellucidError(f"log: found an angle of shape {angle.shape}, expected one number a sample, at least two")
    unknown = set(more) - set(law.sensors[1:])
    if unknown:
        raise PellucidError(f"log: the law has no sensor {', '.join(sorted(unknown))}, expected {', '.join(law.sensors)}")
    running, period = law.start(), law.values["period"]
    moments = np.arange(len(angle)) * period if time is None else np.asarray(time, float)
    others = [more.get(name) for name in law.sensors[1:]]
    stopped: int | None = None
    for i in range(len(angle)):
        read = [None if values is None else _number(values[i]) for values in others]
        measured = None if drive is None else _number(drive[i])
        running.step(float(moments[i]), _number(angle[i]), *read, drive=measured)
        if running.mode in layout.MODES[3:]:
            stopped = i
            break
    before = after = largest = None
    if torque is not None:
        energy = given_energy(angle, np.asarray(torque, float))
        at = len(angle) - 1 if stopped is None else stopped
        before, after, largest = float(energy[at]), float(energy[-1] - energy[at]), largest_rise(energy)
    return LogVerdict(
        samples=len(angle),
        stopped_at=stopped,
        fault=running.fault if stopped is not None else NO_FAULT,
        response=running.mode if stopped is not None else "",
        energy_before=before,
        energy_after=after,
        energy_largest=largest,
        duration=None if time is None else float(moments[-1] - moments[0]),
    )


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
