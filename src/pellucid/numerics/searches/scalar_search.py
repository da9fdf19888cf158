"""Minimum of a function of one variable on an interval, by parabolas and golden sections [1]_.

SciPy has the same search, and takes a fifth of a second of processor time to load it: as long as fitting a joint.

.. [1] R. P. Brent, "Algorithms for minimization without derivatives", Prentice-Hall, 1973, chapter 5.
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, inf, isfinite, sqrt

from ..._errors import IdentificationError

GOLDEN_SECTION = 0.5 * (3.0 - sqrt(5.0))
"""Share of an interval at which its golden section begins."""

RELATIVE_STEP = sqrt(2.2e-16)
"""No step is smaller than this share of the place: rounding of a cost hides smaller ones."""


def minimise_on_interval(
    cost: Callable[[float], float], low: float, high: float, *, tolerance: float = 1e-5, evaluations: int = 500
) -> float:
    """Return the place of a local minimum of `cost` between `low` and `high`.

    The search ends when the place is known to `tolerance`, in the unit of the variable, or after that many
    `evaluations`. A `cost` may be infinite where the function is not defined.
    """
    if not (isfinite(low) and isfinite(high) and low <= high):
        raise IdentificationError(f"found the interval from {low:g} to {high:g}, expected two finite ends in order")
    best = second = third = low + GOLDEN_SECTION * (high - low)
    cost_best = cost_second = cost_third = cost(best)
    step = last = 0.0
    for _ in range(evaluations - 1):
        middle = 0.5 * (low + high)
        least = RELATIVE_STEP * abs(best) + tolerance / 3.0
        if abs(best - middle) <= 2.0 * least - 0.5 * (high - low):
            break
        before, last = last, step
        step = _vertex(best, second, third, cost_best, cost_second, cost_third) if abs(before) > least else inf
        if abs(step) < 0.5 * abs(before) and low < best + step < high:
            if min(best + step - low, high - best - step) < 2.0 * least:
                step = copysign(least, middle - best)
        else:
            last = (high if best < middle else low) - best
            step = GOLDEN_SECTION * last
        place = best + copysign(max(abs(step), least), step)
        found = cost(place)
        if found <= cost_best:
            low, high = (best, high) if place >= best else (low, best)
            third, second, best = second, best, place
            cost_third, cost_second, cost_best = cost_second, cost_best, found
            continue
        low, high = (place, high) if place < best else (low, place)
        if found <= cost_second or second == best:
            third, second, cost_third, cost_second = second, place, cost_second, found
        elif found <= cost_third or third in (best, second):
            third, cost_third = place, found
    return best


def _vertex(x: float, y: float, z: float, at_x: float, at_y: float, at_z: float) -> float:
    """Return how far from `x` the vertex of the parabola through three points is; infinity where it has none."""
    to_y, to_z = (x - y) * (at_x - at_z), (x - z) * (at_x - at_y)
    bend = 2.0 * (to_z - to_y)
    return -((x - z) * to_z - (x - y) * to_y) / bend if bend != 0.0 and isfinite(bend) else inf
