r"""Is it the condition, or when it came and what came before? Order in studies in which everybody has every condition.

People who grow quicker, or tired, from one period to the next change more between control and a condition that lie
further apart. With :math:`d_i` a participant's change and :math:`p_i` by how many periods the condition came later,

.. math::  d_i = \delta + \pi \, p_i + \varepsilon_i

gives the effect of a period, and the change without it: of two conditions in both orders this is Hills and Armitage's
analysis [1]_. Its p value is that of the slope's rank among all assignments of the :math:`p_i` to people, or among
`PERMUTATION_COUNT` drawn ones: it supposes no distribution. In orders that balance (the mean of :math:`p_i` is 0) a
period does not move the mean change, and stating the periods changes no decision. Otherwise the mean change has
:math:`\pi \bar p` in it, and the change without it, its error widened by what the slope is unsure of, must lie within
the margin, too. Where everybody had the same order it cannot be told from the condition's effect.

What came before may linger. With three conditions or more in orders that differ, an effect of the previous condition is
added to effects of people, periods and conditions, and tested by F. With two it is told from people's sums, whose
ranks differ between both orders if the first condition's effect lasts into the second; the change without it is that
of first periods alone, between people [2]_. Both see little with few people: what keeps carry-over out is a pause, not
a test.

.. [1] M. Hills, P. Armitage, "The two-period cross-over clinical trial", Br. J. Clin. Pharmacol. 8, 1979.
.. [2] B. Jones, M. G. Kenward, "Design and Analysis of Cross-Over Trials", 3rd ed., 2014.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from math import factorial

import numpy as np
from scipy import stats

from ..numerics.tied_ranks import tie_groups
from .equivalence import Equivalence, Margin, Method, equivalence, equivalence_of_estimate

PERMUTATION_COUNT = 20_000
"""Number of drawn assignments behind the p value of a period's effect; all are counted if there are no more."""

BALANCE_TOLERANCE = 1e-9
"""Orders balance if a condition comes, on average, within this many periods of control."""


@dataclass(frozen=True)
class OrderEffect:
    """Effect of the order of conditions: its size, its p value, and the test of the change without it."""

    effect: float  # effect of one more period, or of the previous condition (the largest of several)
    p_value: float
    without: Equivalence


def is_balanced(later: np.ndarray) -> bool:
    """Return whether orders balance: a condition comes as long before control as after it, (n,) periods, on average."""
    return bool(abs(np.mean(later)) <= BALANCE_TOLERANCE)


def period_effect(
    differences: np.ndarray, later: np.ndarray, margin: Margin, *, alpha: float = 0.05, method: Method = "skew_robust"
) -> OrderEffect | None:
    """Return the effect of the period on participants' changes; None if it cannot be told from the change itself.

    `differences` and `later` are (n,): changes, and the number of periods by which each came after control. The change
    without the period's effect is tested by `method`.
    """
    d, later = np.asarray(differences, float), np.asarray(later, float)
    if len(d) < 4 or np.ptp(later) == 0.0 or not np.isfinite(d).all():
        return None
    slope, corrected = without_period(d, later)
    without = equivalence(corrected, margin, alpha=alpha, method=method)
    return OrderEffect(float(slope), _permutation_p(d, later), without)


