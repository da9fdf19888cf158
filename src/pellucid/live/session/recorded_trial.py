"""A trial's recording: its entry in study.toml, and the checks of `pellucid check` on it alone.

The entry is added at the end of study.toml, so that nothing that a person wrote there is touched, and every command
takes the recording.

What `pellucid live DIR --replay FILE` answers: a session's commands bit for bit, or any log under the supervisor.

The file of a session has every number that its law was given; each command is computed again and compared. Every other
file is a log whose columns study.toml names: its torque passes gate and supervisor as if a law had asked for it.
"""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..._atomic import write_text_atomically
from ..._errors import PellucidError, RecordingError
from ..._given import read_given
from ...controllers.control_law import Limits
from ...files.fault import Fault
from ...files.recording import Recording
from ...files.xdf_writer import seal_xdf
from ...people.study.assessment_table import AssessmentTable
from ...study.kept import hold_lock
from ...study.procedures.procedure import Procedure
from ...study.procedures.registry import asked, open_study
from ...study.quality import cut_faults
from ...study.study import STUDY_FILE, Study
from ...study.study_file import MAX_FILE_BYTES, RecordingEntry
from ..log_verdict import LogVerdict, judge_log
from ..replay import Replay, has_engine_records, replay_session
from .trial_plan import PlannedTrial

RECORDINGS_FOLDER = "recordings"
"""Folder of a study in which a session records."""


@dataclass(frozen=True)
class Judged:
    """What the checks found in one trial."""

    faults: tuple[Fault, ...]
    seconds: float  # time that the checks took [s]
    recording: Recording | None  # None if the file cannot be read
    used_by: tuple[str, ...] = ()  # commands of the study that will use the trial

    @property
    def reason(self) -> str:
        """Why the trial should be repeated; empty if it need not."""
        refused = [fault.message for fault in self.faults if fault.severity == "refuse"]
        return refused[0] if refused else ""


def trial_file(folder: Path, trial: PlannedTrial, attempt: int = 1) -> Path:
    """Return the path of a trial's recording; a further attempt has a name of its own, so that none is overwritten."""
    suffix = "" if attempt == 1 else f"_attempt{attempt}"
    return folder / RECORDINGS_FOLDER / f"{trial.name}{suffix}.xdf"


def next_attempt(folder: Path, trial: PlannedTrial) -> int:
    """Return the number of the next attempt at a trial, from 1: that of the first file that does not exist."""
    attempt = 1
    while trial_file(folder, trial, attempt).exists():
        attempt += 1
    return attempt


def trial_entry(study: Study, trial: PlannedTrial, file: Path) -> dict[str, object]:
    """Return the entry of a trial's recording; every stream of the study is read from the same file."""
    path = file.relative_to(study.folder).as_posix()
    entry: dict[str, object] = {"name": trial.name, "file": path, "protocol": trial.task.protocol, "use": trial.use}
    entry |= {"participant": trial.participant, "condition": trial.condition}
    entry |= {"repetition": trial.repetition, "period": trial.period}
    if study.config.streams:
        entry["streams"] = dict.fromkeys(study.config.streams, path)
    return entry


def entry_text(entry: dict[str, object]) -> str:
    """Return an entry as text of study.toml."""

    def value(given: object) -> str:
        if isinstance(given, dict):
            return "{ " + ", ".join(f"{key} = {value(each)}" for key, each in given.items()) + " }"
        return json.dumps(given, ensure_ascii=False)

    return "\n[[recordings]]\n" + "".join(f"{key} = {value(each)}\n" for key, each in entry.items())


def study_with(study: Study, trial: PlannedTrial, file: Path) -> Study:
    """Return the study with a trial as its one recording, without writing to study.toml."""
    entry = RecordingEntry.model_validate(trial_entry(study, trial, file))
    return Study(study.folder, study.config.model_copy(update={"recordings": (entry,)}))


