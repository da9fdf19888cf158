"""Findings of a calibration while it runs: evaluations, traces, trials, cards and verdicts.

Results of one estimator in a calibration: scores on held-out recordings, and a stretch of its torque.

Recommend an estimator by the fitted recordings alone, and report its errors on every test recording.

Findings on calibrated muscles: parameters with intervals, cards, verdicts, and errors in parts of a torque.

Findings on joint stiffness: tables by posture with intervals, rows, cards, and verdicts on its limits.

Say for each joint and recording whether EMG is worth it over joint angles alone.

Result rows of a calibration by their ids.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from ...._errors import IdentificationError, RecordingError, listed_names
from ....models.card import CardParameter
from ....models.estimates import Parameter, Verdict
from ....models.parameter_card import ParameterCard
from ....study.procedures.result import FigureTable, ParameterTable
from ....study.results import ResultRow
from ....study.study import Study
from ...estimators.condition_choice import (
    ConditionTestErrors,
    Recommendation,
    combine_tests,
    find_extrapolator,
    predict_without_each_test,
    recommend,
)
from ...estimators.cross_validation import Score, covered_share, score
from ...estimators.emg_session import ChannelComparison
from ...estimators.emg_worth import WORTH_BLOCKS, EmgWorth, worth_on_recording, worth_over_trials
from ...estimators.families import ESTIMATOR_FAMILIES, STACKED, named_family
from ...estimators.families.family import Family
from ...estimators.hill import HillMap
from ...estimators.joint_stiffness import STIFFNESS_KINDS, JointStiffness, joint_stiffness
from ...estimators.torque_map import CrossValidated, TorqueMap
from ...estimators.torque_trial import TorqueTrial
from ...fit.muscle_calibration import DELAY_BOUNDS, MuscleFit
from ...fit.muscle_posterior import covariance, muscle_parameters, muscle_verdicts, reported_covariance
from ...models.emg_estimator import EmgEstimatorCard
from ...models.muscle import CARD_KIND, CalibratedMuscles
from .live_scores import LiveScore

REPORTED_ESTIMATORS = tuple(ESTIMATOR_FAMILIES)
"""Estimators that `calibrate` reports, in the order of its tables."""

CAUSAL_ESTIMATORS = tuple(name for name, family in ESTIMATOR_FAMILIES.items() if family.scored_causally)
"""Estimators that `calibrate` also reports with causal features."""


STEP_KIND = "steps"
"""Kind of an evaluation of torque against an orthosis, whose errors are pooled over trials; others are means."""

TRIALS_KIND = "trials"
"""Kind of an evaluation by cross-validation over recordings."""

FORMULA_KIND = "normalised"
"""Kind of an evaluation whose reference is a formula in the angle, relative to the leg's weight, and no torque."""


def recording_words(name: str) -> str:
    """Return the words that name a recording, in quotes: a name such as rest is not to be read as a state."""
    return f'recording "{name.replace("_", " ")}"'


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
    # Kind of evaluation, which sets the row's id: ``"recording"``, `TRIALS_KIND` (means over trials left out),
    # `STEP_KIND` or `FORMULA_KIND`
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
    def family(self) -> Family:
        """Family of the estimator."""
        return named_family(self.estimator)

    @property
    def words(self) -> str:
        """The estimator in words."""
        return self.family.description + (", causal" if self.causal else "")

    @property
    def unit(self) -> str:
        """Unit of the RMSE."""
        return "of the leg's weight" if self.kind == FORMULA_KIND else self.torque_unit

    @property
    def row_unit(self) -> str:
        """Unit of the RMSE in a result row."""
        return "1" if self.kind == FORMULA_KIND else self.torque_unit


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


MIN_NAMED_WEIGHT = 0.05
"""Smallest weight in a weighted mean that its words state."""

MAX_BRIEF_MEMBERS = 2
"""Largest number of members of a weighted mean that a sentence without room for all of them names."""

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
    # Evaluations of the best estimator of angles alone, in the same order; empty if none was fitted
    bare: tuple[EstimatorEvaluation, ...]
    # Weights of the estimators with and without EMG in the recommended ones; None if trials are left out in turn
    weights: Recommendation | None = None
    bare_weights: Recommendation | None = None

    conditions: int = 1  # Smallest number of conditions left out in turn to choose it; 1: parts of one recording
    fitted_coverage: float | None = None  # Share of left-out fitted trials within the band of the others, the smallest
    by: Mapping[str, str] = field(default_factory=dict)  # Estimator by trial, if trials are left out in turn
    half_width: Mapping[str, float] = field(default_factory=dict)  # Half width of the error band by such trial [N m]
    held: Mapping[str, float] = field(default_factory=dict)  # Share of the reference within the band, by such trial
    # The recommended torque by such trial, shape (n,) [N m]
    predicted: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)

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
    def brief(self) -> str:
        """Description of the estimator in a sentence that has no room for all weights."""
        return self._describe(with_weights=False)

    @property
    def words(self) -> str:
        """Description of the estimator, or of those chosen in all folds."""
        return self._describe(with_weights=True)

    def _describe(self, *, with_weights: bool) -> str:
        counts = Counter(self.estimators)
        if not self.by and len(counts) > 1:
            beyond = next(name for name in self.estimators if name != self.weights.name)
            where = f"on recordings unlike the fitted ones by {named_family(beyond).description}"
            return f"{self._weighted_words(self.weights.name, with_weights)}, {where}"
        if len(counts) == 1:
            return self._weighted_words(self.estimators[0], with_weights)
        each = (f"{named_family(name).description} for {count}" for name, count in counts.most_common())
        return f"the estimator chosen in each fold ({', '.join(each)})"

    def _weighted_words(self, name: str, with_weights: bool) -> str:
        """Return the description of an estimator, with the weights of a weighted mean where these are one set."""
        words = named_family(name).description
        if name != STACKED:
            return words
        if self.weights is None:
            return f"a {words} (weights chosen in each fold)"
        parts = [
            f"{named_family(member).short or named_family(member).description} {100.0 * weight:.0f} %"
            for member, weight in self.weights.weights.items()
            if weight >= MIN_NAMED_WEIGHT
        ]
        return f"a {words} ({', '.join(parts) if with_weights else listed_names(parts, MAX_BRIEF_MEMBERS)})"


