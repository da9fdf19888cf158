r"""Muscles across the joints that never had an electrode, excited by the synergies of the recorded muscles.

Synergies of the recorded excitations are found in the fitted trials (`synergies`), as many as account for the required
share of their variance. With H their activations, a muscle without an electrode is excited by
:math:`u_m = \sum_k w_{mk} h_k`. The weights minimise the torque that calibrated muscles leave unexplained,

.. math::
   \min_{0 \le w \le 1} \sum_j \frac{1}{s_j^2}\sum_t \left(\tau_j - \hat\tau_j - \sum_m r_{jm} F_m(u_m)\right)^2

[1]_, with constants from anatomy and the calibrated muscles' lags. Such muscles are added only if they improve the
prediction of parts of the fitted trials that are left out in turn, by more than the standard error of the difference.
On fitted samples any added muscle reduces the error.

.. [1] M. Sartori, L. Gizzi, D. G. Lloyd, D. Farina, "A musculoskeletal model of human locomotion driven by a low
   dimensional set of impulsive excitation primitives", Front. Comput. Neurosci. 7, 2013.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import lsq_linear

from ..fit.muscle_calibration import MuscleSamples
from ..models.hill import HillModel, HillMuscle
from .hill import make_folds
from .hill_together import HillTogether, TrialByJoint
from .muscle_trials import make_muscle_samples_across
from .synergies import DEFAULT_MIN_MUSCLES, VAF_THRESHOLD, Synergies, find_synergies, vaf
from .torque_trial import TorqueTrial

SYNERGY_WEIGHT_STEP = 0.1
"""Weight of a synergy at which the slope of a muscle's torque is taken. The torque is treated as linear in the weight.

Chosen by judgement; no measurement is recorded.
"""


@dataclass(frozen=True, eq=False)
class UnrecordedMuscles:
    """Muscles without an electrode, beside calibrated ones."""

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
            one[i] = SYNERGY_WEIGHT_STEP
            columns.append(
                self._active_torque(activations, bare, one.reshape(m, k))[:, at].ravel() / SYNERGY_WEIGHT_STEP
            )
        return lsq_linear(np.array(columns).T, left[:, at].ravel(), (0.0, 1.0)).x.reshape(m, k)


def fit_unrecorded_muscles(fit: HillTogether, trials: Mapping[str, Sequence[TorqueTrial]]) -> UnrecordedMuscles | None:
    """Fit muscles that no electrode drives in the fitted trials, beside the calibrated ones.

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
    if not source or len(known) < DEFAULT_MIN_MUSCLES:
        return None
    # The activation dynamics of such a muscle are unknown. They are the mean of the calibrated muscles'.
    calibrated = fit.fit.muscles
    shape, delay = (float(np.mean([getattr(m, q) for m in calibrated])) for q in ("shape", "delay"))
    time_constant_1 = float(np.mean([m.time_constant_1 for m in calibrated]))
    time_constant_2 = float(np.mean([m.time_constant_2 for m in calibrated]))
    unrecorded = tuple(
        replace(m, shape=shape, delay=delay, time_constant_1=time_constant_1, time_constant_2=time_constant_2)
        for m in source.values()
    )
    top = excitation.max(axis=1)
    relative = excitation.T / top
    for number in range(1, len(known)):
        synergies = find_synergies(relative, tuple(known), number)
        if vaf(relative, synergies.reconstruct(relative)) >= VAF_THRESHOLD:
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
