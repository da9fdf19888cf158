"""Reconstructions of published EMG-driven estimators, for comparison on the same folds.

The names are the paper's [1]_; its settings were not published, so these are reconstructions:

NM-CO
    Muscles of Hill's type whose geometry depends on the neighbouring joints, all parameters calibrated together by a
    stochastic particle swarm with conjugate gradients, with bounds and a very weak anatomical prior.
NM-COA
    NM-CO with errors learnt online by a Gaussian process, which sees the torque measured so far.
NM-NC
    Muscles without coupling to neighbouring joints, whose angles are taken as constant; one stage of conjugate
    gradients alone.

.. [1] Wang et al., "sEMG-torque model with subject adjustment", 2021.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .adaptive_correction import AdaptiveCorrection, fit_adaptive_correction
from .features import FeatureSet, compute_features
from .hill import HillChoice, HillMap, fit_hill
from .torque_trial import TorqueTrial

CORRECTION_FEATURES = FeatureSet(velocities=True)
"""Features of the correction: EMG, the joint's angle and its velocity."""

WEAK_ANATOMY_WEIGHT = 1e-3
"""Weight of the anatomical prior. The original has bounds alone; this weight suffices to make parameters unique."""


@dataclass(frozen=True, eq=False)
class CorrectedMap:
    """An estimator whose errors are learnt online."""

    name: str
    base: HillMap
    correction: AdaptiveCorrection = field(repr=False)
    causal: bool = False

    @property
    def choice(self) -> HillChoice:
        """Choice of the corrected estimator."""
        return replace(self.base.choice, words=f"{self.base.choice.words}; errors learnt from the torque so far")

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Predict the torque of a trial, shape (n,) [N m]. Each sample uses the torque measured before it."""
        x = compute_features(trial, CORRECTION_FEATURES, causal=self.causal).x
        return self.correction.correct(x, self.base.predict(trial), trial.torque, trial.fs)


@dataclass(frozen=True, eq=False)
class UncoupledMap:
    """Muscles that do not see the angles of neighbouring joints."""

    name: str
    base: HillMap

    @property
    def choice(self) -> HillChoice:
        """Choice of the muscles."""
        return self.base.choice

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Predict the torque of a trial, shape (n,) [N m]."""
        return self.base.predict(uncouple_trial(trial))


def uncouple_trial(trial: TorqueTrial) -> TorqueTrial:
    """Return the trial with the joint's own angle alone, and with lengths and moment arms of the model."""
    muscles = None if trial.muscles is None else replace(trial.muscles, recorded={})
    return replace(trial, angles={trial.joint: trial.angles[trial.joint]}, muscles=muscles)


def fit_nmco(trials: Sequence[TorqueTrial], name: str, causal: bool) -> HillMap:
    """Fit NM-CO to `trials`, under `name`; `causal` filters use the past alone."""
    return fit_hill(
        trials, name=name, causal=causal, weights=(WEAK_ANATOMY_WEIGHT,), method="swarm", weighs_trials=False
    )


def fit_nmcoa(trials: Sequence[TorqueTrial], name: str, causal: bool) -> CorrectedMap:
    """Fit NM-COA to `trials`, under `name`; `causal` filters use the past alone."""
    base = fit_nmco(trials, name, causal)
    parts = [(compute_features(t, CORRECTION_FEATURES, causal=causal).x, t.torque - base.predict(t)) for t in trials]
    return CorrectedMap(name, base, fit_adaptive_correction(parts), causal)


def fit_nmnc(trials: Sequence[TorqueTrial], name: str, causal: bool) -> UncoupledMap:
    """Fit NM-NC to `trials`, under `name`; `causal` filters use the past alone."""
    alone = [uncouple_trial(t) for t in trials]
    return UncoupledMap(
        name,
        fit_hill(
            alone, name=name, causal=causal, weights=(WEAK_ANATOMY_WEIGHT,), method="descent", weighs_trials=False
        ),
    )