def recommend_estimator(
    evaluated: Sequence[EstimatorEvaluation],
    what: str,
    traces: Sequence[TorqueTrace] = (),
    refused: Collection[str] = (),
) -> RecommendedEstimator:
    """Recommend an estimator for a joint with held-out recordings. No held-out torque influences the choice.

    `traces` hold the predictions on every test recording, to which those of a weighted mean are added. On `refused`
    recordings, which are unlike all fitted ones by angles and EMG, the estimator that extrapolates best is recommended.
    """
    own = [e for e in evaluated if e.what == what and not e.causal]
    tests = {e.estimator: e.examined for e in own if e.examined is not None}
    chosen = recommend(tests)
    without = {name: each for name, each in tests.items() if not ESTIMATOR_FAMILIES[name].muscles}
    bare_chosen = recommend(without) if without else None
    within = combine_tests(tests, chosen)
    bare_within = combine_tests(without, bare_chosen) if bare_chosen is not None else None
    beyond = find_extrapolator(tests) or chosen.name
    of = {(e.estimator, e.recording): e for e in own}
    made = {trace.recording: trace for trace in traces if trace.what == what}
    judged, bare = [], {e.recording: e for e in own if e.estimator == BASELINE_ESTIMATOR}
    for recording in dict.fromkeys(e.recording for e in own):
        name = beyond if recording in refused else chosen.name
        one, trace = of.get((name, recording)), made.get(recording)
        if name == STACKED:
            one = _evaluate_mean(chosen, of, trace, within.half_width)
            trace.predicted[STACKED] = chosen.predict(trace.predicted)
        if one is None:
            continue
        if trace is not None and recording not in refused:
            # The band of what was chosen also carries the choice, which the estimator's own tests do not.
            trace.half_width[name] = np.full(len(trace.time), within.half_width)
            one = replace(one, held=covered_share(trace.reference, trace.predicted[name], within.half_width))
        judged.append(one)
        if bare_chosen is not None and bare_chosen.name != STACKED:
            bare[recording] = of[bare_chosen.name, recording]
        elif bare_chosen is not None:
            bare[recording] = _evaluate_mean(bare_chosen, of, trace, bare_within.half_width)
    judged.sort(key=lambda e: -e.score.rmse)
    return RecommendedEstimator(
        what,
        tuple(dict.fromkeys(e.estimator for e in judged)),
        tuple(judged),
        tuple(bare[e.recording] for e in judged if e.recording in bare),
        chosen,
        bare_chosen,
        within.conditions,
        within.left_out_coverage,
    )


def _evaluate_mean(
    chosen: Recommendation,
    of: Mapping[tuple[str, str], EstimatorEvaluation],
    trace: TorqueTrace,
    half_width: float,
) -> EstimatorEvaluation:
    """Return the evaluation of a weighted mean on a recording, with the half width of its error band [N m]."""
    made = chosen.predict(trace.predicted)
    alike = of[next(iter(chosen.weights)), trace.recording]
    words = ", ".join(f"{weight:.2f} {name}" for name, weight in chosen.weights.items())
    return replace(
        alike, estimator=STACKED, score=score(trace.reference, made), choice=words, examined=None, within=None,
        seconds=None, coverage=None, partial=(), without_changed=None, as_recorded=None,
        held=covered_share(trace.reference, made, half_width),
    )  # fmt: skip


def evaluate_on_recording(
    what: str,
    estimator: str,
    causal: bool,
    recording: str,
    reference: np.ndarray,
    predicted: np.ndarray,
    fit: TorqueMap,
    examined: ConditionTestErrors | None,
    half_width: np.ndarray | None,
    **others: Any,
) -> EstimatorEvaluation:
    """Return the evaluation of a fitted estimator on a held-out recording, all arrays of shape (n,) [N m].

    `half_width` is that of the 95 % interval about the prediction; None if the estimator has none. `others` are further
    fields of the evaluation.
    """
    muscles = isinstance(fit, HillMap)
    return EstimatorEvaluation(
        what, estimator, causal, recording, score(reference, predicted), fit.choice.score, fit.choice.words,
        examined=examined,
        seconds=fit.fit.seconds if muscles else None,
        coverage=None if half_width is None else covered_share(reference, predicted, half_width),
        held=None if examined is None else covered_share(reference, predicted, examined.half_width),
        partial=partial_errors(reference, predicted) if muscles else (),
        **others,
    )  # fmt: skip


