r"""Conditions compared over participants: tests, effect sizes, and intervals of what differs.

Each participant is one number a condition. Friedman's and Nemenyi's tests (`friedman`) say whether conditions differ,
and which; Kendall's :math:`W = \chi^2 / n(k-1)` how much participants agree on their order. Against control, each other
condition has its signed-rank test (`signed_rank`), whose p are corrected together after Holm [1]_: sorted, the i-th of
m is multiplied by m - i + 1 and made no smaller than the one before. Cliff's delta is the chance that a value of one
condition is above one of the other, less the chance that it is below.

The interval of a mean difference is a bootstrap over participants. With a handful of them a plain percentile interval
is too narrow, by the missing :math:`\sqrt{n/(n-1)}` and by the normal tails it imitates; its levels are therefore
widened to :math:`\Phi(-\sqrt{n/(n-1)}\, t_{\alpha/2,\,n-1})` [2]_.

.. [1] S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Stat. 6, 1979.
.. [2] T. C. Hesterberg, "What teachers should know about the bootstrap", Am. Stat. 69, 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from .._errors import PellucidError
from .friedman import FriedmanTest, friedman, nemenyi
from .signed_rank import signed_rank

RESAMPLES = 10_000
"""Of the bootstrap."""


@dataclass(frozen=True)
class AgainstControl:
    """One condition against the control.

    Attributes
    ----------
    condition : str
    change : float
        Mean over participants of the difference from control, in the index's unit.
    interval : tuple of float
        Of `change`; NaN with fewer than 3 participants.
    relative : float or None
        Change of the mean, as a share of control's mean; None where that mean is 0 or below.
    p_value, holm : float
        Of the signed ranks, counted, alone and corrected.
    rank_biserial, cliff : float
        -1 to 1.
    standardised : float
        Mean over standard deviation of the differences (Cohen's d of pairs).
    deviation : float
        Standard deviation of the differences, n - 1.
    """

    condition: str
    change: float
    interval: tuple[float, float]
    relative: float | None
    p_value: float
    holm: float
    rank_biserial: float
    cliff: float
    standardised: float
    deviation: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """What participants' values say of conditions.

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
    against_control : tuple of AgainstControl
        Empty where the control is none of the conditions, or there are fewer than 2 participants.
    """

    conditions: tuple[str, ...]
    values: np.ndarray
    friedman: FriedmanTest | None
    kendall: float
    nemenyi: np.ndarray | None
    against_control: tuple[AgainstControl, ...]

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


def compare_conditions(
    values: np.ndarray,
    conditions: Sequence[str],
    control: str | None = None,
    *,
    against_zero: bool = False,
    confidence: float = 0.95,
    rng: np.random.Generator,
) -> Comparison:
    """Compare conditions over participants.

    Parameters
    ----------
    values : ndarray, shape (n, k)
        One row a participant, one column a condition, in any one unit.
    conditions : sequence of str
        Of the columns.
    control : str, optional
        The one to compare the others with.
    against_zero : bool
        Values are changes from a control that is not among them, and are held against 0.
    confidence : float
        Of the intervals.
    rng : numpy.random.Generator
        Of the bootstrap.

    Returns
    -------
    Comparison

    Raises
    ------
    PellucidError
        If a value is missing, or `conditions` does not fit.
    """
    values = np.asarray(values, float)
    if values.ndim != 2 or values.shape[1] != len(conditions) or not np.isfinite(values).all():
        raise PellucidError(
            f"comparison: found values of shape {values.shape}, expected participants x {len(conditions)} numbers"
        )
    n, k = values.shape
    test, pairs, kendall = None, None, float("nan")
    if n > 1 and k > 1 and np.ptp(values, axis=1).any():
        try:
            test = friedman(values, exact=True)
        except PellucidError:  # too many to count
            test = friedman(values)
        pairs, kendall = nemenyi(values), test.statistic / (n * (k - 1))
    found = []
    if (against_zero or control in conditions) and n > 1:
        base = np.zeros(n) if against_zero else values[:, conditions.index(control)]
        others = [(j, name) for j, name in enumerate(conditions) if against_zero or name != control]
        found = [_against(values[:, j], base, name, confidence, rng) for j, name in others]
        corrected = holm([each[1] for each in found])
        found = [
            AgainstControl(name, *rest[:3], p, c, *rest[3:])
            for (name, p, *rest), c in zip(found, corrected, strict=True)
        ]
    return Comparison(tuple(conditions), values, test, kendall, pairs, tuple(found))


def _against(own: np.ndarray, control: np.ndarray, name: str, confidence: float, rng) -> tuple:
    d = own - control
    test = signed_rank(d)
    deviation = float(np.std(d, ddof=1))
    mean = float(control.mean())
    relative = float(own.mean() / mean - 1.0) if mean > 0.0 else None
    dominance = np.sign(own[:, None] - control[None, :])
    standardised = float(d.mean() / deviation) if deviation > 0.0 else float("nan")
    interval = mean_interval(d, confidence, rng)
    return (
        name, test.p_value, float(d.mean()), interval, relative, test.rank_biserial, float(dominance.mean()),
        standardised, deviation,
    )  # fmt: skip


def mean_interval(samples: np.ndarray, confidence: float, rng: np.random.Generator) -> tuple[float, float]:
    """Bootstrap interval of a mean, its levels widened for few samples.

    Parameters
    ----------
    samples : ndarray, shape (n,)
    confidence : float
        In (0, 1).
    rng : numpy.random.Generator

    Returns
    -------
    low, high : float
        In the samples' unit; NaN with fewer than 3.
    """
    n = len(samples)
    if n < 3:
        return float("nan"), float("nan")
    means = rng.choice(np.asarray(samples, float), (RESAMPLES, n)).mean(axis=1)
    tail = float(stats.norm.cdf(-np.sqrt(n / (n - 1.0)) * stats.t.ppf(0.5 + 0.5 * confidence, n - 1)))
    low, high = np.quantile(means, (tail, 1.0 - tail))
    return float(low), float(high)


def holm(p_values: Sequence[float]) -> list[float]:
    """p values corrected together.

    Parameters
    ----------
    p_values : sequence of float

    Returns
    -------
    list of float
        In the same order; at most 1.
    """
    p = np.asarray(p_values, float)
    order = np.argsort(p, kind="stable")
    corrected = np.minimum(np.maximum.accumulate(p[order] * (len(p) - np.arange(len(p)))), 1.0)
    back = np.empty(len(p))
    back[order] = corrected
    return [float(each) for each in back]
