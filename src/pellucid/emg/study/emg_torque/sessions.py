"""Compare test recordings with the fitted ones: changed channels, and whether estimates are valid at all.

Run the watch of every estimator that can run live over recordings that were not fitted, as a robot would run it.

`emg_session` compares floors, ranges and patterns. A change of gain by 2 lies within what those vary by, yet may cost
half of the explained torque. The watch that `add_channel_watch` makes asks what a change costs an estimator in torque;
here it reads a recording from beginning to end, with the thresholds that a running estimator and exported C use. The
cost of a change differs between estimators: muscles may depend on a channel that a regression ignores.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...._errors import PellucidError
from ....files.fault import Fault
from ....files.recording import MAXIMAL_PROTOCOL, Recording
from ....models.estimates import Verdict
from ....study.procedures.result import FigureTable
from ....study.study import Study
from ...estimators.emg_session import ChannelChange, ChannelComparison, FittedSession, add_channel_watch
from ...estimators.families import ESTIMATOR_FAMILIES
from ...estimators.hill import HillMap
from ...estimators.live_torque import LiveTorque
from ...estimators.raw_session import RAW_LIMITS, RawChannels
from ...estimators.torque_map import fit_torque_map
from ...estimators.torque_trial import TorqueTrial, join_pieces
from ...models.emg_estimator import WATCH_DEFAULTS, EmgEstimatorCard
from ...models.muscle import CalibratedMuscles
from ...signals.emg_quality import channel_fault
from .emg_torque_table import EmgTorqueTable
from .estimator_cards import map_estimator, muscle_estimator
from .relative_envelopes import find_window
from .study_muscles import find_used_muscles
from .trial_sources import moment_trials

LIVE_ESTIMATORS = tuple(name for name, family in ESTIMATOR_FAMILIES.items() if family.runs_live)
"""Estimators whose causal maps a session or a robot runs sample by sample. Their watches read the recordings."""

LiveMaps = Mapping[tuple[str, str], Any]
"""Causal maps by joint and estimator, fitted to the fitted trials alone."""

CONSEQUENCE_KIND = "consequence"
"""Kind of a change that is described by its effect on the torque."""


def find_watched_changes(study: Study, maps: LiveMaps | None = None) -> dict[str, tuple[ChannelChange, ...]]:
    """Return, by test recording, the channels that the watch of an estimator names at any joint.

    Torques in other units than N m have no watch. `maps` are fitted if they are not given. `study` [emg_torque].
    """
    found: dict[str, dict[str, ChannelChange]] = {}
    for joint in study.table(EmgTorqueTable).joints:
        trials = moment_trials(study, joint)
        fitted, held = [t for t in trials if not t.heldout], [t for t in trials if t.heldout]
        if not fitted or fitted[0].unit != "N*m":
            continue
        own = fit_live_maps({joint: fitted}) if maps is None else maps
        cards = [
            watched_card(study, name, own[joint, name], fitted) for name in LIVE_ESTIMATORS if (joint, name) in own
        ]
        for trial in join_pieces(held):
            for card in cards:
                for change in _find_changes(card, trial):
                    found.setdefault(trial.name, {}).setdefault(change.muscle, change)
    return {name: tuple(changes.values()) for name, changes in found.items()}


def fit_live_maps(fitted: Mapping[str, Sequence[TorqueTrial]]) -> LiveMaps:
    """Return the causal maps of the fitted trials of each joint; none of an estimator that cannot be fitted to them."""
    maps = {}
    for joint, trials in fitted.items():
        for name in LIVE_ESTIMATORS:
            try:
                maps[joint, name] = fit_torque_map(list(trials), name, causal=True)
            except PellucidError:  # No geometry of these muscles, or trials unfit for them: `calibrate` says so
                continue
    return maps


def watched_card(study: Study, name: str, estimator: Any, fitted: Sequence[TorqueTrial]) -> EmgEstimatorCard:
    """Return the card, with its watch, of an estimator fitted to some trials of a joint."""
    joint = fitted[0].joint
    if isinstance(estimator, HillMap):
        tissue = {joint: estimator.fit.passive}
        muscles = CalibratedMuscles(estimator.fit.muscles, estimator.driven, tissue, estimator.effort)
        card = muscle_estimator(study, name, muscles, {joint: fitted})
    else:
        card = map_estimator(study, name, estimator, fitted)
    return add_channel_watch(card.of_envelopes(), {joint: fitted})


def _find_changes(card: EmgEstimatorCard, trial: TorqueTrial) -> tuple[ChannelChange, ...]:
    """Return the channels of a trial that the card's watch names, from when on, and the R² that each may cost there.

    A running estimator names a channel early, at a share of the loss that it guards against. In a whole recording, only
    channels that reach this loss count.
    """
    if card.watch is None:
        return ()
    found = LiveTorque(card).find_changes(
        1.0 + card.period * np.arange(len(trial)),
        {channel.name: trial.envelopes[channel.name] for channel in card.channels},
        {name: trial.angles[name] for name in card.angles},
    )
    return tuple(
        ChannelChange(
            muscle,
            CONSEQUENCE_KIND,
            f"a relation of signal and movement that changed at {trial.time[first]:.1f} s, which may reduce R² of the "
            f"torque there by {loss:.2f}",
            "the same relation as in the fitted recordings",
        )
        for muscle, (first, loss) in found.items()
        if loss >= WATCH_DEFAULTS.max_loss
    )


RESCALE_KEY = '[emg_torque] rescale = "3 s"'
"""Key of study.toml that repairs changed channels, as advice names it."""

FOREIGN_SIGNAL_ADVICE = (
    f"Check electrodes and cables, or set {RESCALE_KEY} to replace the channel by a prediction from the others.",
    "The channel was replaced by a prediction from the others in estimators whose torque it affects.",
)
"""Advice for a channel with another muscle's signal, without `rescale` and with it."""