def recommend_by_fold(
    trials: Sequence[TorqueTrial], results: Mapping[str, CrossValidated], evaluated: Sequence[EstimatorEvaluation]
) -> RecommendedEstimator:
    """Recommend an estimator for each held-out trial, based on the other trials alone.

    `results` and `evaluated` hold cross-validation and evaluation of every estimator.
    """
    groups = list(dict.fromkeys(t.group for t in trials))
    by = {e.estimator: e for e in evaluated}
    found = _predict_by_fold(groups, trials, results)
    bare = _predict_by_fold(
        groups, trials, {name: r for name, r in results.items() if not ESTIMATOR_FAMILIES[name].muscles}
    )
    one, of, within, made = _evaluate_folds(groups, trials, found, by, results)
    width = {t.name: within[t.group].half_width for t in trials}
    held = {t.name: covered_share(t.torque, made[t.name], width[t.name]) for t in trials}
    return RecommendedEstimator(
        one.what,
        tuple(of.values()),
        (one,),
        (_evaluate_folds(groups, trials, bare, by, results)[0],) if bare else (),
        conditions=min(each.conditions for each in within.values()),
        fitted_coverage=min(
            (e.left_out_coverage for e in within.values() if e.left_out_coverage is not None), default=None
        ),
        by={t.name: of[t.group] for t in trials},
        half_width=width,
        held=held,
        predicted=made,
    )


def mean_score(scores: Iterable[Score]) -> Score:
    """Return the mean RMSE and the mean R² of trials, which have equal weight, however long they are."""
    every = tuple(scores)
    return Score(float(np.mean([s.rmse for s in every])), float(np.mean([s.r2 for s in every])))


def _predict_by_fold(
    groups: Sequence[str], trials: Sequence[TorqueTrial], results: Mapping[str, CrossValidated]
) -> dict[str, Recommendation]:
    """Return the recommendation without each group of trials; empty if no estimator may be recommended."""
    tests = [_tests_of_fold(results, j) for j in range(len(groups))]
    return {group: recommend(each) for group, each in zip(groups, tests, strict=True)} if all(tests) else {}


def _tests_of_fold(results: Mapping[str, CrossValidated], fold: int) -> dict[str, ConditionTestErrors]:
    """Return the condition tests of every estimator that has some without the trials of a fold."""
    return {name: r.examined[fold] for name, r in results.items() if r.examined and r.examined[fold] is not None}


def _evaluate_folds(
    groups: Sequence[str],
    trials: Sequence[TorqueTrial],
    found: Mapping[str, Recommendation],
    by: Mapping[str, EstimatorEvaluation],
    results: Mapping[str, CrossValidated],
) -> tuple[EstimatorEvaluation, dict[str, str], dict[str, ConditionTestErrors], dict[str, np.ndarray]]:
    """Return the evaluation of what was recommended without each group, and its name, tests and torque by group."""
    alike = next(iter(by.values()))
    of = {group: each.name for group, each in found.items()}
    made, by_trial = {}, {}
    for t in trials:
        chosen = found[t.group]
        made[t.name] = chosen.predict({name: results[name].predicted[t.name] for name in chosen.weights})
        if chosen.name != STACKED:
            by_trial[t.name] = by[chosen.name].by_trial[t.name]
            continue
        # The reported error of a single estimator tells the unit, which may be the weight of a leg.
        name = next(iter(chosen.weights))
        alone, reported = score(t.torque, results[name].predicted[t.name]).rmse, by[name].by_trial[t.name].rmse
        own = score(t.torque, made[t.name])
        by_trial[t.name] = Score(own.rmse * (reported / alone if alone > 0.0 else 1.0), own.r2)
    whole = score(np.concatenate([t.torque for t in trials]), np.concatenate([made[t.name] for t in trials]))
    total = whole if alike.kind == STEP_KIND else mean_score(by_trial.values())
    tests = {group: combine_tests(_tests_of_fold(results, j), found[group]) for j, group in enumerate(groups)}
    one = replace(
        alike, estimator=Counter(of.values()).most_common(1)[0][0], score=total, by_trial=by_trial,
        choice=", ".join(f"{name} without {group}" for group, name in of.items()), examined=None,
    )  # fmt: skip
    return one, of, tests, made


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
    live: dict[str, tuple[LiveScore, ...]] = field(default_factory=dict)  # Scores of the estimators that have a card
    without_card: dict[str, str] = field(default_factory=dict)  # Why causal maps have no card, by the card's name
    muscles: dict[str, HillMap] = field(default_factory=dict)  # Muscles fitted to all fitted trials, by joint or person
    shown: dict[str, TorqueTrial] = field(default_factory=dict)  # Trial with which these muscles are drawn
    stiffness_trials: dict[str, TorqueTrial] = field(default_factory=dict)  # Fitted trial of each stiffness
    passed_over: dict[str, str] = field(default_factory=dict)  # Reason why muscles were not fitted, by joint or person
    verdicts: list[Verdict] = field(default_factory=list)  # Verdicts on this evaluation
    # Recommended estimator, if trials are left out in turn
    chosen: dict[str, RecommendedEstimator] = field(default_factory=dict)
    # Comparison of channels with the fitted ones, by test recording
    sessions: dict[str, ChannelComparison] = field(default_factory=dict)

    @property
    def refused(self) -> set[str]:
        """Test recordings on which no estimate holds, by EMG and angles alone. No band is stated there."""
        return {name for name, compared in self.sessions.items() if not compared.is_valid}


