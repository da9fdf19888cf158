"""Findings of a calibration while it runs: evaluations, traces, trials, cards and verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ...._errors import IdentificationError
from ....models.parameter import Verdict
from ...estimators.emg_session import ChannelComparison
from ...estimators.families import ESTIMATOR_FAMILIES
from ...estimators.hill import HillMap
from ...estimators.torque_trial import TorqueTrial
from .chosen import RecommendedEstimator
from .evaluated import REPORTED_ESTIMATORS, EstimatorEvaluation, TorqueTrace


@dataclass(frozen=True, eq=False)
class CalibrationFindings:
    """All findings of one evaluation of a study, collected while it runs."""

    evaluated: list[EstimatorEvaluation] = field(default_factory=list)  # Evaluations of every estimator
    traces: list[TorqueTrace] = field(default_factory=list)  # Stretches of held-out torque
    trials: list[TorqueTrial] = field(default_factory=list)  # Trials that were fitted or scored
    # Trials by joint, as scored, on which muscles of all joints are calibrated together; empty if there is one joint
    across: dict[str, list[TorqueTrial]] = field(default_factory=dict)
    cards: dict = field(default_factory=dict)  # Cards by name
    causal: dict = field(default_factory=dict)  # Causal maps that can run live, by joint and estimator
    muscles: dict[str, HillMap] = field(default_factory=dict)  # Muscles fitted to all fitted trials, by joint or person
    shown: dict[str, TorqueTrial] = field(default_factory=dict)  # Trial with which these muscles are drawn
    stiffness_trials: dict[str, TorqueTrial] = field(default_factory=dict)  # Fitted trial of each stiffness
    passed_over: dict[str, str] = field(default_factory=dict)  # Reason why muscles were not fitted, by joint or person
    verdicts: list[Verdict] = field(default_factory=list)  # Verdicts on this evaluation
    chosen: dict[str, RecommendedEstimator] = field(
        default_factory=dict
    )  # Recommended estimator, if trials are left out in turn
    # Comparison of channels with the fitted ones, by test recording
    sessions: dict[str, ChannelComparison] = field(default_factory=dict)

    @property
    def refused(self) -> set[str]:
        """Test recordings on which no estimate holds, by EMG and angles alone. No band is stated there."""
        return {name for name, compared in self.sessions.items() if not compared.is_valid}


def find_applicable_estimators(
    trials: Sequence[TorqueTrial], what: str, found: CalibrationFindings, names: Sequence[str] = REPORTED_ESTIMATORS
) -> list[str]:
    """Return the estimators that can be fitted to these trials.

    Muscles need a geometry and relative envelopes. The reason is noted if they cannot be fitted.
    """
    from ...estimators.muscle_trials import find_driven_muscles

    try:
        find_driven_muscles(trials)
    except IdentificationError as error:
        found.passed_over[what] = str(error)
        return [name for name in names if ESTIMATOR_FAMILIES[name].fit_trials is None]
    return list(names)
