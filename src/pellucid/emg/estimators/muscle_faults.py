"""Refuse trials that are unfit for muscles, with the trial, the channel, and what was found and expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import RecordingError
from .torque_trial import TorqueTrial


@dataclass(frozen=True)
class TrialLimits:
    """Limits beyond which no muscle can have made a trial.

    No measurement is recorded for what is chosen by judgement.
    """

    # An envelope may fall below 0 by at most this share of its largest value. Low-passes undershoot by a few percent.
    max_negative_share: float = 0.1
    # Largest angle that a joint can have [rad]. A larger one is probably in degrees.
    max_joint_angle_rad: float = 2.0 * np.pi
    # An envelope must exceed this share of a maximal contraction at least once. Otherwise no muscle was recorded.
    # Chosen by judgement.
    min_envelope_peak: float = 5e-3
    # Flexors and extensors count as swapped if both sides' EMG correlates with the wrong torque by more than this.
    # Chosen by judgement.
    min_swapped_correlation: float = 0.3
    # A file's largest envelope counts as normalised to 1 if it differs from 1 by less than this. Chosen by judgement.
    unit_maximum_tolerance: float = 1e-3


TRIAL_LIMITS = TrialLimits()


def refuse_unfit_trials(trials: Sequence[TorqueTrial]) -> None:
    """Refuse trials whose angles or envelopes no muscle could have made.

    Envelopes of held-out trials reach no fit: what they hold is judged as it is, and refuses nothing.
    """
    for trial in trials:
        for joint, angle in trial.angles.items():
            if np.abs(angle).max() > TRIAL_LIMITS.max_joint_angle_rad:
                raise RecordingError(
                    f"trial {trial.name}, channel angle.{joint}: found {np.abs(angle).max():.4g} rad, expected at most "
                    f"{TRIAL_LIMITS.max_joint_angle_rad:.3g} rad; is it in degrees?"
                )
    fitted = [t for t in trials if not t.heldout] or list(trials)
    for trial in fitted:
        for muscle, envelope in trial.envelopes.items():
            _refuse_envelope(f"trial {trial.name}, channel emg.{muscle}", envelope)
    _refuse_silence_and_own_maxima(fitted)
    _refuse_swapped_sides(fitted)


def _refuse_envelope(where: str, envelope: np.ndarray) -> None:
    """Refuse an envelope that is negative, or far above a maximal contraction."""
    top, low = float(envelope.max()), float(envelope.min())
    if low < -TRIAL_LIMITS.max_negative_share * max(top, -low):
        raise RecordingError(f"{where}: found {low:.3g} in an envelope, expected none below 0; was it rectified?")
    if top > 1.5:
        raise RecordingError(
            f"{where}: found {top:.3g} times the maximum, expected an envelope relative to a maximal contraction"
        )


def _refuse_silence_and_own_maxima(trials: Sequence[TorqueTrial]) -> None:
    """Refuse envelopes that are silent in all trials, and trials that were each normalised by their own maximum.

    A muscle may be silent in some trials, but not in all of them.
    """
    for muscle in trials[0].envelopes:
        tops = [float(t.envelopes[muscle].max()) for t in trials if muscle in t.envelopes]
        if max(tops) < TRIAL_LIMITS.min_envelope_peak:
            raise RecordingError(
                f"trials {', '.join(t.name for t in trials)}, channel emg.{muscle}: found at most {max(tops):.2g} of "
                f"the maximum, expected more than {TRIAL_LIMITS.min_envelope_peak:g}; is the electrode attached?"
            )
    people = dict.fromkeys(t.participant for t in trials)
    for person in people:
        own = [t for t in trials if t.participant == person]
        files = {t.checksum or t.name: t for t in own}
        if len(files) < 2:
            continue
        own_tops = np.array([[float(t.envelopes[m].max()) for m in t.envelopes] for t in files.values()])
        if np.all(np.abs(own_tops - 1.0) < TRIAL_LIMITS.unit_maximum_tolerance):
            raise RecordingError(
                f"trials {', '.join(t.name for t in files.values())}: found a largest envelope of 1 for every muscle "
                "in every trial: each was normalised by its own maximum. Expected one maximum for each muscle of a "
                "participant, or an effort cannot be compared between trials"
            )


def _refuse_swapped_sides(trials: Sequence[TorqueTrial]) -> None:
    """Refuse trials in which flexor and extensor channels are swapped.

    The sign of a muscle's moment arm tells its side of the joint. The mean EMG of each side must not correlate with the
    torque of the other.
    """
    sides: dict[bool, list[np.ndarray]] = {True: [], False: []}
    torque = np.concatenate([t.torque for t in trials])
    first = trials[0]
    if first.muscles is None:
        return
    for muscle, channels in first.muscles.driven(first.joint, first.envelopes).items():
        rates = {name: np.zeros(len(first)) for name in first.angles}
        arm = first.muscles.path(muscle, first.joint, first.angles, rates)[2]
        if len(channels) == 1:
            sides[bool(np.mean(arm) > 0.0)].append(np.concatenate([t.envelopes[channels[0]] for t in trials]))
    if not all(sides.values()) or np.std(torque) == 0.0:
        return
    along, against = (float(np.corrcoef(np.mean(sides[side], axis=0), torque)[0, 1]) for side in (True, False))
    if along < -TRIAL_LIMITS.min_swapped_correlation and against > TRIAL_LIMITS.min_swapped_correlation:
        raise RecordingError(
            f"trials {', '.join(t.name for t in trials)}: found muscles that pull along the {first.joint}'s angle to "
            f"correlate with its torque by {along:.2f}, and those against it by {against:.2f}; expected the other way "
            "round: are flexor and extensor channels swapped?"
        )