def find_applicable_estimators(
    trials: Sequence[TorqueTrial],
    what: str,
    found: CalibrationFindings,
    names: Sequence[str] = REPORTED_ESTIMATORS,
    *,
    is_one_of_several: bool = False,
) -> list[str]:
    """Return the estimators that can be fitted to these trials.

    Muscles need a geometry and relative envelopes. The reason is noted if they cannot be fitted. A recording that is
    unfit for muscles is refused, unless `is_one_of_several` people: the others are calibrated all the same.
    """
    from ...estimators.muscle_trials import find_driven_muscles

    try:
        find_driven_muscles(trials)
    except (IdentificationError, RecordingError) as error:
        if isinstance(error, RecordingError) and not is_one_of_several:
            raise
        found.passed_over[what] = str(error)
        return [name for name in names if ESTIMATOR_FAMILIES[name].fit_trials is None]
    return list(names)


DRAWN_MUSCLES_S = 3.0
"""Duration of the stretch of a trial in figures of muscles [s]."""

CLOCK_FINDING = "clock"
"""Name of the finding that EMG runs ahead of the torque by more than a person's delay."""

DELAY_TOLERANCE_S = 5e-3
"""An electromechanical delay counts as longer than a person's only if it exceeds the longest by more than this [s]."""


@dataclass(frozen=True)
class MuscleSummary:
    """Calibrated muscles of a joint or person, with the data for their figures."""

    what: str  # Joint or participant
    parameters: tuple[str, ...]  # Names of the parameters
    deviation: tuple[float, ...]  # Departure of each parameter from anatomy, in standard deviations among people
    half_width: tuple[float, ...]  # Half of each parameter's 95 % interval, in standard deviations among people
    at_bound: tuple[bool, ...]  # Whether each parameter ended on a bound
    muscles: tuple[str, ...]  # Names of the muscles
    recording: str  # Recording of the drawn stretch
    time: tuple[float, ...]  # Time in the stretch [s]
    activation: tuple[tuple[float, ...], ...]  # Activation in the stretch, a row per muscle [1]
    torque: tuple[tuple[float, ...], ...]  # Torque of each muscle on the joint, a row per muscle [N m]


def partial_errors(reference: np.ndarray, predicted: np.ndarray) -> tuple[float, float]:
    """Return RMSE where the reference pulls along its main direction, and RMSE of both torques cut off at 0 [N m].

    In half of a movement both cut torques are 0 and have no error. The second is therefore up to sqrt(2) times smaller
    than the first. `reference` and `predicted` have shape (n,) [N m].
    """
    main = 1.0 if reference.max() >= -reference.min() else -1.0
    a, b = main * reference, main * predicted
    positive = float(np.sqrt(np.mean((a - b)[a > 0.0] ** 2)))
    return positive, float(np.sqrt(np.mean((np.maximum(a, 0.0) - np.maximum(b, 0.0)) ** 2)))


def muscle_tables(muscles: Mapping[str, HillMap]) -> tuple[ParameterTable, ...]:
    """Return a table of the muscles' parameters for each joint or person."""
    return tuple(
        ParameterTable(f"Muscles: {what}", muscle_parameters(found.fit), max_brief_rows=0)
        for what, found in muscles.items()
    )


def muscle_card(
    study: Study,
    name: str,
    content: CalibratedMuscles,
    fit: MuscleFit,
    parameters: Sequence[Parameter],
    settings: Mapping[str, float],
    words: str,
    trials: Sequence[TorqueTrial],
) -> ParameterCard:
    """Return the card of calibrated muscles, with their covariance in the parameters' units.

    `settings` are added to those of the muscles; `words` describe how they were chosen.
    """
    return ParameterCard(
        kind=CARD_KIND,
        study=study.name,
        name=name,
        parameters=tuple(p.on_card(0.95) for p in parameters),
        covariance=tuple(map(tuple, reported_covariance(fit).tolist())),
        settings={**content.settings(), **settings},
        processing="factors of the anatomical model's strength, tendon slack length and optimal fibre length; " + words,
        checksums={trial.name: trial.checksum for trial in trials if not trial.heldout},
        pellucid=version("pellucid"),
    )


def muscle_cards(
    study: Study, muscles: Mapping[str, HillMap], trials: Sequence[TorqueTrial]
) -> dict[str, ParameterCard]:
    """Return cards of the calibrated muscles of each joint or person."""
    cards = {}
    for what, found in muscles.items():
        name, fit, choice = f"muscles_{what}", found.fit, found.choice
        content = CalibratedMuscles(fit.muscles, found.driven, {found.joint: fit.passive}, found.effort)
        delays = zip(found.muscles, activation_delays(found), strict=True)
        settings = {"weight": choice.weight, "residual_sd": found.residual_sd,
                    **{f"delay.{m}": float(late) for m, late in delays}}  # fmt: skip
        parameters = muscle_parameters(fit)
        cards[name] = muscle_card(study, name, content, fit, parameters, settings, choice.words, trials)
    return cards


