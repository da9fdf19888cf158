"""A torque map: features and settings chosen by cross-validation within what is fitted, then fitted once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .._errors import IdentificationError
from .._processes import among_helpers
from .cross_validation import Fold, Score, block_folds, first_best, grouped_folds, score
from .families import ESTIMATORS, family_of
from .families.family import Family, Regressor
from .features import LAGS, Features, FeatureSet, features
from .smoothing import smooth
from .torque_trial import TorqueTrial

BLOCKS = 5
"""Blocks of a single recording."""

GAP = max(LAGS) + 0.1
"""Gap on either side of a scored block [s]: the longest lag and a filter's memory."""

MOST_SAMPLES = 4000
"""Samples fitted, evenly thinned: neighbours at a high rate say the same."""

MOST_TRIED = 1500
"""Samples fitted while features and settings are chosen, which is done dozens of times."""


WORTH = 15000
"""Samples to be fitted, over all maps, from which on other processes are worth their start."""

MOST_SCORED = 6000
"""Samples scored meanwhile, evenly thinned; thinner than this, an output is not smoothed."""


@dataclass(frozen=True)
class Choice:
    """What cross-validation chose: features, settings, and the RMSE [N m] of every candidate by its words."""

    features: FeatureSet
    settings: Mapping[str, Any]
    score: Score
    tried: Mapping[str, float] = field(repr=False)

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

    name: str  # Of the estimator, in `ESTIMATORS`
    choice: Choice
    regressor: Regressor = field(repr=False)
    causal: bool = False  # Whether features and smoothing use the past alone

    def predict(self, trial: TorqueTrial) -> np.ndarray:
        """Torque of a trial, shape (n,) [N m]; its own torque is not looked at."""
        raw = self.regressor.predict(features(trial, self.choice.features, causal=self.causal).x)
        seconds = ESTIMATORS[self.name].smoothing
        return smooth(raw, seconds, trial.fs, causal=self.causal) if seconds else raw


def fit_torque_map(trials: Sequence[TorqueTrial], name: str, *, causal: bool = False) -> TorqueMap:
    """Choose features and settings by cross-validation within the trials, and fit to all of them."""
    name, family = family_of(name)
    if not trials or any(trial.heldout for trial in trials):
        found = "no trial" if not trials else f"the held-out trial {next(t.name for t in trials if t.heldout)}"
        raise IdentificationError(f"torque map: found {found}, expected trials to fit")
    if family.whole is not None:
        return family.whole(trials, name, causal)
    stack = _Stack(trials, causal)
    choice = _choose(family, stack)
    seen = stack.features(choice.features)
    regressor = family.make(choice.settings, seen).fit(seen.x[stack.thinned], stack.torque[stack.thinned])
    return TorqueMap(name, choice, regressor, causal)


class MapJob(NamedTuple):
    """A map to be fitted, and what is asked of it there."""

    trials: Sequence[TorqueTrial]
    name: str  # Of the estimator
    causal: bool = False
    examine: Callable[[Any, Sequence[TorqueTrial]], Any] | None = None  # Of the map and its trials


def fit_torque_maps(
    jobs: Sequence[MapJob], begun: Callable[[int, float], None] = lambda i, share: None, workers: int | None = None
) -> list[tuple[TorqueMap, Any]]:
    """`fit_torque_map` of each job and what was asked of it, by `workers` processes where that is worth their start;
    `begun` hears which job begins and what share of all is done.
    """
    order = sorted(range(len(jobs)), key=lambda i: _place(jobs[i].name))
    size = sum(min(sum(len(trial) for trial in job.trials), MOST_TRIED) for job in jobs)
    made = among_helpers(
        [(_fitted, jobs[i]) for i in order],
        1 if size < WORTH else workers,
        lambda i, share: begun(order[i], share),
    )
    return [each for _, each in sorted(zip(order, made, strict=True), key=lambda pair: pair[0])]


def _place(name: str) -> tuple[bool, int]:
    """Of an estimator among jobs: muscles, which take longest, then as in tables."""
    own, family = family_of(name)
    return family.whole is None, list(ESTIMATORS).index(own)


def _fitted(job: MapJob) -> tuple[TorqueMap, Any]:
    made = fit_torque_map(job.trials, job.name, causal=job.causal)
    return made, None if job.examine is None else job.examine(made, job.trials)


@dataclass(frozen=True, eq=False)
class CrossValidated:
    """An estimator scored on trials it did not see."""

    score: Score  # Over all samples of all trials
    by_trial: Mapping[str, Score]
    predicted: Mapping[str, np.ndarray]  # (n,) Torque by trial [N m], each from a map fitted without its group
    choices: tuple[Choice, ...]  # Of every outer fold
    examined: tuple[Any, ...] = ()  # What was asked of every outer fold's map


