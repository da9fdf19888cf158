r"""Do conditions differ when every participant tried all of them? Friedman's rank test, and Nemenyi's after it.

Each of n participants (rows) ranks the k conditions (columns); R_j is the sum of a condition's ranks. Friedman [1]_
asks whether the rank sums are further apart than chance:

.. math::
   \chi^2 = \frac{(k-1) \sum_j (R_j - n(k+1)/2)^2}{\sum_{ij} (r_{ij} - (k+1)/2)^2}
   \quad\overset{\text{no ties}}{=}\quad \frac{12}{nk(k+1)} \sum_j R_j^2 - 3n(k+1)

with ties sharing their mean rank; values that rounding alone tells apart are ties (`numerics/tied_ranks.py`). Its
distribution over many participants is chi-squared with k - 1 degrees of freedom; over few, the chance of the same or a
larger statistic is counted exactly instead: under the null hypothesis each participant's ranks are as likely in any
order, and the orders of one participant after another are folded into a distribution of rank sums. That takes moments
where listing all :math:`(k!)^n` outcomes would take hours.

Nemenyi's test [2]_ compares all pairs, and holds the chance of any false alarm at its level:
:math:`q = |R_i - R_j| / n \,/ \sqrt{k(k+1)/6n}`, times :math:`\sqrt 2`, against the studentised range of k means with
infinite degrees of freedom. (A chi-squared variant exists, and gives other numbers.) Ties are not corrected for.

.. [1] M. Friedman, "The use of ranks to avoid the assumption of normality implicit in the analysis of variance",
   J. Am. Stat. Assoc. 32, 1937.
.. [2] P. Nemenyi, "Distribution-free multiple comparisons", PhD thesis, Princeton, 1963; J. Demsar, "Statistical
   comparisons of classifiers over multiple data sets", J. Mach. Learn. Res. 7, 2006.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy import stats

from .._errors import PellucidError
from ..numerics.tied_ranks import tied_ranks

MAX_EXACT_CONDITIONS = 6
"""Largest number of conditions for the exact distribution, which lists all orders of the conditions."""

MAX_EXACT_TABLE_SIZE = 5_000_000
"""One step of the exact distribution lists at most this many rank sums times orders, which bounds its memory."""


@dataclass(frozen=True)
class FriedmanTest:
    """The outcome of a Friedman test."""

    statistic: float  # chi-squared, corrected for ties
    degrees_of_freedom: int  # k - 1
    p_value: float  # p value from the chi-squared distribution, valid for many participants
    exact_p_value: float | None  # p value over all orders of each participant's ranks; None if not requested
    rank_sums: tuple[float, ...]  # R_j for each condition; the smallest values have the lowest ranks
    participants: int  # n

    @property
    def p(self) -> float:
        """Exact p value if it was computed, otherwise that of the chi-squared distribution."""
        return self.p_value if self.exact_p_value is None else self.exact_p_value


def friedman(data: np.ndarray, *, exact: bool = False) -> FriedmanTest:
    """Return Friedman's test of participants' values. `data` (n, k)."""
    ranks = _ranks(data)
    n, k = ranks.shape
    sums = ranks.sum(axis=0)
    spread = np.sum((ranks - 0.5 * (k + 1)) ** 2)
    if spread == 0.0:
        raise PellucidError("Friedman: every participant's values are all equal, so nothing is ranked")
    statistic = (k - 1) * float(np.sum((sums - 0.5 * n * (k + 1)) ** 2)) / float(spread)
    p_exact = _exact_p_value(ranks, sums) if exact else None
    return _friedman_test(statistic, sums, n, p_exact)


def friedman_from_rank_sums(rank_sums: Sequence[float], participants: int, *, exact: bool = False) -> FriedmanTest:
    """Return Friedman's test from rank sums alone, if no participant had ties."""
    sums = _checked_sums(rank_sums, participants)
    k = len(sums)
    statistic = 12.0 / (participants * k * (k + 1)) * float(np.sum((sums - 0.5 * participants * (k + 1)) ** 2))
    p_exact = None
    if exact:
        p_exact = _exact_p_value(np.tile(np.arange(1.0, k + 1.0), (participants, 1)), sums)
    return _friedman_test(statistic, sums, participants, p_exact)