def judge_trial(study: Study, trial: PlannedTrial, file: Path) -> Judged:
    """Check one trial as `pellucid check` checks a study, and say how long that took.

    The procedures of the study decide whether they will use the trial, by the functions with which they take their
    recordings. A trial that one of them leaves out is refused.
    """
    begun = time.perf_counter()
    alone = study_with(study, trial, file)
    faults: list[Fault] = []
    used: list[str] = []
    recording = None
    try:
        recording = alone.recordings()[0]
        faults += cut_faults(recording)
        for procedure in asked(alone):
            if trial.task.protocol in _checked_protocols(study, procedure):
                excluded = procedure.unfit(alone)
                unfit = [replace(fault, severity="refuse") for fault in excluded.values()]
                faults += procedure.excluded_faults(alone, excluded)
                if not unfit:
                    taken = procedure.taken(alone)
                    used.append(procedure.command)
                    faults += procedure.faults(taken, procedure.table_of(taken))
                faults += unfit
    except (PellucidError, OSError) as error:
        faults.append(Fault("refuse", "unreadable", file.name, "", str(error), "a whole recording", str(error)))
    own = [fault for fault in dict.fromkeys(faults) if fault.file in (file.name, "")]
    own.sort(key=lambda fault: fault.severity not in ("refuse", "warn"))
    is_refused = any(fault.severity == "refuse" for fault in own)
    used_by = () if is_refused else tuple(dict.fromkeys(used))
    return Judged(tuple(own), time.perf_counter() - begun, recording, used_by)


def judge_open_trial(study: Study, trial: PlannedTrial, file: Path, why: str) -> Judged:
    """Check a trial whose recorder did not complete the file; it is sealed first as far as the disk allows."""
    with suppress(OSError, PellucidError):
        seal_xdf(file)
    judged = judge_trial(study, trial, file)
    fault = Fault("refuse", "incomplete", file.name, "", why, "a recording that its recorder completed", why)
    return replace(judged, faults=(fault, *judged.faults))


def _checked_protocols(study: Study, procedure: Procedure) -> set[str]:
    """Return the protocols of the session's tasks that a procedure looks at."""
    session = study.config.session
    assert session is not None
    pointing = {task.protocol for task in session.tasks if task.kind == "pointing"}
    every = {task.protocol for task in session.tasks}
    return pointing if procedure.table is AssessmentTable else every


def add_to_study(study: Study, trial: PlannedTrial, file: Path) -> Study:
    """Add a trial's recording at the end of study.toml, and return the study as it is then."""
    path = study.folder / STUDY_FILE
    with hold_lock(path):
        text = read_given(path, MAX_FILE_BYTES).decode("utf-8-sig")
        write_text_atomically(path, text.rstrip("\n") + "\n" + entry_text(trial_entry(study, trial, file)))
    found = open_study(study.folder)
    # What was read stays read: recordings do not change after their trial.
    return replace(found, kept=study.kept)


def recorded_names(study: Study) -> set[str]:
    """Return the names of the recordings that study.toml has."""
    return {entry.name for entry in study.config.recordings}


TORQUE_CHANNELS = ("command", "torque", "interaction")
"""Channels of a log that may contain the commanded torque, in order of preference."""

LOG_NAME = "log"
"""Name of a log's recording while it is read."""


@dataclass(frozen=True)
class ReplayAnswer:
    """What a file says.

    Attributes
    ----------
    lines : tuple of str
        Sentences for the terminal.
    is_equal : bool
        Whether every bit was computed again; True for a log, of which there is nothing to compute again.
    """

    lines: tuple[str, ...]
    is_equal: bool


def replay_file(study: Study, file: str | os.PathLike) -> ReplayAnswer:
    """Compute a session's commands again, or hold a log against the supervisor.

    Parameters
    ----------
    study : Study
        Its channels and limits are those of a log.
    file : path-like
        A session's session.xdf, or a log of any kind that recordings may have.

    Returns
    -------
    ReplayAnswer

    Raises
    ------
    PellucidError
        If the file is missing, cannot be read, or has no command of a law; the message says what was expected.
    """
    path = Path(file)
    if not path.is_file():
        raise PellucidError(f"{path}: no such file, expected a session's session.xdf or a log")
    if has_engine_records(path):
        return _replay_answer(path, replay_session(path))
    return _log_answer(study, path)


