r"""Is it the condition, or when it came and what came before? Order in studies in which everybody has every condition.

People who grow quicker, or tired, from one period to the next change more between control and a condition that lie
further apart. With :math:`d_i` a participant's change and :math:`p_i` by how many periods the condition came later,

.. math::  d_i = \delta + \pi \, p_i + \varepsilon_i

gives the effect of a period, and the change without it: of two conditions in both orders this is Hills and Armitage's
analysis [1]_. Where everybody had the same order it cannot be told from the condition's effect.

What came before may linger. With three conditions or more in orders that differ, an effect of the previous condition is
added to effects of people, periods and conditions, and tested by F; with two it is told from people's sums, which
differ between both orders if the first condition's effect lasts into the second, and the change without it is that of
first periods alone, between people [2]_. Both see little with few people: what keeps carry-over out is a pause, not a
test.

.. [1] M. Hills, P. Armitage, "The two-period cross-over clinical trial", Br. J. Clin. Pharmacol. 8, 1979.
.. [2] B. Jones, M. G. Kenward, "Design and Analysis of Cross-Over Trials", 3rd ed., 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from .equivalence import Equivalence, Margin, equivalence_of_estimate


@dataclass(frozen=True)
class OrderEffect:
    """Effect of the order of conditions: its size, its p value, and the test of the change without it."""

    effect: float  # effect of one more period, or of the previous condition (the largest of several)
    p_value: float
    without: Equivalence


def period_effect(
    differences: np.ndarray, later: np.ndarray, margin: Margin, *, alpha: float = 0.05
) -> OrderEffect | None:
    """Return the effect of the period on participants' changes; None if it cannot be told from the change itself.

    `differences` and `later` are (n,): changes, and the number of periods by which each came after control.
    """
    d, later = np.asarray(differences, float), np.asarray(later, float)
    n = len(d)
    if n < 4 or np.ptp(later) == 0.0:
        return None
    design = np.column_stack([np.ones(n), later])
    value, error, p = _least_squares(design, d, np.array([[1.0, 0.0], [0.0, 1.0]]))
    without = equivalence_of_estimate(value[0], error[0], n - 2, margin, alpha=alpha, method="period", pairs=n)
    return OrderEffect(float(value[1]), float(p[1]), without)


def carry_over(
    values: np.ndarray, period: np.ndarray, control: int, compared: int, margin: Margin, *, alpha: float = 0.05
) -> OrderEffect | None:
    """Return the effect of the previous condition; None if it cannot be estimated.

    `values` and `period` are (n, k), participants by conditions; periods are counted from 1.
    """
    values, period = np.asarray(values, float), np.asarray(period, float)
    n, k = values.shape
    rank = np.argsort(np.argsort(period, axis=1), axis=1)
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
    one, other = int(first.sum()), int((~first).sum())
    if min(one, other) < 2:
        return None
    sums = values.sum(axis=1)
    test = stats.ttest_ind(sums[first], sums[~first])
    own, others = values[first, compared], values[~first, control]
    pooled = (np.sum((own - own.mean()) ** 2) + np.sum((others - others.mean()) ** 2)) / (one + other - 2)
    error = float(np.sqrt(pooled * (1.0 / one + 1.0 / other)))
    without = equivalence_of_estimate(
        float(own.mean() - others.mean()), error, one + other - 2, margin, alpha=alpha, method="carry-over",
        pairs=one + other,
    )  # fmt: skip
    return OrderEffect(float(sums[first].mean() - sums[~first].mean()), float(test.pvalue), without)


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
