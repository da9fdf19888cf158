r"""Comparison of conditions over participants: tests, effect sizes, and intervals of the differences.

Each participant is one number a condition. Friedman's and Nemenyi's tests (`friedman`) say whether conditions differ,
and which; Kendall's :math:`W = \chi^2 / n(k-1)` how much participants agree on their order. Against control, each other
condition has its signed-rank test (`signed_rank`), whose p are corrected together after Holm [1]_: sorted, the i-th of
m is multiplied by m - i + 1 and made no smaller than the one before. Cliff's delta is the chance that a value of one
condition is above one of the other, less the chance that it is below.

The interval of a mean difference is a bootstrap over participants. With a handful of them a plain percentile interval
is too narrow, by the missing :math:`\sqrt{n/(n-1)}` and by the normal tails it imitates; its levels are therefore
widened to :math:`\Phi(-\sqrt{n/(n-1)}\, t_{\alpha/2,\,n-1})` [2]_.

Each of n participants (rows) ranks the k conditions (columns); R_j is the sum of a condition's ranks. Friedman [3]_
asks whether the rank sums are further apart than chance:

.. math::
   \chi^2 = \frac{(k-1) \sum_j (R_j - n(k+1)/2)^2}{\sum_{ij} (r_{ij} - (k+1)/2)^2}
   \quad\overset{\text{no ties}}{=}\quad \frac{12}{nk(k+1)} \sum_j R_j^2 - 3n(k+1)

with ties sharing their mean rank; values that differ only by rounding are ties (`numerics/tied_ranks.py`). Its
distribution over many participants is chi-squared with k - 1 degrees of freedom; over few, the chance of the same or a
larger statistic is counted exactly instead: under the null hypothesis each participant's ranks are as likely in any
order, and the orders of one participant after another are folded into a distribution of rank sums. That takes moments
where listing all :math:`(k!)^n` outcomes would take hours.

Nemenyi's test [4]_ compares all pairs, and holds the chance of any false alarm at its level:
:math:`q = |R_i - R_j| / n \,/ \sqrt{k(k+1)/6n}`, times :math:`\sqrt 2`, against the studentised range of k means with
infinite degrees of freedom. (A chi-squared variant exists, and gives other numbers.) Ties are not corrected for.

.. [1] S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Stat. 6, 1979.
.. [2] T. C. Hesterberg, "What teachers should know about the bootstrap", Am. Stat. 69, 2015.
.. [3] M. Friedman, "The use of ranks to avoid the assumption of normality implicit in the analysis of variance",
   J. Am. Stat. Assoc. 32, 1937.
.. [4] P. Nemenyi, "Distribution-free multiple comparisons", PhD thesis, Princeton, 1963; J. Demsar, "Statistical
   comparisons of classifiers over multiple data sets", J. Mach. Learn. Res. 7, 2006.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import permutations
from math import factorial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, chdtri, ndtr, stdtrit

from .._errors import PellucidError
from .._tabular import html_table, text_table
from ..numerics.arguments import with_checked_arguments
from ..numerics.block_test import holm
from ..numerics.studentized_range import range_quantile, range_tail
from ..numerics.tied_ranks import TIE_TOLERANCE, scale_of, tie_groups, tied_ranks, tied_signs
from .session_periods import SessionPeriods, adjustment

MAX_EXACT_CONDITIONS = 6
"""Largest number of conditions for the exact distribution, which lists all orders of the conditions."""

MAX_EXACT_TABLE_SIZE = 5_000_000
"""One step of the exact distribution lists at most this many rank sums times orders, which bounds its memory."""

MAX_LIMIT_TABLE_SIZE = 500_000
"""Largest table, about n^(k - 1) k^(k - 2), that is listed for the limit of Friedman's statistic.

