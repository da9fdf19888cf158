r"""Fill in the activation of a muscle without an electrode, and score each filling method on recorded muscles.

For the score, a recorded electrode is removed from the test recordings. Each method then predicts the activation of its
muscle, which is compared with the activation by the recorded EMG. Activations can be compared for methods that predict
an envelope as well as for those that find an activation from a torque. Some methods see the measured torque of the test
samples (marked in tables). The others use EMG and angles alone; only for those is the resulting torque a meaningful
test.

Muscles across the joints without an electrode in any recording are excited by the synergies of the recorded muscles.

Synergies of the recorded excitations are found in the fitted trials (`synergies`), as many as account for the required
share of their variance. With H their activations, a muscle without an electrode is excited by
:math:`u_m = \sum_k w_{mk} h_k`. The weights minimise the torque that calibrated muscles leave unexplained,

.. math::
   \min_{0 \le w \le 1} \sum_j \frac{1}{s_j^2}\sum_t \left(\tau_j - \hat\tau_j - \sum_m r_{jm} F_m(u_m)\right)^2

[1]_, with constants from anatomy and the calibrated muscles' lags. Such muscles are added only if they reduce the
cross-validated error in the fitted trials by more than the standard error of the difference.
On fitted samples any added muscle reduces the error.

.. [1] M. Sartori, L. Gizzi, D. G. Lloyd, D. Farina, "A musculoskeletal model of human locomotion driven by a low
   dimensional set of impulsive excitation primitives", Front. Comput. Neurosci. 7, 2013.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear

from ..._errors import IdentificationError
from ..fit.muscle_calibration import MuscleFit, MuscleSamples
from ..models.hill import HillModel, HillMuscle
from .cross_validation import Fold, Score, block_folds, grouped_folds, score
from .hill import AssistedMuscles, HillMap, HillTogether, TrialByJoint, make_folds
from .muscle_trials import count_warm_up_samples, make_muscle_samples_across
from .ridge import Ridge
from .synergies import SYNERGY_FIT, Synergies, find_synergies, r_squared, vaf
from .torque_trial import MUSCLE_BY_CHANNEL_ALIAS, TorqueTrial, filter_and_differentiate

FILLING_METHODS: Mapping[str, str] = {
    "linear": "linear map of the other muscles",
    "synergies": "synergies of the other muscles",
    "pattern": "mean over the joint's cycle",
    "rest": "at rest",
    "synergies_assisted": "synergies, then EMG-assisted (uses the torque)",
    "assisted": "EMG-assisted (told)",
    "static": "static optimisation (told)",
}
"""Description of each filling method by name."""

TORQUE_INFORMED_METHODS = ("synergies_assisted", "assisted", "static")
"""Filling methods that see the measured torque of the samples that they fill in."""


@dataclass(frozen=True)
class FillingSettings:
    """Candidates and settings of the filling methods.

    No measurement is recorded for what is chosen by judgement.
    """

    # Candidate weights of the deviation from recorded EMG, called the trust in EMG
    trusts: tuple[float, ...] = (0.3, 3.0, 30.0, 300.0)
    efforts: tuple[float, ...] = (0.03, 0.3, 3.0, 30.0)  # Candidate weights of the activity of muscles without EMG
    fixed_trust: float = 1e6  # Trust in EMG with which recorded activations practically stay as they are
    penalties: tuple[float, ...] = (0.1, 10.0, 1000.0)  # Candidate penalties of the linear map's ridge regression
    phase_bin_count: int = 40  # Number of phase bins of a movement's cycle. Chosen by judgement.
    # Weight of a synergy at which the slope of a muscle's torque is taken. The torque is treated as linear in the
    # weight. Chosen by judgement.
    weight_step: float = 0.1


FILLING_FIT = FillingSettings()


@dataclass(frozen=True)
class AssistanceWeights:
    """Weights of EMG-assisted muscles."""

    trust: float  # Weight of the deviation from recorded EMG
    effort: float  # Weight of the activity of muscles without EMG
    chosen: bool = True  # Whether the weights were chosen within the fitted trials; False if they were given


@dataclass(frozen=True, eq=False)
class FillingScore:
    """Score of one filling method for one removed electrode."""

    way: str  # Name of the filling method
    channel: str  # Removed EMG channel
    recording: str
    muscle: str  # Muscle under the electrode
    r2: float  # R2 of the filled activation, against the activation by the muscle's own EMG
    correlation: float  # Correlation of the filled activation with the activation by the muscle's own EMG
    # Score of the torque that EMG-driven muscles then predict, by joint; None if the method sees the measured torque
    torque: Mapping[str, Score] | None
    recorded: np.ndarray  # Activation by the muscle's own EMG, shape (n,)
    filled: np.ndarray  # Filled activation, shape (n,)


@dataclass(frozen=True, eq=False)
class SingleJointMuscles:
    """Calibrated muscles of a single joint, with the interface of `HillTogether`."""

    alone: HillMap

    @property
    def joints(self) -> tuple[str, ...]:
        """Name of the joint, as a tuple of one."""
        return (self.alone.joint,)

    @property
    def fit(self) -> MuscleFit:
        """Fit of the muscles."""
        return self.alone.fit

    @property
    def driven(self) -> Mapping[str, tuple[str, ...]]:
        """EMG channels by muscle."""
        return self.alone.driven

    def samples(self, trial: TrialByJoint) -> tuple[MuscleSamples, slice]:
        """Return a recording's samples for these muscles, and the slice in which the recording itself lies."""
        return self.alone.samples(trial[self.alone.joint])

    def predict(self, trial: TrialByJoint) -> dict[str, np.ndarray]:
        """Predict the torque of the joint, shape (n,) [N m]."""
        return {self.alone.joint: self.alone.predict(trial[self.alone.joint])}


