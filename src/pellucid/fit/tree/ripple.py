r"""Drive ripple: what a gear or a motor adds once in so many turns, of an order that nobody stated.

Cogging, teeth and eccentric bearings make an effort that repeats with the motor's angle. Its order need not be whole: a
gear's intermediate shafts turn at other ratios. So the residual of each motor's joint is looked at over that angle: its
power at orders from a few periods within the range that was travelled up to what the rows can follow, each beside the
median of its neighbours. With m independent orders and a line x times the neighbours' mean, noise has such a line
somewhere with probability

.. math::
   p = 1 - (1 - e^{-x})^m .

What is left of a rigid body's or a friction's misfit fills neighbouring orders alike and is no line. A line below 1 %
is then fitted, sine and cosine in one regression with everything else, and kept where it also predicts segments left
out better, by the test that friction terms pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..block_test import sign_flip_p_value
from .tree_estimate import Ripple
from .tree_families import RARE
from .tree_regression import (
    Linearised,
    TreeSolution,
    left_out_losses,
    linearised,
    loads_of,
    normal_equations,
)

LINE = 0.01
"""p of a line that is worth a fit."""
FEWEST_PERIODS = 4.0
"""Within the range that an angle travels: slower lines are what bodies and gravity make."""
SLOWEST_ORDER = 4.0
"""Periods a turn: gravity makes one, products of it with inertia two."""
ROWS_A_PERIOD = 8.0
"""At the median speed, of the fastest line."""
OVERSAMPLED = 8  # orders tried for each independent one
NEIGHBOURS = 30  # independent orders, half on either side, that a line is held against


@dataclass(frozen=True)
class Line:
    """A line of a motor's residual over its angle: its order, how many times the mean of its neighbours, its p."""

    motor: int
    order: float
    prominence: float
    p_value: float


def strongest_line(motor: int, angle: np.ndarray, speed: np.ndarray, residual: np.ndarray, rate: float) -> Line | None:
    """Of a `residual` (n,) over an `angle` (n,) that moves at `speed` (n,), rows at `rate` [Hz]; None where no order
    can be seen."""
    low, high = float(angle.min()), float(angle.max())
    turns = (high - low) / (2.0 * np.pi)
    if turns <= 0.0 or not np.isfinite(rate):
        return None
    first = max(SLOWEST_ORDER, FEWEST_PERIODS / turns)
    last = 2.0 * np.pi * rate / ROWS_A_PERIOD / float(np.median(np.abs(speed)))
    independent = (last - first) * turns
    if independent < NEIGHBOURS:
        return None
    # Rows are gathered into bins of the angle, 16 to a period of the fastest line; then one transform has all orders.
    bins = int(np.ceil(16.0 * last * turns))
    padded = 1 << int(np.ceil(np.log2(bins * OVERSAMPLED)))
    at = np.minimum(((angle - low) / (high - low) * bins).astype(int), bins - 1)
    gathered = np.bincount(at, residual - residual.mean(), minlength=bins)
    power = np.abs(np.fft.rfft(gathered, padded)) ** 2
    orders = np.arange(len(power)) * bins / padded / turns
    inside = np.flatnonzero((orders >= first) & (orders <= last))
    beside = _beside(power, max(1, round(NEIGHBOURS / 2 * padded / bins)))
    prominence = power[inside] / np.maximum(beside[inside], 1e-300)
    best = int(inside[np.argmax(prominence)])
    x = float(prominence.max())
    order = _refined(angle, residual, float(orders[best]), 1.0 / turns / OVERSAMPLED)
    return Line(motor, order, x, float(-np.expm1(independent * np.log1p(-np.exp(-max(x, 1e-9))))))


def _beside(power: np.ndarray, half: int) -> np.ndarray:
    """Mean of each order's neighbours as their median tells it, for powers that are exponential; in steps."""
    step = max(1, half // 4)
    centres = np.arange(0, len(power), step)
    medians = [np.median(power[max(0, c - half) : c + half + 1]) for c in centres]
    return np.interp(np.arange(len(power)), centres, medians) / np.log(2.0)


def _refined(angle: np.ndarray, residual: np.ndarray, order: float, step: float) -> float:
    """The order near a coarse one whose sine and cosine take most of the residual."""
    from scipy.optimize import minimize_scalar

    def left(x: float) -> float:
        w = np.column_stack([np.sin(x * angle), np.cos(x * angle)])
        pull = w.T @ residual
        return -float(pull @ np.linalg.solve(w.T @ w, pull))

    found = minimize_scalar(left, bounds=(order - step, order + step), method="bounded", options={"xatol": 1e-4})
    return float(found.x)


def lines_of(at: Linearised, found: TreeSolution, rate: float) -> tuple[Line, ...]:
    """The strongest line of every motor, rows at `rate` [Hz]."""
    rows, made = at.rows, []
    for k, residual in enumerate(at.residuals(found.values)):
        lines = rows.lines[k]
        line = strongest_line(k, rows.turned[lines, k], rows.turning[lines, k], residual, rate)
        if line is not None:
            made.append(line)
    return tuple(made)


def chosen_ripples(at: Linearised, found: TreeSolution, rate: float) -> tuple[tuple[Ripple, ...], Sequence[Line]]:
    """Ripples that a model fitted to rows lacks, sizes still to be fitted, and the lines that were looked at."""
    lines = lines_of(at, found, rate)
    model, rows = at.model, at.rows
    load = loads_of(rows, model, found.values)
    kept: list[Ripple] = []
    best = left_out_losses(normal_equations(at), found.sd)
    for line in sorted(lines, key=lambda x: x.p_value):
        if line.p_value >= LINE:
            continue
        tried = replace(model, ripples=(*model.ripples, *kept, Ripple(line.motor, line.order, 0.0, 0.0)))
        equations = normal_equations(linearised(tried, rows, load, model.alpha(found.values)))
        losses = left_out_losses(equations, found.sd)
        if sign_flip_p_value(best - losses) < RARE:
            kept.append(Ripple(line.motor, line.order, 0.0, 0.0))
            best = losses
    return tuple(kept), lines
