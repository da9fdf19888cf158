r"""Stochastic particle swarm and conjugate gradients in alternation: a global search refined by a local one.

The particles have no velocities [1]_; each moves by

.. math::  x_i \leftarrow x_i + c_1 r_1 (p_i - x_i) + c_2 r_2 (p_g - x_i)

towards its own best place and the swarm's best place. The particle at the swarm's best place is redrawn uniformly
within the bounds, so that the search reaches every place eventually. Conjugate gradients [2]_ descend from the best
place, and the swarm continues from there.

.. [1] Z. Cui, J. Zeng, "A guaranteed global convergence particle swarm optimizer", RSCTC, 2004.
.. [2] E. Polak, G. Ribiere, "Note sur la convergence de methodes de directions conjuguees", RIRO 3, 1969.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError
from .adam import CostAndGradient

Cost = Callable[[np.ndarray], float]
"""A function from parameters of shape (p,) to a cost."""


@dataclass(frozen=True)
class LineSearchSettings:
    """Armijo's condition, and how far a line search goes."""

    # A step must reduce the cost by at least this share of the decrease that the slope predicts (Armijo's condition).
    min_decrease_share: float = 1e-4
    # After a failed try, a line search shortens the step by a factor within these bounds.
    shrink_bounds: tuple[float, float] = (0.1, 0.5)
    max_tries: int = 30  # A line search gives up after this many tries
    # A fine line search ends within this share of the step from the minimum of its parabola.
    fine_tolerance: float = 0.01
    # A coarse line search, used between two swarms, ends within this share of the step. It needs fewer evaluations, but
    # its directions do not stay conjugate.
    coarse_tolerance: float = 0.1


LINE_SEARCH = LineSearchSettings()


@dataclass(frozen=True, eq=False)
class Search:
    """Result of a search, with its effort."""

    best: np.ndarray  # (p,) parameters of the lowest cost
    cost: float  # lowest cost
    evaluations: int  # number of evaluations of the cost, with or without gradient
    gradients: int  # number of evaluations of the gradient
    # (k, 2) number of evaluations and lowest cost so far, each time the lowest cost fell
    trail: np.ndarray = field(repr=False)

    def evaluations_until(self, cost: float) -> int | None:
        """Return the number of evaluations until the cost was at most `cost`; None if it never was."""
        reached = np.flatnonzero(self.trail[:, 1] <= cost)
        return int(self.trail[reached[0], 0]) if len(reached) else None


class _CountedCost:
    """A cost function that counts its evaluations and keeps the best parameters."""

    def __init__(self, cost: Cost | None, with_gradient: CostAndGradient):
        self._cost, self._with_gradient = cost, with_gradient
        self.evaluations = self.gradients = 0
        self.best: np.ndarray | None = None
        self.lowest = np.inf
        self.trail: list[tuple[int, float]] = []

    def value(self, x: np.ndarray) -> float:
        found = self._cost(x) if self._cost is not None else self._with_gradient(x)[0]
        return self._seen(x, float(found))

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        found, gradient = self._with_gradient(x)
        self.gradients += 1
        return self._seen(x, float(found)), np.asarray(gradient, dtype=float)

    def _seen(self, x: np.ndarray, found: float) -> float:
        self.evaluations += 1
        if found < self.lowest:
            self.lowest, self.best = found, np.array(x)
            self.trail.append((self.evaluations, found))
        # A cost that is not finite counts as infinite, so it is never the best.
        return found if np.isfinite(found) else np.inf

    def search(self) -> Search:
        if self.best is None:
            raise IdentificationError("found no place with a finite cost within the bounds, expected at least one")
        trail = np.array(self.trail, dtype=float)
        return Search(self.best, self.lowest, self.evaluations, self.gradients, trail)


def conjugate_gradient(
    cost: CostAndGradient,
    start: np.ndarray,
    *,
    value: Cost | None = None,
    lower: np.ndarray | None = None,
    upper: np.ndarray | None = None,
    iterations: int = 200,
    tolerance: float = 1e-8,
) -> Search:
    """Descend by Polak-Ribiere conjugate gradients [2]_ with a line search that stays within bounds.

    A parameter on a bound is held as long as the gradient points outwards. When the set of held parameters changes, or
    a direction leads upwards, the search restarts along the gradient. Line searches use `value`, the cost without
    gradient, if it is given. `start`, `lower` and `upper` have shape (p,).
    """
    start = np.asarray(start, dtype=float)
    low, high = _bounds(
        np.full(start.shape, -np.inf) if lower is None else lower,
        np.full(start.shape, np.inf) if upper is None else upper,
    )
    counted = _CountedCost(value, cost)
    _descend(counted, start, low, high, iterations, tolerance, LINE_SEARCH.fine_tolerance)
    return counted.search()