def nemenyi(data: np.ndarray) -> np.ndarray:
    """Return Nemenyi's p value of every pair of conditions, (k, k). `data` (n, k)."""
    ranks = _ranks(data)
    return _nemenyi(ranks.sum(axis=0), len(ranks))


def nemenyi_from_rank_sums(rank_sums: Sequence[float], participants: int) -> np.ndarray:
    """Return Nemenyi's p value of every pair of conditions, (k, k), from rank sums alone."""
    return _nemenyi(_checked_sums(rank_sums, participants), participants)


def _nemenyi(sums: np.ndarray, n: int) -> np.ndarray:
    k = len(sums)
    apart = np.abs(sums[:, None] - sums[None, :]) / n / np.sqrt(k * (k + 1) / (6.0 * n))
    i, j = np.triu_indices(k, 1)
    p = np.ones((k, k))
    p[i, j] = p[j, i] = np.clip(stats.studentized_range.sf(np.sqrt(2.0) * apart[i, j], k, np.inf), 0.0, 1.0)
    return p


def _ranks(data: np.ndarray) -> np.ndarray:
    """Return the ranks within each row, shape (n, k); ties share their mean rank."""
    data = np.asarray(data, float)
    if data.ndim != 2 or min(data.shape) < 2:
        raise PellucidError(
            f"Friedman: a table of shape {data.shape}; expected participants x conditions, 2 of each or more"
        )
    if not np.all(np.isfinite(data)):
        row, column = np.argwhere(~np.isfinite(data))[0]
        raise PellucidError(f"Friedman: participant {row}, condition {column} has no finite value; leave the row out")
    return tied_ranks(data, axis=1)


def _checked_sums(rank_sums: Sequence[float], n: int) -> np.ndarray:
    sums = np.asarray(rank_sums, float)
    k = len(sums)
    if n < 2 or k < 2 or not np.isclose(sums.sum(), 0.5 * n * k * (k + 1)) or sums.min() < n or sums.max() > n * k:
        raise PellucidError(
            f"rank sums {sums.tolist()} cannot come from {n} rankings of {k} conditions: "
            f"they lie in [{n}, {n * k}] and add up to {0.5 * n * k * (k + 1):g}"
        )
    return sums


def _friedman_test(statistic: float, sums: np.ndarray, n: int, p_exact: float | None) -> FriedmanTest:
    df = len(sums) - 1
    return FriedmanTest(
        statistic, df, float(stats.chi2.sf(statistic, df)), p_exact, tuple(float(s) for s in sums), participants=n
    )


def _exact_p_value(ranks: np.ndarray, sums: np.ndarray) -> float:
    """Return the probability of rank sums at least as uneven as `sums`, if each row's ranks come in any order.

    Sums are counted in half ranks, so that ties too are integers and rounding plays no part. The statistic does not
    depend on the order of the conditions, so sums are kept sorted.
    """
    n, k = ranks.shape
    if k > MAX_EXACT_CONDITIONS:
        raise PellucidError(
            f"Friedman: {k} conditions are too many for the exact distribution; up to {MAX_EXACT_CONDITIONS}"
        )
    doubled = np.rint(2.0 * ranks).astype(np.int64)
    place = (2 * n * k + 1) ** np.arange(k, dtype=np.int64)
    every = np.array(list(permutations(range(k))))
    reached: np.ndarray = np.zeros((1, k), np.int64)
    chance: np.ndarray = np.ones(1)
    for row in doubled:
        orders = row[every]
        if len(reached) * len(orders) > MAX_EXACT_TABLE_SIZE:
            raise PellucidError(f"Friedman: {n} participants, {k} conditions: too many for the exact distribution")
        ahead = np.sort((reached[:, None, :] + orders[None, :, :]).reshape(-1, k), axis=1)
        _, first, where = np.unique(ahead @ place, return_index=True, return_inverse=True)
        chance = np.bincount(where.ravel(), np.repeat(chance / len(orders), len(orders)))
        reached = ahead[first]
    middle = n * (k + 1)  # mean of the doubled rank sums
    spread = np.sum((reached - middle) ** 2, axis=1)
    seen = np.sum((np.rint(2.0 * sums).astype(np.int64) - middle) ** 2)
    return float(min(1.0, chance[spread >= seen].sum()))
