r"""Muscles across the joints that never had an electrode, excited by the synergies of those that had.

Synergies of the recorded excitations are found in what is fitted (`synergies`), as many as account for enough of it.
With H their activations, a muscle without an electrode is excited by :math:`u_m = \sum_k w_{mk} h_k`, and the weights
are those with which what calibrated muscles leave of the torques is least,

.. math::
   \min_{0 \le w \le 1} \sum_j \frac{1}{s_j^2}\sum_t \left(\tau_j - \hat\tau_j - \sum_m r_{jm} F_m(u_m)\right)^2

[1]_, with constants from anatomy and the calibrated muscles' lags. They are added only where parts of what is fitted,
left out in turn, are told better with them, by more than the standard error of the difference: whatever is added fits.

.. [1] M. Sartori, L. Gizzi, D. G. Lloyd, D. Farina, "A musculoskeletal model of human locomotion driven by a low
   dimensional set of impulsive excitation primitives", Front. Comput. Neurosci. 7, 2013.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import lsq_linear

from ..fit.muscles.muscle_calibration import MuscleSamples
from ..models.hill import HillModel, HillMuscle
from .hill import folds_of
from .hill_together import Across, HillTogether
from .muscle_trials import samples_across
from .synergies import ENOUGH, FEWEST, Synergies, find_synergies, vaf
from .torque_trial import TorqueTrial

SMALL = 0.1
"""Share of a synergy at which a muscle's torque is taken for straight in it."""


@dataclass(frozen=True, eq=False)
class NeverRecorded:
    """Muscles without an electrode, beside calibrated ones."""

    beside: HillTogether = field(repr=False)
    muscles: tuple[HillMuscle, ...]
    synergies: Synergies  # Of the recorded muscles' excitations, each over its largest
    top: np.ndarray = field(repr=False)  # (r,) Those largest [1]
    weights: np.ndarray = field(repr=False)  # (m, k) Of each synergy in each muscle's excitation [1]
    # (f,) Mean squared error over the reference's variance of each part left out
    without: np.ndarray = field(repr=False, default_factory=lambda: np.zeros(0))
    with_them: np.ndarray = field(repr=False, default_factory=lambda: np.zeros(0))

    @property
    def helps(self) -> bool:
        """Whether parts of what was fitted, left out in turn, are told better with them."""
        gain = self.without - self.with_them
        return bool(len(gain) > 1 and np.mean(gain) > np.std(gain, ddof=1) / np.sqrt(len(gain)))

    def added(self, trial: Across) -> dict[str, np.ndarray]:
        """Torque that they add at each joint, shape (n,) [N m]; the recording's own is not looked at."""
        across = {joint: [trial[joint]] for joint in self.beside.joints}
        recorded, own = self.beside.samples(trial)
        made = self._torque(self._activations(recorded), self._bare(across)[0], self.weights)
        return dict(zip(self.beside.joints, made[:, own], strict=True))

    def predict(self, trial: Across) -> dict[str, np.ndarray]:
        """Torque of each joint with them, shape (n,) [N m]."""
        more = self.added(trial)
        return {joint: torque + more[joint] for joint, torque in self.beside.predict(trial).items()}

    def _activations(self, recorded: MuscleSamples) -> np.ndarray:
        """Of the synergies, (n, k)."""
        return self.synergies.activations(np.maximum(recorded.data.excitation, 0.0).T / self.top)

    def _bare(self, across: Mapping[str, Sequence[TorqueTrial]]) -> tuple[MuscleSamples, list[slice]]:
        """Lengths, rates and arms, without excitation, and where each trial's own lie."""
        return samples_across(across, muscles=[m.name for m in self.muscles], ahead=self.beside.choice.timing.ahead)

    def _torque(self, activations: np.ndarray, bare: MuscleSamples, weights: np.ndarray) -> np.ndarray:
        """Beyond what they give at rest, which anatomy alone would add, (j, n) [N m]."""
        model = HillModel(self.muscles)
        excited = replace(bare.data, excitation=weights @ activations.T)
        return model.torque(excited) - model.torque(bare.data)

    def _fitted(self, activations: np.ndarray, bare: MuscleSamples, left: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Weights, (m, k), with which least of `left`, (j, n), remains `at` some samples."""
        m, k = len(self.muscles), activations.shape[1]
        columns = []
        for i in range(m * k):
            one = np.zeros(m * k)
            one[i] = SMALL
            columns.append(self._torque(activations, bare, one.reshape(m, k))[:, at].ravel() / SMALL)
        return lsq_linear(np.array(columns).T, left[:, at].ravel(), (0.0, 1.0)).x.reshape(m, k)


def never_recorded(fit: HillTogether, trials: Mapping[str, Sequence[TorqueTrial]]) -> NeverRecorded | None:
    """Muscles that no electrode drives in the trials that were fitted, beside those calibrated on them; None where
    there are none, or too few recorded ones for synergies."""
    first = next(iter(trials.values()))
    known = {m.name: m for m in fit.fit.muscles}
    source = {
        name: own[0].muscles.constants[name]
        for joint, own in trials.items()
        for name in own[0].muscles.crossing(joint)
        if name not in known and name in own[0].muscles.constants
    }
    samples = fit.fit.problem.samples
    excitation = np.maximum(samples.data.excitation, 0.0)
    if not source or len(known) < FEWEST:
        return None
    # Of one muscle's activation nobody knows the lags: they are those of the muscles beside it.
    like = {q: float(np.mean([getattr(m, q) for m in fit.fit.muscles])) for q in
            ("shape", "delay", "time_constant_1", "time_constant_2")}  # fmt: skip
    top = excitation.max(axis=1)
    relative = excitation.T / top
    for number in range(1, len(known)):
        synergies = find_synergies(relative, tuple(known), number)
        if vaf(relative, synergies.rebuilt(relative)) >= ENOUGH:
            break
    made = NeverRecorded(
        fit, tuple(replace(m, **like) for m in source.values()), synergies, top, np.zeros((len(source), len(synergies)))
    )
    activations, (bare, own) = made._activations(samples), made._bare(trials)
    scale = np.std(samples.torque[:, samples.weight[0] > 0.0], axis=1, keepdims=True)
    left = (samples.torque - fit.fit.predict(samples)) / scale
    bare = replace(bare, data=replace(bare.data, moment_arm=bare.data.moment_arm / scale[:, :, None]))
    counted = np.flatnonzero(samples.weight[0] > 0.0)
    without, with_them = [], []
    for fitted, judged in folds_of(first, own, samples, counted):
        more = made._torque(activations, bare, made._fitted(activations, bare, left, fitted))
        without.append(float(np.mean(left[:, judged] ** 2)))
        with_them.append(float(np.mean((left - more)[:, judged] ** 2)))
    weights = made._fitted(activations, bare, left, counted)
    return replace(made, weights=weights, without=np.array(without), with_them=np.array(with_them))