CalibratedMuscleSet = SingleJointMuscles | HillTogether
"""Calibrated muscles of one joint, or of several at once."""


def make_assisted_muscles(
    fitted: CalibratedMuscleSet, trial: TrialByJoint, scale: np.ndarray
) -> tuple[AssistedMuscles, slice]:
    """Return calibrated muscles over a recording, and the slice in which the recording itself lies.

    `scale` is the standard deviation of each joint's fitted torque, shape (j,) [N m].
    """
    samples, own = fitted.samples(trial)
    count = samples.torque.shape[-1]
    bare = AssistedMuscles(fitted.fit.muscles, samples, np.zeros((len(scale), count)), scale)
    tissue = fitted.fit.predict(samples).reshape(-1, count) - bare.torque(bare.recorded)
    return replace(bare, tissue=tissue), own


def find_removable_channels(fitted: CalibratedMuscleSet, trial: TrialByJoint) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Return the channels that can be removed, with the muscle under each and the indices of all muscles it drives.

    A channel may drive a muscle in part, together with others.
    """
    found = {}
    for channel in _any_joint_trial(trial).envelopes:
        muscle = MUSCLE_BY_CHANNEL_ALIAS.get(channel, channel)
        lost = tuple(i for i, channels in enumerate(fitted.driven.values()) if channel in channels)
        if muscle in fitted.driven and lost:
            found[channel] = muscle, lost
    return found


def _any_joint_trial(trial: TrialByJoint) -> TorqueTrial:
    """Return a recording's trial at one of its joints. EMG and angles are the same at all of them."""
    return next(iter(trial.values()))


