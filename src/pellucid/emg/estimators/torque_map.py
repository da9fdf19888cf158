"""A torque map: its features and settings are chosen by cross-validation within the fitted trials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..._errors import IdentificationError
from ..._processes import results_with_helpers
from .cross_validation import Fold, Score, block_folds, first_best, grouped_folds, score, weighted_rmse
from .families import ESTIMATOR_FAMILIES, find_family
from .families.family import Family, Regressor
from .feature_scale import find_row_weights, smooth
from .torque_trial import ENVELOPE_LAGS_S, Features, FeatureSet, TorqueTrial, compute_features


@dataclass(frozen=True)
class MapFitting:
    """Numbers of samples and folds for the selection and the fit of a regression."""

    block_count: int = 5  # Number of blocks into which a single recording is divided for cross-validation
    # Gap on either side of a scored block [s]. It covers the longest lag and the memory of a filter.
    fold_gap_s: float = max(ENVELOPE_LAGS_S) + 0.1
    # Largest number of fitted samples, evenly thinned. Neighbouring samples at a high rate are nearly equal.
    max_fitted_samples: int = 4000
    # Largest number of fitted samples while features and settings are chosen. Maps are then fitted dozens of times.
    max_choice_samples: int = 1500
    # Maps are fitted in several processes only from this many samples over all maps. Below, their start takes longer.
    min_parallel_samples: int = 15000
    # Largest number of scored samples in cross-validation, evenly thinned. Thinned outputs are not smoothed.
    max_scored_samples: int = 6000


MAP_FITTING = MapFitting()


@dataclass(frozen=True)
class Choice:
    """Result of cross-validation over features and settings."""

    features: FeatureSet  # Chosen features
    settings: Mapping[str, Any]  # Chosen settings
    score: Score  # Score out of fold
    tried: Mapping[str, float] = field(repr=False)  # RMSE out of fold of every candidate [N m], by its description
    # RMSE out of fold with trials weighed by the noise model, which chose [N m]; equal to the score's for one trial
    weighted_rmse: float = float("nan")

    @property
    def words(self) -> str:
        """Features and settings in one line."""
        said = ", ".join(
            f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in self.settings.items()
        )
        return f"{self.features}" + (f"; {said}" if said else "")


@dataclass(frozen=True, eq=False)
class TorqueMap:
    """A fitted map from EMG and motion to a joint's torque."""

    name: str  # Name of the estimator in `ESTIMATOR_FAMILIES`
    choice: Choice
    regressor: Regressor = field(repr=False)
    causal: bool = False  # Whether features and smoothing use the past alone

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Predict the torque of a trial, shape (n,) [N m]; its measured torque is not used."""
        raw = self.regressor.predict(compute_features(trial, self.choice.features, causal=self.causal).x)
        seconds = ESTIMATOR_FAMILIES[self.name].smoothing
        return smooth(raw, seconds, trial.fs, causal=self.causal) if seconds else raw


def fit_torque_map(trials: Sequence[TorqueTrial], name: str, *, causal: bool = False) -> TorqueMap:
    """Choose features and settings by cross-validation within the trials, then fit to all of them."""
    name, family = find_family(name)
    if not trials or any(trial.heldout for trial in trials):
        found = "no trial" if not trials else f"the held-out trial {next(t.name for t in trials if t.heldout)}"
        raise IdentificationError(f"torque map: found {found}, expected trials to fit")
    if family.fit_trials is not None:
        return family.fit_trials(trials, name, causal)
    stack = _StackedTrials(trials, causal)
    choice = _choose_features_and_settings(family, stack)
    seen = stack.features(choice.features)
    weights = family.weights(None if stack.weight is None else stack.weight[stack.thinned])
    regressor = family.make(choice.settings, seen).fit(seen.x[stack.thinned], stack.torque[stack.thinned], **weights)
    return TorqueMap(name, choice, regressor, causal)


class MapJob(NamedTuple):
    """A map to be fitted, and a function to be evaluated on it in the same process."""

    trials: Sequence[TorqueTrial]
    name: str  # Name of the estimator
    causal: bool = False
    examine: Callable[[Any, Sequence[TorqueTrial]], Any] | None = None  # Function of the fitted map and its trials


def fit_torque_maps(
    jobs: Sequence[MapJob], begun: Callable[[int, float], None] = lambda i, share: None, workers: int | None = None
) -> list[tuple[TorqueMap, Any]]:
    """Return the fitted map of each job and the result of its `examine`, None without one.

    Large jobs are divided among `workers` processes. `begun` is called with the index of a job that begins and the
    share of all jobs that is done.
    """
    groups = sorted(_group_jobs(jobs), key=lambda group: _job_order_key(jobs[group[0]].name))
    size = sum(min(sum(len(trial) for trial in job.trials), MAP_FITTING.max_choice_samples) for job in jobs)
    made = results_with_helpers(
        [(_run_jobs, [jobs[i] for i in group]) for group in groups],
        1 if size < MAP_FITTING.min_parallel_samples else workers,
        lambda i, share: begun(groups[i][0], share),
    )
    found = {i: each for group, own in zip(groups, made, strict=True) for i, each in zip(group, own, strict=True)}
    return [found[i] for i in range(len(jobs))]


def _group_jobs(jobs: Sequence[MapJob]) -> list[list[int]]:
    """Return the indices of jobs that run one after another: an estimator, and those that correct its fit."""
    groups: dict[int, list[int]] = {}
    for i, job in enumerate(jobs):
        corrected = find_family(job.name)[1].corrects
        alike = (
            k for k in groups
            if corrected and find_family(jobs[k].name)[0] == corrected
            and jobs[k].trials is job.trials and jobs[k].causal == job.causal
        )  # fmt: skip
        groups.setdefault(next(alike, i), []).append(i)
    return list(groups.values())


def _job_order_key(name: str) -> tuple[bool, int]:
    """Return the sorting key of an estimator among jobs: muscles, which take longest, then the order of tables."""
    own, family = find_family(name)
    return family.fit_trials is None, list(ESTIMATOR_FAMILIES).index(own)


def _run_jobs(jobs: Sequence[MapJob]) -> list[tuple[TorqueMap, Any]]:
    """Fit the map of each job and examine it. The jobs after the first one correct its fit."""
    made: list[tuple[TorqueMap, Any]] = []
    for job in jobs:
        name, family = find_family(job.name)
        if made and family.correct_fit is not None:
            fit = family.correct_fit(made[0][0], job.trials, name, job.causal)
        else:
            fit = fit_torque_map(job.trials, job.name, causal=job.causal)
        made.append((fit, None if job.examine is None else job.examine(fit, job.trials)))
    return made


@dataclass(frozen=True, eq=False)
class CrossValidated:
    """Scores and predictions of an estimator on trials that it was not fitted to."""

    score: Score  # Score over all samples of all trials
    by_trial: Mapping[str, Score]  # Score of each trial
    predicted: Mapping[str, np.ndarray]  # Torque by trial, shape (n,) [N m], by a map fitted without its group
    choices: tuple[Choice, ...]  # Choice in every outer fold
    examined: tuple[Any, ...] = ()  # Result of `examine` for every outer fold's map


def cross_validate_torque_maps(
    trials: Sequence[TorqueTrial],
    estimators: Sequence[str] = ("boost", "bagging", "tree", "ridge"),
    *,
    causal: bool = False,
    on_progress: Callable[[str, float], None] | None = None,
    examine: Callable[[Any, Sequence[TorqueTrial]], Any] | None = None,
) -> dict[str, CrossValidated]:
    """Score estimators on each group of trials, after fitting and choosing features and settings on the other groups.

    `examine` is called with every map and the trials that it was fitted to.
    """
    tell = on_progress or (lambda text, share: None)
    groups = list(dict.fromkeys(trial.group for trial in trials))
    if len(groups) < 3:
        raise IdentificationError(
            f"torque map: found {len(groups)} groups of trials ({', '.join(map(repr, groups))}), expected at least 3"
        )
    others = {group: [t for t in trials if t.group != group] for group in groups}
    runs = [(name, group) for name in estimators for group in groups]
    fitted = fit_torque_maps(
        [MapJob(others[group], name, causal, examine) for name, group in runs],
        lambda i, share: tell(
            f"{ESTIMATOR_FAMILIES[find_family(runs[i][0])[0]].description}, without {runs[i][1]}", share
        ),
    )
    made, results = dict(zip(runs, fitted, strict=True)), {}
    for name in estimators:
        predicted: dict[str, np.ndarray] = {}
        choices, examined = [], []
        for group in groups:
            fit, found = made[name, group]
            choices.append(fit.choice)
            if examine is not None:
                examined.append(found)
            predicted |= {t.name: fit.predict(t) for t in trials if t.group == group}
        by_trial = {t.name: score(t.torque, predicted[t.name]) for t in trials}
        whole = score(np.concatenate([t.torque for t in trials]), np.concatenate([predicted[t.name] for t in trials]))
        results[name] = CrossValidated(whole, by_trial, predicted, tuple(choices), tuple(examined))
    return results


class _StackedTrials:
    """Trials one after another, with their folds, and a cache of their features by set."""

    def __init__(self, trials: Sequence[TorqueTrial], causal: bool):
        self.trials, self.causal = trials, causal
        self.torque = np.concatenate([trial.torque for trial in trials])
        self.weight = find_row_weights([trial.torque for trial in trials])
        lengths = [len(trial) for trial in trials]
        self.member = np.repeat(np.arange(len(trials)), lengths)
        self.neighbours = len(trials[0].angles) > 1
        self.thinned, self.tried = (
            np.arange(0, len(self.torque), max(1, -(-len(self.torque) // most)))
            for most in (MAP_FITTING.max_fitted_samples, MAP_FITTING.max_choice_samples)
        )
        self._made: dict[FeatureSet, Features] = {}

    @cached_property
    def folds(self) -> list[Fold]:
        """Folds by group, by trial if there is one group, or by blocks of a single trial."""
        groups = np.repeat([trial.group for trial in self.trials], [len(trial) for trial in self.trials])
        if len(set(groups.tolist())) > 1:
            return grouped_folds(groups)
        if len(self.trials) > 1:
            return grouped_folds(self.member)
        return block_folds(self.trials[0].time, MAP_FITTING.block_count, MAP_FITTING.fold_gap_s)

    def features(self, chosen: FeatureSet) -> Features:
        """Return the features of all trials."""
        if chosen not in self._made:
            each = [compute_features(trial, chosen, causal=self.causal) for trial in self.trials]
            self._made[chosen] = Features(np.vstack([f.x for f in each]), each[0].names, each[0].motion)
        return self._made[chosen]


def _choose_features_and_settings(family: Family, stack: _StackedTrials) -> Choice:
    """Choose features and settings by cross-validation.

    A family may try every pair of them. Otherwise features are chosen first, motion before earlier envelopes, and then
    the settings.
    """
    sets = family.candidates(neighbours=stack.neighbours)
    tried: dict[str, Choice] = {}

    def least(candidates: list[tuple[FeatureSet, Mapping[str, Any]]]) -> Choice:
        named = {f"{chosen} {settings}": (chosen, settings) for chosen, settings in candidates}
        for chosen in dict.fromkeys(chosen for chosen, _ in candidates):
            new = {key: settings for key, (own, settings) in named.items() if own == chosen and key not in tried}
            scores = _cross_validate_settings(family, stack, chosen, list(new.values())) if new else ()
            for (key, settings), (scored, weighted) in zip(new.items(), scores, strict=True):
                tried[key] = Choice(chosen, settings, scored, {}, weighted)
        choices = [tried[key] for key in named]
        return choices[first_best([choice.weighted_rmse for choice in choices])]

    if family.tries_all_pairs:
        best = least([(chosen, settings) for chosen in sets for settings in family.settings])
    else:
        quick = family.feature_choice_settings or family.settings[0]
        if len(sets) > 1:
            plain = least([(chosen, quick) for chosen in sets if chosen.lags == sets[0].lags]).features
            sets = (least([(c, quick) for c in sets if replace(c, lags=plain.lags) == plain]).features,)
        best = least([(chosen, settings) for chosen in sets for settings in family.settings])
    return replace(best, tried={choice.words: choice.weighted_rmse for choice in tried.values()})


def _cross_validate_settings(
    family: Family, stack: _StackedTrials, chosen: FeatureSet, settings: Sequence[Mapping[str, Any]]
) -> list[tuple[Score, float]]:
    """Return the score of each of `settings` out of fold, over all samples, and its RMSE with trials weighed."""
    seen = stack.features(chosen)
    predicted = np.full((len(settings), len(stack.torque)), np.nan)
    every = -(-len(stack.torque) // MAP_FITTING.max_scored_samples)
    for fitted, scored in stack.folds:
        fitted = np.intersect1d(fitted, stack.tried, assume_unique=True)
        rows = scored[::every]
        weight = None if stack.weight is None else stack.weight[fitted]
        made = family.fit_and_predict(settings, seen, seen.x[fitted], stack.torque[fitted], seen.x[rows], weight)
        for own, raw in zip(predicted, made, strict=True):
            own[rows] = (
                raw if every > 1 or not family.smoothing else _smooth_by_trial(stack, raw, rows, family.smoothing)
            )
    known = [np.isfinite(own) for own in predicted]
    weight = stack.weight if family.weight_argument else None
    return [
        (
            score(stack.torque[k], own[k]),
            weighted_rmse(stack.torque[k], own[k], None if weight is None else weight[k]),
        )
        for k, own in zip(known, predicted, strict=True)
    ]


def _smooth_by_trial(stack: _StackedTrials, raw: np.ndarray, rows: np.ndarray, seconds: float) -> np.ndarray:
    """Smooth the predictions for `rows` trial by trial: an average must not run from one trial into the next."""
    member = stack.member[rows]
    ends = np.flatnonzero(np.diff(member)) + 1
    return np.concatenate(
        [
            smooth(part, seconds, stack.trials[of[0]].fs, causal=stack.causal)
            for part, of in zip(np.split(raw, ends), np.split(member, ends), strict=True)
        ]
    )