ELECTRODE_ADVICE = ("Check the electrode, its contact and its cable; scaling cannot repair this.",) * 2
"""Advice for a change of raw EMG, without `rescale` and with it."""

ADVICE_BY_CHANGE = {
    "silent": ("Attach the electrode and connect its cable; scaling cannot repair this.",) * 2,
    "swapped": (
        f"Check cables and columns, or set {RESCALE_KEY} to exchange the two channels.",
        "The two channels were exchanged in estimators whose torque they affect.",
    ),
    "crosstalk": FOREIGN_SIGNAL_ADVICE,
    "pattern": FOREIGN_SIGNAL_ADVICE,
    **dict.fromkeys(("spectrum", "hum", "saturation", "shared"), ELECTRODE_ADVICE),
    CONSEQUENCE_KIND: ("Check electrode and amplifier; the change does not show how to scale the signal.",) * 2,
    "floor": (
        f"Set {RESCALE_KEY} to scale the noise floor and range of a changed channel to the fitted ones.",
        "Its noise floor and range were scaled to the fitted ones in estimators whose torque it affects.",
    ),
}
"""Advice by kind of change: what to do without `rescale`, and what was done with it."""


def compare_sessions(
    study: Study, fitted: Sequence[TorqueTrial], held: Sequence[TorqueTrial], maps: LiveMaps | None = None
) -> tuple[FittedSession, dict[str, ChannelComparison]]:
    """Return the channels of the fitted trials, and the comparison of each held-out trial with them.

    It includes raw EMG, and channels that the watch of an estimator names by what they cost in torque. `maps` are
    fitted if they are not given.

    `study` [emg_torque].
    """
    session, raw = FittedSession.from_trials(join_pieces(fitted)), find_raw_changes(study)
    watched = find_watched_changes(study, maps)
    found: dict[str, ChannelComparison] = {}
    for trial in join_pieces(held):
        compared = session.compare(trial)
        # Where no estimate is valid, the watch would name whatever differs.
        costly = [c for c in watched.get(trial.name, ()) if compared.is_valid and c.muscle not in compared.changed]
        found[trial.name] = replace(compared, changes=(*compared.changes, *raw.get(trial.name, ()), *costly))
    return session, found


def find_raw_changes(study: Study) -> dict[str, tuple[ChannelChange, ...]]:
    """Return, by test recording, raw channels that differ from the same person's fitted recordings.

    `study` [emg_torque].
    """
    if study.table(EmgTorqueTable).chain == "none":
        return {}
    found: dict[str, tuple[ChannelChange, ...]] = {}
    read = [(r, r.stream_or_self(study.table(EmgTorqueTable).emg)) for r in study.recordings()]
    wired = [(r, s) for r, s in read if any(c.startswith("emg.") for c in s.channels)]
    long = [
        (r, s) for r, s in wired if r.time[-1] - r.time[0] >= RAW_LIMITS.min_recording_s
    ]  # pieces of a trial one by one
    for person in dict.fromkeys(r.participant for r, _ in long):
        own = [(r, s) for r, s in long if r.participant == person]
        fitted = [(r, s) for r, s in own if r.use == "fit" and r.protocol != MAXIMAL_PROTOCOL]
        judged = [(r, s) for r, s in own if r.use != "fit" and r.protocol != MAXIMAL_PROTOCOL]
        if fitted and judged:
            before = RawChannels.from_recordings([_raw_emg(study, r, s) for r, s in fitted])
            for trial in dict.fromkeys(r.trial for r, _ in judged):
                pieces = [_raw_emg(study, r, s) for r, s in judged if r.trial == trial]
                found[trial] = before.changes(RawChannels.from_recordings(pieces))
    return found


