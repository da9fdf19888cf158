"""Results of one estimator in a calibration: scores on held-out recordings, and a stretch of its torque."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...estimators.condition_choice import ConditionTestErrors, choose_estimator, is_candidate, run_condition_tests
from ...estimators.cross_validation import Score, score
from ...estimators.families import ESTIMATOR_FAMILIES
from ...estimators.torque_map import CrossValidated
from ...estimators.torque_trial import TorqueTrial

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


BASELINE_ESTIMATOR = "motion"
"""Estimator that sees angles alone, no EMG. The others are compared with it."""


@dataclass(frozen=True)
class ConditionScore:
    """Score of the recommended estimator on one recording or trial."""

    name: str  # Name of the recording or trial
    estimator: str
    score: Score
    bare: Score | None  # Score of angles alone
    held: float | None  # Share of the reference within the error band


@dataclass(frozen=True)
class RecommendedEstimator:
    """The recommended estimator of one joint or participant."""

    what: str  # Joint or participant
    estimators: tuple[str, ...]  # Name of the estimator, or one name for each outer fold
    judged: tuple[EstimatorEvaluation, ...]  # Its evaluation on each recording, the worst first
    bare: tuple[
        EstimatorEvaluation, ...
    ]  # Evaluations of angles alone, in the same order; empty if these were not fitted

    conditions: int = 1  # Smallest number of conditions left out in turn to choose it; 1: parts of one recording
    fitted_coverage: float | None = None  # Share of left-out fitted trials within the band of the others, the smallest
    by: Mapping[str, str] = field(default_factory=dict)  # Estimator by trial, if trials are left out in turn
    half_width: Mapping[str, float] = field(default_factory=dict)  # Half width of the error band by such trial [N m]
    held: Mapping[str, float] = field(default_factory=dict)  # Share of the reference within the band, by such trial

    def by_condition(self) -> list[ConditionScore]:
        """Return its score on each recording or trial."""
        if not self.by:
            bare = {e.recording: e.score for e in self.bare}
            return [
                ConditionScore(e.recording, e.estimator, e.score, bare.get(e.recording), e.held) for e in self.judged
            ]
        bare = self.bare[0].by_trial if self.bare else {}
        own = self.judged[0].by_trial
        return [ConditionScore(t, name, own[t], bare.get(t), self.held.get(t)) for t, name in self.by.items()]

    @property
    def words(self) -> str:
        """Description of the estimator, or of those chosen in all folds."""
        counts = Counter(self.estimators)
        if len(counts) == 1:
            return ESTIMATOR_FAMILIES[self.estimators[0]].description
        each = (f"{ESTIMATOR_FAMILIES[name].description} for {count}" for name, count in counts.most_common())
        return f"what was chosen without each ({', '.join(each)})"


def run_tests_if_candidate(fit: object, trials: Sequence[TorqueTrial]) -> ConditionTestErrors | None:
    """Return the condition tests of a fitted estimator; None for one that may not be recommended."""
    return run_condition_tests(fit, trials) if is_candidate(fit.name) else None


def recommend_estimator(evaluated: Sequence[EstimatorEvaluation], what: str) -> RecommendedEstimator:
    """Recommend an estimator for a joint with held-out recordings. No held-out recording influences the choice."""
    own = [e for e in evaluated if e.what == what and not e.causal]
    best = choose_estimator({e.estimator: e.examined for e in own if e.examined is not None})
    judged = sorted((e for e in own if e.estimator == best), key=lambda e: -e.score.rmse)
    bare = {e.recording: e for e in own if e.estimator == BASELINE_ESTIMATOR}
    bare = tuple(bare[e.recording] for e in judged if e.recording in bare)
    tests = judged[0].examined
    assert tests is not None  # only an estimator with tests is chosen
    return RecommendedEstimator(
        what, (best,), tuple(judged), bare, tests.conditions, fitted_coverage=tests.left_out_coverage
    )


def recommend_by_fold(
    trials: Sequence[TorqueTrial], results: Mapping[str, CrossValidated], evaluated: Sequence[EstimatorEvaluation]
) -> RecommendedEstimator:
    """Recommend an estimator for each trial that is left out, by the other trials alone.

    `results` and `evaluated` hold cross-validation and evaluation of every estimator.
    """
    groups = list(dict.fromkeys(t.group for t in trials))
    best = [
        choose_estimator({name: r.examined[j] for name, r in results.items() if r.examined[j] is not None})
        for j in range(len(groups))
    ]
    of = dict(zip(groups, best, strict=True))
    made = np.concatenate([results[of[t.group]].predicted[t.name] for t in trials])
    whole = score(np.concatenate([t.torque for t in trials]), made)
    by, alike = {e.estimator: e for e in evaluated}, evaluated[0]
    by_trial = {t.name: by[of[t.group]].by_trial[t.name] for t in trials}
    rmse = whole.rmse if alike.kind == "steps" else float(np.mean([s.rmse for s in by_trial.values()]))
    one = replace(
        alike, estimator=Counter(best).most_common(1)[0][0], score=Score(rmse, whole.r2), by_trial=by_trial,
        choice=", ".join(f"{name} without {group}" for group, name in of.items()),
    )  # fmt: skip
    within = {g: results[name].examined[j] for j, (g, name) in enumerate(of.items())}
    width = {t.name: within[t.group].half_width for t in trials}
    held = {
        t.name: float(np.mean(np.abs(t.torque - results[of[t.group]].predicted[t.name]) <= width[t.name]))
        for t in trials
    }
    return RecommendedEstimator(
        one.what,
        tuple(best),
        (one,),
        tuple(e for e in evaluated if e.estimator == BASELINE_ESTIMATOR),
        min(each.conditions for each in within.values()),
        min((e.left_out_coverage for e in within.values() if e.left_out_coverage is not None), default=None),
        by={t.name: of[t.group] for t in trials},
        half_width=width,
        held=held,
    )