A search for a number of people has a limit for each number that it tries. Larger studies take the chi-squared limit."""


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
    if np.all(ranks == 0.5 * (k + 1)):
        raise PellucidError(
            "Friedman: found equal values in all conditions of every participant, expected values that can be ranked"
        )
    statistic = float(friedman_statistics(ranks))
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
    p[i, j] = p[j, i] = range_tail(np.sqrt(2.0) * apart[i, j], k)
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
        statistic, df, float(chdtrc(df, statistic)), p_exact, tuple(float(s) for s in sums), participants=n
    )


def _exact_p_value(ranks: np.ndarray, sums: np.ndarray) -> float:
    """Return the probability of rank sums at least as uneven as `sums`, if each row's ranks come in any order."""
    spread, chance = _exact_distribution(ranks)
    seen = np.sum((np.rint(2.0 * sums).astype(np.int64) - ranks.shape[0] * (ranks.shape[1] + 1)) ** 2)
    return float(min(1.0, chance[spread >= seen].sum()))


def _exact_distribution(ranks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how uneven rank sums can be and with which probability, if each row's ranks come in any order.

    Sums are counted in half ranks, so that ties too are integers and rounding plays no part; their unevenness is the
    sum of squares about their mean. It does not depend on the order of the conditions, so sums are kept sorted.
    """
    return _distribution_of(tuple(sorted(map(tuple, np.sort(ranks, axis=1).tolist()))))


# Of indices without ties all have the same one.
@lru_cache(maxsize=64)
def _distribution_of(rows: tuple[tuple[float, ...], ...]) -> tuple[np.ndarray, np.ndarray]:
    ranks = np.array(rows)
    n, k = ranks.shape
    if k > MAX_EXACT_CONDITIONS:
        raise PellucidError(
            f"Friedman: found {k} conditions, expected at most {MAX_EXACT_CONDITIONS} for the exact distribution"
        )
    doubled = np.rint(2.0 * ranks).astype(np.int64)
    place = (2 * n * k + 1) ** np.arange(k, dtype=np.int64)
    every = np.array(list(permutations(range(k))))
    reached: np.ndarray = np.zeros((1, k), np.int64)
    chance: np.ndarray = np.ones(1)
    for row in doubled:
        orders = row[every]
        if len(reached) * len(orders) > MAX_EXACT_TABLE_SIZE:
            raise PellucidError(
                f"Friedman: found {n} participants and {k} conditions, expected fewer for the exact distribution"
            )
        ahead = np.sort((reached[:, None, :] + orders[None, :, :]).reshape(-1, k), axis=1)
        _, first, where = np.unique(ahead @ place, return_index=True, return_inverse=True)
        chance = np.bincount(where.ravel(), np.repeat(chance / len(orders), len(orders)))
        reached = ahead[first]
    return np.sum((reached - n * (k + 1)) ** 2, axis=1), chance


def tells_from_control(values: np.ndarray, control: int = 0, *, alpha: float = 0.05) -> np.ndarray:
    """Return whether Friedman's and Nemenyi's tests of each study tell each condition from control, (studies, k).

    `values`, (studies, n, k), are participants' values; `control` is its column. The limit of Friedman's statistic is
    that of values without ties. With one participant no condition differs.
    """
    studies, n, k = values.shape
    if n < 2 or k < 2 or not studies:
        return np.zeros((studies, k), bool)
    ranks = tied_ranks(values, axis=2)
    sums = ranks.sum(axis=1)
    least = range_quantile(alpha, k) / np.sqrt(2.0) * n * np.sqrt(k * (k + 1) / (6.0 * n))
    apart = np.abs(sums - sums[:, [control]]) > least
    return apart & (friedman_statistics(ranks) >= _critical_statistic(n, k, alpha))[:, None]


def friedman_statistics(ranks: np.ndarray) -> np.ndarray:
    """Return Friedman's statistic, corrected for ties, of each study's ranks (..., n, k); 0 where all are tied."""
    n, k = ranks.shape[-2:]
    spread = np.sum((ranks - 0.5 * (k + 1)) ** 2, axis=(-2, -1))
    far = (k - 1) * np.sum((ranks.sum(axis=-2) - 0.5 * n * (k + 1)) ** 2, axis=-1)
    return np.divide(far, spread, out=np.zeros_like(far), where=spread > 0.0)


@lru_cache(maxsize=64)
def _critical_statistic(n: int, k: int, alpha: float) -> float:
    """Return the smallest significant of Friedman's statistics of n people and k conditions; infinite if none is."""
    if k > MAX_EXACT_CONDITIONS or n ** (k - 1) * k ** (k - 2) > MAX_LIMIT_TABLE_SIZE:
        return float(chdtri(k - 1, alpha))
    spread, chance = _exact_distribution(np.tile(np.arange(1.0, k + 1.0), (n, 1)))
    possible, where = np.unique(spread, return_inverse=True)
    p = np.cumsum(np.bincount(where, chance)[::-1])[::-1]
    significant = possible[p < alpha]
    # Half ranks have four times the squares of ranks.
    return 3.0 / (n * k * (k + 1)) * float(significant[0]) - 1e-9 if len(significant) else np.inf


REFERENCE_STUDY_COUNT = 100_000
"""Number of simulated studies behind each reference distribution."""

REFERENCE_SEED = 29
"""Seed of the reference distributions."""

MAX_REFERENCE_PEOPLE = 200
"""The distributions of this many people serve for more, too: they come closer to the normal one."""

LOGNORMAL_SIGMA = 1.0
"""Standard deviation of the logarithm of the skewed reference shape."""


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


def skewed_p(statistic: np.ndarray | float, people: int, sessions: SessionPeriods | None = None) -> np.ndarray:
    """Return the p value of Student's `statistic` of a number of `people`, for the least favourable skew.

    With `sessions` it is the statistic of differences that were adjusted for their periods.
    """
    normal, lognormal = _reference(people, sessions)
    return np.maximum(_tail_share(normal, statistic), _tail_share(lognormal, statistic))


def critical_statistic(people: int, alpha: float, sessions: SessionPeriods | None = None) -> float:
    """Return the smallest statistic whose `skewed_p` is at most `alpha`."""
    allowed = int(np.floor(alpha * (REFERENCE_STUDY_COUNT + 1.0) - 1.0 + 1e-9))
    own = _reference(people, sessions)
    return max(float(np.nextafter(each[-1 - allowed], np.inf)) for each in own) if allowed >= 0 else np.inf


def mean_p_values(
    lower: np.ndarray, upper: np.ndarray, low: float, high: float, *, allowance: float = 0.0,
    sessions: SessionPeriods | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return the p values of "the mean lies within" and "the mean lies beyond" a margin from `low` to `high`.

    `lower` and `upper`, (..., n), are bounds of the differences, or twice the differences themselves; p have shape
    (...). Differences of ordered `sessions` come adjusted for the periods, and widened. Both claims hold even if the
    mean is off by an `allowance`.
    """
    n = lower.shape[-1]
    inside = np.minimum(_statistics(lower, low + allowance), _statistics(-upper, allowance - high))
    beyond = np.maximum(_statistics(lower, high + allowance), _statistics(-upper, allowance - low))
    return skewed_p(inside, n, sessions), skewed_p(beyond, n, sessions)


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


def _reference(people: int, sessions: SessionPeriods | None) -> tuple[np.ndarray, np.ndarray]:
    if sessions is None or people > MAX_REFERENCE_PEOPLE or adjustment(people, sessions).is_plain:
        return _reference_statistics(min(people, MAX_REFERENCE_PEOPLE), ())
    return _reference_statistics(people, sessions.key)


@lru_cache(maxsize=64)
def _reference_statistics(people: int, periods: tuple) -> tuple[np.ndarray, np.ndarray]:
    """Return sorted statistics of normal and lognormal studies about their true means.

    The statistics are those of a mean that lies too high because of a tail downwards. `periods` are the contrasts of
    ordered sessions, for whose effects the studies are adjusted; () for none.
    """
    rng = np.random.default_rng([REFERENCE_SEED, people])
    ordered = SessionPeriods(np.array(periods), np.empty((people, 0))) if periods else None
    adjusted = adjustment(people, ordered)

    def statistics(drawn: np.ndarray, mean: float) -> np.ndarray:
        return student_statistics(adjusted.widened(adjusted.adjusted(drawn)), mean)

    found: tuple[list[np.ndarray], ...] = ([], [])
    part = max(1, min(REFERENCE_STUDY_COUNT, 2_000_000 // people))
    for first in range(0, REFERENCE_STUDY_COUNT, part):
        z = rng.standard_normal((min(part, REFERENCE_STUDY_COUNT - first), people))
        found[0].append(statistics(z, 0.0))
        found[1].append(statistics(-np.exp(LOGNORMAL_SIGMA * z), -float(np.exp(0.5 * LOGNORMAL_SIGMA**2))))
    normal, lognormal = (np.sort(np.concatenate(each)) for each in found)
    return normal, lognormal


@dataclass(frozen=True)
class SignedRankTest:
    """The outcome of a signed-rank test."""

    statistic: float  # W+
    p_value: float  # exact two-sided p value
    rank_biserial: float  # matched rank-biserial correlation, -1 to 1
    pairs: int  # number of pairs that differ


def signed_rank(differences: np.ndarray, scale: float | None = None) -> SignedRankTest:
    """Return the signed-rank test of paired `differences`, (n,), against 0.

    `scale` is the size of the values that they are differences of; by default that of the largest difference.
    """
    d = np.asarray(differences, float)
    if d.ndim != 1 or not len(d) or not np.isfinite(d).all():
        raise PellucidError(f"signed ranks: found differences of shape {d.shape}, expected (n,) finite numbers")
    signs = tied_signs(d, scale)
    d = d[signs != 0.0]
    if not len(d):
        return SignedRankTest(0.0, 1.0, 0.0, 0)
    ranks = tied_ranks(np.abs(d), scale)
    above = float(ranks[d > 0.0].sum())
    total = float(ranks.sum())
    chance = sign_distribution(np.rint(2.0 * ranks).astype(int))
    # Sums are counted in half ranks, so that ties are integers.
    far = np.abs(np.arange(len(chance)) - total) >= abs(2.0 * above - total) - 1e-9
    return SignedRankTest(above, float(min(1.0, chance[far].sum())), (2.0 * above - total) / total, len(d))


def sign_distribution(weights: np.ndarray) -> np.ndarray:
    """Return the probability of every sum of `weights` if each is included with probability 1/2.

    `weights` are integers above 0; the result has shape (sum of weights + 1,).
    """
    chance = np.zeros(int(np.sum(weights)) + 1)
    chance[0] = 1.0
    for weight in weights:
        moved = np.zeros_like(chance)
        moved[weight:] = chance[: len(chance) - weight]
        chance = 0.5 * (chance + moved)
    return chance


def rank_sums(differences: np.ndarray) -> np.ndarray:
    """Return W+ of each row of differences, (k, n), shape (k,); a difference of 0 counts half its rank.

    This count keeps the distribution of n differences valid: a difference of 0 adds no evidence.
    """
    sizes = np.abs(differences)
    # Where no two are tied, sorting alone gives the ranks: each size takes its sign along in its last bit.
    coded = np.sort((sizes.view(np.int64) & ~1) | (differences > 0.0), axis=1)
    sizes = coded.view(np.float64)
    far = TIE_TOLERANCE * sizes[:, -1:]
    if (np.diff(sizes, axis=1) > far).all() and (sizes[:, 0] > np.max(far, initial=0.0)).all():
        return (coded & 1).astype(float) @ np.arange(1.0, sizes.shape[1] + 1.0)
    return np.sum(tied_ranks(np.abs(differences)) * (0.5 + 0.5 * tied_signs(differences)), axis=1)


def two_sided_p(above: np.ndarray, pairs: int) -> np.ndarray:
    """Return the exact two-sided p of each W+ (k,), of a number of `pairs` without ties; a W+ between two values is
    replaced by the less extreme one.
    """
    chance = _rank_sum_shares(pairs)
    below = np.minimum(above, pairs * (pairs + 1) / 2 - above)
    return np.minimum(2.0 * chance[np.ceil(below - 1e-9).astype(int)], 1.0)


@lru_cache(maxsize=64)
def _rank_sum_shares(pairs: int) -> np.ndarray:
    """Return the probability of at most every W+ of a number of `pairs` without ties."""
    return np.cumsum(sign_distribution(np.arange(1, pairs + 1)))


def smallest_p(pairs: int) -> float:
    """Return the smallest p value that a number of `pairs` can give: all differ to one side."""
    return min(1.0, 2.0 ** (1 - pairs))


def smallest_told_p(people: int, conditions: int) -> float:
    """Return the smallest p value with which Friedman's and Nemenyi's tests together tell a condition from control.

    Everybody then has the same order of conditions, with control at one end.
    """
    sums = people * np.arange(1.0, conditions + 1.0)
    return max(float(factorial(conditions)) ** (1 - people), float(_nemenyi(sums, people)[0, -1]))


BOOTSTRAP_RESAMPLES = 10_000
"""Number of bootstrap resamples of an interval."""


@dataclass(frozen=True)
class ControlComparison:
    """Comparison of one condition with the control."""

    condition: str
    change: float  # mean over participants of the difference from control, in the index's unit
    interval: tuple[float, float]  # confidence interval of `change`; NaN with fewer than 3 participants
    relative: float | None  # change of the mean as a share of control's mean; None if that mean is 0 or less
    p_value: float  # exact p value of the signed-rank test, not corrected
    holm: float  # the same p value, corrected after Holm
    rank_biserial: float  # matched rank-biserial correlation, -1 to 1
    cliff: float  # Cliff's delta, -1 to 1
    standardised: float  # mean over standard deviation of the differences (Cohen's d of pairs)
    deviation: float  # standard deviation of the differences, with n - 1

    @property
    def p(self) -> float:
        """p value corrected for all comparisons with the control (Holm)."""
        return self.holm


@dataclass(frozen=True, eq=False)
class ConditionComparison:
    """Comparison of conditions over participants.

    Attributes
    ----------
    conditions : tuple of str
    values : ndarray, shape (n, k)
        One row a participant.
    friedman : FriedmanTest or None
        None with fewer than 2 participants, or where nobody's values differ.
    kendall : float
        W; NaN without a test.
    nemenyi : ndarray, shape (k, k), or None
    against_control : tuple of ControlComparison
        Empty where the control is none of the conditions, or there are fewer than 2 participants.
    confidence : float
        Confidence level of the intervals.
    left_out : tuple of int
        Rows of participants who lacked a value.
    """

    conditions: tuple[str, ...]
    values: np.ndarray
    friedman: FriedmanTest | None
    kendall: float
    nemenyi: np.ndarray | None
    against_control: tuple[ControlComparison, ...]
    confidence: float = 0.95
    left_out: tuple[int, ...] = ()

    @property
    def pairwise(self) -> Mapping[str, ControlComparison]:
        """Each other condition against the control, by its name."""
        return {each.condition: each for each in self.against_control}

    @property
    def p_value(self) -> float | None:
        """Friedman's p, counted where it can be; None without a test."""
        if self.friedman is None:
            return None
        exact = self.friedman.exact_p_value
        return self.friedman.p_value if exact is None else exact

    def pair(self, one: str, other: str) -> float:
        """Nemenyi's p of two conditions; NaN without a test."""
        if self.nemenyi is None:
            return float("nan")
        return float(self.nemenyi[self.conditions.index(one), self.conditions.index(other)])

    @property
    def headline(self) -> str:
        """Return one line with the numbers of participants and conditions, and Friedman's test."""
        n, k = self.values.shape
        said = f"{n} participants, {k} conditions"
        said += f", {len(self.left_out)} excluded for missing values" if self.left_out else ""
        if self.friedman is None:
            return f"{said}: no test"
        test = self.friedman
        return (
            f"{said}: Friedman chi2({test.degrees_of_freedom}) = {test.statistic:.3g}, p = {test.p:.2g}, "
            f"Kendall's W = {self.kendall:.2g}"
        )

    def _table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        level = f"{100.0 * self.confidence:g} % interval"
        rows: list[tuple[str, ...]] = []
        against = self.pairwise
        for name, mean in zip(self.conditions, self.values.mean(axis=0), strict=True):
            found = against.get(name)
            rows.append(
                (name, f"{mean:.4g}", *[""] * 5)
                if found is None
                else (
                    name, f"{mean:.4g}", f"{found.change:+.3g}", "[{:.3g}, {:.3g}]".format(*found.interval),
                    f"{found.p:.2g}", f"{found.standardised:.2g}", f"{found.cliff:.2g}",
                )
            )  # fmt: skip
        return ("condition", "mean", "change", level, "p (Holm)", "d", "Cliff's delta"), rows

    def __str__(self) -> str:
        return f"{self.headline}\n\n{text_table(*self._table())}"

    def _repr_html_(self) -> str:
        return html_table(self.headline, *self._table())


@with_checked_arguments
def compare_conditions(
    values: ArrayLike,
    conditions: Sequence[str],
    control: str | None = None,
    *,
    against_zero: bool = False,
    confidence: float = 0.95,
    missing: Literal["refuse", "leave out"] = "refuse",
    rng: np.random.Generator | None = None,
) -> ConditionComparison:
    """Compare conditions over participants who did all of them: rank tests, effect sizes and intervals.

    Parameters
    ----------
    values : array_like, shape (n, k)
        One row a participant, one column a condition, in any one unit.
    conditions : sequence of str
        Names of the columns.
    control : str, optional
        Name of the condition with which the others are compared.
    against_zero : bool
        Values are changes from a control that is not among them, and are compared with 0.
    confidence : float
        Confidence level of the intervals, in (0, 1).
    missing : str
        What to do with a participant who lacks a value (NaN): ``"refuse"``, or ``"leave out"`` of everything.
    rng : numpy.random.Generator, optional
        Generator of the bootstrap; by default one with a fixed seed.

    Returns
    -------
    ConditionComparison
        ``.friedman.p`` for all conditions; by condition, ``.pairwise[name]`` with its ``p`` (signed ranks, corrected
        after Holm), ``change``, ``interval``, ``standardised`` (Cohen's d of pairs), ``cliff`` and ``rank_biserial``.

    Raises
    ------
    PellucidError
        If a value is missing, shapes do not fit, names of conditions repeat, or the control is none of them.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> rng = np.random.default_rng(1)
    >>> duration = rng.normal(1.0, 0.1, (8, 1)) + rng.normal(0.0, 0.02, (8, 3)) + np.array([0.0, 0.01, 0.2])
    >>> found = pl.compare_conditions(duration, ["Ctrl", "FC", "CLPC"], control="Ctrl")
    >>> found.friedman.p < 0.01, round(found.pairwise["CLPC"].p, 3)
    (True, 0.016)
    >>> low, high = found.pairwise["CLPC"].interval
    >>> bool(low < 0.2 < high)
    True
    """
    values = np.asarray(values, float)
    conditions = tuple(conditions)
    if values.ndim != 2 or values.shape[1] != len(conditions) or not len(values):
        raise PellucidError(
            f"comparison: found values of shape {values.shape}, expected participants x {len(conditions)} conditions "
            f"({', '.join(conditions)})"
        )
    if len(set(conditions)) < len(conditions):
        raise PellucidError(f"comparison: found the conditions {', '.join(conditions)}, expected each name once")
    if control is not None and control not in conditions and not against_zero:
        raise PellucidError(f"comparison: found the control {control!r}, expected one of {', '.join(conditions)}")
    if missing not in ("refuse", "leave out"):
        raise PellucidError(f'comparison: found missing = {missing!r}, expected "refuse" or "leave out"')
    if not 0.0 < confidence < 1.0:
        raise PellucidError(f"comparison: found the confidence {confidence!r}, expected a share between 0 and 1")
    lacking = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(lacking) and (missing == "refuse" or len(lacking) == len(values)):
        row, column = np.argwhere(~np.isfinite(values))[0]
        raise PellucidError(
            f"comparison: found no value of participant {row} (row) in {conditions[column]}, and {len(lacking)} of "
            f'{len(values)} participants lack one, expected one each; missing="leave out" compares the others'
        )
    values = np.delete(values, lacking, axis=0)
    rng = np.random.default_rng(0) if rng is None else rng
    n, k = values.shape
    test, pairs, kendall = None, None, float("nan")
    if n > 1 and k > 1 and tie_groups(values, axis=1).any():
        try:
            test = friedman(values, exact=True)
        except PellucidError:  # too many to count
            test = friedman(values)
        pairs, kendall = nemenyi(values), test.statistic / (n * (k - 1))
    found: list[ControlComparison] = []
    if (against_zero or control is not None) and n > 1:
        base = np.zeros(n) if against_zero else values[:, conditions.index(control)]
        others = [(j, name) for j, name in enumerate(conditions) if against_zero or name != control]
        found = [_compare_with_control(values[:, j], base, name, confidence, rng) for j, name in others]
        corrected = holm([each.p_value for each in found])
        found = [replace(each, holm=p) for each, p in zip(found, corrected, strict=True)]
    return ConditionComparison(
        conditions, values, test, kendall, pairs, tuple(found), confidence, tuple(int(i) for i in lacking)
    )


def _compare_with_control(
    own: np.ndarray, control: np.ndarray, name: str, confidence: float, rng: np.random.Generator
) -> ControlComparison:
    """Return the comparison of one condition with the control, its p value not yet corrected."""
    d = own - control
    scale = scale_of(own, control)
    test = signed_rank(d, scale)
    deviation = float(np.std(d, ddof=1))
    deviation = deviation if deviation > TIE_TOLERANCE * scale else 0.0
    mean = float(control.mean())
    relative = float(own.mean() / mean - 1.0) if mean > 0.0 else None
    dominance = tied_signs(own[:, None] - control[None, :], scale)
    # Where nobody changes, such as by an index that is 0 in both conditions, there is no effect.
    unscaled = float("nan") if d.any() else 0.0
    standardised = float(d.mean() / deviation) if deviation > 0.0 else unscaled
    interval = mean_interval(d, confidence, rng)
    return ControlComparison(
        condition=name,
        change=float(d.mean()),
        interval=interval,
        relative=relative,
        p_value=test.p_value,
        holm=test.p_value,
        rank_biserial=test.rank_biserial,
        cliff=float(dominance.mean()),
        standardised=standardised,
        deviation=deviation,
    )


def mean_interval(samples: np.ndarray, confidence: float, rng: np.random.Generator) -> tuple[float, float]:
    """Return the bootstrap interval of the mean of `samples`, shape (n,), at a `confidence` level.

    The interval is widened for small samples, and NaN with fewer than 3.
    """
    n = len(samples)
    if n < 3:
        return float("nan"), float("nan")
    means = rng.choice(np.asarray(samples, float), (BOOTSTRAP_RESAMPLES, n)).mean(axis=1)
    tail = float(ndtr(-np.sqrt(n / (n - 1.0)) * stdtrit(n - 1, 0.5 + 0.5 * confidence)))
    low, high = np.quantile(means, (tail, 1.0 - tail))
    return float(low), float(high)
