r"""Share of people within a margin, and share far beyond it.

A mean within its margin does not show that most people are. Two shares are therefore tested in addition: at least 75 %
of people lie within the margin, and at most 5 % lie beyond three margins. Each test has its own level and the
confidence bound of its share.

- **Counting.** The number of people within is binomial, whatever the distribution of their changes; the bound is that
  of Clopper and Pearson. From `MODEL_PEOPLE` people on nothing else is used.
- **Normal changes.** With fewer people counting has little power: twelve of twelve show 83 % at a level of 10 %. Where
  people's changes look normal, the share beyond both ends of the margin is estimated from their mean and standard
  deviation, and its bound follows from the noncentral t distribution [1]_, as in acceptance sampling by variables [2]_.
- **Shape.** Changes look normal unless the test of Shapiro and Francia [3]_, the correlation of sorted changes with
  normal scores, rejects it. With 12 people one person in five is missing from 6.9 % of studies; of the studies that
  show nobody far away, so many are refused, those with the least normal changes first, that such a group is missed in
  at most `MISSED_GROUP_LEVEL`. A group is supposed to lie within `HIDDEN_GAP_SD` of the others.
- **Noise of movements.** A person's change is a mean of few movements, so people seem to differ more than they do.
  Where the variance by this noise is known (`movement_noise`), the share of normal people within is bounded by
  generalised pivots, as in tolerance limits of a random model [4]_: draws of the mean, of the variance of people's
  changes, and of the noise, which is subtracted. Counting takes all noise for differences between people.
- **Skewed changes.** The far share may also be bounded where the shape is not normal: by the least favourable of the
  normal and the lognormal distribution of sigma 1, with its long tail to the nearer end.

A normal model never argues against a count: where somebody was seen far beyond, only counting shows the far share.

.. [1] G. J. Lieberman, G. J. Resnikoff, "Sampling plans for inspection by variables", J. Am. Stat. Assoc. 50, 1955.
.. [2] ISO 3951-2:2013, double specification limits, unknown process standard deviation.
.. [3] S. S. Shapiro, R. S. Francia, "An approximate analysis of variance test for normality", J. Am. Stat. Assoc. 67,
   1972.
.. [4] K. Krishnamoorthy, T. Mathew, "One-sided tolerance limits in balanced and unbalanced one-way random models based
   on generalized confidence intervals", Technometrics 46, 2004.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import nan

import numpy as np
import scipy
from scipy import special
from scipy.optimize import brentq

from ..numerics.tied_ranks import TIE_TOLERANCE
from .margin import Margin
from .movement_noise import MovementNoise
from .session_periods import Adjustment

MIN_PEOPLE = 12
"""Fewest people with whom "transparent" is claimed: a group of one person in five is missing from 6.9 % of studies."""

HIDDEN_SHARE = 0.2
"""Share of people who may form a group that lies far from the others."""

MISSED_GROUP_LEVEL = 0.0555
"""Largest share of studies in which a far group of `HIDDEN_SHARE` may be missed: 5 % and a part of the step to 6.9 %,
so that the refusal of normal changes with 12 people costs no more than a fifth of the power."""

HIDDEN_GAP_SD = 20.0
"""Where the far end of the margins lies more standard deviations away, no group is supposed to hide beyond it: it would
lie at least this many standard deviations of the others away from them."""

MODEL_PEOPLE = 60
"""From this number of people on, shares are shown by counting alone where no noise of movements is known: 59 people of
whom nobody lies far beyond show that at most 5 % do at 95 % confidence."""

MAX_SHAPE_PEOPLE = 200
"""The distribution of shape of this many people serves for more, too."""

PIVOT_COUNT = 20_000
"""Number of draws of the generalised pivots of one study."""

MANY_PIVOT_COUNT = 1_000
"""Number of draws for each of many simulated studies."""

SHAPE_LEVEL = 0.05
"""Level of the test that people's changes are normal."""

SHAPE_STUDY_COUNT = 100_000
"""Number of simulated studies behind each reference distribution of shape and of skewed people."""

SHAPE_SEED = 31
"""Seed of these distributions."""

NOTED_NOISE_SHARE = 0.05
"""Smallest share of noise that is reported."""

TOO_FEW = "too few"
"""Answer with fewer than `MIN_PEOPLE` people."""

