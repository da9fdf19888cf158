r"""Least squares within bounds by Levenberg-Marquardt steps [1]_, from normal equations alone.

Each step solves

.. math::  (J^T J + \mu \, \mathrm{diag}(J^T J)) \, s = -J^T r

for the parameters that are not held by a bound; a step beyond a bound is shortened to it. The damping :math:`\mu`
decreases when the cost falls as the linear model predicts and increases otherwise [2]_. A parameter on a bound is held
as long as the gradient points outwards. No Jacobian has to be stored: its products may be summed in one pass over the
samples.

.. [1] D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", J. SIAM 11, 1963.
.. [2] K. Madsen, H. B. Nielsen, O. Tingleff, "Methods for non-linear least squares problems", 2nd ed., DTU, 2004.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError

NormalEquations = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]
"""A function from parameters (p,) to half the sum of squares, J'r of shape (p,), and J'J of shape (p, p)."""

_FIRST_DAMPING = 0.1
"""Damping of the first step."""

_MAX_DAMPING = 1e12
"""The search stops when no step reduces the cost up to this damping."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Result of a bounded least-squares search."""

    x: np.ndarray  # (p,) parameters
    cost: float  # half the sum of squares
    gradient: np.ndarray = field(repr=False)  # (p,) J'r
    normal: np.ndarray = field(repr=False)  # (p, p) J'J
    evaluations: int = 0  # number of evaluations of the normal equations
    converged: bool = True  # whether no further step would reduce the cost by more than the tolerance


def bounded_least_squares(
    equations: NormalEquations,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    iterations: int = 60,
    tolerance: float = 1e-5,
    damping: float = _FIRST_DAMPING,
) -> Descent:
    """Minimise a sum of squares within bounds; `start`, `lower` and `upper` have shape (p,).

    The search ends where a step promises to reduce the cost by less than the share `tolerance`. `damping` is that of
    the first step.
    """
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    if not np.all(lower <= upper):
        raise IdentificationError(f"found the bounds {lower} and {upper}, expected no lower one above its upper one")
    x = np.clip(np.asarray(start, float), lower, upper)
    cost, gradient, normal = equations(x)
    if not np.isfinite(cost):
        raise IdentificationError(f"found the cost {cost} at the start {x}, expected a finite number")
    rise, evaluations = 2.0, 1
    while evaluations < iterations:
        rests = ((x <= lower) & (gradient > 0.0)) | ((x >= upper) & (gradient < 0.0)) | (lower == upper)
        if rests.all():
            return Descent(x, cost, gradient, normal, evaluations)
        step = _step(gradient, normal, damping, lower - x, upper - x, ~rests)
        if np.all(np.abs(step) <= np.finfo(float).eps * np.abs(x)):
            return Descent(x, cost, gradient, normal, evaluations)
        promise = -float(gradient @ step) - 0.5 * float(step @ normal @ step)
        if promise <= tolerance * cost:
            # A heavily damped or shortened step predicts little decrease anywhere, so this is no sign of convergence.
            if promise >= 0.0 and damping <= 1.0:
                return Descent(x, cost, gradient, normal, evaluations)
            damping, rise = (damping / 10.0, 2.0) if promise >= 0.0 else (damping * 10.0, 2.0)
            evaluations += 1
            continue
        tried = equations(x + step)
        evaluations += 1
        ratio = (cost - tried[0]) / promise
        if np.isfinite(tried[0]) and ratio > 1e-4:
            x = x + step
            cost, gradient, normal = tried
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3), 1e-12)
            rise = 2.0
        else:
            damping, rise = damping * rise, 2.0 * rise
            if damping > _MAX_DAMPING:
                return Descent(x, cost, gradient, normal, evaluations)
    return Descent(x, cost, gradient, normal, evaluations, converged=False)


def _step(gradient, normal, damping, lowest, highest, free) -> np.ndarray:
    """Return a damped step. Parameters that would leave their bounds end on them, and the others are solved again."""
    scale = np.diag(normal)
    damped = normal + np.diag(damping * np.maximum(scale, 1e-12 * scale.max(initial=1e-300)))
    step, free = np.zeros(len(gradient)), free.copy()
    while free.any():
        if free.all():
            step = np.linalg.solve(damped, -gradient)
        else:
            inner = np.ix_(free, free)
            step[free] = np.linalg.solve(damped[inner], -(gradient + damped[:, ~free] @ step[~free])[free])
        beyond = free & ((step < lowest) | (step > highest))
        if not beyond.any():
            break
        step = np.clip(step, lowest, highest)
        free &= ~beyond
    return step