def choose_trust(fitted: CalibratedMuscleSet, trials: Sequence[TrialByJoint]) -> AssistanceWeights:
    """Choose the weights with which the activations of removed muscles are best predicted, on the fitted trials."""
    scale = torque_standard_deviations(trials)
    seen = [(trial, *make_assisted_muscles(fitted, trial, scale)) for trial in trials]
    best = (np.inf, AssistanceWeights(FILLING_FIT.trusts[-1], FILLING_FIT.efforts[-1]))
    for trust in FILLING_FIT.trusts:
        for effort in FILLING_FIT.efforts:
            missed = 0.0
            for trial, muscles, own in seen:
                kept = count_warm_up_samples(_any_joint_trial(trial))
                for muscle, lost in find_removable_channels(fitted, trial).values():
                    at = list(fitted.driven).index(muscle)
                    predicted = muscles.find_activations(lost, trust=trust, effort=effort)[at, own]
                    truth = muscles.recorded[at, own]
                    missed += float(np.sum((predicted - truth)[kept:] ** 2) / np.sum(truth[kept:] ** 2))
            best = min(best, (missed, AssistanceWeights(trust, effort)), key=lambda each: each[0])
    return best[1]


def torque_standard_deviations(trials: Sequence[TrialByJoint]) -> np.ndarray:
    """Return the standard deviation of each joint's fitted torque, shape (j,) [N m]."""
    return np.array([np.std(np.concatenate([trial[joint].torque for trial in trials])) for joint in trials[0]])


def score_filling_methods(
    fitted: CalibratedMuscleSet,
    trials: Sequence[TrialByJoint],
    judged: Sequence[TrialByJoint],
    trust: AssistanceWeights,
    lost: Sequence[str] = (),
) -> list[FillingScore]:
    """Remove every electrode of the test recordings in turn and score every filling method.

    `trials` are fitted and `judged` are the test recordings. Channels in `lost` are missing there from the start.
    """
    if any(_any_joint_trial(trial).heldout for trial in trials):
        raise IdentificationError("filling in: found a held-out trial among the fitted ones, expected none")
    scale, filling, found = torque_standard_deviations(trials), EnvelopeFiller(trials), []
    for trial in judged:
        # Samples before a recording are not filled in. They are removed, so that all methods start alike.
        trial = {joint: replace(own, lead={}) for joint, own in trial.items()}
        muscles, own = make_assisted_muscles(fitted, trial, scale)
        kept = slice(count_warm_up_samples(_any_joint_trial(trial)), None)
        truth = muscles.recorded
        for channel, (muscle, its_own) in find_removable_channels(fitted, trial).items():
            if channel in lost:
                continue
            at = list(fitted.driven).index(muscle)
            for way in FILLING_METHODS:
                torque, plain = None, way.removesuffix("_assisted")
                if way in ("assisted", "static"):
                    how = FILLING_FIT.fixed_trust if way == "static" else trust.trust
                    predicted = muscles.find_activations(its_own, trust=how, effort=trust.effort)[at, own]
                elif plain == "synergies" and not filling.grouped:
                    continue
                else:
                    without = filling.fill_in(trial, (*lost, channel), plain)
                    seen, part = make_assisted_muscles(fitted, without, scale)
                    if way in TORQUE_INFORMED_METHODS:
                        predicted = seen.find_activations(trust=trust.trust, effort=trust.effort)[at, part]
                    else:
                        predicted = seen.recorded[at, part]
                        made = fitted.predict(without)
                        torque = {j: score(trial[j].torque[kept], made[j][kept]) for j in fitted.joints}
                a, b = truth[at, own][kept], predicted[kept]
                together = float(np.corrcoef(a, b)[0, 1]) if np.std(a) > 0.0 and np.std(b) > 0.0 else 0.0
                found.append(
                    FillingScore(
                        way, channel, _any_joint_trial(trial).name, muscle, r_squared(a, b), together, torque, a, b
                    )
                )
    return found