def swarm_with_gradients(
    cost: Cost,
    cost_and_gradient: CostAndGradient,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    rng: np.random.Generator,
    rounds: int = 3,
    particles: int = 20,
    iterations: int = 30,
    descent: int = 50,
    pull: tuple[float, float] = (1.8, 1.8),
) -> Search:
    """Alternate swarm and conjugate gradients, each starting from the other's best place; bounds have shape (p,)."""
    low, high = _bounds(lower, upper)
    counted = _CountedCost(cost, cost_and_gradient)
    for _ in range(rounds):
        _swarm(counted, low, high, rng, particles, iterations, pull, counted.best)
        if counted.best is not None:
            _descend(counted, counted.best, low, high, descent, 1e-8, LINE_SEARCH.coarse_tolerance)
    return counted.search()


def _bounds(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    if low.shape != high.shape or not np.all(low < high):
        raise IdentificationError(
            f"found the bounds {low} and {high}, expected each lower one below its upper one, of one shape"
        )
    return low, high


def _swarm(counted, low, high, rng, particles, iterations, pull, start) -> None:
    x = rng.uniform(low, high, (particles, len(low)))
    if start is not None:
        x[0] = np.clip(start, low, high)
    own, reached = x.copy(), np.array([counted.value(each) for each in x])
    for _ in range(iterations):
        first = int(np.argmin(reached))
        r1, r2 = rng.random((2, *x.shape))
        x = np.clip(x + pull[0] * r1 * (own - x) + pull[1] * r2 * (own[first] - x), low, high)
        x[first] = rng.uniform(low, high)
        found = np.array([counted.value(each) for each in x])
        better = found < reached
        own[better], reached[better] = x[better], found[better]


def _descend(counted, start, low, high, iterations, tolerance, near) -> None:
    x = np.clip(start, low, high)
    value, gradient = counted.value_and_gradient(x)
    if not np.isfinite(value):
        raise IdentificationError(f"found the cost {value} at the start {x}, expected a finite number")
    direction: np.ndarray | None = None
    before = np.zeros(len(x))
    resting = np.zeros(len(x), bool)
    step = 1.0 / max(float(np.abs(gradient).sum()), np.finfo(float).tiny)
    for _ in range(iterations):
        rests = ((x <= low) & (gradient > 0.0)) | ((x >= high) & (gradient < 0.0))
        down = np.where(rests, 0.0, -gradient)
        if not np.any(down):
            return
        conjugate = None
        if direction is not None and np.array_equal(rests, resting):
            # The factor is at least 0; at 0 the search restarts along the gradient.
            share = max(float(gradient @ (gradient - before)) / max(float(before @ before), np.finfo(float).tiny), 0.0)
            conjugate = down + share * np.where(rests, 0.0, direction)
        direction = down if conjugate is None or float(conjugate @ gradient) >= 0.0 else conjugate
        resting, before = rests, gradient
        found = _line_search(counted, x, value, gradient, direction, step, low, high, near)
        if found is None and direction is not down:
            direction = down
            found = _line_search(counted, x, value, gradient, direction, step, low, high, near)
        if found is None:
            return
        fall = value - found[2]
        x, step, value, gradient = found
        if fall <= tolerance * (abs(value) + np.finfo(float).tiny):
            return


def _line_search(counted, x, value, gradient, direction, step, low, high, near):
    """Return point, step, cost and gradient after a step that satisfies Armijo's condition; None if none does."""
    slope, best, length = float(gradient @ direction), None, step
    for _ in range(LINE_SEARCH.max_tries):
        point = np.clip(x + length * direction, low, high)
        found = counted.value(point)
        promise = float(gradient @ (point - x))
        if found <= value + LINE_SEARCH.min_decrease_share * promise and promise < 0.0:
            if best is not None and found >= best[1]:
                break
            best = (length, found)
            # The parabola through both costs and the slope predicts the minimum; go on if it lies further away.
            curve = found - value - slope * length
            ahead = -slope * length**2 / (2.0 * curve) if curve > 0.0 else 4.0 * length
            if abs(ahead - length) <= near * length:
                break
            length = float(np.clip(ahead, 0.25 * length, 4.0 * length))
        elif best is not None:
            break
        else:
            curve = found - value - slope * length
            ahead = -slope * length**2 / (2.0 * curve) if np.isfinite(curve) and curve > 0.0 else 0.0
            length = float(np.clip(ahead, LINE_SEARCH.shrink_bounds[0] * length, LINE_SEARCH.shrink_bounds[1] * length))
    if best is None:
        return None
    point = np.clip(x + best[0] * direction, low, high)
    found, changed = counted.value_and_gradient(point)
    return point, best[0], found, changed
