r"""Choose the estimator to recommend: refit each candidate on some conditions, test it on the others, and weigh them.

Candidates are all families with all their penalties, with and without EMG. If several recordings, sessions or
repetitions are fitted, each is held out as a whole in turn. A single recording is divided into blocks. Two recordings
alone show little of how candidates differ between recordings; blocks of both then count as much as the two recordings.
Every candidate is tested on the same samples, with the features and settings that it chose before.

Let :math:`e_k` be the errors of candidate k in the tests, with trials weighed by the noise model of
`find_trial_weights`. The recommended estimator is the weighted mean of the candidates [1]_ with

.. math:: \min_w \sum_i s_i \overline{\Big(\sum_k w_k e_{ki}\Big)^2} + \frac{\sigma^2}{n} \sum_k w_k^2,
    \qquad w_k \ge 0, \quad \sum_k w_k = 1 .

Shares :math:`s_i` of the n tests have the sum 1. The last term stands for what n tests leave unknown of each
candidate's mean square error, with :math:`\sigma^2` that of the best. A candidate that receives nearly all of the
weight is recommended alone.

The tests say nothing of a recording that is unlike all fitted ones, by its angles and envelopes. There the candidate
that extrapolates best by its form is recommended: muscles held by anatomy.

The error band follows from conditions that are held out in turn, or from long parts of a single recording. Each is
predicted by candidates that are refitted to the others, with weights that follow from the errors in the others: the
band also carries what the choice of weights costs. Features and settings of a candidate stay as all of them chose them.

.. [1] L. Breiman, "Stacked regressions", Machine Learning 24, 1996.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..._errors import IdentificationError
from ..fit.muscle_calibration import MuscleProblem, solve_calibration
from .adaptive_correction import UncoupledMap, uncouple_trial
from .cross_validation import apply_useful_repairs, block_folds
from .families import ESTIMATOR_FAMILIES, STACKED
from .feature_scale import find_row_weights, smooth
from .hill import HillMap
from .muscle_trials import count_warm_up_samples, make_muscle_samples
from .torque_map import MAP_FITTING, TorqueMap
from .torque_trial import TorqueTrial, compute_features, filter_and_differentiate

MAX_TEST_COUNT = 5
"""Largest number of tests if several recordings are fitted. Recordings of similar speed are then held out together.

Chosen by judgement; no measurement is recorded.
"""

MIN_SOLE_WEIGHT = 0.9
"""Weight from which a candidate is recommended alone: the others together change its estimate little.