def _raw_emg(study: Study, recording: Recording, stream: Recording) -> tuple[dict[str, np.ndarray], float]:
    """Return raw EMG by muscle [V] within the recording's window, and its rate [Hz]."""
    channels = {muscle: f"emg.{muscle}" for muscle in find_used_muscles(study, stream)}
    return {m: stream[c][find_window(stream, recording, c)] for m, c in channels.items()}, stream.fs


def session_faults(study: Study) -> list[Fault]:
    """Return faults of test recordings whose channels or movements differ from fitted ones. `study` [emg_torque]."""
    asked = study.table(EmgTorqueTable)
    try:
        found = _compare_study(study)
        changes = {name: compared.changes for name, compared in found.items()}
        if any(r.trial not in found for r in study.recordings("validate")):
            changes = {**find_raw_changes(study), **changes}
    except PellucidError:  # Other checks report this error
        return []
    files = {r.trial: r.stream_or_self(asked.emg).path.name for r in study.recordings()}
    faults = []
    for name, changed in changes.items():
        compared = found.get(name)
        if compared is not None and not compared.is_valid:
            text, wanted = invalidity_words(compared), "envelopes and movement within the range of the fitted ones"
            where = f"{files[name]} (recording {name}), channels emg"
            message = f"{where}: found {text}, expected {wanted}. Add such movements to the fitted recordings"
            faults.append(Fault("warn", "another_condition", files[name], "emg", text, wanted, message))
        for change in changed:
            channel = f"emg.{change.muscle}"
            faults.append(
                channel_fault("warn", "changed_channel", files[name], name, channel, change.found, change.expected)
            )
    return faults


def _compare_study(study: Study) -> dict[str, ChannelComparison]:
    """Compare held-out recordings with moments with the fitted ones; empty without both kinds."""
    asked = study.table(EmgTorqueTable)
    uses = {r.use for r in study.recordings() if f"moment.{asked.joints[0]}" in r.stream_or_self(asked.moments)}
    if uses != {"fit", "validate"}:
        return {}
    trials = moment_trials(study, asked.joints[0])
    return compare_sessions(study, [t for t in trials if not t.heldout], [t for t in trials if t.heldout])[1]


def invalidity_words(compared: ChannelComparison) -> str:
    """Return the reason, in words, why no estimate is valid in a recording."""
    if compared.has_other_effort:
        levels = sorted(compared.range_ratio.values())
        many = sum(value > 1.0 for value in levels) > len(levels) / 2
        ends = (levels[len(levels) // 2], levels[-1]) if many else (levels[0], levels[len(levels) // 2])
        return f"most envelopes with {ends[0]:.2g} to {ends[1]:.2g} times the range in the fitted recordings"
    share = 100.0 * compared.outside_share
    return f"angles, speeds or envelopes outside the fitted range for {share:.0f} % of the time"


def session_verdicts(sessions: Mapping[str, ChannelComparison], rescaled: bool) -> Iterator[Verdict]:
    """Yield verdicts on test recordings with changed channels or without valid estimates."""
    for name, compared in sessions.items():
        if not compared.is_valid:
            why = (
                f"{name}: no estimate is valid, because the fitted recordings do not cover it: "
                f"{invalidity_words(compared)}."
            )
            yield Verdict("wrong", why, "Add such movements to the fitted recordings.", finding="another_condition")
        for muscle in compared.changed:
            own = [change for change in compared.changes if change.muscle == muscle]
            found = "; ".join(f"{change.found}, expected {change.expected}" for change in own)
            kinds = {change.kind for change in own}
            what = next((words for kind, words in ADVICE_BY_CHANGE.items() if kind in kinds), ADVICE_BY_CHANGE["floor"])
            text = f"{name}, channel emg.{muscle}: found {found}."
            yield Verdict("warning", text, what[int(rescaled)], finding="changed_channel")


def session_tables(sessions: Mapping[str, ChannelComparison]) -> tuple[FigureTable, ...]:
    """Return a table for each test recording that compares every channel with the fitted one."""
    heads = ("Channel", "Floor moved (ranges)", "Range (times)", "Own pattern (r)")
    made = []
    for name, c in sessions.items():
        rows = tuple(
            (m + " – changed" * (m in c.changed), shift, c.range_ratio[m], c.own_correlation.get(m))
            for m, shift in c.floor_shift.items()
        )
        title = f"Channels of {name.replace('_', ' ')} against those fitted"
        made.append(FigureTable(title, heads, rows, max_brief_rows=0))
    return tuple(made)