SHOWN = "shown"
"""Answer if both shares are shown."""

NOT_SHOWN = "not shown"
"""Answer if at least one share is not shown."""


@dataclass(frozen=True)
class ShareRule:
    """Shares of people that must be shown, and the level of each test."""

    within: float = 0.75  # least share of people within the margin
    far: float = 0.05  # largest share of people beyond `far_margins`
    far_margins: float = 3.0  # in half-widths of the margin from its middle
    alpha: float = 0.10  # level of each of both tests


DEFAULT_RULE = ShareRule()
"""Shares and level unless a study states others."""


@dataclass(frozen=True)
class ShareTest:
    """Result of both tests of one end point."""

    rule: ShareRule
    people: int
    within: int  # number of people within the margin
    far: int  # number of people who may lie beyond `rule.far_margins`
    p_within: float
    p_far: float
    least_within: float  # lower confidence bound of the share within, at 1 - alpha
    most_far: float  # upper confidence bound of the share far beyond, at 1 - alpha
    noise_share: float = 0.0  # share of the variance of people's changes that is noise of their movements

    @property
    def noise_note(self) -> str:
        """How much of the variance of people's changes is noise, in brackets after a count; "" if little is."""
        if self.noise_share < NOTED_NOISE_SHARE:
            return ""
        return f" ({100.0 * self.noise_share:.0f} % of the variance of changes is noise of single movements)"

    @property
    def answer(self) -> str:
        """``"shown"``, ``"not shown"`` or ``"too few"``."""
        if self.people < MIN_PEOPLE:
            return TOO_FEW
        return SHOWN if max(self.p_within, self.p_far) <= self.rule.alpha else NOT_SHOWN


def limits(margin: Margin, count: float) -> tuple[float, float]:
    """Return the ends of a number of margins: `count` half-widths from the middle.

    Of a margin with one end the half-width is the distance of that end from 0.

    >>> from pellucid.people.margin import Margin
    >>> limits(Margin(-1.0, 3.0), 3.0), limits(Margin(-np.inf, 2.0), 3.0)
    ((-5.0, 7.0), (-inf, 6.0))
    """
    more = (count - 1.0) * margin.half_width
    return margin.low - more, margin.high + more


