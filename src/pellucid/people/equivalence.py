r"""Is a change small enough not to matter? Equivalence of paired values within a margin that was stated beforehand.

A test that finds no difference shows none to be absent. Two one-sided tests turn the question round [1]_: the null
hypotheses are that the change is at or beyond the lower margin, and at or beyond the upper one; both refused at level
:math:`\alpha`, the change lies within. This is the same as an interval of confidence :math:`1 - 2\alpha` that lies
within the margins.

Each side is a test of the differences d less that margin. For the mean it is Student's statistic, judged by its least
favourable skewed distribution (`mean_p_values`); Student's t, whose level does not hold for skewed differences, is
there to compare with. For the pseudo-median it is counted signed ranks, exact where differences are as likely above as
below it. Ranks count through the means of all pairs of differences, Walsh's averages: as many of them
lie above a margin as W+ says, so the interval's ends are two of them [2]_.

Neither mean nor pseudo-median says that everybody is spared. Beside them stands how many people lie within the margin,
with a lower confidence bound of their share after Clopper and Pearson, which supposes no distribution: twelve of twelve
show 78 % at most.

That a change is *beyond* a margin is a claim too, with a test of its own; between both nothing can be said.

A difference may be known by bounds alone, where a duration was cut off: "above the lower margin" is then tested with
the lower bounds and "below the upper" with the upper ones, which may be infinite. Whatever the differences are in
truth, nothing is claimed that they would not show.

Beside them stands a Bayes factor of "within" against "beyond" [3]_: by how much the data move the odds that the change
over the standard deviation of changes lies within the margins, from a Cauchy prior of scale :math:`\sqrt{1/2}`.

.. [1] D. J. Schuirmann, "A comparison of the two one-sided tests procedure and the power approach", J. Pharmacokin.
   Biopharm. 15, 1987.
.. [2] M. Hollander, D. A. Wolfe, E. Chicken, "Nonparametric Statistical Methods", 3rd ed., 2014, sec. 3.3.
.. [3] R. D. Morey, J. N. Rouder, "Bayes factor approaches for testing interval null hypotheses", Psychol. Methods 16,
   2011.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, nan
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from .._errors import PellucidError
from ..numerics.tied_ranks import TIE_TOLERANCE, scale_of, tied_signs
from .comparison import critical_statistic, mean_p_values, sign_distribution

Method = Literal["skew_robust", "signed_rank", "t"]
METHODS = ("skew_robust", "signed_rank", "t")

WITHIN_MARGIN = "within"
"""Verdict if the change lies within its margin at level alpha."""

BEYOND_MARGIN = "beyond"
"""Verdict if the change lies beyond its margin at level alpha."""

UNDECIDED = "undecided"
"""Verdict if neither is significant."""

FAR_MARGIN_COUNT = 3.0
"""A person lies far beyond if the change leaves the middle of the margin by more than this many of its half-widths."""

PRIOR_SCALE = 0.5**0.5
"""Scale of the Cauchy prior on the standardised change."""


@dataclass(frozen=True)
class Margin:
    """Largest change that does not matter: from `low` to `high`, in the unit of the differences; one may be
    infinite."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not self.low < self.high or (self.low == -inf and self.high == inf):
            raise PellucidError(f"margin: found {self.low:g} to {self.high:g}, expected a low end below a high one")

    def excess(self, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Return how many half-widths differences between bounds (..., n) may lie from the middle; at most 1 is within.

        Of a margin with one end the half-width is the distance of that end from 0.
        """
        if np.isinf(self.low) or np.isinf(self.high):
            end, worst = (self.high, upper) if np.isinf(self.low) else (-self.low, -lower)
            return 1.0 + (worst - end) / abs(end) if end else np.where(worst > 0.0, inf, 0.0)
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return np.maximum(upper - middle, middle - lower) / half

    @classmethod
    def either_way(cls, size: float) -> Margin:
        """Return the margin from -`size` to `size`."""
        return cls(-abs(size), abs(size))

    @classmethod
    def of_ratio(cls, share: float) -> Margin:
        """Return the margin for logarithms of ratios: from 1/(1 + share) to 1 + share."""
        return cls.either_way(float(np.log1p(share)))


@dataclass(frozen=True, eq=False)
class Equivalence:
    """Result of the test of paired differences against a margin."""

    margin: Margin
    pairs: int
    estimate: float  # location of the differences, in their unit: the Hodges-Lehmann estimate, or the mean
    interval: tuple[float, float]  # interval at level 1 - 2 alpha; infinite ends with too few pairs
    p_within: float  # p value of "within": the larger of the two one-sided tests
    p_beyond: float  # p value of "beyond": the smaller of the two one-sided tests
    alpha: float
    method: str
    differences: np.ndarray = field(repr=False)  # (n,); lower bounds if bounded; empty if a model was fitted
    bounded: int = 0  # number of differences that are known by bounds alone
    upper: np.ndarray | None = field(default=None, repr=False)  # (n,); upper bounds if bounded

    @property
    def excess(self) -> np.ndarray:
        """Distance of each person's difference, in half-widths of the margin (`Margin.excess`), (n,)."""
        return self.margin.excess(self.differences, self.differences if self.upper is None else self.upper)

    @property
    def people_within(self) -> int:
        """Number of people whose difference lies within the margin."""
        return int(np.sum(self.excess <= 1.0 + TIE_TOLERANCE))

    @property
    def share_within(self) -> float:
        """Lower confidence bound, at level alpha, of the share of people who lie within; NaN for a model."""
        return share_bound(self.people_within, len(self.differences), self.alpha) if len(self.differences) else nan

    @property
    def far_people(self) -> tuple[int, ...]:
        """Rows of the people who are known to lie far beyond the margin, the farthest first."""
        if not len(self.differences):
            return ()
        upper = self.differences if self.upper is None else self.upper
        inside = 0.5 * (self.margin.low + self.margin.high)
        inside = inside if np.isfinite(inside) else (-inf if self.margin.low == -inf else inf)
        nearest = np.clip(inside, self.differences, upper)
        excess = self.margin.excess(nearest, nearest)
        far = np.flatnonzero(excess > FAR_MARGIN_COUNT)
        return tuple(int(i) for i in far[np.argsort(-excess[far], kind="stable")])

    @property
    def bayes_factor(self) -> float:
        """Bayes factor of "within" against "beyond"; NaN for a model, and if differences are known by bounds alone."""
        if self.bounded or len(self.differences) < 2:
            return nan
        return interval_bayes_factor(self.differences, self.margin)

    @property
    def verdict(self) -> str:
        """``"within"``, ``"beyond"`` or ``"undecided"``, each tested by itself at level alpha."""
        if self.p_within <= self.alpha:
            return WITHIN_MARGIN
        return BEYOND_MARGIN if self.p_beyond <= self.alpha else UNDECIDED


def equivalence(
    differences: ArrayLike,
    margin: Margin,
    *,
    upper: ArrayLike | None = None,
    alpha: float = 0.05,
    method: Method = "skew_robust",
) -> Equivalence:
    """Test whether paired differences lie within a margin.

    Parameters
    ----------
    differences : array_like, shape (n,)
        One difference for each participant, in any one unit.
    margin : Margin
        Margin in the same unit.
    upper : array_like, shape (n,), optional
        Upper bounds, if the differences are known by bounds alone and `differences` are the lower ones; infinite if
        there is no bound. Only ``"skew_robust"``, which then claims nothing, and ``"signed_rank"`` accept them.
    alpha : float
        Level of each one-sided test, in (0, 0.5).
    method : str
        ``"skew_robust"`` or ``"t"`` for the mean; ``"signed_rank"`` for the pseudo-median.

    Returns
    -------
    Equivalence

    Raises
    ------
    PellucidError
        If there are fewer than 2 differences, one is no number, or bounds do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> changes = np.random.default_rng(1).normal(0.01, 0.03, 16)
    >>> found = equivalence(changes, Margin.either_way(0.08))
    >>> found.verdict, found.people_within, round(found.share_within, 2)
    ('within', 16, 0.83)
    >>> equivalence(changes[:8], Margin.either_way(0.08)).verdict
    'undecided'
    """
    d = np.asarray(differences, float)
    high = d if upper is None else np.asarray(upper, float)
    if d.ndim != 1 or len(d) < 2 or not (np.isfinite(d) if upper is None else ~np.isnan(d)).all():
        raise PellucidError(f"equivalence: found differences of shape {d.shape}, expected (n,) finite numbers, n >= 2")
    if high.shape != d.shape or not (high >= d).all():
        raise PellucidError(f"equivalence: found upper bounds of shape {high.shape}, expected {d.shape}, none below")
    if not 0.0 < alpha < 0.5:
        raise PellucidError(f"equivalence: found the level {alpha!r}, expected one between 0 and 0.5")
    if method not in METHODS:
        raise PellucidError(f"equivalence: found the method {method!r}, expected one of {', '.join(METHODS)}")
    bounded = int(np.sum(high > d))
    if bounded and method == "t":
        raise PellucidError(f"equivalence: found bounds and the method {method!r}, expected skew_robust or signed_rank")
    ends = high if bounded else None
    if method == "skew_robust":
        within, beyond = (float(p) for p in mean_p_values(d, high, margin.low, margin.high))
        interval = (_mean_end(d, alpha), -_mean_end(-high, alpha))
        known = d if np.isfinite(d).all() else high
        middle = float(known.mean()) if np.isfinite(known).all() else nan
        return Equivalence(margin, len(d), middle, interval, within, beyond, alpha, method, d, bounded, ends)
    if method == "t":
        error = float(np.std(d, ddof=1)) / np.sqrt(len(d))
        return equivalence_of_estimate(float(d.mean()), error, len(d) - 1, margin, alpha=alpha, differences=d)
    p_above, interval = _test_by_ranks(d, high, alpha)
    known = d if np.isfinite(d).all() else high
    middle = float(np.median(walsh_averages(known))) if np.isfinite(known).all() else nan
    within = max(p_above(margin.low, d), p_above(-margin.high, -high))
    beyond = min(p_above(-margin.low, -high), p_above(margin.high, d))
    return Equivalence(margin, len(d), middle, interval, within, beyond, alpha, method, d, bounded, ends)


def share_bound(count: int, people: int, alpha: float) -> float:
    """Return the lower confidence bound of a share of which `count` of a number of `people` have been seen."""
    return float(stats.beta.ppf(alpha, count, people - count + 1)) if count else 0.0


def people_for_share(share: float, alpha: float) -> int:
    """Return the fewest people, all of them within, whose lower confidence bound reaches a `share` in (0, 1)."""
    return max(int(np.ceil(np.log(alpha) / np.log(share) - 1e-9)), 2)


def equivalence_of_estimate(
    estimate: float,
    error: float,
    degrees: float,
    margin: Margin,
    *,
    alpha: float = 0.05,
    method: str = "t",
    pairs: int = 0,
    differences: np.ndarray | None = None,
) -> Equivalence:
    """Return the two one-sided t tests of an `estimate` with its standard `error` and `degrees` of freedom.

    The estimate is that of `differences`, (n,), or of a number of `pairs`.
    """
    own = np.empty(0) if differences is None else differences

    def p_above(gap: float) -> float:
        if error == 0.0:
            return 0.0 if gap > 0.0 else 1.0
        return float(stats.t.sf(gap / error, degrees))

    reach = float(stats.t.isf(alpha, degrees)) * error
    inner, outer = (estimate - margin.low, margin.high - estimate), (margin.low - estimate, estimate - margin.high)
    return Equivalence(
        margin, pairs or len(own), estimate, (estimate - reach, estimate + reach), max(map(p_above, inner)),
        min(map(p_above, outer)), alpha, method, own,
    )  # fmt: skip


def unknown_equivalence(margin: Margin, pairs: int, method: str, alpha: float = 0.05) -> Equivalence:
    """Return the undecided result of a method that failed: its interval is infinite and its p values are 1."""
    return Equivalence(margin, pairs, nan, (-inf, inf), 1.0, 1.0, alpha, method, np.empty(0))


def walsh_averages(differences: np.ndarray) -> np.ndarray:
    """Return the means of all pairs of differences (n,), each with itself too; shape (n (n + 1)/2,), sorted."""
    i, j = np.triu_indices(len(differences))
    return np.sort(0.5 * (differences[i] + differences[j]))


def critical_rank_sum(pairs: int, alpha: float) -> int | None:
    """Return the smallest W+ of a number of `pairs` whose one-sided p value is at most `alpha`; None without one."""
    chance = sign_distribution(np.arange(1, pairs + 1))
    tail = np.cumsum(chance[::-1])[::-1]
    enough = np.flatnonzero(tail <= alpha * (1.0 + 1e-12))
    return int(enough[0]) if len(enough) else None


def _mean_end(differences: np.ndarray, alpha: float) -> float:
    """Return the lower end of the interval of the mean of `differences`, (n,); -infinite with unknown bounds."""
    if not np.isfinite(differences).all():
        return -inf
    error = float(np.std(differences, ddof=1)) / np.sqrt(len(differences))
    return float(differences.mean() - critical_statistic(len(differences), alpha) * error)


def _test_by_ranks(d: np.ndarray, high: np.ndarray, alpha: float):
    tail = np.cumsum(sign_distribution(np.arange(1, len(d) + 1))[::-1])[::-1]

    def p_above(margin: float, d: np.ndarray) -> float:
        if margin == -inf:
            return float(tail[-1])
        if margin == inf:
            return 1.0
        # A Walsh average equal to the margin does not count as above it: ties are no evidence.
        above = tied_signs(walsh_averages(d) - margin, scale_of(d, np.array([margin])))
        return float(tail[int(np.sum(above > 0.0))])

    needed = critical_rank_sum(len(d), alpha)
    if needed is None:
        return p_above, (-inf, inf)
    return p_above, (float(walsh_averages(d)[-needed]), float(walsh_averages(high)[needed - 1]))


def interval_bayes_factor(differences: np.ndarray, margin: Margin) -> float:
    """Return the Bayes factor of "within" against "beyond" the margin; NaN if all differences are equal."""
    n, spread = len(differences), float(np.std(differences, ddof=1))
    if spread == 0.0:
        return nan
    t = float(np.mean(differences)) / spread * np.sqrt(n)
    low, high = margin.low / spread, margin.high / spread
    # The grid is uniform in the quantiles of the Cauchy prior, so that all points have the same prior weight.
    angle = (np.arange(4000) + 0.5) / 4000.0
    effect = PRIOR_SCALE * np.tan(np.pi * (angle - 0.5))
    log_likelihood = (
        stats.nct.logpdf(t, n - 1, np.clip(effect * np.sqrt(n), -37.0, 37.0))
        if n < 2000
        else (-0.5 * (t - effect * np.sqrt(n)) ** 2)
    )
    log_likelihood = np.where(np.isfinite(log_likelihood), log_likelihood, -inf)
    weight = np.exp(log_likelihood - np.max(log_likelihood))
    inside = (effect > low) & (effect < high)
    # Both parts are summed by themselves: 1 minus the one is rounding error where the other is all there is.
    if inside.all() or not inside.any():
        return nan
    with np.errstate(divide="ignore"):
        return float(np.divide(weight[inside].mean(), weight[~inside].mean()))