def summarise_muscles(
    what: str, fit: MuscleFit, muscles: Sequence[str], recording: str, *drawn: tuple
) -> MuscleSummary:
    """Return calibrated muscles with their departures from anatomy.

    `drawn` are time, activations and torques of the drawn stretch.
    """
    half = 1.96 * np.sqrt(np.diag(covariance(fit)))
    numbers = (tuple(map(kind, x)) for kind, x in ((float, fit.z), (float, half), (bool, fit.at_bound)))
    return MuscleSummary(what, fit.problem.names, *numbers, tuple(muscles), recording, *drawn)


def muscle_summaries(found: CalibrationFindings) -> tuple[MuscleSummary, ...]:
    """Return the data for figures of calibrated muscles."""
    made = []
    for what, fitted in found.muscles.items():
        trial, problem = found.shown[what], fitted.fit.problem
        samples, own = fitted.samples(trial)
        states = problem.model.states(samples.data, problem.values(fitted.fit.z)[: len(problem.priors)])
        shown = slice(own.start, min(own.stop, own.start + round(DRAWN_MUSCLES_S * trial.fs)))
        pull = samples.data.moment_arm * states["force"]
        drawn = (
            tuple(np.round(trial.time[: shown.stop - shown.start], 4).tolist()),
            tuple(map(tuple, np.round(states["activation"][:, shown], 4).tolist())),
            tuple(map(tuple, np.round(pull[:, shown], 3).tolist())),
        )
        made.append(summarise_muscles(what, fitted.fit, fitted.muscles, trial.name, *drawn))
    return tuple(made)


def activation_delays(found: HillMap) -> np.ndarray:
    """Return the time by which each muscle's activation follows a slow envelope, with all lags, shape (m,) [s]."""
    estimator, _ = found.stream(found.fit.problem.samples.data.period)
    return np.asarray(estimator.delays)


def electromechanical_delay_verdict(what: str, delays: np.ndarray) -> Verdict:
    """Return what the electromechanical delays of a calibration mean.

    A person's lie between 10 and 100 ms. A longer one is not the person's: the EMG's stream runs ahead of the torque.
    `delays` has shape (m,) [s]: from each envelope to its activation, with all lags.
    """
    found = (
        f"{what}, muscles: the electromechanical delay, from envelope to activation with all lags, is "
        f"{1e3 * delays.min():.0f} to {1e3 * delays.max():.0f} ms"
    )
    if delays.max() <= DELAY_BOUNDS.max_total_s + DELAY_TOLERANCE_S:
        return Verdict("note", f"{found}; causal filters delay the angular velocities by another 19 ms.")
    return Verdict(
        "warning",
        f"{found}, more than the physiological {1e3 * DELAY_BOUNDS.min_total_s:.0f} to "
        f"{1e3 * DELAY_BOUNDS.max_total_s:.0f} ms. The EMG stream is probably ahead of the torque, and the estimated "
        "delay includes this time offset.",
        "Check whether the torque was filtered causally and whether the streams share a clock. With several joints in "
        "[emg_torque], the offset is estimated separately from the electromechanical delay.",
        finding=CLOCK_FINDING,
    )


def calibrated_muscle_verdicts(found: CalibrationFindings) -> Iterator[Verdict]:
    """Yield verdicts on calibrated muscles: their delays, the coverage of intervals, and why some were not fitted."""
    yield from found.verdicts
    for what, fitted in found.muscles.items():
        yield from muscle_verdicts(fitted.fit, what)
        yield electromechanical_delay_verdict(what, activation_delays(fitted))
        yield from _compare_with_regression(found, what)
    for each in found.evaluated:
        if each.coverage is not None and not each.causal:
            where = each.recording.replace("_", " ") or "cross-validation over trials"
            yield Verdict(
                "good" if each.coverage >= 0.9 else "warning",
                f"{each.what}, muscles: {100.0 * each.coverage:.0f} % of the torque in {where} lies within the "
                "95 % prediction interval.",
            )
    for what, why in found.passed_over.items():
        yield Verdict("note", f"{what}: muscles were not fitted: {why}.")


def _compare_with_regression(found: CalibrationFindings, what: str) -> Iterator[Verdict]:
    """Yield a verdict that compares muscles with regressions of the same inputs, on the first test recording."""
    own = [e for e in found.evaluated if e.what == what and not e.causal]
    own = [e for e in own if e.recording == own[0].recording]
    muscles = next((e for e in own if e.family.shows_muscles), None)
    rivals = [e for e in own if e.family.rivals_muscles]
    if muscles is None or not rivals or muscles.kind == FORMULA_KIND:
        return
    rival = min(e.score.rmse for e in rivals)
    errors = f"{what}: RMS error {muscles.score.rmse:.3g} {muscles.unit} with muscles, {rival:.3g} with regression: "
    if muscles.score.rmse < rival:
        yield Verdict("good", errors + "the muscle model improves the estimate.")
    else:
        end = "regression was tested only on movements like the fitted ones and may fail on others."
        yield Verdict("note", errors + end)


STIFFNESS_UNIT = "N*m/rad"
"""Unit of stiffness in rows and cards."""

STIFFNESS_KIND_WORDS = {"short_range": "at once", "slope": "by Hill's slope"}
"""Description of each kind of stiffness."""


