r"""Equivalence of paired values: test whether a change lies within a margin that was stated beforehand.

A test that finds no difference shows none to be absent. Two one-sided tests turn the question round [1]_: the null
hypotheses are that the change is at or beyond the lower margin, and at or beyond the upper one; both refused at level
:math:`\alpha`, the change lies within. This is the same as an interval of confidence :math:`1 - 2\alpha` that lies
within the margins.

Each side is a test of the differences d minus that margin. For the mean the test uses Student's statistic with its
least favourable skewed distribution (`mean_p_values`). Student's t-test exceeds its level for skewed differences and
serves for comparison only. For the pseudo-median the test uses signed ranks, and it is exact for symmetric
differences. W+ is the number of Walsh averages (means of all pairs of differences) above a margin. The interval's ends
are therefore two of these averages [2]_.

Neither mean nor pseudo-median says that everybody is spared. Beside them stand the share of people within the margin
and the share far beyond it, with their bounds (`share_of_people`).

Where sessions came in an order, the effects of their periods are taken out of people's differences first
(`session_periods`). Both claims hold for any carry-over up to a declared one: the margin is narrower for "within", and
wider for "beyond", by as much as that carry-over could move the estimate.

A change *beyond* a margin is also a claim with its own test. If neither claim holds, the result is undecided.

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
from typing import Literal, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike

from .._errors import PellucidError
from ..numerics.tied_ranks import TIE_TOLERANCE, scale_of, tied_signs
from .comparison import critical_statistic, mean_p_values, rank_sums, sign_distribution, student_statistics
from .margin import Margin
from .movement_noise import MovementNoise
from .session_periods import Adjustment, SessionPeriods, adjustment
from .share_of_people import DEFAULT_RULE, ShareRule, ShareTest, far_people_p, limits, share_p_values, share_test

Method = Literal["skew_robust", "signed_rank", "t"]
METHODS = ("skew_robust", "signed_rank", "t")

WITHIN_MARGIN = "within"
"""Verdict if the change lies within its margin at level alpha."""

BEYOND_MARGIN = "beyond"
"""Verdict if the change, or too many people, lie beyond the margin at level alpha."""

UNDECIDED = "undecided"
"""Verdict if neither is significant."""

DEFAULT_CARRY_OVER = 0.25
"""Largest carry-over that is assumed, in half-widths of the margin, unless a study declares another."""

MAX_TIPPING_POINT = 10.0
"""Carry-overs up to this many half-widths of the margin are tried for the tipping point."""

MAX_BAYES_FACTOR = 1000.0
"""Largest reported Bayes factor; larger ones depend on the tails of the prior and not on the data."""

TINY = float(np.finfo(float).tiny)
"""Half-width of a margin around no change: a change as small as this cannot be told from none."""

PRIOR_SCALE = 0.5**0.5
"""Scale of the Cauchy prior on the standardised change."""


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
    # People's differences, adjusted for periods, (n,); lower bounds if bounded; empty if a model was fitted
    differences: np.ndarray = field(repr=False)
    bounded: int = 0  # number of differences that are known by bounds alone
    upper: np.ndarray | None = field(default=None, repr=False)  # (n,); upper bounds if bounded

    sessions: SessionPeriods | None = field(default=None, repr=False)  # when people had both conditions, if stated
    largest_carry_over: float = 0.0  # largest carry-over for which both claims hold, in half-widths of the margin
    noise: MovementNoise | None = None  # noise of people's differences by their movements, if it is known

    @property
    def highest(self) -> np.ndarray:
        """Upper bounds of the differences, (n,); the differences themselves if they are known."""
        return self.differences if self.upper is None else self.upper

    @property
    def fit(self) -> Adjustment:
        """How the differences were adjusted for periods."""
        return adjustment(len(self.differences), self.sessions, known=not self.bounded)

    @property
    def allowance(self) -> float:
        """Largest shift of the estimate by the largest carry-over, in the unit of the differences."""
        return _allowance(self.margin, self.fit, self.largest_carry_over) if len(self.differences) else 0.0

    def share_test(self, rule: ShareRule = DEFAULT_RULE) -> ShareTest:
        """Return the tests of the shares of people within and far beyond the margin; nothing is shown for a model."""
        if not len(self.differences):
            return ShareTest(rule, 0, 0, 0, 1.0, 1.0, nan, nan)
        return share_test(self.differences, self.highest, self.margin, self.fit, allowance=self.allowance, rule=rule,
                          noise=self.noise)  # fmt: skip

    def shows_people(self, rule: ShareRule = DEFAULT_RULE) -> bool:
        """Return whether the shares of people within and far beyond the margin are shown."""
        if not len(self.differences):
            return False
        shares = share_p_values(
            self.differences, self.highest, self.margin, self.fit, allowance=self.allowance, rule=rule,
            noise=self.noise,
        )
        return bool(max(shares) <= rule.alpha)

    def tested_again(self, *, alpha: float | None = None, largest_carry_over: float | None = None) -> Equivalence:
        """Return the same test at another level, or for another largest carry-over."""
        return equivalence(
            self.differences,
            self.margin,
            upper=self.upper,
            alpha=self.alpha if alpha is None else alpha,
            method=cast("Method", self.method),
            sessions=self.sessions,
            largest_carry_over=self.largest_carry_over if largest_carry_over is None else largest_carry_over,
            noise=self.noise,
        )

    def tipping_point(self, rule: ShareRule = DEFAULT_RULE) -> float | None:
        """Return the carry-over, in half-widths of the margin, that overturns the verdict of the differences.

        None if there is no verdict to overturn, or no carry-over moves it: sessions are not stated, or too few.
        """
        if not len(self.differences) or self.fit.carry_over_share == 0.0:
            return None

        def says(carry_over: float) -> str:
            again = self.tested_again(largest_carry_over=carry_over)
            return again.verdict if again.verdict != WITHIN_MARGIN or again.shows_people(rule) else UNDECIDED

        said = says(0.0)
        if said == UNDECIDED:
            return None
        low, high = 0.0, MAX_TIPPING_POINT
        while high - low > 0.005:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if says(middle) == said else (low, middle)
        return low

    @property
    def p_far(self) -> float:
        """p value of "more people lie far beyond the margin than a transparent robot may have"; 1 for a model."""
        if not len(self.differences):
            return 1.0
        return far_people_p(self.differences, self.highest, self.margin, allowance=self.allowance, noise=self.noise)

    @property
    def p_no_change(self) -> float:
        """Two-sided p value of "no change", by the test of the interval; NaN for a model.

        It is below 2 alpha exactly where the interval, of confidence 1 - 2 alpha, excludes 0.
        """
        if not len(self.differences):
            return nan
        zero = Margin(-TINY, TINY)
        method = cast("Method", self.method)
        beyond = margin_p_values(self.differences, self.highest, zero, self.fit, method, self.sessions, 0.0)[1]
        return min(1.0, 2.0 * float(beyond))

    @property
    def people_within(self) -> int:
        """Number of people whose difference lies within the margin."""
        return self.share_test().within

    @property
    def share_within(self) -> float:
        """Lower confidence bound of the share of people who lie within; NaN for a model and with too few people."""
        return self.share_test().least_within

    @property
    def far_people(self) -> tuple[int, ...]:
        """Rows of the people who are known to lie far beyond the margin, the farthest first."""
        if not len(self.differences):
            return ()
        low, high = limits(self.margin, DEFAULT_RULE.far_margins)
        beyond = np.maximum(low - self.highest, self.differences - high)
        far = np.flatnonzero(beyond > TIE_TOLERANCE * self.margin.half_width)
        return tuple(int(i) for i in far[np.argsort(-beyond[far], kind="stable")])

    @property
    def bayes_factor(self) -> float:
        """Bayes factor of "within" against "beyond", up to `MAX_BAYES_FACTOR` either way.

        NaN for a model, and if differences are known by bounds alone.
        """
        if self.bounded or len(self.differences) < 2:
            return nan
        factor = interval_bayes_factor(self.differences, self.margin)
        return float(np.clip(factor, 1.0 / MAX_BAYES_FACTOR, MAX_BAYES_FACTOR))

    @property
    def verdict(self) -> str:
        """``"within"``, ``"beyond"`` or ``"undecided"``, each tested by itself at level alpha."""
        if self.p_within <= self.alpha:
            return WITHIN_MARGIN
        return BEYOND_MARGIN if min(self.p_beyond, self.p_far) <= self.alpha else UNDECIDED


def equivalence(
    differences: ArrayLike,
    margin: Margin,
    *,
    upper: ArrayLike | None = None,
    alpha: float = 0.05,
    method: Method = "skew_robust",
    sessions: SessionPeriods | None = None,
    largest_carry_over: float = DEFAULT_CARRY_OVER,
    noise: MovementNoise | None = None,
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
    sessions : SessionPeriods, optional
        When each participant had both conditions: the effects of the periods are taken out of finite differences.
    largest_carry_over : float
        Largest carry-over from one session to the next for which both claims hold, in half-widths of the margin. It
        matters only with `sessions`.
    noise : MovementNoise, optional
        Variance of the differences by the noise of movements, which is no difference between people.

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
    >>> found.verdict, found.people_within, found.share_test().answer
    ('within', 16, 'shown')
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
    if not 0.0 <= largest_carry_over < inf:
        raise PellucidError(
            f"equivalence: found largest_carry_over = {largest_carry_over:g}, expected a share of the margin, 0 or more"
        )
    ends = high if bounded else None
    fit = adjustment(len(d), sessions, known=not bounded)
    d, high = (d, high) if bounded else (fit.adjusted(d),) * 2
    allowance = _allowance(margin, fit, largest_carry_over)
    within, beyond = (float(p) for p in margin_p_values(d, high, margin, fit, method, sessions, allowance))
    estimate, interval = _location(d, high, alpha, fit, method, sessions)
    return Equivalence(
        margin, len(d), estimate, interval, within, beyond, alpha, method, d, bounded, ends, sessions,
        largest_carry_over, noise,
    )  # fmt: skip


def _allowance(margin: Margin, fit: Adjustment, largest_carry_over: float) -> float:
    return largest_carry_over * margin.half_width * fit.carry_over_share


def margin_p_values(
    lower: np.ndarray, upper: np.ndarray, margin: Margin, fit: Adjustment, method: Method,
    sessions: SessionPeriods | None, allowance: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return the p values of "within" and of "beyond" of many studies, shape (...) each.

    `lower` and `upper`, (..., n), are bounds of people's adjusted differences, or twice the differences themselves.
    """
    d, high = fit.widened(lower), fit.widened(upper)
    if method == "skew_robust":
        return mean_p_values(d, high, margin.low, margin.high, allowance=allowance,
                             sessions=None if fit.is_plain else sessions)  # fmt: skip
    above = _t_above if method == "t" else _ranks_above
    within = np.maximum(above(d, margin.low + allowance), above(-high, allowance - margin.high))
    beyond = np.minimum(above(-high, allowance - margin.low), above(d, margin.high + allowance))
    return within, beyond


