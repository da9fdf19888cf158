"""Minimisation of a function that is infinite outside its feasible set, from a feasible start."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_DIFFERENCE_STEP = 1e-6
"""Step of difference quotients. Variables are of the order of 1."""

_MIN_DECREASE_SHARE = 1e-4
"""A step must gain at least this share of the decrease that the slope predicts (Armijo's rule)."""

_MAX_HALVINGS = 30
"""A step is halved at most this often before the search ends."""


def interior_search(
    cost: Callable[[np.ndarray], float], start: np.ndarray, *, steps: int, least: float = 0.0
) -> np.ndarray:
    """Minimise a cost by quasi-Newton steps (BFGS), each halved until it is feasible and better; gives (k,).

    The search ends when two successive steps gain less than `least`. The cost must be finite at the `start`, (k,).
    """
    x, here = np.array(start, float), cost(start)
    if not np.isfinite(here):
        raise ValueError("the search begins outside the feasible set; expected a start of finite cost")
    inverse, slope, slow = np.eye(len(x)), _difference_gradient(cost, x, here), 0
    for taken in range(steps):
        way = -inverse @ slope
        if not way @ slope < 0.0:
            inverse, way = np.eye(len(x)), -slope
        length = 1.0 if taken else min(1.0, 0.1 / max(np.abs(way).max(), 1e-300))
        for _ in range(_MAX_HALVINGS):
            there = cost(x + length * way)
            if there <= here + _MIN_DECREASE_SHARE * length * (way @ slope):
                break
            length *= 0.5
        else:
            return x
        moved, before = length * way, slope
        slow = slow + 1 if here - there < least else 0
        x, here = x + moved, there
        if slow == 2:
            return x
        slope = _difference_gradient(cost, x, here)
        change = slope - before
        if moved @ change > 1e-12:
            if not taken:
                inverse *= (moved @ change) / (change @ change)
            rho = 1.0 / (moved @ change)
            left = np.eye(len(x)) - rho * np.outer(moved, change)
            inverse = left @ inverse @ left.T + rho * np.outer(moved, moved)
    return x


def _difference_gradient(cost: Callable[[np.ndarray], float], x: np.ndarray, here: float) -> np.ndarray:
    """Return the gradient by forward differences, or backward ones where a limit is in the way, (k,)."""
    made = np.empty(len(x))
    for i in range(len(x)):
        other = x.copy()
        other[i] += _DIFFERENCE_STEP
        value = cost(other)
        if np.isfinite(value):
            made[i] = (value - here) / _DIFFERENCE_STEP
            continue
        other[i] = x[i] - _DIFFERENCE_STEP
        value = cost(other)
        made[i] = (here - value) / _DIFFERENCE_STEP if np.isfinite(value) else 0.0
    return made