def find_stiffness(found: CalibrationFindings, cards: Mapping[str, EmgEstimatorCard]) -> tuple[JointStiffness, ...]:
    """Compute the stiffness of every joint with a live muscle estimator, along its first fitted recording.

    A card holds what is found, and held-out recordings may move nothing in it.
    """
    made = []
    for (joint, estimator), fit in found.causal.items():
        card = cards.get(f"emg_{joint}_{estimator}")
        if isinstance(fit, HillMap) and card is not None:
            made.append(joint_stiffness(card, fit.fit, found.stiffness_trials[joint]))
    return tuple(made)


def stiffness_tables(stiffness: Sequence[JointStiffness]) -> tuple[FigureTable, ...]:
    """Return a table of stiffness by posture for each joint."""
    heads = (
        "Angle (°)",
        "Torque (N·m)",
        *(f"{w[0].upper()}{w[1:]} ± 95 % (N·m/rad)" for w in STIFFNESS_KIND_WORDS.values()),
    )
    return tuple(
        FigureTable(
            f"Stiffness by calibrated muscles: {s.joint}, {s.recording.replace('_', ' ')}",
            heads,
            tuple(
                (
                    f"{np.degrees(p.low):.0f} to {np.degrees(p.high):.0f}",
                    float(p.torque),
                    *(f"{p.value[kind]:.0f} ± {1.96 * p.error[kind]:.0f}" for kind in STIFFNESS_KINDS),
                )
                for p in (*s.postures, s.whole)
            ),
            max_brief_rows=0,
        )
        for s in stiffness
    )


def stiffness_rows(study: str, stiffness: Sequence[JointStiffness], checksums: Mapping[str, str]) -> list[ResultRow]:
    """Return result rows: mean stiffness over the movement, its standard error, and the largest value."""
    rows = []
    for s in stiffness:
        for kind in STIFFNESS_KINDS:
            note = f"{STIFFNESS_KIND_WORDS[kind]}, muscles and tissue; ± {1.96 * s.whole.error[kind]:.3g} (95 %)"
            for name, value, words in (
                ("mean", s.whole.value[kind], note),
                (
                    "mean.error",
                    s.whole.error[kind],
                    "standard error: calibration, and variation of muscles and tendons among people",
                ),
                ("largest", float(np.max(s.value[kind])), STIFFNESS_KIND_WORDS[kind]),
            ):
                where = f"{study}.{s.joint}.stiffness.{kind}.{name}"
                rows.append(
                    ResultRow(where, value, STIFFNESS_UNIT, "calibrate", "fitted", checksums.get(s.recording), words)
                )
    return rows


def stiffness_cards(study: Study, stiffness: Sequence[JointStiffness]) -> dict[str, ParameterCard]:
    """Return a card for each joint, with stiffness by posture and standard errors."""
    cards = {}
    for s in stiffness:
        parameters, ranges = [], {}
        for i, p in enumerate((s.whole, *s.postures)):
            for kind in STIFFNESS_KINDS:
                value, error = p.value[kind], p.error[kind]
                half, name = 1.96 * error, f"{kind}.{'mean' if i == 0 else f'posture_{i}'}"
                parameters.append(CardParameter(name, STIFFNESS_UNIT, value, error, (value - half, value + half)))
            if i:
                ranges |= {f"posture_{i}.low": p.low, f"posture_{i}.high": p.high, f"posture_{i}.torque": p.torque}
        name = f"stiffness_{s.joint}"
        cards[name] = ParameterCard(
            kind="joint_stiffness",
            study=study.name,
            name=name,
            parameters=tuple(parameters),
            settings={"joint": s.joint, "recording": s.recording, **ranges},
            processing="-d torque / d angle of calibrated muscles and tissue, mean over shares of a movement's time",
            pellucid=version("pellucid"),
        )
    return cards


def stiffness_verdicts(stiffness: Sequence[JointStiffness]) -> list[Verdict]:
    """Return verdicts that state the stiffness and the limits of an estimate without perturbation."""
    return [
        Verdict(
            "note",
            f"{s.joint}: the mean stiffness over {s.recording.replace('_', ' ')} is "
            f"{s.whole.value['short_range']:.3g} N*m/rad for short-range stiffness and {s.whole.value['slope']:.3g} "
            "from the slope of Hill's model. No perturbation was applied: the model was fitted to torque, which does "
            "not show co-contraction, and short-range stiffness was measured in cats. In perturbation experiments, "
            "knees were 17 % (extension) and 42 % (flexion) less stiff than such estimates (Pfeifer et al. 2011).",
        )
        for s in stiffness
    ]


MAX_BRIEF_WORTH_ROWS = 6
"""Largest number of joints and recordings in the table on a terminal without ``-v``."""

TOO_FEW_TRIALS_SENTENCE = (
    f"Fewer than {WORTH_BLOCKS.min_trials} trials were fitted, too few to decide whether EMG improves the estimate. "
)
"""Sentence before the results of estimators that were fitted to too few of the study's trials."""


@dataclass(frozen=True)
class RecordingWorth:
    """Gain from EMG for one joint or person, on one held-out recording or in cross-validation over trials."""

    what: str  # Joint or participant
    recording: str  # Held-out recording; "" for cross-validation over all trials
    worth: EmgWorth

    @property
    def words(self) -> str:
        """Joint or participant, and the recording or the number of trials, in words."""
        of = recording_words(self.recording) if self.recording else f"{self.worth.blocks} trials"
        return f"{self.what}, {of}"


