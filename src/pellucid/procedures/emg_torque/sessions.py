"""Recordings to be judged beside those fitted: which channels changed, and whether anything holds there at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..._errors import PellucidError
from ...estimators.emg_session import Compared, FittedSession
from ...estimators.torque_trial import TorqueTrial
from ...fit.parameter import Verdict
from ...recordings.fault import Fault
from ...recordings.study import Study
from ..result import FigureTable
from .trial_sources import moment_trials

RESCALE = '[emg_torque] rescale = "3 s"'
FOREIGN = (
    f"Look at electrodes and cables; {RESCALE} puts what the other channels tell in its place.",
    "What the other channels tell stands in its place.",
)
WHAT_TO_DO = {
    "swapped": (
        f"Look at cables and columns; {RESCALE} exchanges them again.",
        "The two channels were exchanged again.",
    ),
    "crosstalk": FOREIGN,
    "pattern": FOREIGN,
    "floor": (
        f"{RESCALE} brings floor and range of a channel that changed to those fitted.",
        "Its floor and range were brought to those fitted.",
    ),
}
"""Kind of a change -> what to do, and what was done where the study asks for it."""


def compared_sessions(
    fitted: Sequence[TorqueTrial], held: Sequence[TorqueTrial]
) -> tuple[FittedSession, dict[str, Compared]]:
    """What the channels of fitted trials were, and those of every other trial against them."""
    session = FittedSession.of(fitted)
    return session, {trial.name: session.compared(trial) for trial in held}


def session_faults(study: Study) -> list[Fault]:
    """Channels that are not what they were in the recordings to be fitted. `study` [emg_torque]."""
    asked = study.config.emg_torque
    uses = {r.use for r in study.recordings() if f"moment.{asked.joints[0]}" in r.streams.get(asked.moments, r)}
    if uses != {"fit", "validate"}:
        return []
    try:
        trials = moment_trials(study, asked.joints[0])
        _, found = compared_sessions([t for t in trials if not t.heldout], [t for t in trials if t.heldout])
    except PellucidError:  # told where it is found
        return []
    files = {r.name: r.streams.get(asked.emg, r).path.name for r in study.recordings()}
    faults = []
    for name, compared in found.items():
        where = f"{files[name]} (recording {name})"
        if not compared.holds:
            text, wanted = elsewhere_words(compared), "envelopes and movement like those to be fitted"
            message = f"{where}, channels emg: found {text}, expected {wanted}: record such movements to fit, too"
            faults.append(Fault("warn", "another_condition", files[name], "emg", text, wanted, message))
        for change in compared.changes:
            message = f"{where}, channel emg.{change.muscle}: found {change.found}, expected {change.expected}"
            channel = f"emg.{change.muscle}"
            faults.append(
                Fault("warn", "changed_channel", files[name], channel, change.found, change.expected, message)
            )
    return faults


def elsewhere_words(compared: Compared) -> str:
    """Why nothing holds there."""
    if compared.effort:
        levels = sorted(compared.level.values())
        many = sum(value > 1.0 for value in levels) > len(levels) / 2
        ends = (levels[len(levels) // 2], levels[-1]) if many else (levels[0], levels[len(levels) // 2])
        return f"most envelopes ranging {ends[0]:.2g} to {ends[1]:.2g} times as far as those to be fitted"
    return (
        f"angles, speeds or envelopes beyond all that is to be fitted in {100.0 * compared.elsewhere:.0f} % of the time"
    )


def session_verdicts(sessions: Mapping[str, Compared], rescaled: bool) -> list[Verdict]:
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


def session_tables(sessions: Mapping[str, Compared]) -> tuple[FigureTable, ...]:
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
