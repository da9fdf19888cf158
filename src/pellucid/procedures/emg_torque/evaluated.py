"""What calibration reports of an estimator: how it did on what it had not seen, and a stretch of its torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..._errors import IdentificationError
from ...estimators.condition_choice import ConditionTestErrors
from ...estimators.cross_validation import Score
from ...estimators.emg_session import ChannelComparison
from ...estimators.families import ESTIMATOR_FAMILIES
from ...estimators.hill import HillMap
from ...estimators.torque_trial import TorqueTrial
from ...fit.parameter import Verdict

if TYPE_CHECKING:
    from .chosen import Chosen

EVALUATED = tuple(ESTIMATOR_FAMILIES)
"""Estimators that `calibrate` reports, in the order of its tables."""

CAUSAL = ("boost", "ridge", "hill")
"""Those it also reports with features from the past alone."""


@dataclass(frozen=True)
class Evaluated:
    """One estimator on one recording (or on all of a person's), with what it was chosen to see."""

    what: str  # Joint, or participant
    estimator: str  # In `ESTIMATOR_FAMILIES`; the past alone where `causal`
    causal: bool
    recording: str  # Judged on; ``""`` for all trials, each left out in turn
    score: Score
    within: Score | None  # Of cross-validation within what was fitted
    choice: str  # Features and settings, in words
    examined: ConditionTestErrors | None = None  # Away from what it is fitted to; None for what is not named first
    by_trial: Mapping[str, Score] = field(default_factory=dict, repr=False)  # Where trials are left out in turn
    # What the figures are called: ``"recording"``, ``"steps"`` (torque against an orthosis), ``"trials"`` (means over
    # trials left out), ``"normalised"`` (a torque relative to the leg's own weight)
    kind: str = "recording"
    seconds: float | None = None  # One calibration took, all starts included, where that is a figure of its own
    coverage: float | None = None  # Share of held-out samples within the 95 % interval about what is predicted
    # Share within the band of `condition_choice.LEVEL`, as wide as errors were away from what was fitted
    held: float | None = None
    # RMSE where the reference pulls along its main direction, and of both torques cut off at 0 [N m]; or empty
    partial: tuple[float, ...] = ()
    # The same with envelopes of channels that changed replaced by what the others tell; None where none did
    without_changed: Score | None = None
    torque_unit: str = "N*m"  # Of the reference; "MVC": shares of a maximal contraction's

    @property
    def unit(self) -> str:
        """Of the RMSE."""
        return "of the leg's weight" if self.kind == "normalised" else self.torque_unit


@dataclass(frozen=True, eq=False)
class TorqueTrace:
    """A stretch of held-out torque, the reference and what maps made of it."""

    what: str
    recording: str
    time: np.ndarray  # time, reference: (n,) [s] and [N m]
    reference: np.ndarray
    predicted: Mapping[str, np.ndarray]  # (n,) By estimator [N m]
    # (n,) Half the band about what is predicted, of estimators that have one [N m]
    half_width: Mapping[str, np.ndarray] = field(default_factory=dict)
    level: float = 0.95  # What the bands are meant for


@dataclass(frozen=True, eq=False)
class Calibrated:
    """All that one way of judging found."""

    evaluated: list[Evaluated] = field(default_factory=list)
    traces: list[TorqueTrace] = field(default_factory=list)
    trials: list[TorqueTrial] = field(default_factory=list)  # That took part
    # Of each joint, as judged: what muscles of all joints together are calibrated on; empty where there is one joint
    across: dict[str, list[TorqueTrial]] = field(default_factory=dict)
    cards: dict = field(default_factory=dict)
    causal: dict = field(default_factory=dict)  # Maps of the past alone that can be stepped, by joint and estimator
    # Muscles fitted to all that may be fitted, by joint or participant
    muscles: dict[str, HillMap] = field(default_factory=dict)
    shown: dict[str, TorqueTrial] = field(default_factory=dict)  # A trial to show them with
    passed_over: dict[str, str] = field(default_factory=dict)  # Why muscles were not fitted, by joint or participant
    verdicts: list[Verdict] = field(default_factory=list)  # On this way of judging
    chosen: dict[str, Chosen] = field(default_factory=dict)  # What is named first, where trials are left out in turn
    sessions: dict[str, ChannelComparison] = field(
        default_factory=dict
    )  # Channels against those fitted, by recording judged


def estimators_for(
    trials: Sequence[TorqueTrial], what: str, found: Calibrated, names: Sequence[str] = EVALUATED
) -> list[str]:
    """Estimators that these trials can be given to; those with muscles need geometry and relative envelopes."""
    from ...estimators.muscle_trials import find_driven_muscles

    try:
        find_driven_muscles(trials)
    except IdentificationError as error:
        found.passed_over[what] = str(error)
        return [name for name in names if ESTIMATOR_FAMILIES[name].fit_trials is None]
    return list(names)
