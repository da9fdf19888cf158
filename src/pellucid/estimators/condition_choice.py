r"""Which estimator to name for movements unlike those fitted: each is fitted again to some and judged on others.

Where several recordings, sessions or repetitions are fitted, each is left out whole. Within a single recording nothing
but its own variety can tell: slow strides judge what was fitted to fast ones and the reverse, and the fifth of the
samples with the most effort, and that with the most speed, judges what was fitted to the rest. Every method is judged
on the same samples, with the features and settings that it chose before.

With :math:`e_{ki}` the RMSE of method k in test i, the least mean of :math:`e_{ki}^2` is found; of methods whose mean
is no more than one standard error of the paired differences above it, those come first whose form says most beyond what
was fitted: muscles held by anatomy, muscles that are not, what is linear in its terms, then what stays within the
torques it has seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._errors import IdentificationError
from ..fit.muscles.muscle_calibration import MuscleProblem, solve_calibration
from .families import ESTIMATORS
from .features import derivatives, features
from .hill import HillMap
from .muscle_trials import muscle_samples, warm
from .reconstructions import UncoupledMap, uncoupled
from .smoothing import smooth
from .torque_map import MOST_TRIED, TorqueMap
from .torque_trial import TorqueTrial

MOST = 5
"""Tests at most where several recordings are fitted: those of like speed are then left out together."""

SHORTEST, FEWEST = 0.4, 4
"""A movement's shortest period [s], and the fewest of its strides that can be told apart by how fast they are."""

REPEATS = 0.5
"""Autocorrelation of the joint's speed from which a movement is one that repeats."""

REST = 0.8
"""Share of the samples that is fitted where those with the most effort or speed judge."""

LEVEL = 0.9
"""Of the band about what is predicted."""

KNOWN = 9
"""Conditions from which a band of that level may be known: of fewer, the largest error is passed more than once in ten
others that are like them."""


@dataclass(frozen=True, eq=False)
class ConditionTest:
    """Samples of trials one after another: what is fitted, and what then judges."""

    words: str
    fitted: np.ndarray = field(repr=False)  # fitted, judged: indices
    judged: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class Examined:
    """An estimator in every test."""

    words: tuple[str, ...]  # What each test was
    rmse: tuple[float, ...]  # [N m]; nan where it could not be fitted
    half_width: float  # Of the band that holds `LEVEL` of the samples judged, as the mean over tests is [N m]
    conditions: int = 1  # Recordings, sessions or repetitions that were left out in turn; 1: parts of a single one

    @property
    def mean(self) -> float:
        """Root of the mean square, every test counted the same [N m]."""
        return float(np.sqrt(np.mean(np.square(self.rmse))))


def candidate(name: str) -> bool:
    """Whether an estimator may be named: it sees EMG, is not told the torque, rebuilds no paper's and has settings."""
    family = ESTIMATORS[name]
    own = not family.told and not family.reconstruction
    return family.muscles and own and (family.whole is not None or len(family.settings) > 1)


def named(found: Mapping[str, Examined]) -> str:
    """The estimator to name, of those examined alike."""
    errors = {name: np.square(each.rmse) for name, each in found.items()}
    whole = np.isfinite(np.array(list(errors.values()))).all(axis=0)
    if not whole.any():
        raise IdentificationError(f"choice: found no test that {', '.join(found)} could all be given, expected one")
    errors = {name: error[whole] for name, error in errors.items()}
    means = {name: float(error.mean()) for name, error in errors.items()}
    best = min(means, key=means.get)

    def unsure(name: str) -> float:
        apart = errors[name] - errors[best]
        return float(apart.std(ddof=1) / np.sqrt(len(apart))) if len(apart) > 1 else 0.0

    alike = [name for name in means if means[name] - means[best] <= unsure(name)]
    return min(alike, key=lambda name: (ESTIMATORS[name].reach, means[name]))


def condition_tests(trials: Sequence[TorqueTrial]) -> tuple[ConditionTest, ...]:
    """Tests that these trials allow: one left out after the other, or parts of a single one unlike the others."""
    counted = np.concatenate([np.arange(len(t)) >= warm(t) for t in trials])

    def test(words: str, fitted: np.ndarray, judged: np.ndarray) -> ConditionTest:
        return ConditionTest(words, np.flatnonzero(fitted & counted), np.flatnonzero(judged & counted))

    of = _conditions_of(trials)
    conditions = _conditions(trials, of)
    if len(conditions) > 1:
        member = np.repeat(of, [len(t) for t in trials])
        return tuple(
            test(f"without {', '.join(out)}", ~np.isin(member, out), np.isin(member, out)) for out in conditions
        )
    (trial,) = trials
    v = _speed(trial)
    slow = _slow_strides(v, trial.fs)
    effort = np.mean([x / max(float(np.quantile(x, 0.95)), 1e-12) for x in trial.envelopes.values()], axis=0)
    calm, still = (x <= np.quantile(x, REST) for x in (effort, np.abs(v)))
    return (
        test("fast strides", slow, ~slow),
        test("slow strides", ~slow, slow),
        test("most effort", calm, ~calm),
        test("most speed", still, ~still),
    )