def share_p_values(
    lower: np.ndarray, upper: np.ndarray, margin: Margin, fit: Adjustment, *, allowance: float = 0.0,
    rule: ShareRule = DEFAULT_RULE, noise: MovementNoise | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return the p values of the share within and of the share far beyond, shape (...) each.

    Parameters
    ----------
    lower, upper : ndarray, shape (..., n)
        Bounds of people's differences, or twice the differences themselves, adjusted for periods.
    margin : Margin
        Margin in their unit.
    fit : Adjustment
        How the differences were adjusted.
    allowance : float
        Amount by which all differences may be off.
    rule : ShareRule
        Shares and level.
    noise : MovementNoise, optional
        Variance of the differences by the noise of movements.
    """
    n = lower.shape[-1]
    if n < MIN_PEOPLE:
        ones = np.ones(lower.shape[:-1])
        return ones, ones
    near, far = (limits(margin, count) for count in (1.0, rule.far_margins))
    slack = TIE_TOLERANCE * margin.half_width
    within = _count_inside(lower, upper, near, allowance, slack)
    seen_far = n - _count_inside(lower, upper, far, allowance, slack)
    p_within = scipy.stats.binom.sf(within - 1, n, rule.within)
    p_far = scipy.stats.binom.cdf(seen_far, n, rule.far)
    if n >= MODEL_PEOPLE and noise is None:
        return p_within, p_far
    known = np.isfinite(lower).all(axis=-1) & (lower == upper).all(axis=-1)
    d = np.where(known[..., None], lower, 0.0)
    shape = shape_p(d)
    looks_normal = known & (shape > SHAPE_LEVEL)
    if noise is None:
        by_model = _normal_p(d, near, allowance, fit, 1.0 - rule.within)
    else:
        by_model = np.mean(_pivots(d, near, allowance, fit, noise) >= 1.0 - rule.within, axis=-1)
    p_within = np.where(looks_normal, by_model, p_within)
    if n >= MODEL_PEOPLE:
        return p_within, p_far
    gap = _distance(d, far, allowance, fit)
    usable = known & (seen_far == 0) & ((shape > refused_share(n)) | (gap > HIDDEN_GAP_SD))
    skewed = _skewed_p(gap, n, rule.far)
    modelled = np.where(looks_normal, _normal_p(d, far, allowance, fit, rule.far), skewed)
    return p_within, np.where(usable, np.minimum(p_far, modelled), p_far)


def far_people_p(
    lower: np.ndarray, upper: np.ndarray, margin: Margin, *, allowance: float = 0.0, rule: ShareRule = DEFAULT_RULE,
    noise: MovementNoise | None = None,
) -> float:  # fmt: skip
    """Return the p value of "more people than a share `rule.far` lie far beyond the margin, on one of its sides".

    A person within the margin is seen beyond `rule.far_margins` where noise carries them so far. Where the noise of
    movements is not known, that is taken to happen to half of people. Arguments are those of `share_p_values`, the
    differences (n,).

    >>> from pellucid.people.margin import Margin
    >>> slowed = np.array([0.6, 0.8, 1.3, 0.8, 2.3, 0.9])
    >>> round(far_people_p(slowed, slowed, Margin.either_way(0.1)), 3)
    0.042
    """
    slack = TIE_TOLERANCE * margin.half_width
    low, high = limits(margin, rule.far_margins)
    below, above = int(np.sum(upper < low - allowance - slack)), int(np.sum(lower > high + allowance + slack))
    carried = 0.5
    if noise is not None:
        reach = (rule.far_margins - 1.0) * margin.half_width
        spread = float(np.sqrt(np.max(noise.variance)))
        carried = float(scipy.stats.norm.sf(reach / spread)) if spread > 0.0 else 0.0
    share = rule.far + (1.0 - rule.far) * carried
    return min(1.0, 2.0 * float(scipy.stats.binom.sf(max(below, above) - 1, len(lower), share)))


def share_test(
    lower: np.ndarray, upper: np.ndarray, margin: Margin, fit: Adjustment, *, allowance: float = 0.0,
    rule: ShareRule = DEFAULT_RULE, noise: MovementNoise | None = None,
) -> ShareTest:  # fmt: skip
    """Return both tests of one end point, with their bounds; arguments as in `share_p_values`, differences (n,)."""
    n, slack = len(lower), TIE_TOLERANCE * margin.half_width
    within = int(_count_inside(lower, upper, limits(margin, 1.0), 0.0, slack))
    far = n - int(_count_inside(lower, upper, limits(margin, rule.far_margins), 0.0, slack))

    p_within, p_far = map(
        float, share_p_values(lower, upper, margin, fit, allowance=allowance, rule=rule, noise=noise)
    )
    if n < MIN_PEOPLE:
        return ShareTest(rule, n, within, far, p_within, p_far, nan, nan)
    bounds = _share_bounds(lower, upper, margin, fit, allowance, rule, noise)
    spread = _variance(lower, fit) if np.isfinite(lower).all() else nan
    share = min(1.0, noise.variance / spread) if noise is not None and spread > 0.0 else 0.0
    return ShareTest(rule, n, within, far, p_within, p_far, *bounds, share)


def _share_bounds(
    lower: np.ndarray, upper: np.ndarray, margin: Margin, fit: Adjustment, allowance: float, rule: ShareRule,
    noise: MovementNoise | None,
) -> tuple[float, float]:  # fmt: skip
    """Return the bounds of both shares of one study: the shares whose p values are the level (`share_p_values`)."""
    n, slack = len(lower), TIE_TOLERANCE * margin.half_width
    near, far = (limits(margin, count) for count in (1.0, rule.far_margins))
    within = int(_count_inside(lower, upper, near, allowance, slack))
    seen_far = n - int(_count_inside(lower, upper, far, allowance, slack))
    least = float(scipy.stats.beta.ppf(rule.alpha, within, n - within + 1)) if within else 0.0
    most = float(scipy.stats.beta.isf(rule.alpha, seen_far + 1, n - seen_far)) if seen_far < n else 1.0
    if (n >= MODEL_PEOPLE and noise is None) or not (np.isfinite(lower).all() and (lower == upper).all()):
        return least, most
    shape = float(shape_p(lower))
    if shape > SHAPE_LEVEL and noise is not None:
        least = 1.0 - float(np.quantile(_pivots(lower, near, allowance, fit, noise), 1.0 - rule.alpha))
    elif shape > SHAPE_LEVEL:
        least = 1.0 - _normal_bound(lower, near, allowance, fit, rule.alpha)
    if n >= MODEL_PEOPLE:
        return least, most
    gap = float(_distance(lower, far, allowance, fit))
    if seen_far == 0 and (shape > refused_share(n) or gap > HIDDEN_GAP_SD):
        if shape > SHAPE_LEVEL:
            return least, min(most, _normal_bound(lower, far, allowance, fit, rule.alpha))
        if gap == np.inf:
            return least, 0.0
        ends = [float(np.quantile(gap * spread + mean, rule.alpha)) for mean, spread in _skewed_reference(n)]
        shares = scipy.stats.norm.sf(ends[0]), scipy.stats.norm.sf(np.log(ends[1])) if ends[1] > 0.0 else 1.0
        most = min(most, float(max(shares)))
    return least, most


def _normal_bound(
    d: np.ndarray, ends: tuple[float, float], allowance: float, fit: Adjustment, alpha: float
) -> float:
    """Return the upper bound of the share of normal people beyond both ends together."""

    def short(share: float) -> float:
        return float(_normal_p(d, ends, allowance, fit, share)) - alpha

    low, high = 1e-9, 1.0 - 1e-9
    if short(low) <= 0.0:
        return 0.0
    return 1.0 if short(high) >= 0.0 else float(brentq(short, low, high, xtol=1e-6))


def refused_share(people: int) -> float:
    """Return the share of normal samples whose far share is not bounded by a model, as a group may hide from them.

    >>> [round(refused_share(n), 2) for n in (12, 13, 20)]
    [0.19, 0.0, 0.0]
    """
    return max(0.0, 1.0 - MISSED_GROUP_LEVEL / (1.0 - HIDDEN_SHARE) ** people)


def shape_p(differences: np.ndarray) -> np.ndarray:
    """Return the p value of Shapiro and Francia's test of differences (..., n), shape (...); 1 if all are equal."""
    n = differences.shape[-1]
    seen = _francia(differences)
    reference = _francia_reference(min(n, MAX_SHAPE_PEOPLE))
    return (1.0 + np.searchsorted(reference, seen, side="right")) / (len(reference) + 1.0)


def _francia(differences: np.ndarray) -> np.ndarray:
    n = differences.shape[-1]
    scores = scipy.stats.norm.ppf((np.arange(1, n + 1) - 0.375) / (n + 0.25))
    ordered = np.sort(differences - differences.mean(axis=-1, keepdims=True), axis=-1)
    size = np.sum(ordered**2, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        w = (ordered @ scores) ** 2 / (size * float(scores @ scores))
    return np.where(size > 0.0, w, 1.0)


@lru_cache(maxsize=64)
def _francia_reference(people: int) -> np.ndarray:
    rng = np.random.default_rng([SHAPE_SEED, people])
    count = SHAPE_STUDY_COUNT if people < MODEL_PEOPLE else SHAPE_STUDY_COUNT // 5
    return np.sort(_francia(rng.standard_normal((count, people))))


def _count_inside(
    lower: np.ndarray, upper: np.ndarray, ends: tuple[float, float], allowance: float, slack: float
) -> np.ndarray:
    low, high = ends[0] + allowance - slack, ends[1] - allowance + slack
    return np.sum((lower >= low) & (upper <= high), axis=-1)


def _variance(d: np.ndarray, fit: Adjustment) -> np.ndarray:
    """Return the variance of people's adjusted differences (..., n), shape (...)."""
    return np.var(d, axis=-1, ddof=1) * (d.shape[-1] - 1.0) / fit.degrees


def _pivots(
    d: np.ndarray, ends: tuple[float, float], allowance: float, fit: Adjustment, noise: MovementNoise
) -> np.ndarray:
    """Return draws of the share of people beyond both ends, without the noise of movements; shape (..., draws)."""
    mean, variance = d.mean(axis=-1)[..., None], _variance(d, fit)[..., None]
    count = PIVOT_COUNT if d.ndim == 1 else MANY_PIVOT_COUNT
    z, of_variance, of_noise = _pivot_draws(count, fit.degrees, noise.degrees)
    drawn = variance * of_variance
    middle = mean + z * np.sqrt(drawn / fit.people)
    subtracted = np.asarray(noise.variance)[..., None] * of_noise
    of_people = np.sqrt(np.maximum(drawn - subtracted, 0.0))
    below, above = ends[0] + allowance - middle, middle - (ends[1] - allowance)
    with np.errstate(divide="ignore", invalid="ignore"):
        tails = special.ndtr(below / of_people) + special.ndtr(above / of_people)
    return np.where(of_people > 0.0, tails, (np.maximum(below, above) > 0.0).astype(float))


@lru_cache(maxsize=16)
def _pivot_draws(count: int, degrees: float, noise_degrees: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normal scores, and pivots of both variances over their estimates, evenly spaced in chance; (count,) each.

    Each is in an order of its own.
    """
    rng = np.random.default_rng([SHAPE_SEED, 2])
    even = (np.arange(count) + 0.5) / count
    z, one, other = scipy.stats.norm.ppf(rng.permutation(even)), rng.permutation(even), rng.permutation(even)
    return z, degrees / scipy.stats.chi2.ppf(one, degrees), noise_degrees / scipy.stats.chi2.ppf(other, noise_degrees)


def _standardised_gaps(
    d: np.ndarray, ends: tuple[float, float], allowance: float, fit: Adjustment
) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances of the mean from both ends, in standard deviations of people; each (...)."""
    mean = d.mean(axis=-1)
    spread = np.sqrt(_variance(d, fit))
    gaps = []
    for gap in (mean - ends[0] - allowance, ends[1] - allowance - mean):
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = gap / spread
        gaps.append(np.where(spread > 0.0, ratio, np.where(gap > 0.0, np.inf, -np.inf)))
    return gaps[0], gaps[1]


def _normal_p(
    d: np.ndarray, ends: tuple[float, float], allowance: float, fit: Adjustment, share: float
) -> np.ndarray:
    """Return the p value of "less than a `share` of normal people lies beyond both ends together"."""
    half = 0.5 * (fit.degrees - 1.0)
    size = np.sqrt(fit.degrees + 1.0) / fit.degrees

    def tail(gap: np.ndarray) -> np.ndarray:
        return special.betainc(half, half, np.clip(0.5 * (1.0 - gap * size), 0.0, 1.0))

    both = np.clip(sum(map(tail, _standardised_gaps(d, ends, allowance, fit))), 0.0, 1.0)
    # One end with the same estimated share beyond has the p value of the noncentral t distribution.
    gap = (1.0 - 2.0 * special.betaincinv(half, half, both)) / size
    root = np.sqrt(fit.people)
    return scipy.stats.nct.sf(gap * root, fit.degrees, float(scipy.stats.norm.isf(share)) * root)


def _distance(d: np.ndarray, ends: tuple[float, float], allowance: float, fit: Adjustment) -> np.ndarray:
    """Return the distance of the mean from the nearer end, in standard deviations of people."""
    return np.minimum(*_standardised_gaps(d, ends, allowance, fit))


def _skewed_p(gap: np.ndarray, people: int, share: float) -> np.ndarray:
    """Return the p value of "less than a `share` lies beyond" at a `gap`, for the least favourable of both shapes."""
    worst = np.zeros(np.shape(gap))
    for reference in _skewed_gaps(people, share):
        above = len(reference) - np.searchsorted(reference, gap, side="left")
        worst = np.maximum(worst, (1.0 + above) / (len(reference) + 1.0))
    return worst


@lru_cache(maxsize=64)
def _skewed_gaps(people: int, share: float) -> tuple[np.ndarray, ...]:
    """Return sorted distances, in standard deviations, of studies' means from an end beyond which a `share` lies."""
    z = float(scipy.stats.norm.isf(share))
    ends = z, float(np.exp(z))
    return tuple(np.sort((end - m) / sd) for (m, sd), end in zip(_skewed_reference(people), ends, strict=True))


@lru_cache(maxsize=64)
def _skewed_reference(people: int) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Return the mean and the standard deviation of normal and of lognormal studies."""
    rng = np.random.default_rng([SHAPE_SEED, people, 1])
    z = rng.standard_normal((SHAPE_STUDY_COUNT, people))
    return tuple((x.mean(axis=1), x.std(axis=1, ddof=1)) for x in (z, np.exp(z)))