def _location(
    d: np.ndarray, high: np.ndarray, alpha: float, fit: Adjustment, method: Method, sessions: SessionPeriods | None
) -> tuple[float, tuple[float, float]]:
    """Return the estimate of people's differences, (n,), and its interval at level 1 - 2 alpha."""
    known = d if np.isfinite(d).all() else high
    wide, wide_high = fit.widened(d), fit.widened(high)
    if method == "signed_rank":
        middle = float(np.median(walsh_averages(fit.widened(known)))) if np.isfinite(known).all() else nan
        needed = critical_rank_sum(len(d), alpha)
        if needed is None:
            return middle, (-inf, inf)
        return middle, (float(walsh_averages(wide)[-needed]), float(walsh_averages(wide_high)[needed - 1]))
    middle = float(known.mean()) if np.isfinite(known).all() else nan
    if method == "t":
        reach = float(scipy.stats.t.isf(alpha, len(d) - 1)) * float(np.std(wide, ddof=1)) / np.sqrt(len(d))
        return middle, (middle - reach, middle + reach)
    own = None if fit.is_plain else sessions
    return middle, (_mean_end(wide, alpha, own), -_mean_end(-wide_high, alpha, own))


def _t_above(differences: np.ndarray, value: float) -> np.ndarray:
    """Return the p value of Student's t that the mean of differences (..., n) lies above a value, shape (...)."""
    if np.isinf(value):
        return np.full(differences.shape[:-1], 0.0 if value < 0.0 else 1.0)
    return scipy.stats.t.sf(student_statistics(differences, value), differences.shape[-1] - 1)


