"""Recordings to be judged beside those fitted: which channels changed, and whether anything holds there at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .procedure import EmgTorqueTable
from ..._errors import PellucidError
from ...estimators.emg_session import ChannelChange, ChannelComparison, FittedSession
from ...estimators.raw_session import MIN_RECORDING_S, RawChannels
from ...estimators.torque_trial import TorqueTrial
from ...fit.parameter import Verdict
from ...recordings.fault import Fault
from ...recordings.recording import Recording
from ...recordings.study import Study
from ..result import FigureTable
from .relative_envelopes import MAXIMAL, inside_of, muscles_of, stream_of
from .trial_sources import moment_trials

RESCALE = '[emg_torque] rescale = "3 s"'
FOREIGN = (
    f"Look at electrodes and cables; {RESCALE} puts what the other channels tell in its place.",
    "What the other channels tell stands in its place.",
)
ELECTRODE = ("Look at the electrode, its contact and its cable: no scaling mends that.",) * 2
WHAT_TO_DO = {
    "swapped": (
        f"Look at cables and columns; {RESCALE} exchanges them again.",
        "The two channels were exchanged again.",
    ),
    "crosstalk": FOREIGN,
    "pattern": FOREIGN,
    **dict.fromkeys(("spectrum", "hum", "saturation", "shared"), ELECTRODE),
    "floor": (
        f"{RESCALE} brings floor and range of a channel that changed to those fitted.",
        "Its floor and range were brought to those fitted.",
    ),
}
"""Kind of a change -> what to do, and what was done where the study asks for it."""


def compared_sessions(
    study: Study, fitted: Sequence[TorqueTrial], held: Sequence[TorqueTrial]
) -> tuple[FittedSession, dict[str, ChannelComparison]]:
    """What the channels of fitted trials were, and those of every other trial against them, raw ones too. `study`
    [emg_torque]."""
    session, raw = FittedSession.of(fitted), raw_changes(study)
    found = {trial.name: session.compare(trial) for trial in held}
    return session, {name: replace(c, changes=(*c.changes, *raw.get(name, ()))) for name, c in found.items()}


def raw_changes(study: Study) -> dict[str, tuple[ChannelChange, ...]]:
    """By recording to be judged, raw channels that are not what they were in what is fitted of the same person.
    `study` [emg_torque]."""
    if study.table(EmgTorqueTable).chain == "none":
        return {}
    found: dict[str, tuple[ChannelChange, ...]] = {}
    read = [(r, stream_of(r, study.table(EmgTorqueTable).emg)) for r in study.recordings()]
    wired = [(r, s) for r, s in read if any(c.startswith("emg.") for c in s.channels)]
    long = [(r, s) for r, s in wired if r.time[-1] - r.time[0] >= MIN_RECORDING_S]
    for person in dict.fromkeys(r.participant for r, _ in long):
        own = [(r, s) for r, s in long if r.participant == person]
        fitted = [(r, s) for r, s in own if r.use == "fit" and r.protocol != MAXIMAL]
        judged = [(r, s) for r, s in own if r.use != "fit" and r.protocol != MAXIMAL]
        if fitted and judged:
            before = RawChannels.of([_raw(study, r, s) for r, s in fitted])
            found |= {r.name: before.changes(RawChannels.of([_raw(study, r, s)])) for r, s in judged}
    return found


def _raw(study: Study, recording: Recording, stream: Recording) -> tuple[dict[str, np.ndarray], float]:
    """Raw EMG by muscle [V] within the recording's window, and its rate [Hz]."""
    channels = {muscle: f"emg.{muscle}" for muscle in muscles_of(study, stream)}
    return {m: stream[c][inside_of(stream, recording, c)] for m, c in channels.items()}, stream.fs


def session_faults(study: Study) -> list[Fault]:
    """Channels that are not what they were in the recordings to be fitted. `study` [emg_torque]."""
    asked = study.table(EmgTorqueTable)
    try:
        found = _compared(study)
        changes = {name: compared.changes for name, compared in found.items()}
        if any(r.name not in found for r in study.recordings("validate")):
            changes = {**raw_changes(study), **changes}
    except PellucidError:  # told where it is found
        return []
    files = {r.name: stream_of(r, asked.emg).path.name for r in study.recordings()}
    faults = []
    for name, changed in changes.items():
        where = f"{files[name]} (recording {name})"
        compared = found.get(name)
        if compared is not None and not compared.holds:
            text, wanted = elsewhere_words(compared), "envelopes and movement like those to be fitted"
            message = f"{where}, channels emg: found {text}, expected {wanted}: record such movements to fit, too"
            faults.append(Fault("warn", "another_condition", files[name], "emg", text, wanted, message))
        for change in changed:
            message = f"{where}, channel emg.{change.muscle}: found {change.found}, expected {change.expected}"
            channel = f"emg.{change.muscle}"
            faults.append(
                Fault("warn", "changed_channel", files[name], channel, change.found, change.expected, message)
            )
    return faults


def _compared(study: Study) -> dict[str, ChannelComparison]:
    """Recordings with moments to be judged against those to be fitted; none where there are not both."""
    asked = study.table(EmgTorqueTable)
    uses = {r.use for r in study.recordings() if f"moment.{asked.joints[0]}" in stream_of(r, asked.moments)}
    if uses != {"fit", "validate"}:
        return {}
    trials = moment_trials(study, asked.joints[0])
    return compared_sessions(study, [t for t in trials if not t.heldout], [t for t in trials if t.heldout])[1]


def elsewhere_words(compared: ChannelComparison) -> str:
    """Why nothing holds there."""
    if compared.effort:
        levels = sorted(compared.level.values())
        many = sum(value > 1.0 for value in levels) > len(levels) / 2
        ends = (levels[len(levels) // 2], levels[-1]) if many else (levels[0], levels[len(levels) // 2])
        return f"most envelopes ranging {ends[0]:.2g} to {ends[1]:.2g} times as far as those to be fitted"
    return (
        f"angles, speeds or envelopes beyond all that is to be fitted in {100.0 * compared.elsewhere:.0f} % of the time"
    )


def session_verdicts(sessions: Mapping[str, ChannelComparison], rescaled: bool) -> list[Verdict]:
    """What is to be known before any figure of these recordings is."""
    said = []
    for name, compared in sessions.items():
        if not compared.holds:
            text = f"{name}: nothing that was fitted says what torque this is: {elsewhere_words(compared)}."
            said.append(Verdict("wrong", text, "Record such movements to fit, too.", finding="another_condition"))
        for muscle in compared.changed:
            own = [change for change in compared.changes if change.muscle == muscle]
            found = "; ".join(f"{change.found}, expected {change.expected}" for change in own)
            kinds = {change.kind for change in own}
            what = next((words for kind, words in WHAT_TO_DO.items() if kind in kinds), WHAT_TO_DO["floor"])
            text = f"{name}, channel emg.{muscle}: found {found}."
            said.append(Verdict("warning", text, what[int(rescaled)], finding="changed_channel"))
    return said


def session_tables(sessions: Mapping[str, ChannelComparison]) -> tuple[FigureTable, ...]:
    """Every channel against what it was when it was fitted."""
    heads = ("Channel", "Floor moved (ranges)", "Range (times)", "Own pattern (r)")
    return tuple(
        FigureTable(
            f"Channels of {name.replace('_', ' ')} against those fitted",
            heads,
            tuple(
                (m + (" – changed" if m in c.changed else ""), c.floor[m], c.level[m], c.own.get(m)) for m in c.floor
            ),
        )
        for name, c in sessions.items()
    )
