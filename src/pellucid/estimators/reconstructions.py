"""Published EMG-driven estimators, reconstructed from what is said of them: to be compared with, on the same folds.

The names are the paper's [1]_; its settings were not published, so these are reconstructions:

NM-CO
    Muscles of Hill's type whose geometry depends on the neighbouring joints, all parameters calibrated together by a
    stochastic particle swarm with conjugate gradients; bounds, and hardly any pull of anatomy.
NM-COA
    The same with errors learnt online by a Gaussian process; it is given the torque that was measured so far.
NM-NC
    No coupling with neighbouring joints, whose angles are taken as constant; one stage, conjugate gradients alone.

.. [1] Wang et al., "sEMG-torque model with subject adjustment", 2021.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .adaptive_correction import AdaptiveCorrection, adaptive_correction
from .features import FeatureSet, features
from .hill import HillChoice, HillMap, fit_hill
from .torque_trial import TorqueTrial

SEEN = FeatureSet(velocities=True)
"""What the correction sees: EMG, the joint's angle and its velocity."""

LOOSE = 1e-3
"""Weight of anatomy where the original has bounds alone: enough to make parameters unique."""


@dataclass(frozen=True, eq=False)
class CorrectedMap:
    """An estimator whose errors are learnt online."""

    name: str
    base: HillMap
    correction: AdaptiveCorrection = field(repr=False)
    causal: bool = False

    @property
    def choice(self) -> HillChoice:
        """The choice of what is corrected."""
        return replace(self.base.choice, words=f"{self.base.choice.words}; errors learnt from the torque so far")

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Torque of a trial; of its own torque, each sample sees what was measured before it, shape (n,) [N m]."""
        x = features(trial, SEEN, causal=self.causal).x
        return self.correction.correct(x, self.base.predict(trial), trial.torque, trial.fs)


@dataclass(frozen=True, eq=False)
class UncoupledMap:
    """Muscles that know nothing of neighbouring joints."""

    name: str
    base: HillMap

    @property
    def choice(self) -> HillChoice:
        """The choice of the muscles."""
        return self.base.choice

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Torque of a trial, shape (n,) [N m]."""
        return self.base.predict(uncoupled(trial))


def uncoupled(trial: TorqueTrial) -> TorqueTrial:
    """The same trial with no angle but the joint's own; lengths and moment arms are the model's."""
    muscles = None if trial.muscles is None else replace(trial.muscles, recorded={})
    return replace(trial, angles={trial.joint: trial.angles[trial.joint]}, muscles=muscles)


def fit_nmco(trials: Sequence[TorqueTrial], name: str, causal: bool) -> HillMap:
    """NM-CO of `trials`, under `name`, from the past alone if `causal`."""
    return fit_hill(trials, name=name, causal=causal, weights=(LOOSE,), method="swarm")


def fit_nmcoa(trials: Sequence[TorqueTrial], name: str, causal: bool) -> CorrectedMap:
    """NM-COA of `trials`, under `name`, from the past alone if `causal`."""
    base = fit_nmco(trials, name, causal)
    parts = [(features(t, SEEN, causal=causal).x, t.torque - base.predict(t)) for t in trials]
    return CorrectedMap(name, base, adaptive_correction(parts), causal)


def fit_nmnc(trials: Sequence[TorqueTrial], name: str, causal: bool) -> UncoupledMap:
    """NM-NC of `trials`, under `name`, from the past alone if `causal`."""
    alone = [uncoupled(t) for t in trials]
    return UncoupledMap(name, fit_hill(alone, name=name, causal=causal, weights=(LOOSE,), method="descent"))