def _ranks_above(differences: np.ndarray, value: float) -> np.ndarray:
    """Return the exact p value of signed ranks that differences (..., n) lie above a value, shape (...)."""
    n = differences.shape[-1]
    tail = np.cumsum(sign_distribution(np.arange(1, n + 1))[::-1])[::-1]
    if np.isinf(value):
        return np.full(differences.shape[:-1], tail[-1] if value < 0.0 else 1.0)
    if differences.ndim > 1 and np.isfinite(differences).all():
        return tail[np.floor(rank_sums(differences - value) + 1e-9).astype(int)]
    rows = [_walsh_above(each, value) for each in differences.reshape(-1, n)]
    return tail[np.array(rows)].reshape(differences.shape[:-1])


def _walsh_above(d: np.ndarray, value: float) -> int:
    # A Walsh average equal to the margin does not count as above it: ties are no evidence.
    above = tied_signs(walsh_averages(d) - value, scale_of(d, np.array([value])))
    return int(np.sum(above > 0.0))


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
        return float(scipy.stats.t.sf(gap / error, degrees))

    reach = float(scipy.stats.t.isf(alpha, degrees)) * error
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


def _mean_end(differences: np.ndarray, alpha: float, sessions: SessionPeriods | None = None) -> float:
    """Return the lower end of the interval of the mean of `differences`, (n,); -infinite with unknown bounds."""
    if not np.isfinite(differences).all():
        return -inf
    error = float(np.std(differences, ddof=1)) / np.sqrt(len(differences))
    return float(differences.mean() - critical_statistic(len(differences), alpha, sessions) * error)


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
        scipy.stats.nct.logpdf(t, n - 1, np.clip(effect * np.sqrt(n), -37.0, 37.0))
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
