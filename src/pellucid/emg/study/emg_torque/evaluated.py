"""Results of one estimator in a calibration: scores on held-out recordings, and a stretch of its torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...estimators.condition_choice import ConditionTestErrors
from ...estimators.cross_validation import Score
from ...estimators.families import ESTIMATOR_FAMILIES

REPORTED_ESTIMATORS = tuple(ESTIMATOR_FAMILIES)
"""Estimators that `calibrate` reports, in the order of its tables."""

CAUSAL_ESTIMATORS = tuple(name for name, family in ESTIMATOR_FAMILIES.items() if family.scored_causally)
"""Estimators that `calibrate` also reports with causal features."""


@dataclass(frozen=True)
class EstimatorEvaluation:
    """Evaluation of one estimator on one recording, or on all trials of a joint or person."""

    what: str  # Joint or participant
    estimator: str  # Name in `ESTIMATOR_FAMILIES`
    causal: bool  # Whether its features use the past alone
    recording: str  # Test recording; ``""`` for all trials, each left out in turn
    score: Score
    within: Score | None  # Score of cross-validation within the fitted trials
    choice: str  # Chosen features and settings, in words
    examined: ConditionTestErrors | None = None  # Condition tests; None for an estimator that may not be recommended
    by_trial: Mapping[str, Score] = field(default_factory=dict, repr=False)  # Score of each trial left out in turn
    # Kind of evaluation, which sets the row's id: ``"recording"``, ``"steps"`` (torque against an orthosis),
    # ``"trials"`` (means over trials left out), ``"normalised"`` (a torque relative to the leg's own weight)
    kind: str = "recording"
    seconds: float | None = None  # Duration of one calibration with all starts [s], if it is reported
    coverage: float | None = None  # Share of held-out samples within the 95 % interval about the prediction
    held: float | None = None  # Share of held-out samples within the error band of `ConditionTestErrors`
    # RMSE where the reference pulls along its main direction, and RMSE of both torques cut off at 0 [N m]; or empty
    partial: tuple[float, ...] = ()
    # Score with the envelopes of changed channels predicted from the other channels; None if no channel changed
    without_changed: Score | None = None
    as_recorded: Score | None = None  # Score without any repair, if channels changed and repairs were asked for
    repaired: tuple[str, ...] = ()  # Muscles whose channels were repaired for this estimator
    torque_unit: str = "N*m"  # Unit of the reference; "MVC": shares of a maximal contraction's torque

    @property
    def unit(self) -> str:
        """Unit of the RMSE."""
        return "of the leg's weight" if self.kind == "normalised" else self.torque_unit


@dataclass(frozen=True, eq=False)
class TorqueTrace:
    """A stretch of held-out torque: the reference and the predictions."""

    what: str  # Joint or participant
    recording: str
    time: np.ndarray  # Time, shape (n,) [s]
    reference: np.ndarray  # Reference torque, shape (n,) [N m]
    predicted: Mapping[str, np.ndarray]  # Predicted torque by estimator, shape (n,) [N m]
    # Half the band about the prediction, of estimators that have one, shape (n,) [N m]
    half_width: Mapping[str, np.ndarray] = field(default_factory=dict)
    level: float = 0.95  # Nominal share of samples within the bands
