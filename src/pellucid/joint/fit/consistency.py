r"""Physical consistency of a rotary joint's inertia and gravity: the planar pseudo-inertia condition.

A body of mass m whose first moments about the axis give the gravity amplitude :math:`m g d` has

.. math::  J \ge m d^2 = \frac{g_s^2 + g_c^2}{m g^2}

about that axis [1]_, whatever its shape. With an upper limit on the moving mass this bounds the inertia from below.

.. [1] P. M. Wensing, S. Kim, J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial parameter
   identification", IEEE Robot. Autom. Lett. 3, 2018.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...models.joint import GRAVITY, JointModel
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, nearest_feasible, regression_rows

RELINEARISATION_COUNT = 4
"""Number of relinearisations of a nonlinear model. A model that is linear in its parameters needs one."""


def least_inertia(model: JointModel, values: np.ndarray, mass: float) -> float:
    """Return the smallest inertia about the axis that a body with the model's gravity can have [kg*m^2].

    `values` has shape (p,); `mass` is the moving mass [kg].
    """
    free = dict(zip(model.names, values, strict=True))
    amplitude2 = sum(free.get(n, model.known.get(n, 0.0)) ** 2 for n in ("gravity", "gravity_cosine"))
    return float(amplitude2 / (mass * GRAVITY**2))


def enforce_pseudo_inertia(
    model: JointModel, data: Stack[Motion], found: Solution, mass: float
) -> tuple[Solution, tuple[str, ...]]:
    """Move the least-squares solution `found` to the nearest physically consistent one, in the metric of its residuals.

    The body has at most `mass` [kg]. Returns the solution, and a note if it was moved.
    """
    if "inertia" not in model.names or model.motion != "rotary" or model.effort_unit != "N*m":
        return found, ()
    i = model.names.index("inertia")
    if found.values[i] >= least_inertia(model, found.values, mass):
        return found, ()
    values, jacobian, residual = found.values, found.jacobian, found.residual
    w, least = found.weights, max(least_inertia(model, found.values, mass), np.finfo(float).tiny)

    def room(x: np.ndarray) -> float:
        return (x[i] - least_inertia(model, x, mass)) / least

    for _ in range(1 if model.linear else RELINEARISATION_COUNT):
        values = nearest_feasible(jacobian * w[:, None], residual * w, values, model.bounds(), room, values)[0]
        jacobian, effort = regression_rows(model, values, data)
        residual = data.target - effort
    at_bound = found.at_bound.copy()
    at_bound[i] = True
    note = f"inertia is held at the least that {mass:g} kg with this gravity torque can have"
    return replace(found, values=values, jacobian=jacobian, residual=residual, at_bound=at_bound), (note,)
