"""Step 3 on the virtual shank exoskeleton: the knee's torque from EMG, by muscle models and by baselines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pellucid.emg.estimators.adaptive_correction import CORRECTION_FEATURES, CorrectedMap, fit_adaptive_correction
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES
from pellucid.emg.estimators.hill import HillMap, fit_hill
from pellucid.emg.estimators.torque_map import fit_torque_map
from pellucid.emg.estimators.torque_trial import compute_features
from pellucid.orthosis.study.loaded_swing.seated_swings import FLEXOR_MUSCLE
from pellucid.orthosis.swing.loaded_swing import bare_leg_torque

from .steps import IdentifiedBody, IdentifiedLeg
from .trials import ActiveSwing, SubjectSession, active_swing

BASELINE_FAMILIES = ("nmco", "nmcoa", "nmnc", "mbp", "ridge", "boost", "motion")
"""Estimators of `ESTIMATOR_FAMILIES` that are fitted and scored on the same swings."""

RECORDED_EMG_BASELINES = ("nmco", "nmcoa", "nmnc", "mbp", "ridge")
"""Baselines that are also fitted to the recorded muscles alone.

They lack the flexors, whose envelope follows from the torque balance.
"""

ERROR_MEASURES = ("rmse", "maxe", "mae")
"""Fields of `Errors`, as rows have them."""


@dataclass(frozen=True)
class Errors:
    """RMSE, largest and mean absolute error of a torque [N m]."""

    rmse: float
    maxe: float
    mae: float


def errors_of(found: np.ndarray, true: np.ndarray, *, truncated: bool = False) -> Errors:
    """Return the errors of a torque; `found`, `true` (n,) [N m]. With `truncated`, negative torque counts as none."""
    if truncated:
        found, true = np.maximum(found, 0.0), np.maximum(true, 0.0)
    off = np.abs(found - true)
    return Errors(float(np.sqrt(np.mean(off**2))), float(off.max()), float(off.mean()))


@dataclass(frozen=True, eq=False)
class TorqueComparison:
    """One subject's torque in the held-out swing."""

    time: np.ndarray  # (n,) [s]
    reference: np.ndarray = field(repr=False)  # (n,) Torque by the balance of leg, exoskeleton and motor [N m]
    active: np.ndarray = field(repr=False)  # (n,) True torque of the muscles less their torque at rest [N m]
    muscles: np.ndarray = field(repr=False)  # (n,) True torque of the muscles [N m]
    eq12: np.ndarray = field(repr=False)  # (n,) Torque by eq. 12 as published [N m]
    predicted: Mapping[str, np.ndarray] = field(repr=False)  # (n,) Predicted torque, by estimator [N m]
    envelopes: Mapping[str, np.ndarray] = field(repr=False)  # (n,) Relative EMG envelopes of the recorded muscles
    hill: HillMap  # Muscle model with the unrecorded flexors
    recorded: HillMap  # Muscle model of the recorded muscles alone

    def errors(self, estimator: str, against: str = "active", *, truncated: bool = False) -> Errors:
        """Return the errors of an estimator against a field of torque."""
        return errors_of(self.predicted[estimator], getattr(self, against), truncated=truncated)


def find_torque(empty: IdentifiedBody, leg: IdentifiedLeg, taken: SubjectSession) -> TorqueComparison:
    """Calibrate on a subject's first swing and predict the second one; every setting is chosen within the first."""
    loaded = leg.body.corrected["rich"]
    fitted, heldout = (active_swing(taken, what, loaded, flexors=True) for what in ("swing_1", "swing_2"))
    alone, alone_heldout = _without_flexors(fitted), _without_flexors(heldout)
    hill, recorded = fit_hill([fitted.trial]), fit_hill([alone.trial])
    predicted = {"hill": hill.predict(heldout.trial), "hill.recorded": recorded.predict(alone_heldout.trial)}
    seen = compute_features(fitted.trial, CORRECTION_FEATURES).x
    learnt = fit_adaptive_correction([(seen, fitted.trial.torque - hill.predict(fitted.trial))])
    predicted["hill.adaptive"] = CorrectedMap("hill", hill, learnt).predict(heldout.trial)
    for name in BASELINE_FAMILIES:
        predicted[name] = _fit_estimator(name, fitted).predict(heldout.trial)
    for name in RECORDED_EMG_BASELINES:
        predicted[f"{name}.recorded"] = _fit_estimator(name, alone).predict(alone_heldout.trial)
    # As published: calibrated on the torque of eq. 12, scored on it.
    of_eq12 = [bare_leg_torque(empty.published, leg.body.published, s.motion).torque for s in (fitted, heldout)]
    as_published = fit_hill([replace(alone.trial, torque=of_eq12[0])])
    predicted["hill.eq12"] = as_published.predict(alone_heldout.trial)
    trial = heldout.trial
    return TorqueComparison(
        trial.time, trial.torque, heldout.active, heldout.muscles, of_eq12[1], predicted,
        dict(alone_heldout.trial.envelopes), hill, recorded,
    )  # fmt: skip


def _without_flexors(swing: ActiveSwing) -> ActiveSwing:
    """Return a swing without the flexors' envelope."""
    kept = {name: e for name, e in swing.trial.envelopes.items() if name != FLEXOR_MUSCLE}
    return replace(swing, trial=replace(swing.trial, envelopes=kept))


def _fit_estimator(name: str, swing: ActiveSwing):
    """Fit an estimator of `ESTIMATOR_FAMILIES` to one swing."""
    whole = ESTIMATOR_FAMILIES[name].fit_trials
    return whole([swing.trial], name, False) if whole else fit_torque_map([swing.trial], name)