Chosen by judgement; no measurement is recorded.
"""

LEFT_OUT_WORDS = "without"
"""Beginning of the description of a test that leaves out a condition."""


@dataclass(frozen=True)
class ErrorBand:
    """How the band about a prediction follows from errors in other conditions.

    No measurement is recorded for what is chosen by judgement.
    """

    share: float = 0.9  # Share of the test samples that the error band about a prediction holds
    # An error band is known only from at least this many conditions. With two, how errors vary between conditions
    # follows from `prior_deviation` rather than from recordings.
    min_conditions: int = 3
    # Standard deviation of the logarithm of an error's scale between conditions that is expected beforehand. Chosen by
    # judgement: errors of one estimator then differ by a third from one trial to the next.
    prior_deviation: float = 0.3
    prior_weight: float = 2.0  # Number of conditions that this expectation counts for. Chosen by judgement.
    quadrature_count: int = 100  # Number of quantiles over which scales and errors are averaged


ERROR_BAND = ErrorBand()


@dataclass(frozen=True, eq=False)
class ConditionTest:
    """Indices of the fitted samples and of the test samples, in trials that are joined one after another."""

    words: str  # Description of the test
    fitted: np.ndarray = field(repr=False)  # Indices of the fitted samples
    judged: np.ndarray = field(repr=False)  # Indices of the test samples
    share: float = 1.0  # How much the test counts in the choice, relative to the others


@dataclass(frozen=True)
class ConditionTestErrors:
    """Errors of an estimator in every test."""

    words: tuple[str, ...]  # Description of each test
    rmse: tuple[float, ...]  # RMSE in each test [N m]; NaN if the estimator could not be fitted
    half_width: float  # Half width of the band that should hold the share `ERROR_BAND.share` in other conditions [N m]
    conditions: int = 1  # Number of recordings, sessions or repetitions left out in turn; 1: parts of a single one
    # Share of the errors of each test within the band that the other tests give; None with fewer than three tests
    left_out_coverage: float | None = None
    # Errors in each test, shape (n,) each [N m], and the weights of their samples by the noise model
    errors: tuple[np.ndarray, ...] = field(default=(), repr=False, compare=False)
    weights: tuple[np.ndarray, ...] = field(default=(), repr=False, compare=False)
    shares: tuple[float, ...] = ()  # How much each test counts in the choice; empty: the same
    # Errors in the tests that give the band, shape (n,) each [N m], and the weights of their samples
    band_errors: tuple[np.ndarray, ...] = field(default=(), repr=False, compare=False)
    band_weights: tuple[np.ndarray, ...] = field(default=(), repr=False, compare=False)

    @property
    def mean(self) -> float:
        """Root mean square error, each test weighted equally [N m]."""
        return float(np.sqrt(np.mean(np.square(self.rmse))))


def is_candidate(name: str) -> bool:
    """Return whether an estimator may be recommended, alone or in a weighted mean, with EMG or without.

    It must not see the measured torque, and not be another paper's method.
    """
    family = ESTIMATOR_FAMILIES[name]
    own = not family.sees_measured_torque and not family.reconstruction
    return own and (family.fit_trials is not None or bool(family.weight_argument))


@dataclass(frozen=True)
class Recommendation:
    """Weights of the candidates in the recommended estimator."""

    weights: Mapping[str, float]  # Weight of each candidate with one, the largest first
    # The same without one test, by number of that test: how far the choice depends on the tests
    jackknife: Mapping[int, Mapping[str, float]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the candidate that is recommended alone, otherwise `STACKED`."""
        return next(iter(self.weights)) if len(self.weights) == 1 else STACKED

    def predict(self, predicted: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the weighted mean of the candidates' torques, shape (n,) each [N m]."""
        return weighted_mean(self.weights, predicted)


def weighted_mean(weights: Mapping[str, float], predicted: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the weighted mean of torques by candidate, shape (n,) each [N m]."""
    return np.sum([weight * predicted[name] for name, weight in weights.items()], axis=0)


def predict_without_each_test(
    first: Recommendation, second: Recommendation, predicted: Mapping[str, np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the torques of two recommendations, shape (n,) each [N m], without each test that both were chosen by."""
    common = [test for test in first.jackknife if test in second.jackknife]
    return [
        (weighted_mean(first.jackknife[test], predicted), weighted_mean(second.jackknife[test], predicted))
        for test in common
    ]


def recommend(found: Mapping[str, ConditionTestErrors]) -> Recommendation:
    """Return the weights of the candidates, from results of the same tests by name."""
    first = next(iter(found.values()))
    return _recommend({name: each.errors for name, each in found.items()}, first.weights, first.shares)


def _recommend(
    errors: Mapping[str, Sequence[np.ndarray]], weights: Sequence[np.ndarray], shares: Sequence[float]
) -> Recommendation:
    """Return the weights of candidates from the errors of each in the same tests, shape (n,) each [N m].

    `weights` are those of the samples of each test, and `shares` how much each counts; empty: all the same.
    """
    names, whole = list(errors), _find_known_tests(errors)
    if not len(whole):
        raise IdentificationError(f"choice: found no test recording that {', '.join(names)} all predict, expected one")
    moments = np.array([_error_moments([own[i] for own in errors.values()], weights, i) for i in whole])
    each_share = np.asarray(shares)[whole] if shares else np.ones(len(whole))

    def solve(kept: np.ndarray) -> dict[str, float]:
        total = np.average(moments[kept], axis=0, weights=each_share[kept])
        return _solve_weights(names, total + np.eye(len(names)) * np.diag(total).min() / len(kept))

    every = np.arange(len(whole))
    left_out = {int(test): solve(np.delete(every, i)) for i, test in enumerate(whole)} if len(every) > 1 else {}
    return Recommendation(solve(every), left_out)


def _is_known(errors: np.ndarray) -> bool:
    """Return whether an estimator predicted every sample of a test, from its errors, shape (n,) [N m]."""
    return bool(len(errors) and np.isfinite(errors).all())


def _find_known_tests(errors: Mapping[str, Sequence[np.ndarray]]) -> np.ndarray:
    """Return the indices of the tests that all candidates predict, from their errors by name, shape (n,) each [N m]."""
    return np.flatnonzero([all(map(_is_known, own)) for own in zip(*errors.values(), strict=True)])


def _error_moments(each: Sequence[np.ndarray], weights: Sequence[np.ndarray], test: int) -> np.ndarray:
    """Return the mean products of the candidates' weighed errors in a test, shape (k, k)."""
    errors = np.column_stack(each)
    weight = weights[test] if len(weights) else np.ones(len(errors))
    return (weight[:, None] * errors).T @ errors / len(errors)


def _solve_weights(names: Sequence[str], moments: np.ndarray) -> dict[str, float]:
    """Return the weights of least mean square error, at least 0 with the sum 1, the largest first.

    If all candidates but one have a total weight below `1 - MIN_SOLE_WEIGHT`, only that one is returned.
    """
    from scipy.optimize import nnls

    count = len(names)
    scale = np.trace(moments) / count
    if not scale > 0.0:
        return {names[0]: 1.0}
    # Weights w = u / sum(u) of the least w' M w solve the non-negative least squares of M u = 1.
    root = np.linalg.cholesky(moments / scale + 1e-9 * np.eye(count))
    found, _ = nnls(root.T, np.linalg.solve(root, np.ones(count)))
    weights = dict(zip(names, (found / found.sum()).tolist(), strict=True))
    ordered = dict(sorted(weights.items(), key=lambda pair: -pair[1]))
    first = next(iter(ordered))
    if ordered[first] >= MIN_SOLE_WEIGHT:
        return {first: 1.0}
    return {name: weight for name, weight in ordered.items() if weight > 0.0}


def find_extrapolator(found: Mapping[str, ConditionTestErrors]) -> str | None:
    """Return the candidate to use on recordings unlike all fitted ones: muscles held by anatomy; None without any."""
    held = [name for name in found if ESTIMATOR_FAMILIES[name].is_anatomical]
    return min(held, key=lambda name: np.nan_to_num(found[name].mean, nan=np.inf), default=None)


def combine_tests(found: Mapping[str, ConditionTestErrors], chosen: Recommendation) -> ConditionTestErrors:
    """Return the test errors of what was recommended, from results of the same tests by name.

    Each condition that gives the band is predicted with the weights that the errors in the other conditions recommend.
    """
    first = next(iter(found.values()))
    errors = [chosen.predict({n: found[n].errors[i] for n in chosen.weights}) for i in range(len(first.errors))]
    left_out = {n: each.band_errors for n, each in found.items()}
    known = _find_known_tests(left_out)
    without = _recommend(left_out, first.band_weights, ()).jackknife if len(known) else {}
    band_errors = [
        weighted_mean(without.get(i, chosen.weights), {n: own[i] for n, own in left_out.items()})
        for i in range(len(first.band_errors))
    ]
    return _report_errors(
        first.words, errors, first.weights, first.shares, band_errors, first.band_weights, first.conditions
    )


def _report_errors(
    words: Sequence[str],
    errors: Sequence[np.ndarray],
    weights: Sequence[np.ndarray],
    shares: Sequence[float],
    band_errors: Sequence[np.ndarray],
    band_weights: Sequence[np.ndarray],
    conditions: int,
) -> ConditionTestErrors:
    """Return what errors in tests, shape (n,) each [N m], say of an estimator."""
    return ConditionTestErrors(
        tuple(words),
        tuple(float(np.sqrt(np.mean(e**2))) if len(e) else float("nan") for e in errors),
        find_error_band(band_errors),
        conditions,
        find_left_out_coverage(band_errors) if conditions > 1 else None,
        tuple(errors),
        tuple(weights),
        tuple(shares),
        tuple(band_errors),
        tuple(band_weights),
    )


def make_choice_tests(trials: Sequence[TorqueTrial]) -> tuple[ConditionTest, ...]:
    """Return the tests by which candidates are weighed: conditions held out in turn, or blocks of a single one.

    Two conditions and blocks of both count the same.
    """
    count = len(set(_condition_of_each_trial(trials)))
    if count >= ERROR_BAND.min_conditions:
        return make_condition_tests(trials)
    blocks = _make_block_tests(trials)
    if count == 1:
        return blocks
    conditions = make_condition_tests(trials)
    return tuple(replace(test, share=1.0 / len(own)) for own in (conditions, blocks) for test in own)


def _make_block_tests(trials: Sequence[TorqueTrial]) -> tuple[ConditionTest, ...]:
    """Return tests that leave out the first block of every trial, then the second and so on, with gaps."""
    fitted: list[list[np.ndarray]] = [[] for _ in range(MAP_FITTING.block_count)]
    judged: list[list[np.ndarray]] = [[] for _ in range(MAP_FITTING.block_count)]
    start = 0
    for trial in trials:
        counted = np.arange(len(trial)) >= count_warm_up_samples(trial)
        for i, fold in enumerate(block_folds(trial.time, MAP_FITTING.block_count, MAP_FITTING.fold_gap_s)):
            for rows, made in zip(fold, (fitted, judged), strict=True):
                made[i].append(start + rows[counted[rows]])
        start += len(trial)
    return tuple(
        ConditionTest(f"block {i}", np.concatenate(kept), np.concatenate(out))
        for i, (kept, out) in enumerate(zip(fitted, judged, strict=True), start=1)
    )


def make_condition_tests(trials: Sequence[TorqueTrial]) -> tuple[ConditionTest, ...]:
    """Return tests that hold out several conditions in turn, or long parts of a single one with gaps.

    A single one has as many parts as the band needs conditions.
    """
    counted = np.concatenate([np.arange(len(t)) >= count_warm_up_samples(t) for t in trials])
    of = _condition_of_each_trial(trials)
    if len(set(of)) > 1:
        member = np.repeat(of, [len(t) for t in trials])
        held = [(f"{LEFT_OUT_WORDS} {', '.join(out)}", np.isin(member, out)) for out in _group_conditions(trials, of)]
        return tuple(
            ConditionTest(words, np.flatnonzero(~out & counted), np.flatnonzero(out & counted)) for words, out in held
        )
    parts = block_folds(trials[0].time, ERROR_BAND.min_conditions, MAP_FITTING.fold_gap_s)
    return tuple(
        ConditionTest(f"{LEFT_OUT_WORDS} part {i}", fitted[counted[fitted]], judged[counted[judged]])
        for i, (fitted, judged) in enumerate(parts, start=1)
    )


def _group_conditions(trials: Sequence[TorqueTrial], of: Sequence[str]) -> list[list[str]]:
    """Return groups of conditions that are held out together: single ones, or those of similar speed if there are many.

    `of` names the condition of each trial.
    """
    names = list(dict.fromkeys(of))
    if len(names) <= MAX_TEST_COUNT:
        return [[name] for name in names]
    speed = {
        name: np.sqrt(
            np.mean(np.concatenate([_joint_speed(t) for t, o in zip(trials, of, strict=True) if o == name]) ** 2)
        )
        for name in names
    }
    return [list(part) for part in np.array_split(sorted(names, key=lambda name: speed[name]), MAX_TEST_COUNT)]


def _joint_speed(trial: TorqueTrial) -> np.ndarray:
    """Return the speed of a trial's joint, shape (n,) [rad/s]."""
    return filter_and_differentiate(np.asarray(trial.angles[trial.joint], float), trial.fs, causal=False)[1]


def run_condition_tests(fit: Any, trials: Sequence[TorqueTrial]) -> ConditionTestErrors:
    """Refit an estimator in each test that `trials` allow, with the settings that it chose, and return its errors.

    `fit` is the estimator fitted to all of the trials.
    """
    torque = np.concatenate([t.torque for t in trials])
    predict = (
        _make_map_predictor(fit, trials, torque) if isinstance(fit, TorqueMap) else _make_muscle_predictor(fit, trials)
    )

    def run(tests: Sequence[ConditionTest]) -> list[np.ndarray]:
        errors = []
        for test in tests:
            try:
                errors.append(predict(test) - torque[test.judged])
            except IdentificationError:  # The test holds no samples that can be fitted
                errors.append(np.full(max(1, len(test.judged)), np.nan))
        return errors

    weight = find_row_weights([t.torque for t in trials])
    tests, conditions = make_choice_tests(trials), len(set(_condition_of_each_trial(trials)))
    errors = run(tests)
    held = [i for i, test in enumerate(tests) if test.words.startswith(LEFT_OUT_WORDS)]
    band_tests = [tests[i] for i in held] if held else make_condition_tests(trials)
    band_errors = [errors[i] for i in held] if held else run(band_tests)
    weights, band_weights = (
        [] if weight is None else [weight[test.judged] for test in each] for each in (tests, band_tests)
    )
    shares = [test.share for test in tests]
    return _report_errors(
        [test.words for test in tests], errors, weights, shares, band_errors, band_weights, conditions
    )


def run_tests_if_candidate(fit: Any, trials: Sequence[TorqueTrial]) -> ConditionTestErrors | None:
    """Return the condition tests of a fitted estimator; None for one that may not be recommended."""
    return run_condition_tests(fit, trials) if is_candidate(fit.name) else None


@dataclass(frozen=True, eq=False)
class Examination:
    """Function of a fitted map, run in the process that fitted it: its condition tests and its predictions.

    It is part of the estimators, so that a process which fits maps imports nothing of studies.
    """

    judged: tuple[tuple[TorqueTrial, TorqueTrial], ...]  # Held-out trials as recorded and with all repairs
    causal: bool  # Whether the map is causal; condition tests are then omitted

    def __call__(
        self, fit: Any, fitted: Sequence[TorqueTrial]
    ) -> tuple[ConditionTestErrors | None, dict[str, tuple[TorqueTrial, tuple[str, ...], np.ndarray]]]:
        """Return the condition tests, and by held-out trial the trial as used, its repaired muscles and its torque."""
        away, predicted = None if self.causal else run_tests_if_candidate(fit, fitted), {}
        for recorded, repaired in self.judged:
            trial, muscles = apply_useful_repairs(fit.predict, fitted, recorded, repaired)
            predicted[recorded.name] = trial, muscles, fit.predict(trial)
        return away, predicted


def find_error_band(errors: Sequence[np.ndarray]) -> float:
    r"""Return half the width of the band that should cover `ERROR_BAND.share` of the errors in another condition.

    The errors of condition i are taken as :math:`q_i z`: a scale :math:`q_i`, which is the quantile of their size at
    the band's share, and a distribution of z that all conditions have in common. Logarithms of scales vary normally
    between conditions. Their variance is estimated together with a prior, and the scale of another condition is then
    distributed as Student's t with ``ERROR_BAND.prior_weight + K - 1`` degrees of freedom about the mean of K. The
    band's half width is the one within which the errors of such a condition lie with the band's share in the mean.
    Few conditions so give a wider band.

    Parameters
    ----------
    errors : sequence of ndarray, shape (n,)
        Errors in each condition [N m]; conditions with missing values are excluded.

    Returns
    -------
    float
        Half width [N m]; NaN without a test.
    """
    from scipy.optimize import brentq
    from scipy.special import stdtrit

    each = [np.abs(e) for e in errors if _is_known(e)]
    quantiles = np.array([np.quantile(e, ERROR_BAND.share) for e in each])
    if not len(each):
        return float("nan")
    if not quantiles.min() > 0.0:
        return float(np.sqrt(np.mean(quantiles**2)))
    logs, count = np.log(quantiles), len(each)
    freedom = ERROR_BAND.prior_weight + count - 1.0
    variance = (ERROR_BAND.prior_weight * ERROR_BAND.prior_deviation**2 + count * logs.var()) / freedom
    places = (np.arange(ERROR_BAND.quadrature_count) + 0.5) / ERROR_BAND.quadrature_count
    scales = logs.mean() + np.sqrt(variance * (1.0 + 1.0 / count)) * stdtrit(freedom, places)
    # Every condition counts the same in the common distribution, however long it lasts.
    relative = np.concatenate([np.quantile(e / q, places) for e, q in zip(each, quantiles, strict=True)])
    ranked = np.log(np.maximum(np.sort(relative), 1e-12))

    def missing_share(log_width: float) -> float:
        return float(np.mean(np.searchsorted(ranked, log_width - scales) / len(ranked))) - ERROR_BAND.share

    low, high = logs.min() + ranked[0] - 50.0, logs.max() + ranked[-1] + 50.0
    return float(np.exp(brentq(missing_share, low, high, xtol=1e-3)))


def find_left_out_coverage(errors: Sequence[np.ndarray]) -> float | None:
    """Return the mean share of each test's errors within the band computed from the other tests.

    This checks the band with fitted recordings alone. None with fewer than three tests.
    """
    each = [e for e in errors if _is_known(e)]
    if len(each) < 3:
        return None
    shares = []
    for i, own in enumerate(each):
        width = find_error_band([e for k, e in enumerate(each) if k != i])
        shares.append(np.mean(np.abs(own) <= width))
    return float(np.mean(shares))


def _condition_of_each_trial(trials: Sequence[TorqueTrial]) -> list[str]:
    """Return the condition of each trial: its group, or its name if all trials have the same group."""
    groups = [t.group for t in trials]
    return groups if len(set(groups)) > 1 else [t.name for t in trials]


def _make_map_predictor(
    fit: TorqueMap, trials: Sequence[TorqueTrial], torque: np.ndarray
) -> Callable[[ConditionTest], np.ndarray]:
    """Return a function that refits a torque map to a test's fitted samples and predicts its test samples."""
    family = ESTIMATOR_FAMILIES[fit.name]
    each = [compute_features(t, fit.choice.features, causal=fit.causal) for t in trials]
    x = np.vstack([f.x for f in each])
    member = np.repeat(np.arange(len(trials)), [len(t) for t in trials])
    weight = find_row_weights([t.torque for t in trials])

    def predict(test: ConditionTest) -> np.ndarray:
        if not len(test.fitted) or not len(test.judged):
            raise IdentificationError(f"{test.words}: found no samples, expected some to fit and some to test")
        kept = test.fitted[:: -(-len(test.fitted) // MAP_FITTING.max_choice_samples)]
        weights = family.weights(None if weight is None else weight[kept])
        made = family.make(fit.choice.settings, each[0]).fit(x[kept], torque[kept], **weights).predict(x[test.judged])
        if not family.smoothing:
            return made
        # An average must not run over samples outside the test set, nor into the next trial.
        ends = np.flatnonzero((np.diff(test.judged) > 1) | (np.diff(member[test.judged]) > 0)) + 1
        return np.concatenate(
            [smooth(part, family.smoothing, trials[0].fs, causal=fit.causal) for part in np.split(made, ends)]
        )

    return predict


def _make_muscle_predictor(
    fit: HillMap | UncoupledMap, trials: Sequence[TorqueTrial]
) -> Callable[[ConditionTest], np.ndarray]:
    """Return a function that recalibrates muscles on a test's fitted samples and predicts its test samples."""
    if isinstance(fit, UncoupledMap):
        fit, trials = fit.base, [uncouple_trial(t) for t in trials]
    samples, own = make_muscle_samples(trials, muscles=fit.muscles, effort=fit.effort, causal=fit.causal)
    at, problem = np.concatenate([np.arange(s.start, s.stop) for s in own]), fit.fit.problem

    def predict(test: ConditionTest) -> np.ndarray:
        if not len(test.judged):
            raise IdentificationError(f"{test.words}: found no samples, expected some to test")
        again = MuscleProblem(
            problem.model.muscles, samples.only(at[test.fitted]), priors=problem.priors, passive=problem.passive,
            weight=problem.weight,
        )  # fmt: skip
        return solve_calibration(again, method=fit.fit.method).predict(samples)[at[test.judged]]

    return predict
