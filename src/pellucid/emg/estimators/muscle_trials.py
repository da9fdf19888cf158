"""Convert trials into muscle samples: excitations, lengths, rates and moment arms about one or several joints.

Refuse trials that are unfit for muscles, with the trial, the channel, and what was found and expected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError, RecordingError
from ..fit.muscle_calibration import MuscleSamples
from ..models.hill import HillData, HillMuscle
from ..models.muscle_geometry import muscle_table
from .feature_scale import find_trial_weights
from .torque_trial import TorqueTrial, filter_and_differentiate


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
    """Reject fitted trials whose angles or envelopes are impossible for a muscle.

    Envelopes of held-out trials are not checked, because they are not used to fit.
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


WARM_UP_S = 0.3
"""Duration at a trial's beginning that is not fitted [s].

A muscle's force depends on its past EMG, and the EMG before the trial is not known.
"""


def find_driven_muscles(trials: Sequence[TorqueTrial]) -> tuple[HillMuscle, ...]:
    """Return the muscles of the trials' joint that EMG drives, with their anatomical constants."""
    first = trials[0]
    if first.unit != "N*m":
        raise IdentificationError(
            f"trial {first.name}: found the torque in shares of a maximal contraction, expected N*m: state the torque "
            "of that contraction in [emg_torque.largest_moment]"
        )
    muscles = first.known_muscles
    found = [t.known_muscles.driven(t.joint, t.envelopes) for t in trials]
    if not found[0] or any(each != found[0] for each in found):
        raise IdentificationError(
            f"trials {', '.join(t.name for t in trials)}: found EMG of {', '.join(first.envelopes)}, expected in each "
            f"trial the same muscles across the {first.joint}"
        )
    if not muscles.relative:
        raise IdentificationError(
            f"trial {first.name}: found envelopes in V, expected them relative to a maximal contraction: a chain in "
            '[emg_torque] that normalises, and a recording with the protocol "mvc"'
        )
    refuse_unfit_trials(trials)
    return tuple(muscles.constants[name] for name in found[0])


def find_driven_muscles_across(trials: Mapping[str, Sequence[TorqueTrial]]) -> tuple[HillMuscle, ...]:
    """Return the muscles of several joints that EMG drives, each once.

    `trials` by joint must be of the same recordings, in the same order.
    """
    first, *others = trials
    for joint in others:
        names = [[t.name for t in trials[j]] for j in (first, joint)]
        if names[0] != names[1]:
            raise IdentificationError(
                f"muscles across {' and '.join(trials)}: found the {first}'s torque in {', '.join(names[0]) or 'none'} "
                f"and the {joint}'s in {', '.join(names[1]) or 'none'}, expected both in the same recordings"
            )
        for a, b in zip(trials[first], trials[joint], strict=True):
            if not np.array_equal(a.time, b.time):
                raise IdentificationError(
                    f"recording {a.name}: found the {first}'s torque at {len(a)} instants and the {joint}'s at "
                    f"{len(b)} others, expected both at the same"
                )
    found: dict[str, HillMuscle] = {}
    for own in trials.values():
        for muscle in find_driven_muscles(own):
            found.setdefault(muscle.name, muscle)
    return tuple(found.values())


def make_muscle_samples(
    trials: Sequence[TorqueTrial],
    *,
    muscles: Sequence[str],
    effort: float = 1.0,
    causal: bool = False,
    weighs_trials: bool = True,
) -> tuple[MuscleSamples, list[slice]]:
    """Return the muscle samples of several trials of one joint, and the slice of each trial in them."""
    samples, own = make_muscle_samples_across(
        {"joint": trials}, muscles=muscles, effort=effort, causal=causal, weighs_trials=weighs_trials
    )
    data = replace(samples.data, moment_arm=samples.data.moment_arm[0])
    rows = {name: getattr(samples, name)[0] for name in ("torque", "angle", "speed", "weight")}
    return replace(samples, data=data, **rows), own


