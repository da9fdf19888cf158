r"""Find drive ripple: effort that is periodic in the motor's angle, with an order that is not known beforehand.

Cogging, gear teeth and eccentric bearings make an effort that repeats with the motor's angle. Its order need not be a
whole number, because intermediate shafts of a gear turn at other ratios. The power spectrum of each joint's residual
over that angle is searched. The orders range from a few periods in the travelled range up to what the rows can resolve.
Each order is compared with the median of its neighbours. With m independent orders and a line x times the neighbours'
mean, noise has such a line somewhere with probability

.. math::
   p = 1 - (1 - e^{-x})^m .

Errors of the rigid-body or friction model spread over neighbouring orders and make no line. A line with p below 1 % is
fitted by a sine and a cosine in the joint regression. It is kept if it also improves the prediction of left-out
segments, by the same test as friction terms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...numerics.block_test import sign_flip_p_value
from .tree_estimate import Ripple
from .tree_families import FAMILY_THRESHOLDS
from .tree_regression import (
    LinearisedModel,
    TreeSolution,
    compute_loads,
    left_out_losses,
    linearise_rows,
    sum_normal_equations,
)


@dataclass(frozen=True)
class RippleThresholds:
    """Thresholds of the search for drive ripple."""

    max_line_p_value: float = 0.01  # a spectral line is fitted only if its p value is below this
    # A ripple must have at least this many periods within the travelled range. Links and gravity cause slower lines.
    min_periods: float = 4.0
    # Smallest order of a ripple, in periods per turn. Gravity has order one, its products with inertia order two.
    min_order: float = 4.0
    min_rows_per_period: float = 8.0  # the highest order has this many rows per period at the median speed
    order_oversampling: int = 8  # number of orders that are evaluated for each independent one
    # Number of independent neighbouring orders with which a line is compared, half on either side.
    neighbour_count: int = 30


RIPPLE_THRESHOLDS = RippleThresholds()


@dataclass(frozen=True)
class SpectralLine:
    """A spectral line in a motor's residual over its angle."""

    motor: int  # index of the motor
    order: float  # periods per turn
    p_value: float  # probability of such a line anywhere in noise


def find_strongest_line(
    motor: int, angle: np.ndarray, speed: np.ndarray, residual: np.ndarray, rate: float
) -> SpectralLine | None:
    """Return the strongest line of a `residual`, (n,), over an `angle`, (n,), that moves at `speed`, (n,).

    `rate` is that of the rows [Hz]. Returns None if the rows resolve too few orders.
    """
    low, high = float(angle.min()), float(angle.max())
    turns = (high - low) / (2.0 * np.pi)
    if turns <= 0.0 or not np.isfinite(rate):
        return None
    first = max(RIPPLE_THRESHOLDS.min_order, RIPPLE_THRESHOLDS.min_periods / turns)
    last = 2.0 * np.pi * rate / RIPPLE_THRESHOLDS.min_rows_per_period / float(np.median(np.abs(speed)))
    independent = (last - first) * turns
    if independent < RIPPLE_THRESHOLDS.neighbour_count:
        return None
    # Rows are summed in bins of the angle, 16 per period of the highest order; one transform then has all orders.
    bins = int(np.ceil(16.0 * last * turns))
    padded = 1 << int(np.ceil(np.log2(bins * RIPPLE_THRESHOLDS.order_oversampling)))
    at = np.minimum(((angle - low) / (high - low) * bins).astype(int), bins - 1)
    gathered = np.bincount(at, residual - residual.mean(), minlength=bins)
    power = np.abs(np.fft.rfft(gathered, padded)) ** 2
    orders = np.arange(len(power)) * bins / padded / turns
    inside = np.flatnonzero((orders >= first) & (orders <= last))
    beside = _neighbour_mean(power, max(1, round(RIPPLE_THRESHOLDS.neighbour_count / 2 * padded / bins)))
    prominence = power[inside] / np.maximum(beside[inside], 1e-300)
    best = int(inside[np.argmax(prominence)])
    x = float(prominence.max())
    order = _refine_order(angle, residual, float(orders[best]), 1.0 / turns / RIPPLE_THRESHOLDS.order_oversampling)
    return SpectralLine(motor, order, float(-np.expm1(independent * np.log1p(-np.exp(-max(x, 1e-9))))))


def _neighbour_mean(power: np.ndarray, half: int) -> np.ndarray:
    """Return the mean power of each order's neighbours, estimated from medians of exponentially distributed powers."""
    step = max(1, half // 4)
    centres = np.arange(0, len(power), step)
    medians = [np.median(power[max(0, c - half) : c + half + 1]) for c in centres]
    return np.interp(np.arange(len(power)), centres, medians) / np.log(2.0)


def _refine_order(angle: np.ndarray, residual: np.ndarray, order: float, step: float) -> float:
    """Refine a coarse order to the one whose sine and cosine explain most of the residual."""
    from scipy.optimize import minimize_scalar

    def left(x: float) -> float:
        w = np.column_stack([np.sin(x * angle), np.cos(x * angle)])
        pull = w.T @ residual
        return -float(pull @ np.linalg.solve(w.T @ w, pull))

    found = minimize_scalar(left, bounds=(order - step, order + step), method="bounded", options={"xatol": 1e-4})
    return float(found.x)


def find_lines(at: LinearisedModel, found: TreeSolution, rate: float) -> tuple[SpectralLine, ...]:
    """Return the strongest line of every motor, from rows at `rate` [Hz]."""
    rows, made = at.rows, []
    for k, residual in enumerate(at.residuals(found.values)):
        lines = rows.lines[k]
        line = find_strongest_line(k, rows.turned[lines, k], rows.turning[lines, k], residual, rate)
        if line is not None:
            made.append(line)
    return tuple(made)


def choose_ripples(
    at: LinearisedModel, found: TreeSolution, rate: float
) -> tuple[tuple[Ripple, ...], Sequence[SpectralLine]]:
    """Choose the ripples that a fitted model lacks; return them without amplitudes, and the lines considered."""
    lines = find_lines(at, found, rate)
    model, rows = at.model, at.rows
    load = compute_loads(rows, model, found.values)
    kept: list[Ripple] = []
    best = left_out_losses(sum_normal_equations(at), found.sd)
    for line in sorted(lines, key=lambda x: x.p_value):
        if line.p_value >= RIPPLE_THRESHOLDS.max_line_p_value:
            continue
        tried = replace(model, ripples=(*model.ripples, *kept, Ripple(line.motor, line.order, 0.0, 0.0)))
        equations = sum_normal_equations(linearise_rows(tried, rows, load, model.alpha(found.values)))
        losses = left_out_losses(equations, found.sd)
        if sign_flip_p_value(best - losses) < FAMILY_THRESHOLDS.max_term_p_value:
            kept.append(Ripple(line.motor, line.order, 0.0, 0.0))
            best = losses
    return tuple(kept), lines
