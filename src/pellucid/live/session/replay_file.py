"""What `pellucid live DIR --replay FILE` answers: a session's commands bit for bit, or any log under the supervisor.

The file of a session has every number that its law was given; each command is computed again and compared. Every other
file is a log whose columns study.toml names: its torque passes gate and supervisor as if a law had asked for it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import PellucidError, RecordingError
from ...controllers.limits import Limits
from ...files.recording import Recording
from ...study.study import STUDY_FILE, Study
from ...study.study_file import RecordingEntry
from ..log_verdict import LogVerdict, judge_log
from ..replay import Replay, has_engine_records, replay_session

TORQUE_CHANNELS = ("command", "torque", "interaction")
"""Channels of a log that may be what its robot was asked for; the first one that it has is judged."""

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
        raise PellucidError(f"{path}: found {found.cycles} cycles without a law, expected some in which one ran")
    lines = [f"{found.compared:,} commands of {found.cycles:,} cycles were computed again."]
    if found.wrong_bits:
        lines.append(f"{found.wrong_bits:,} bits differ, the first in cycle {found.first_wrong}.")
    else:
        lines.append("Every bit is equal.")
    if found.gaps or found.unknown:
        lines.append(
            f"{found.gaps} times records are missing; {found.unknown:,} commands after them were not computed again."
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
    lines = [f"{path.name}: the channel {torque} over {angle}, under {said}."]
    return ReplayAnswer((*lines, *(_sentences(each, times) for each in verdicts)), True)


def _sentences(verdict: LogVerdict, times: np.ndarray) -> str:
    """Return a verdict's sentences, with the time of its stop where the log has a clock."""
    said = verdict.sentence()
    if verdict.stopped_at is None or verdict.is_rate_assumed:
        return said
    return f"{said} The stop comes {times[verdict.stopped_at] - times[0]:.3f} s after the first sample."


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
    return _first_channel(recording, TORQUE_CHANNELS, path, "what the robot was asked for")


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
    """Return the limits of the study and a text that names them; what is not stated has its default."""
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
    return limits, said + (f" ({', '.join(unstated)} by default: [rig.limits] does not say)" if unstated else "")