def without_period(differences: np.ndarray, later: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the effect of a period on `differences` (..., n), and the differences without it, (..., n).

    `later`, (n,), is by how many periods each came after control. The corrected differences are widened about their
    mean, so that their standard error is that of least squares, which also has the error of the period's effect.
    """
    n, mean = differences.shape[-1], float(np.mean(later))
    centred = later - mean
    spread = float(centred @ centred)
    slope = np.asarray(differences @ centred / spread)
    middle = differences.mean(axis=-1, keepdims=True)
    rest = differences - middle - slope[..., None] * centred
    wider = np.sqrt((1.0 + n * mean**2 / spread) * (n - 1.0) / (n - 2.0))
    return slope, middle - slope[..., None] * mean + wider * rest


def _permutation_p(differences: np.ndarray, later: np.ndarray) -> float:
    """Return the two-sided p value of the slope of `differences` over `later`, (n,) each, over assignments."""
    d, p = differences - differences.mean(), later - later.mean()
    n, seen = len(d), abs(float(d @ p))
    if factorial(n) <= PERMUTATION_COUNT:
        drawn = np.array(list(permutations(p)))
    else:
        drawn = np.random.default_rng([n, 1]).permuted(np.tile(p, (PERMUTATION_COUNT, 1)), axis=1)
    far = int(np.sum(np.abs(drawn @ d) >= seen * (1.0 - 1e-12)))
    return far / len(drawn) if factorial(n) <= PERMUTATION_COUNT else (far + 1.0) / (len(drawn) + 1.0)


def carry_over(
    values: np.ndarray, period: np.ndarray, control: int, compared: int, margin: Margin, *, alpha: float = 0.05
) -> OrderEffect | None:
    """Return the effect of the previous condition; None if it cannot be estimated.

    `values` and `period` are (n, k), participants by conditions; periods are counted from 1.
    """
    values, period = np.asarray(values, float), np.asarray(period, float)
    n, k = values.shape
    rank = np.argsort(np.argsort(period, axis=1), axis=1)  # places of conditions in time, no ranks of values
    if n < 3:
        return None
    if k == 2:
        return _carry_over_of_two_conditions(values, rank, control, compared, margin, alpha)
    person, condition = np.divmod(np.arange(n * k), k)
    order = rank.ravel()
    before = np.argsort(rank, axis=1)[person, np.maximum(order - 1, 0)]
    base = np.column_stack([
        (person[:, None] == np.arange(n)).astype(float),
        _indicator_columns(condition, k, control),
        _indicator_columns(order, k, 0),
    ])  # fmt: skip
    # The effect of the control as previous condition is the reference for those of the others.
    lingers = np.column_stack([((before == j) & (order > 0)) * 1.0 for j in range(k) if j != control])
    rank_base, rank_whole = (np.linalg.matrix_rank(m) for m in (base, np.column_stack([base, lingers])))
    if rank_whole < rank_base + k - 1 or n * k - rank_whole < 2:
        return None
    design = np.column_stack([base, lingers])
    contrast = np.zeros((1, design.shape[1]))
    contrast[0, n + compared - (compared > control)] = 1.0
    y = values.ravel()
    value, error, _ = _least_squares(design, y, contrast)
    rest, free = _residual_sum_of_squares(design, y), n * k - rank_whole
    f = (_residual_sum_of_squares(base, y) - rest) / (k - 1) / (rest / free) if rest > 0.0 else np.inf
    coefficients = np.linalg.lstsq(design, y, rcond=None)[0][-(k - 1) :]
    effect = float(coefficients[np.argmax(np.abs(coefficients))])
    without = equivalence_of_estimate(value[0], error[0], free, margin, alpha=alpha, method="carry-over", pairs=n)
    return OrderEffect(effect, float(stats.f.sf(f, k - 1, free)), without)


def _carry_over_of_two_conditions(values, rank, control, compared, margin, alpha) -> OrderEffect | None:
    first = rank[:, compared] == 0
    if min(int(first.sum()), int((~first).sum())) < 2:
        return None
    sums = values.sum(axis=1)
    p, estimate, error = carry_over_of_studies(values[None, :, control], values[None, :, compared], first)
    without = equivalence_of_estimate(
        float(estimate[0]), float(error[0]), len(values) - 2, margin, alpha=alpha, method="carry-over",
        pairs=len(values),
    )  # fmt: skip
    return OrderEffect(float(sums[first].mean() - sums[~first].mean()), float(p[0]), without)


def carry_over_of_studies(
    control: np.ndarray, compared: np.ndarray, first: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the p value of carry-over between two conditions, and the change of first periods with its error.

    `control` and `compared` are (k, n) values of people in k studies; `first`, (n,), tells who had the compared
    condition first. The p value is that of the exact rank-sum test of people's sums.
    """
    sums, n = control + compared, len(first)
    ranked = tie_groups(sums, axis=1)
    p = stats.mannwhitneyu(ranked[:, first], ranked[:, ~first], axis=1, method="exact").pvalue
    own, others = compared[:, first], control[:, ~first]
    squares = own.shape[1] * own.var(axis=1) + others.shape[1] * others.var(axis=1)
    error = np.sqrt(squares / (n - 2) * (1.0 / own.shape[1] + 1.0 / others.shape[1]))
    return p, own.mean(axis=1) - others.mean(axis=1), error


def _indicator_columns(labels: np.ndarray, k: int, left_out: int) -> np.ndarray:
    return np.column_stack([(labels == j) * 1.0 for j in range(k) if j != left_out])


def _residual_sum_of_squares(design: np.ndarray, y: np.ndarray) -> float:
    return float(np.sum((y - design @ np.linalg.lstsq(design, y, rcond=None)[0]) ** 2))


def _least_squares(design: np.ndarray, y: np.ndarray, contrasts: np.ndarray):
    """Return values, standard errors and two-sided p values of linear combinations of least-squares coefficients."""
    inverse = np.linalg.pinv(design.T @ design)
    free = len(y) - np.linalg.matrix_rank(design)
    value = contrasts @ (inverse @ (design.T @ y))
    error = np.sqrt(
        np.maximum(np.einsum("ij,jk,ik->i", contrasts, inverse, contrasts), 0.0)
        * _residual_sum_of_squares(design, y)
        / free
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        p = 2.0 * stats.t.sf(np.abs(value / error), free)
    return value, error, np.where(np.isfinite(p), p, 1.0)