class EnvelopeFiller:
    """Predictor of envelopes whose electrodes are lost, fitted to trials in which they were recorded."""

    def __init__(self, trials: Sequence[TrialByJoint]):
        self._trials = tuple(map(_any_joint_trial, trials))
        self.channels = tuple(self._trials[0].envelopes)
        known = np.concatenate([np.column_stack([t.envelopes[n] for n in self.channels]) for t in self._trials])
        top = known.max(axis=0)
        self._top = np.where(top > 0.0, top, 1.0)
        # Zero-phase filters undershoot slightly below 0.
        self._known = np.maximum(known, 0.0) / self._top
        self._folds = _make_folds(self._trials)

    @property
    def grouped(self) -> bool:
        """Whether there are enough muscles for synergies without one of them."""
        return len(self.channels) > SYNERGY_FIT.min_muscles

    def fill_in(self, trial: TrialByJoint, lost: Sequence[str], way: str = "synergies") -> dict[str, TorqueTrial]:
        """Return a recording with its `lost` channels filled in by the method `way`; their own EMG is not used."""
        unknown = [channel for channel in lost if channel not in self.channels]
        if unknown or set(lost) >= set(self.channels):
            raise IdentificationError(
                f"filling in {', '.join(lost)}: found EMG of {', '.join(self.channels)} in the fitted recordings, "
                f"expected {', '.join(unknown) or 'one more channel'} there"
            )
        seen, shared = [i for i, name in enumerate(self.channels) if name not in lost], _any_joint_trial(trial)
        x = np.column_stack([shared.envelopes[n] if n not in lost else np.zeros(len(shared)) for n in self.channels])
        x = np.maximum(x, 0.0) / self._top
        made = {}
        for channel in lost:
            at = self.channels.index(channel)
            if way == "rest":
                envelope = np.zeros(len(shared))
            elif way == "pattern":
                envelope = _cycle_mean(channel, self._trials, shared)
            elif way == "linear":
                envelope = self._fit_linear_map(at, tuple(seen)).predict(x[:, seen]) * self._top[at]
            else:
                envelope = self._choose_synergies(at, tuple(seen)).reconstruct(x, seen)[:, at] * self._top[at]
            made[channel] = np.maximum(envelope, 0.0)
        return {j: replace(own, envelopes={**own.envelopes, **made}, lead={}) for j, own in trial.items()}

    def _fit_linear_map(self, at: int, seen: tuple[int, ...]) -> Ridge:
        """Return the ridge regression that predicts muscle `at` from those `seen`, with the best penalty."""
        x, y = self._known[:, seen], self._known[:, at]
        missed = [
            sum(_squared_error(Ridge(p).fit(x[f], y[f]).predict(x[g]), y[g]) for f, g in self._folds)
            for p in FILLING_FIT.penalties
        ]
        return Ridge(FILLING_FIT.penalties[int(np.argmin(missed))]).fit(x, y)

    def _choose_synergies(self, at: int, seen: tuple[int, ...]) -> Synergies:
        """Return the synergies whose number best predicts muscle `at` from those `seen`, by cross-validation."""
        missed = [
            sum(
                _squared_error(own.reconstruct(self._known[g], seen)[:, at], self._known[g, at])
                for own, (_, g) in zip(tried, self._folds, strict=True)
            )
            for tried in self._synergies_by_fold
        ]
        return self._synergies_by_number[int(np.argmin(missed))]

    @cached_property
    def _synergies_by_fold(self) -> list[list[Synergies]]:
        """Synergies by number, each fitted without one fold."""
        return [
            [find_synergies(self._known[f], self.channels, k) for f, _ in self._folds] for k in self._synergy_numbers
        ]

    @cached_property
    def _synergies_by_number(self) -> list[Synergies]:
        """Synergies by number, fitted to all samples."""
        return [find_synergies(self._known, self.channels, k) for k in self._synergy_numbers]

    @property
    def _synergy_numbers(self) -> range:
        """Numbers of synergies that are tried."""
        return range(1, len(self.channels) - 1)


