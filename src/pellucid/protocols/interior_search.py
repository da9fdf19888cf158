"""The least of a function that is infinite outside what is allowed, looked for from inside."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_APART = 1e-6  # of a difference quotient, where variables are of the order of 1
_ENOUGH = 1e-4  # of the decrease that the slope promises
_HALVINGS = 30


def interior_search(
    cost: Callable[[np.ndarray], float], start: np.ndarray, *, steps: int, least: float = 0.0
) -> np.ndarray:
    """Quasi-Newton steps (BFGS), each made shorter until it is allowed and better, until two in turn gain less than
    `least`. `start` (k,), where the cost is finite; gives (k,)."""
    x, here = np.array(start, float), cost(start)
    if not np.isfinite(here):
        raise ValueError("the search begins outside what is allowed; expected a start of finite cost")
    inverse, slope, slow = np.eye(len(x)), _slope(cost, x, here), 0
    for taken in range(steps):
        way = -inverse @ slope
        if not way @ slope < 0.0:
            inverse, way = np.eye(len(x)), -slope
        length = 1.0 if taken else min(1.0, 0.1 / max(np.abs(way).max(), 1e-300))
        for _ in range(_HALVINGS):
            there = cost(x + length * way)
            if there <= here + _ENOUGH * length * (way @ slope):
                break
            length *= 0.5
        else:
            return x
        moved, before = length * way, slope
        slow = slow + 1 if here - there < least else 0
        x, here = x + moved, there
        if slow == 2:
            return x
        slope = _slope(cost, x, here)
        change = slope - before
        if moved @ change > 1e-12:
            if not taken:
                inverse *= (moved @ change) / (change @ change)
            rho = 1.0 / (moved @ change)
            left = np.eye(len(x)) - rho * np.outer(moved, change)
            inverse = left @ inverse @ left.T + rho * np.outer(moved, moved)
    return x


def _slope(cost: Callable[[np.ndarray], float], x: np.ndarray, here: float) -> np.ndarray:
    """Forward differences; backward ones where a limit is in the way, (k,)."""
    made = np.empty(len(x))
    for i in range(len(x)):
        other = x.copy()
        other[i] += _APART
        value = cost(other)
        if np.isfinite(value):
            made[i] = (value - here) / _APART
            continue
        other[i] = x[i] - _APART
        value = cost(other)
        made[i] = (here - value) / _APART if np.isfinite(value) else 0.0
    return made
