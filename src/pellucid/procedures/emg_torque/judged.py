"""What calibration reports of an estimator: how it did on what it had not seen, and a stretch of its torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError
from ...estimators.cross_validation import Score
from ...estimators.families import ESTIMATORS
from ...estimators.hill import HillMap
from ...estimators.torque_trial import TorqueTrial
from ...fit.parameter import Verdict

JUDGED = tuple(ESTIMATORS)
"""Estimators that `calibrate` reports, in the order of its tables."""

CAUSAL = ("boost", "ridge", "hill")
"""Those it also reports with features from the past alone."""


@dataclass(frozen=True)
class Judged:
    """One estimator on one recording (or on all of a person's), with what it was chosen to see.

    Attributes
    ----------
    what : str
        Joint, or participant.
    estimator : str
        In `ESTIMATORS`; the past alone where `causal`.
    causal : bool
    recording : str
        Judged on; ``""`` for all trials, each left out in turn.
    score : Score
    within : Score or None
        Of cross-validation within what was fitted.
    choice : str
        Features and settings, in words.
    kind : str
        What the figures are called: ``"recording"``, ``"steps"`` (torque against an orthosis), ``"trials"`` (means over
        trials left out), ``"normalised"`` (a torque relative to the leg's own weight).
    seconds : float or None
        One calibration took, all starts included, where that is a figure of its own.
    coverage : float or None
        Share of held-out samples within the 95 % interval about what is predicted.
    partial : tuple of float
        RMSE where the reference pulls along its main direction, and of both torques cut off at 0 [N m]; or empty.
    """

    what: str
    estimator: str
    causal: bool
    recording: str
    score: Score
    within: Score | None
    choice: str
    kind: str = "recording"
    seconds: float | None = None
    coverage: float | None = None
    partial: tuple[float, ...] = ()

    @property
    def unit(self) -> str:
        """Of the RMSE."""
        return "of the leg's weight" if self.kind == "normalised" else "N*m"


@dataclass(frozen=True, eq=False)
class TorqueTrace:
    """A stretch of held-out torque, the reference and what maps made of it.

    Attributes
    ----------
    what, recording : str
    time, reference : ndarray, shape (n,)
        [s] and [N m].
    predicted : Mapping[str, ndarray of shape (n,)]
        By estimator [N m].
    half_width : Mapping[str, ndarray of shape (n,)]
        Half the 95 % interval about what is predicted, of estimators that have one [N m].
    """

    what: str
    recording: str
    time: np.ndarray
    reference: np.ndarray
    predicted: Mapping[str, np.ndarray]
    half_width: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Calibrated:
    """All that one way of judging found.

    Attributes
    ----------
    judged : list of Judged
    traces : list of TorqueTrace
    trials : list of TorqueTrial
        That took part.
    cards : dict of str to ParameterCard
    muscles : dict of str to HillMap
        Muscles fitted to all that may be fitted, by joint or participant.
    shown : dict of str to TorqueTrial
        A trial to show them with.
    passed_over : dict of str to str
        Why muscles were not fitted, by joint or participant.
    verdicts : list of Verdict
        On this way of judging.
    """

    judged: list[Judged] = field(default_factory=list)
    traces: list[TorqueTrace] = field(default_factory=list)
    trials: list[TorqueTrial] = field(default_factory=list)
    cards: dict = field(default_factory=dict)
    muscles: dict[str, HillMap] = field(default_factory=dict)
    shown: dict[str, TorqueTrial] = field(default_factory=dict)
    passed_over: dict[str, str] = field(default_factory=dict)
    verdicts: list[Verdict] = field(default_factory=list)


def estimators_for(
    trials: Sequence[TorqueTrial], what: str, found: Calibrated, names: Sequence[str] = JUDGED
) -> list[str]:
    """Estimators that these trials can be given to; those with muscles need geometry and relative envelopes.

    Parameters
    ----------
    trials : sequence of TorqueTrial
    what : str
        Joint or participant.
    found : Calibrated
        Is told why muscles were passed over.
    names : sequence of str

    Returns
    -------
    list of str
    """
    from ...estimators.muscle_trials import driven_muscles

    try:
        driven_muscles(trials)
    except IdentificationError as error:
        found.passed_over[what] = str(error)
        return [name for name in names if ESTIMATORS[name].whole is None]
    return list(names)