def torque_map_cv(
    trials: Sequence[TorqueTrial],
    estimators: Sequence[str] = ("boost", "bagging", "tree", "ridge"),
    *,
    causal: bool = False,
    on_progress: Callable[[str, float], None] | None = None,
    examine: Callable[[Any, Sequence[TorqueTrial]], Any] | None = None,
) -> dict[str, CrossValidated]:
    """Score estimators group by group, features and settings chosen anew within the other groups each time; `examine`
    is asked of every map, with the trials that it was fitted to."""
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
        lambda i, share: tell(f"{ESTIMATORS[family_of(runs[i][0])[0]].words}, without {runs[i][1]}", share),
    )
    made, results = dict(zip(runs, fitted, strict=True)), {}
    for name in estimators:
        predicted, choices, examined = {}, [], []
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


class _Stack:
    """Trials one after another, with their folds, and features made once a set."""

    def __init__(self, trials: Sequence[TorqueTrial], causal: bool):
        self.trials, self.causal = trials, causal
        self.torque = np.concatenate([trial.torque for trial in trials])
        lengths = [len(trial) for trial in trials]
        self.member = np.repeat(np.arange(len(trials)), lengths)
        self.neighbours = len(trials[0].angles) > 1
        self.thinned, self.tried = (
            np.arange(0, len(self.torque), max(1, -(-len(self.torque) // most))) for most in (MOST_SAMPLES, MOST_TRIED)
        )
        self._made: dict[FeatureSet, Features] = {}

    @cached_property
    def folds(self) -> list[Fold]:
        groups = np.repeat([trial.group for trial in self.trials], [len(trial) for trial in self.trials])
        if len(set(groups.tolist())) > 1:
            return grouped_folds(groups)
        if len(self.trials) > 1:
            return grouped_folds(self.member)
        return block_folds(self.trials[0].time, BLOCKS, GAP)

    def features(self, chosen: FeatureSet) -> Features:
        if chosen not in self._made:
            each = [features(trial, chosen, causal=self.causal) for trial in self.trials]
            self._made[chosen] = Features(np.vstack([f.x for f in each]), each[0].names, each[0].motion)
        return self._made[chosen]


def _choose(family: Family, stack: _Stack) -> Choice:
    """Every pair of features and settings, or features first (motion, then earlier envelopes), then settings."""
    sets = family.candidates(neighbours=stack.neighbours)
    tried: dict[str, Choice] = {}

    def least(candidates: list[tuple[FeatureSet, Mapping[str, Any]]]) -> Choice:
        named = {f"{chosen} {settings}": (chosen, settings) for chosen, settings in candidates}
        for chosen in dict.fromkeys(chosen for chosen, _ in candidates):
            new = {key: settings for key, (own, settings) in named.items() if own == chosen and key not in tried}
            scores = _scores_of(family, stack, chosen, list(new.values())) if new else ()
            for (key, settings), scored in zip(new.items(), scores, strict=True):
                tried[key] = Choice(chosen, settings, scored, {})
        choices = [tried[key] for key in named]
        return choices[first_best([choice.score.rmse for choice in choices])]

    if family.every:
        best = least([(chosen, settings) for chosen in sets for settings in family.settings])
    else:
        quick = family.quick or family.settings[0]
        if len(sets) > 1:
            plain = least([(chosen, quick) for chosen in sets if chosen.lags == sets[0].lags]).features
            sets = (least([(c, quick) for c in sets if replace(c, lags=plain.lags) == plain]).features,)
        best = least([(chosen, settings) for chosen in sets for settings in family.settings])
    return replace(best, tried={choice.words: choice.score.rmse for choice in tried.values()})


def _scores_of(family: Family, stack: _Stack, chosen: FeatureSet, settings: Sequence[Mapping[str, Any]]) -> list[Score]:
    """Of each of `settings` out of fold, over all samples."""
    seen = stack.features(chosen)
    predicted = np.full((len(settings), len(stack.torque)), np.nan)
    every = -(-len(stack.torque) // MOST_SCORED)
    for fitted, scored in stack.folds:
        fitted = np.intersect1d(fitted, stack.tried, assume_unique=True)
        rows = scored[::every]
        made = family.predicted(settings, seen, seen.x[fitted], stack.torque[fitted], seen.x[rows])
        for own, raw in zip(predicted, made, strict=True):
            own[rows] = raw if every > 1 or not family.smoothing else _smoothed(stack, raw, rows, family.smoothing)
    known = [np.isfinite(own) for own in predicted]
    return [score(stack.torque[k], own[k]) for k, own in zip(known, predicted, strict=True)]


def _smoothed(stack: _Stack, raw: np.ndarray, rows: np.ndarray, seconds: float) -> np.ndarray:
    """What was predicted for `rows`, averaged trial by trial: an average must not run from one into the next."""
    member = stack.member[rows]
    ends = np.flatnonzero(np.diff(member)) + 1
    return np.concatenate(
        [
            smooth(part, seconds, stack.trials[of[0]].fs, causal=stack.causal)
            for part, of in zip(np.split(raw, ends), np.split(member, ends), strict=True)
        ]
    )