def find_worth(
    chosen: Sequence[RecommendedEstimator],
    traces: Sequence[TorqueTrace],
    margin: float,
    recordings: Mapping[str, str],
    *,
    is_founded: bool = True,
) -> tuple[RecordingWorth, ...]:
    """Return the gain of every recommended estimator over angles alone; no answer of it if that is not `is_founded`.

    A recording's answer uses the predictions on that recording and nothing else. `traces` holds the predictions on
    every test recording on which estimates are valid, `recordings` the recording's name of each trial: pieces of one
    recording are no independent trials.
    """
    found, made = [], {(trace.what, trace.recording): trace for trace in traces}
    for each in chosen:
        if each.by:
            pieces: dict[str, list[tuple[float, float]]] = {}
            for one in each.by_condition():
                if one.bare is not None:
                    pieces.setdefault(recordings.get(one.name, one.name), []).append((one.score.r2, one.bare.r2))
            if pieces:
                with_emg, bare = zip(*(np.mean(pairs, axis=0).tolist() for pairs in pieces.values()), strict=True)
                found.append(RecordingWorth(each.what, "", worth_over_trials(with_emg, bare, margin)))
            continue
        for judged in each.judged:
            trace = made.get((each.what, judged.recording))
            if trace is not None and each.weights is not None and each.bare_weights is not None:
                with_emg, bare = each.weights, each.bare_weights
                fs = (len(trace.time) - 1) / float(trace.time[-1] - trace.time[0])
                others = predict_without_each_test(with_emg, bare, trace.predicted)
                predicted = with_emg.predict(trace.predicted), bare.predict(trace.predicted)
                worth = worth_on_recording(trace.reference, *predicted, fs, margin, others)
                found.append(RecordingWorth(each.what, judged.recording, worth))
    return tuple(replace(each, worth=replace(each.worth, is_founded=is_founded)) for each in found)


def is_answer_founded(fitted: int, lost: int) -> bool:
    """Return whether `fitted` trials suffice to answer whether EMG is worth it, where `lost` ones were not used.

    A study whose trials are all used answers for the trials that it planned. Where some were lost, the ones that are
    left must be as many as an interval over trials requires.
    """
    return not lost or fitted >= WORTH_BLOCKS.min_trials


def _signed(value: float) -> str:
    """Return a gain with its sign."""
    return f"{value:+.2f}"


MAX_NAMED_GAINS = 3
"""Largest number of gains that a sentence names; the first table has all."""


def worth_sentence(worth: Sequence[RecordingWorth]) -> str:
    """Return the first sentence of the headline: for which joints and recordings EMG is worth it; empty without any."""
    if not worth:
        return ""
    by_answer: dict[str, list[str]] = {}
    for each in worth:
        where = f" on {recording_words(each.recording)}" if each.recording else ""
        made = each.worth
        figure = f"{'' if by_answer else 'gain in '}R² {_signed(made.gain)}"
        if np.isfinite(made.low):
            level = "" if by_answer else "95 % interval "
            figure += f", {level}{_signed(made.low)} to {_signed(made.high)}"
        by_answer.setdefault(made.answer, []).append(f"{each.what}{where} ({figure})")
    words = {
        "worth it": "EMG improves on joint angles alone for",
        "not worth it": "EMG does not improve on joint angles alone for",
        "cannot say": "The data do not show whether EMG improves on joint angles alone for",
    }
    few = "" if all(each.worth.is_founded for each in worth) else TOO_FEW_TRIALS_SENTENCE
    told = ((words[answer], listed_names(parts, MAX_NAMED_GAINS)) for answer, parts in by_answer.items())
    return few + "".join(f"{begin} {gains}. " for begin, gains in told)


def worth_tables(worth: Sequence[RecordingWorth]) -> tuple[FigureTable, ...]:
    """Return the table of what EMG is worth, the first of a calibration."""
    if not worth:
        return ()
    rows = tuple(
        (
            each.words,
            each.worth.gain,
            None if not np.isfinite(each.worth.low) else f"{_signed(each.worth.low)} to {_signed(each.worth.high)}",
            each.worth.answer,
        )
        for each in worth
    )
    heads = ("Held out", "Gain in R²", "95 % interval", f"EMG (required gain {worth[0].worth.margin:g})")
    return (FigureTable("Gain from EMG over joint angles alone", heads, rows, MAX_BRIEF_WORTH_ROWS),)


OVER_TRIALS_NOTE = "mean over held-out trials; "
"""Beginning of the note on a mean over trials."""

ROWS_OVER_TRIALS = {
    STEP_KIND: ("emg.{what}.rmse.{how}", "emg.{what}.r2.{how}", ""),
    FORMULA_KIND: (
        "{what}.{how}.rmse_normalised", "{what}.{how}.r2", f"relative to the weight of the leg; {OVER_TRIALS_NOTE}",
    ),
    TRIALS_KIND: ("{what}.{how}.rmse", "{what}.{how}.r2", OVER_TRIALS_NOTE),
}
"""Ids of RMSE and R² of evaluations over all trials by their kind, and the beginning of the RMSE's note."""