def _squared_error(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Return the sum of squared errors of a prediction, whose negative values count as 0."""
    return float(np.sum((np.maximum(predicted, 0.0) - truth) ** 2))


def _make_folds(trials: Sequence[TorqueTrial]) -> list[Fold]:
    """Return folds of whole trials, or of blocks of a single one."""
    if len(trials) > 1:
        return grouped_folds([name for i, t in enumerate(trials) for name in [str(i)] * len(t)])
    return block_folds(trials[0].time, SYNERGY_FIT.block_count, SYNERGY_FIT.fold_gap_s)


def _cycle_mean(channel: str, trials: Sequence[TorqueTrial], judged: TorqueTrial) -> np.ndarray:
    """Return the mean fitted envelope at the same phase of the cycle of the joint's angle and speed, shape (n,)."""
    moved = [
        filter_and_differentiate(np.asarray(t.angles[t.joint], float), t.fs, causal=False)[:2]
        for t in (*trials, judged)
    ]
    q, v = (np.concatenate([each[i] for each in moved[:-1]]) for i in (0, 1))
    middle, size, speed = q.mean(), q.std() or 1.0, v.std() or 1.0

    def phase(angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        return np.arctan2(-rate / speed, (angle - middle) / size)

    known = np.concatenate([t.envelopes[channel] for t in trials])
    place = ((phase(q, v) + np.pi) / (2.0 * np.pi) * FILLING_FIT.phase_bin_count).astype(
        int
    ) % FILLING_FIT.phase_bin_count
    count = np.bincount(place, minlength=FILLING_FIT.phase_bin_count)
    mean = np.bincount(place, known, minlength=FILLING_FIT.phase_bin_count) / np.maximum(count, 1)
    centre = -np.pi + (np.arange(FILLING_FIT.phase_bin_count) + 0.5) * 2.0 * np.pi / FILLING_FIT.phase_bin_count
    met = count > 0
    return np.interp(phase(*moved[-1]), centre[met], mean[met], period=2.0 * np.pi)


@dataclass(frozen=True, eq=False)
class UnrecordedMuscles:
    """Muscles without an electrode, in addition to calibrated ones."""

    beside: HillTogether = field(repr=False)  # Calibrated muscles
    muscles: tuple[HillMuscle, ...]  # Muscles without an electrode
    synergies: Synergies  # Synergies of the recorded muscles' excitations, each relative to its largest value
    top: np.ndarray = field(repr=False)  # Largest excitation of each recorded muscle, shape (r,) [1]
    weights: np.ndarray = field(repr=False)  # Weight of each synergy in each muscle's excitation, shape (m, k) [1]
    # Mean squared error over the reference's variance in each fold without these muscles, shape (f,)
    errors_without: np.ndarray = field(repr=False, default_factory=lambda: np.zeros(0))
    # Mean squared error over the reference's variance in each fold with these muscles, shape (f,)
    errors_with: np.ndarray = field(repr=False, default_factory=lambda: np.zeros(0))

    @property
    def helps(self) -> bool:
        """Whether these muscles reduce the error in cross-validation by more than the standard error."""
        gain = self.errors_without - self.errors_with
        return bool(len(gain) > 1 and np.mean(gain) > np.std(gain, ddof=1) / np.sqrt(len(gain)))

    def added_torque(self, trial: TrialByJoint) -> dict[str, np.ndarray]:
        """Return the torque that these muscles add at each joint, shape (n,) [N m]; the measured one is not used."""
        across = {joint: [trial[joint]] for joint in self.beside.joints}
        recorded, own = self.beside.samples(trial)
        made = self._active_torque(
            self._synergy_activations(recorded), self._unexcited_samples(across)[0], self.weights
        )
        return dict(zip(self.beside.joints, made[:, own], strict=True))

    def predict(self, trial: TrialByJoint) -> dict[str, np.ndarray]:
        """Predict the torque of each joint, with these muscles, shape (n,) [N m]."""
        more = self.added_torque(trial)
        return {joint: torque + more[joint] for joint, torque in self.beside.predict(trial).items()}

    def _synergy_activations(self, recorded: MuscleSamples) -> np.ndarray:
        """Return the activations of the synergies, shape (n, k)."""
        return self.synergies.activations(np.maximum(recorded.data.excitation, 0.0).T / self.top)

    def _unexcited_samples(self, across: Mapping[str, Sequence[TorqueTrial]]) -> tuple[MuscleSamples, list[slice]]:
        """Return samples of these muscles without excitation, and the slice of each trial in them."""
        return make_muscle_samples_across(
            across, muscles=[m.name for m in self.muscles], ahead=self.beside.choice.timing.ahead
        )

    def _active_torque(self, activations: np.ndarray, bare: MuscleSamples, weights: np.ndarray) -> np.ndarray:
        """Return the active torque of these muscles, shape (j, n) [N m].

        Their torque at rest is subtracted, since anatomy alone would add it.
        """
        model = HillModel(self.muscles)
        excited = replace(bare.data, excitation=weights @ activations.T)
        return model.torque(excited) - model.torque(bare.data)

    def _solve_weights(
        self, activations: np.ndarray, bare: MuscleSamples, left: np.ndarray, at: np.ndarray
    ) -> np.ndarray:
        """Return the weights that minimise the unexplained torque at some samples, shape (m, k).

        `left` is the torque that calibrated muscles leave, shape (j, n); `at` indexes the fitted samples.
        """
        m, k = len(self.muscles), activations.shape[1]
        columns = []
        for i in range(m * k):
            one = np.zeros(m * k)
            one[i] = FILLING_FIT.weight_step
            columns.append(
                self._active_torque(activations, bare, one.reshape(m, k))[:, at].ravel() / FILLING_FIT.weight_step
            )
        return lsq_linear(np.array(columns).T, left[:, at].ravel(), (0.0, 1.0)).x.reshape(m, k)


def fit_unrecorded_muscles(fit: HillTogether, trials: Mapping[str, Sequence[TorqueTrial]]) -> UnrecordedMuscles | None:
    """Fit muscles that have no electrode in the fitted trials, in addition to the calibrated ones.

    Return None if there are no such muscles, or too few recorded ones for synergies.
    """
    first = next(iter(trials.values()))
    known = {m.name: m for m in fit.fit.muscles}
    source = {
        name: own[0].known_muscles.constants[name]
        for joint, own in trials.items()
        for name in own[0].known_muscles.crossing(joint)
        if name not in known and name in own[0].known_muscles.constants
    }
    samples = fit.fit.problem.samples
    excitation = np.maximum(samples.data.excitation, 0.0)
    if not source or len(known) < SYNERGY_FIT.min_muscles:
        return None
    # The activation dynamics of such a muscle are unknown. They are the mean of the calibrated muscles'.
    calibrated = fit.fit.muscles
    dynamics = ("shape", "delay", "time_constant_1", "time_constant_2")
    means = {q: float(np.mean([getattr(m, q) for m in calibrated])) for q in dynamics}
    unrecorded = tuple(replace(m, **means) for m in source.values())
    top = excitation.max(axis=1)
    relative = excitation.T / top
    for number in range(1, len(known)):
        synergies = find_synergies(relative, tuple(known), number)
        if vaf(relative, synergies.reconstruct(relative)) >= SYNERGY_FIT.min_vaf:
            break
    made = UnrecordedMuscles(fit, unrecorded, synergies, top, np.zeros((len(source), len(synergies))))
    activations, (bare, own) = made._synergy_activations(samples), made._unexcited_samples(trials)
    scale = np.std(samples.torque[:, samples.weight[0] > 0.0], axis=1, keepdims=True)
    left = (samples.torque - fit.fit.predict(samples)) / scale
    bare = replace(bare, data=replace(bare.data, moment_arm=bare.data.moment_arm / scale[:, :, None]))
    counted = np.flatnonzero(samples.weight[0] > 0.0)
    without, with_them = [], []
    for fitted, judged in make_folds(first, own, samples, counted):
        more = made._active_torque(activations, bare, made._solve_weights(activations, bare, left, fitted))
        without.append(float(np.mean(left[:, judged] ** 2)))
        with_them.append(float(np.mean((left - more)[:, judged] ** 2)))
    weights = made._solve_weights(activations, bare, left, counted)
    return replace(made, weights=weights, errors_without=np.array(without), errors_with=np.array(with_them))
