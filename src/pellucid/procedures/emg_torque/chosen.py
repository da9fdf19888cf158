"""The estimator that is named first: chosen by what was fitted alone, and how it did on every recording that judged."""

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
from .evaluated import Evaluated

BASELINE = "motion"
"""The estimator that sees no EMG."""


@dataclass(frozen=True)
class Judged:
    """What is named first, on one recording or trial."""

    name: str
    estimator: str
    score: Score
    bare: Score | None  # Of angles alone
    held: float | None  # Share of the reference within the band


@dataclass(frozen=True)
class Chosen:
    """What is named first for one joint or participant."""

    what: str
    estimators: tuple[str, ...]  # One, or one for each outer fold
    judged: tuple[Evaluated, ...]  # Its figures by recording, the worst first
    bare: tuple[Evaluated, ...]  # Those of angles alone, in the same order; empty where nothing was fitted to them

    conditions: int = 1  # That were left out in turn to choose it, the fewest in any fold; 1: parts of one recording
    by: Mapping[str, str] = field(default_factory=dict)  # Estimator by trial, where trials are left out in turn
    half_width: Mapping[str, float] = field(default_factory=dict)  # Of the band by trial there [N m]
    held: Mapping[str, float] = field(default_factory=dict)  # Share of the reference within, by trial there

    def by_condition(self) -> list[Judged]:
        """How it did on each recording or trial."""
        if not self.by:
            bare = {e.recording: e.score for e in self.bare}
            return [Judged(e.recording, e.estimator, e.score, bare.get(e.recording), e.held) for e in self.judged]
        bare = self.bare[0].by_trial if self.bare else {}
        own = self.judged[0].by_trial
        return [Judged(t, name, own[t], bare.get(t), self.held.get(t)) for t, name in self.by.items()]

    @property
    def words(self) -> str:
        """What it is."""
        counts = Counter(self.estimators)
        if len(counts) == 1:
            return ESTIMATOR_FAMILIES[self.estimators[0]].words
        each = (f"{ESTIMATOR_FAMILIES[name].description} for {count}" for name, count in counts.most_common())
        return f"what was chosen without each ({', '.join(each)})"


def examined_if_candidate(fit: object, trials: Sequence[TorqueTrial]) -> ConditionTestErrors | None:
    """How an estimator fares away from what it is fitted to; None for one that is not named first."""
    return run_condition_tests(fit, trials) if is_candidate(fit.name) else None


def chosen_of(evaluated: Sequence[Evaluated], what: str) -> Chosen:
    """Of estimators judged on recordings of their own; no recording that judges takes part."""
    own = [e for e in evaluated if e.what == what and not e.causal]
    best = choose_estimator({e.estimator: e.examined for e in own if e.examined is not None})
    judged = sorted((e for e in own if e.estimator == best), key=lambda e: -e.score.rmse)
    bare = {e.recording: e for e in own if e.estimator == BASELINE}
    bare = tuple(bare[e.recording] for e in judged if e.recording in bare)
    return Chosen(what, (best,), tuple(judged), bare, judged[0].examined.conditions)


def chosen_in_folds(
    trials: Sequence[TorqueTrial], results: Mapping[str, CrossValidated], evaluated: Sequence[Evaluated]
) -> Chosen:
    """Of estimators judged trial by trial: for each left out, what the others alone choose; `evaluated` are theirs."""
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
    return Chosen(
        one.what,
        tuple(best),
        (one,),
        tuple(e for e in evaluated if e.estimator == BASELINE),
        min(each.conditions for each in within.values()),
        {t.name: of[t.group] for t in trials},
        width,
        held,
    )
