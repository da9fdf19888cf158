r"""Test the mean of people's changes without assuming that they are spread normally, or even symmetrically.

Student's statistic is judged by its least favourable reference distribution. With :math:`\bar d` and :math:`s` the mean
and the standard deviation of n changes,

.. math:: t = \frac{\bar d - m}{s / \sqrt{n}}

says how far the mean lies above m. Where changes have a long tail downwards, large t are frequent although the mean is
no larger than m: few of n people show the tail; where it does not show, :math:`\bar d` is too large and s too small.
The p value is therefore the largest tail probability of t over two shapes of changes, simulated once for each n with a
stated seed: normal, and lognormal with :math:`\sigma = 1` (skewness 6.2). Changes that are less skewed give fewer false
claims; those of any location and scale give the same.

No statistic sees people who are not in the sample. If one person in five is slowed, none of them is among n people in
:math:`0.8^n` of studies: 26 % with 6 people, 17 % with 8, 6.9 % with 12, 4.4 % with 14. A claim about the mean is
therefore made from `MIN_PEOPLE` people on, and the p value of "one in five lies far away" (`hidden_fifth_p`) must be
small, too: it costs power with 12 and 13 people, and none from 14 on at a level of 5 %.

The bootstrap-t interval [1]_ and transformations of t [2]_ correct for the skewness that the sample shows. A sample
without a person of the tail shows none; the evidence has them as rivals.

.. [1] P. Hall, "Theoretical comparison of bootstrap confidence intervals", Ann. Stat. 16, 1988.
.. [2] N. J. Johnson, "Modified t tests and confidence intervals for asymmetrical populations", J. Am. Stat. Assoc. 73,
   1978.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

REFERENCE_STUDY_COUNT = 100_000
"""Number of simulated studies behind each reference distribution."""

REFERENCE_SEED = 29
"""Seed of the reference distributions."""

MAX_REFERENCE_PEOPLE = 200
"""The distributions of this many people serve for more, too: they come closer to the normal one."""

LOGNORMAL_SIGMA = 1.0
"""Standard deviation of the logarithm of the skewed reference shape."""

HIDDEN_SHARE = 0.2
"""Share of people who may form a group that lies far from the others."""

HIDDEN_DISTANCE_SD = 13.0
"""Distance of that group, in standard deviations of the others. If it lies farther, the level is exceeded with fewer
than 14 people, to `HIDDEN_SHARE`'s limit of 6.9 % with 12: every study that sees none of the group errs."""

MIN_PEOPLE = 12
"""Fewest people with whom a mean is claimed to lie within a margin: a fifth of people hides from 6.9 % of studies."""


def student_statistics(differences: np.ndarray, value: float | np.ndarray = 0.0) -> np.ndarray:
    """Return Student's statistic of the mean of `differences` (..., n) above a `value`; shape (...).

    Differences that are all equal give an infinite statistic, with the sign of their distance from the value.
    """
    n = differences.shape[-1]
    gap = differences.mean(axis=-1) - value
    error = np.std(differences, axis=-1, ddof=1) / np.sqrt(n)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = gap / error
    return np.where(error > 0.0, ratio, np.where(gap > 0.0, np.inf, -np.inf))


def skewed_p(statistic: np.ndarray | float, people: int) -> np.ndarray:
    """Return the p value of Student's `statistic` of a number of `people`, for the least favourable skew."""
    normal, lognormal, _ = _reference_statistics(min(people, MAX_REFERENCE_PEOPLE))
    return np.maximum(_tail_share(normal, statistic), _tail_share(lognormal, statistic))


def hidden_fifth_p(statistic: np.ndarray | float, people: int) -> np.ndarray:
    """Return the p value of the `statistic` if a fifth of people lies far away; 1 with too few people for a claim."""
    if people < MIN_PEOPLE:
        return np.ones_like(np.asarray(statistic, float))
    return _tail_share(_reference_statistics(min(people, MAX_REFERENCE_PEOPLE))[2], statistic)


def critical_statistic(people: int, alpha: float) -> float:
    """Return the smallest statistic whose `skewed_p` is at most `alpha`."""
    own = _reference_statistics(min(people, MAX_REFERENCE_PEOPLE))[:2]
    allowed = int(np.floor(alpha * (REFERENCE_STUDY_COUNT + 1.0) - 1.0 + 1e-9))
    return max(float(np.nextafter(each[-1 - allowed], np.inf)) for each in own) if allowed >= 0 else np.inf


def mean_p_values(lower: np.ndarray, upper: np.ndarray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the p values of "the mean lies within" and "the mean lies beyond" a margin from `low` to `high`.

    `lower` and `upper`, (..., n), are bounds of the differences, or twice the differences themselves; p have shape
    (...).
    """
    n = lower.shape[-1]
    above_low, below_high = _statistics(lower, low), _statistics(-upper, -high)
    worse = np.minimum(above_low, below_high)
    within = np.maximum(skewed_p(worse, n), hidden_fifth_p(worse, n))
    beyond = np.maximum(_statistics(lower, high), _statistics(-upper, -low))
    return within, skewed_p(beyond, n)


def _statistics(differences: np.ndarray, value: float) -> np.ndarray:
    """Return Student's statistics above a `value`; infinite for an infinite value, -infinite with unknown bounds."""
    if np.isinf(value):
        return np.full(differences.shape[:-1], np.inf if value < 0.0 else -np.inf)
    known = np.isfinite(differences).all(axis=-1)
    filled = np.where(known[..., None], differences, 0.0)
    return np.where(known, student_statistics(filled, value), -np.inf)


def _tail_share(reference: np.ndarray, statistic: np.ndarray | float) -> np.ndarray:
    """Return the share of simulated statistics, sorted, at or above a `statistic`, which counts as one of them."""
    above = len(reference) - np.searchsorted(reference, statistic, side="left")
    return (1.0 + above) / (len(reference) + 1.0)


@lru_cache(maxsize=64)
def _reference_statistics(people: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return sorted statistics of normal and lognormal studies and of those with a far fifth, about their true means.

    The statistics are those of a mean that lies too high because of a tail downwards.
    """
    rng = np.random.default_rng([REFERENCE_SEED, people])
    found: tuple[list[np.ndarray], ...] = ([], [], [])
    part = max(1, min(REFERENCE_STUDY_COUNT, 2_000_000 // people))
    for first in range(0, REFERENCE_STUDY_COUNT, part):
        z = rng.standard_normal((min(part, REFERENCE_STUDY_COUNT - first), people))
        far = HIDDEN_DISTANCE_SD * (rng.uniform(size=z.shape) < HIDDEN_SHARE)
        found[0].append(student_statistics(z))
        found[1].append(student_statistics(-np.exp(LOGNORMAL_SIGMA * z), -float(np.exp(0.5 * LOGNORMAL_SIGMA**2))))
        found[2].append(student_statistics(z - far, -HIDDEN_SHARE * HIDDEN_DISTANCE_SD))
    normal, lognormal, hidden = (np.sort(np.concatenate(each)) for each in found)
    return normal, lognormal, hidden