def calibration_rows(
    study: str,
    evaluated: Sequence[EstimatorEvaluation],
    trials: Sequence[TorqueTrial],
    sessions: Mapping[str, ChannelComparison],
    chosen: Sequence[RecommendedEstimator],
    worth: Sequence[RecordingWorth],
) -> Iterator[ResultRow]:
    """Yield all result rows. Ids name the recording, except for the first held-out one."""
    sums = {trial.name: trial.checksum for trial in trials}
    first = next((trial.name for trial in trials if trial.heldout), "")

    def row(name: str, value: float, unit: str, note: str, recording: str = "", split: str = "heldout") -> ResultRow:
        return ResultRow(f"{study}.{name}", value, unit, "calibrate", split, sums.get(recording), note)

    for each in evaluated:
        how, unit = each.estimator + (".causal" if each.causal else ""), each.row_unit
        if each.kind in ROWS_OVER_TRIALS:
            rmse, r2, words = (x.format(what=each.what, how=how) for x in ROWS_OVER_TRIALS[each.kind])
            yield row(rmse, each.score.rmse, unit, words + each.choice)
            aggregate = "" if each.kind == STEP_KIND else OVER_TRIALS_NOTE
            yield row(r2, each.score.r2, "1", aggregate + each.choice)
            continue
        base, tail = f"{each.what}.{how}", "" if each.recording == first else f".{each.recording}"
        for name, value, unit, note in _recording_numbers(each):
            yield row(f"{base}.{name}{tail}", value, unit, note, each.recording)
        for name, value, unit, note in () if tail else _fit_numbers(each):
            yield row(f"{base}.{name}", value, unit, note, split="fitted")
    refused = {name for name, compared in sessions.items() if not compared.is_valid}
    for named in chosen:
        for judged in named.judged:
            tail, unit = "" if judged.recording in (first, "") else f".{judged.recording}", judged.row_unit
            note = f"chosen within the fitted recordings: {named.words}"
            yield row(f"{named.what}.chosen.rmse{tail}", judged.score.rmse, unit, note, judged.recording)
            yield row(f"{named.what}.chosen.r2{tail}", judged.score.r2, "1", note, judged.recording)
        if named.fitted_coverage is not None:
            words = "smallest coverage of the 90 % band in cross-validation over the fitted trials"
            yield row(f"{named.what}.chosen.coverage90.fitted", named.fitted_coverage, "1", words, split="fitted")
        for one in named.by_condition():
            tail = f".{one.name}" if named.by or one.name != first else ""
            if named.by:
                words = f"by {one.estimator}"
                yield row(f"{named.what}.chosen.rmse{tail}", one.score.rmse, unit, words, one.name)
            if one.held is not None:
                words = "share of samples within the 90 % band"
                if one.name in refused:
                    words = "share of samples within the 90 % band; not reported, because no estimate is valid here"
                yield row(f"{named.what}.chosen.coverage90{tail}", one.held, "1", words, one.name)
    for gained in worth:
        tail, made = "" if gained.recording in (first, "") else f".{gained.recording}", gained.worth
        note = f"gain in R² over angles alone: {made.answer}, required gain {made.margin:g}"
        for end, value in (("", made.gain), (".low", made.low), (".high", made.high)):
            if np.isfinite(value):
                words = "end of its 95 % interval" if end else note
                yield row(f"{gained.what}.gain_over_angles{end}{tail}", value, "1", words, gained.recording)
    for name, compared in sessions.items():
        changed, outside = compared.changed, "share of time outside the fitted range"
        yield row(f"session.{name}.channels_changed", len(changed), "1", ", ".join(changed), name)
        yield row(f"session.{name}.elsewhere", compared.outside_share, "1", outside, name)
        valid = "1: the fitted recordings cover it, so that estimates are valid"
        yield row(f"session.{name}.holds", float(compared.is_valid), "1", valid, name)


Number = tuple[str, float, str, str]
"""Last part of a row's id, its value, unit and note."""


def _recording_numbers(each: EstimatorEvaluation) -> Iterator[Number]:
    """Yield the numbers of an evaluation on one recording."""
    note, unit = each.choice, each.torque_unit
    yield "r2", each.score.r2, "1", note
    yield "rmse", each.score.rmse, unit, note
    if each.as_recorded is not None:
        repaired = ", ".join(each.repaired) or "none: the torque hardly changes"
        yield "r2.as_recorded", each.as_recorded.r2, "1", f"without rescale; channels it repairs: {repaired}"
    if each.without_changed is not None:
        words = "changed channels predicted from the others"
        yield "r2.without_changed", each.without_changed.r2, "1", words
    if each.coverage is not None:
        yield "coverage", each.coverage, "1", "share of samples within the 95 % interval"
    if each.partial:
        yield "rmse.positive", each.partial[0], unit, "samples in which the reference has its main sign"
        yield "rmse.truncated", each.partial[1], unit, "both torques limited to at least 0"


def _fit_numbers(each: EstimatorEvaluation) -> Iterator[Number]:
    """Yield the numbers of an evaluation that hold for all recordings."""
    if each.examined is not None:
        words = f"root mean square over tests within the fitted recordings: {', '.join(each.examined.words)}"
        yield "rmse.tested", each.examined.mean, each.torque_unit, words
    if each.within is not None:
        yield "r2.cross_validated", each.within.r2, "1", "cross-validation within the fitted recordings"
    if each.seconds is not None:
        yield "seconds", each.seconds, "s", "one calibration, all starts included"
