"""Run the watch of a calibrated estimator over recordings that were not fitted, as a robot would run it.

`emg_session` compares floors, ranges and patterns. A change of gain by 2 lies within what those vary by, yet may cost
half of the explained torque. The watch of `channel_watch` asks what a change costs in torque; here it reads a recording
from beginning to end, with the thresholds that a running estimator and exported C use.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ....study.study import Study
from ...estimators.emg_session import ChannelChange, add_channel_watch
from ...estimators.live_torque import LiveTorque
from ...estimators.torque_map import fit_torque_map
from ...estimators.torque_trial import TorqueTrial, join_pieces
from ...models.emg_estimator import EmgEstimatorCard
from .emg_torque_table import EmgTorqueTable
from .estimator_cards import map_estimator
from .trial_sources import moment_trials

WATCHING_ESTIMATOR = "ridge"
"""Estimator whose watch reads the recordings. It is fitted within a second and needs no anatomy."""

CONSEQUENCE_KIND = "consequence"
"""Kind of a change that is told by what it costs in torque."""


def find_watched_changes(study: Study) -> dict[str, tuple[ChannelChange, ...]]:
    """Return, by test recording, the channels that the watch of an estimator names at any joint.

    An estimator is fitted for each joint, to the fitted trials alone. Torques in other units than N m have no watch.
    `study` [emg_torque].
    """
    found: dict[str, dict[str, ChannelChange]] = {}
    for joint in study.table(EmgTorqueTable).joints:
        trials = moment_trials(study, joint)
        fitted, held = [t for t in trials if not t.heldout], [t for t in trials if t.heldout]
        card = _watched_card(study, joint, fitted) if fitted and fitted[0].unit == "N*m" else None
        if card is None or card.watch is None:
            continue
        for trial in join_pieces(held):
            for change in _find_changes(card, trial):
                found.setdefault(trial.name, {}).setdefault(change.muscle, change)
    return {name: tuple(changes.values()) for name, changes in found.items()}


def _watched_card(study: Study, joint: str, fitted: Sequence[TorqueTrial]) -> EmgEstimatorCard:
    """Return the card, with its watch, of an estimator fitted to some trials of a joint."""
    estimator = fit_torque_map(list(fitted), WATCHING_ESTIMATOR, causal=True)
    card = map_estimator(study, WATCHING_ESTIMATOR, estimator, fitted)
    # Trials hold envelopes that are made and scaled already.
    card = replace(card, chain="none", channels=tuple(replace(channel, scale=1.0) for channel in card.channels))
    return add_channel_watch(card, {joint: fitted})


def _find_changes(card: EmgEstimatorCard, trial: TorqueTrial) -> tuple[ChannelChange, ...]:
    """Return the channels of a trial that the card's watch names, with the largest share of R² that each may cost."""
    live = LiveTorque(card)
    largest: dict[str, float] = {}
    emg = {channel.name: trial.envelopes[channel.name] for channel in card.channels}
    angles: Mapping[str, np.ndarray] = {name: trial.angles[name] for name in card.angles}
    for i in range(len(trial)):
        made = live.step(
            1.0 + i * card.period, {m: x[i] for m, x in emg.items()}, {name: q[i] for name, q in angles.items()}
        )
        if made.changed:
            losses = live.losses
            largest |= {m: max(losses[m], largest.get(m, 0.0)) for m in made.changed}
    return tuple(
        ChannelChange(
            muscle,
            CONSEQUENCE_KIND,
            f"a signal that does not follow the movement as it did, which may cost {loss:.2f} of the torque's R²",
            "a signal as in the recordings to be fitted",
        )
        for muscle, loss in largest.items()
    )