def _conditions(trials: Sequence[TorqueTrial], of: Sequence[str]) -> list[list[str]]:
    """What is left out together: each by itself, or where there are many, those of like speed."""
    names = list(dict.fromkeys(of))
    if len(names) <= MOST:
        return [[name] for name in names]
    speed = {
        name: np.sqrt(np.mean(np.concatenate([_speed(t) for t, o in zip(trials, of, strict=True) if o == name]) ** 2))
        for name in names
    }
    return [list(part) for part in np.array_split(sorted(names, key=speed.get), MOST)]


def _speed(trial: TorqueTrial) -> np.ndarray:
    """Of the joint, shape (n,) [rad/s]."""
    return derivatives(np.asarray(trial.angles[trial.joint], float), trial.fs, causal=False)[1]


def _slow_strides(v: np.ndarray, fs: float) -> np.ndarray:
    """Samples in the slower half of the strides, or of as many parts of a movement that does not repeat, shape (n,)."""
    n = len(v)
    r = np.fft.irfft(np.abs(np.fft.rfft(v - v.mean(), 2 * n)) ** 2)[:n] / np.arange(n, 0, -1)
    first, last = round(SHORTEST * fs), n // FEWEST
    period = first + int(np.argmax(r[first:last])) if last > first else 0
    if period == 0 or r[period] < REPEATS * r[0]:
        period = max(1, n // (2 * FEWEST))
    stride = np.minimum(np.arange(n) // period, n // period - 1)
    level = np.bincount(stride, v**2) / np.bincount(stride)
    return (level <= np.median(level))[stride]


def examined(fit: Any, trials: Sequence[TorqueTrial]) -> Examined:
    """How an estimator fares in each test that `trials` allow, fitted again with what it chose; `fit` is fitted to all
    of them."""
    torque = np.concatenate([t.torque for t in trials])
    tests = condition_tests(trials)
    predict = _of_features(fit, trials, torque) if isinstance(fit, TorqueMap) else _of_muscles(fit, trials)
    errors = []
    for test in tests:
        try:
            errors.append(predict(test) - torque[test.judged])
        except IdentificationError:  # nothing to fit in there
            errors.append(np.full(max(1, len(test.judged)), np.nan))
    return Examined(
        tuple(test.words for test in tests),
        tuple(float(np.sqrt(np.mean(e**2))) for e in errors),
        _half_width(errors),
        len(set(_conditions_of(trials))),
    )


def _half_width(errors: Sequence[np.ndarray]) -> float:
    """Half the band that holds `LEVEL` of a test's errors, its mean square over all tests [N m]."""
    each = [np.quantile(np.abs(e), LEVEL) for e in errors if np.isfinite(e).all()]
    return float(np.sqrt(np.mean(np.square(each)))) if each else float("nan")


def _conditions_of(trials: Sequence[TorqueTrial]) -> list[str]:
    """Which condition each trial is of: its group, or where there is but one, itself."""
    groups = [t.group for t in trials]
    return groups if len(set(groups)) > 1 else [t.name for t in trials]


def _of_features(
    fit: TorqueMap, trials: Sequence[TorqueTrial], torque: np.ndarray
) -> Callable[[ConditionTest], np.ndarray]:
    family = ESTIMATORS[fit.name]
    each = [features(t, fit.choice.features, causal=fit.causal) for t in trials]
    x = np.vstack([f.x for f in each])
    member = np.repeat(np.arange(len(trials)), [len(t) for t in trials])

    def predict(test: ConditionTest) -> np.ndarray:
        if not len(test.fitted) or not len(test.judged):
            raise IdentificationError(f"{test.words}: found no samples, expected some to fit and some to judge")
        kept = test.fitted[:: -(-len(test.fitted) // MOST_TRIED)]
        made = family.make(fit.choice.settings, each[0]).fit(x[kept], torque[kept]).predict(x[test.judged])
        if not family.smoothing:
            return made
        # An average must not run over samples that are not judged, nor into the next trial.
        ends = np.flatnonzero((np.diff(test.judged) > 1) | (np.diff(member[test.judged]) > 0)) + 1
        return np.concatenate(
            [smooth(part, family.smoothing, trials[0].fs, causal=fit.causal) for part in np.split(made, ends)]
        )

    return predict


def _of_muscles(fit: HillMap | UncoupledMap, trials: Sequence[TorqueTrial]) -> Callable[[ConditionTest], np.ndarray]:
    if isinstance(fit, UncoupledMap):
        fit, trials = fit.base, [uncoupled(t) for t in trials]
    samples, own = muscle_samples(trials, muscles=fit.muscles, effort=fit.effort, causal=fit.causal)
    at, problem = np.concatenate([np.arange(s.start, s.stop) for s in own]), fit.fit.problem

    def predict(test: ConditionTest) -> np.ndarray:
        if not len(test.judged):
            raise IdentificationError(f"{test.words}: found no samples, expected some to judge")
        again = MuscleProblem(
            problem.model.muscles, samples.only(at[test.fitted]), priors=problem.priors, passive=problem.passive,
            weight=problem.weight,
        )  # fmt: skip
        return solve_calibration(again, method=fit.fit.method).predict(samples)[at[test.judged]]

    return predict