def make_muscle_samples_across(
    across: Mapping[str, Sequence[TorqueTrial]],
    *,
    muscles: Sequence[str],
    effort: float = 1.0,
    causal: bool = False,
    ahead: float = 0.0,
    weighs_trials: bool = True,
) -> tuple[MuscleSamples, list[slice]]:
    """Return the muscle samples of several trials at several joints, and the slice of each trial in them.

    Envelopes are advanced by `ahead` [s]. Samples at a trial's end, where envelopes are then missing, have weight 0.
    The others have their trial's weight by `find_trial_weights`, at each joint by its own torque, or 1 if not
    `weighs_trials`.
    """
    trials = next(iter(across.values()))
    fs = float(np.mean([t.fs for t in trials]))
    worst = max(trials, key=lambda t: abs(t.fs - fs))
    # Trials share one period. An error of some percent in the rate changes a lag by as much, within its uncertainty.
    if abs(worst.fs - fs) > 0.15 * fs:
        raise IdentificationError(f"trial {worst.name}: found a rate of {worst.fs:.4g} Hz, expected about {fs:.4g} Hz")
    parts, own, starts, at = [], [], [], 0
    for same in zip(*across.values(), strict=True):
        part, lead = _recording_samples(same, muscles, causal, round(ahead * fs))
        starts.append(at)
        own.append(slice(at + lead, at + part["torque"].shape[-1]))
        at += part["torque"].shape[-1]
        parts.append(part)
    for j, of_joint in enumerate(across.values()):
        weights = find_trial_weights([t.torque for t in of_joint]) if weighs_trials else None
        if weights is not None:
            for part, weight in zip(parts, weights, strict=True):
                part["weight"][j] *= weight
    joined = {key: np.concatenate([part[key] for part in parts], axis=-1) for key in parts[0]}
    data = HillData(
        effort * joined["excitation"], joined["length"], joined["rate"], joined["moment_arm"], 1.0 / fs, tuple(starts)
    )
    samples = MuscleSamples(data, joined["torque"], joined["angle"], joined["speed"], joined["weight"], tuple(across))
    return samples, own


def count_warm_up_samples(trial: TorqueTrial) -> int:
    """Return the number of samples at a trial's beginning on which no estimator is scored."""
    lead = len(next(iter(trial.lead.values()))) if trial.lead else 0
    return max(0, round(WARM_UP_S * trial.fs) - lead)


def _recording_samples(
    same: Sequence[TorqueTrial], muscles: Sequence[str], causal: bool, ahead: int
) -> tuple[Mapping[str, np.ndarray], int]:
    """Return the samples of one recording, given its trial at each joint, and the number of samples before the trial.

    `ahead` is the number of samples by which envelopes are advanced.
    """
    trial = same[0]
    lead = len(next(iter(trial.lead.values()))) if trial.lead else 0
    moved = {
        name: filter_and_differentiate(np.asarray(q, float), trial.fs, causal=causal)[:2]
        for name, q in trial.angles.items()
    }
    # A causal filter is late. The angle itself therefore stays unfiltered.
    angles = {name: np.asarray(trial.angles[name], float) if causal else q for name, (q, _) in moved.items()}
    rates = {name: v for name, (_, v) in moved.items()}
    driven = {
        m: channels for t in reversed(same) for m, channels in t.known_muscles.driven(t.joint, t.envelopes).items()
    }
    # Recorded lengths have precedence: those of a model may be another person's.
    along = {m: next((t for t in same if m in t.known_muscles.recorded), trial) for m in muscles}
    paths = [along[m].known_muscles.path(m, along[m].joint, angles, rates) for m in muscles]
    arms = [
        [
            _moment_arm(t, m, angles, rates) if t is not along[m] else path[2]
            for m, path in zip(muscles, paths, strict=True)
        ]
        for t in same
    ]
    # A muscle without EMG is at rest.
    rest = [np.zeros(lead + len(trial))]
    excitation = np.array(
        [
            np.mean([np.concatenate((trial.lead.get(c, ()), trial.envelopes[c])) for c in driven.get(m, ())] or rest, 0)
            for m in muscles
        ]
    )
    weight = np.ones(len(trial))
    weight[: count_warm_up_samples(trial)] = 0.0
    if ahead:
        excitation = np.concatenate((excitation[:, ahead:], np.repeat(excitation[:, -1:], ahead, axis=1)), axis=1)
        weight[len(weight) - ahead :] = 0.0

    def lasting(x: np.ndarray) -> np.ndarray:
        return np.concatenate((np.repeat(x[..., :1], lead, axis=-1), x), axis=-1)

    return {
        "excitation": excitation,
        "length": lasting(np.array([p[0] for p in paths])),
        "rate": lasting(np.array([p[1] for p in paths])),
        "moment_arm": lasting(np.array(arms)),
        "torque": lasting(np.array([t.torque for t in same])),
        "angle": lasting(np.array([angles[t.joint] for t in same])),
        "speed": lasting(np.array([rates[t.joint] for t in same])),
        "weight": np.tile(np.concatenate((np.zeros(lead), weight)), (len(same), 1)),
    }, lead


def _moment_arm(
    trial: TorqueTrial, muscle: str, angles: Mapping[str, np.ndarray], rates: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Return the moment arm of a muscle about the trial's joint, shape (n,) [m]; 0 if it does not cross the joint."""
    known = trial.known_muscles.recorded or muscle_table().geometry
    if muscle not in known:
        return np.zeros(len(trial))
    return trial.known_muscles.path(muscle, trial.joint, angles, rates)[2]