def _replay_answer(path: Path, found: Replay) -> ReplayAnswer:
    if found.compared == 0:
        raise PellucidError(f"{path}: found {found.cycles} cycles without a controller, expected some with one")
    lines = [f"{found.compared:,} commands of {found.cycles:,} cycles were recomputed."]
    if found.wrong_bits:
        lines.append(f"{found.wrong_bits:,} bits differ, the first in cycle {found.first_wrong}.")
    else:
        lines.append("All commands agree in every bit.")
    if found.gaps or found.unknown:
        lines.append(
            f"Records are missing at {found.gaps} places; {found.unknown:,} commands after them were not recomputed."
        )
    return ReplayAnswer(tuple(lines), found.is_equal)


def _log_answer(study: Study, path: Path) -> ReplayAnswer:
    recording = _recording_of(study, path)
    angle, torque = _angle_channel(study, recording, path), _torque_channel(recording, path)
    limits, said = _stated_limits(study)
    spec = study.config.channels.get("time")
    has_clock = spec is None or spec.rate is None
    positions, torques, times = recording[angle], recording[torque], recording["time"]
    if has_clock:
        verdicts = judge_log(positions, torques, limits=limits, time=times)
    else:
        rate = 1.0 / float(np.median(np.diff(times)))
        verdicts = judge_log(positions, torques, limits=limits, rates=(rate,))
    lines = [f"{path.name}: channel {torque} against {angle}, with {said}."]
    return ReplayAnswer((*lines, *(_sentences(each, times) for each in verdicts)), True)


def _sentences(verdict: LogVerdict, times: np.ndarray) -> str:
    """Return a verdict's sentences, with the time of its stop where the log has a clock."""
    said = verdict.sentence()
    if verdict.stopped_at is None or verdict.is_rate_assumed:
        return said
    return f"{said} The stop is {times[verdict.stopped_at] - times[0]:.3f} s after the first sample."


def _recording_of(study: Study, path: Path) -> Recording:
    known = [
        entry.name for entry in study.config.recordings
        if entry.file is not None and (study.folder / entry.file).resolve() == path.resolve()
    ]  # fmt: skip
    if known:
        return study.recording(known[0])
    entry = RecordingEntry.model_validate({"name": LOG_NAME, "file": str(path.resolve()), "use": "validate"})
    alone = Study(study.folder, study.config.model_copy(update={"recordings": (entry,)}), allow_outside=True)
    return alone.recording(LOG_NAME)


def _angle_channel(study: Study, recording: Recording, path: Path) -> str:
    expected = ("position", f"angle.{study.rig.joint}") if hasattr(study.rig, "joint") else ("position",)
    return _first_channel(recording, expected, path, "the joint's angle")


def _torque_channel(recording: Recording, path: Path) -> str:
    return _first_channel(recording, TORQUE_CHANNELS, path, "the commanded torque")


def _first_channel(recording: Recording, expected: tuple[str, ...], path: Path, what: str) -> str:
    for name in expected:
        if name in recording.channels:
            return name
    there = ", ".join(name for name in recording.channels if name != "time") or "none"
    wanted = " or ".join(expected)
    raise RecordingError(
        f"{path.name}: found the channels {there}, expected {wanted} in [channels] of {STUDY_FILE}: {what}"
    )


def _stated_limits(study: Study) -> tuple[Limits, str]:
    """Return the limits of the study, with defaults for unstated ones, and a text that names them."""
    given, session = study.rig.limits, study.config.session
    stated: dict[str, Any] = {
        "effort": session.limits.effort if session is not None and session.limits.effort else given.effort,
        "velocity": given.velocity,
    }
    limits = replace(Limits(), **{name: value for name, value in stated.items() if value is not None})
    low, high = limits.position
    low = low if given.position_min is None else given.position_min
    high = high if given.position_max is None else given.position_max
    limits = replace(limits, position=(low, high))
    said = f"limits of {limits.effort:g} N*m, {limits.rate:g} N*m/s, {limits.velocity:g} rad/s"
    said += f" and {low:.3g} to {high:.3g} rad"
    unstated = [name for name, value in stated.items() if value is None]
    unstated += [] if None not in (given.position_min, given.position_max) else ["position"]
    return limits, said + (f" ({', '.join(unstated)} by default, not stated in [rig.limits])" if unstated else "")
