r"""The published model of an elbow with a carriage: one set of every parameter for each direction of motion.

.. math::
   \tau = g\,[(s_1 x + s_0)\sin q + c\cos q] + \nu\dot q + (a_0 + a_1 x + a_2 x^2)\ddot q + sign(\dot q)\,\tau_{dry}

with its own s, c, nu, a and tau_dry while the joint goes up and while it goes down [1]_, eqs. 3 and 4. Here q = 0 hangs
(the paper's is horizontal: its cosine is our sine). Nothing ties the sets to each other or to a body that could exist.

.. [1] D. Verdel et al., "An identification-based method improving the transparency of a robotic upper limb
   exoskeleton", Robotica 39, 2021.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .filtered_dynamics import regressor
from .joint import GRAVITY, NAMES, PARAMETER_INDEX

UNITS: Mapping[str, str] = {
    "moment_slope": "kg",
    "moment": "kg*m",
    "cross_moment": "kg*m",
    "coulomb": "N*m",
    "viscous": "N*m*s/rad",
    "a0": "kg*m^2",
    "a1": "kg*m",
    "a2": "kg",
}
"""Parameters of one set, in the order of every array, and their units."""

GRAVITY_TERMS = slice(0, 3)
"""Places of the gravity parameters in a set."""

FRICTION_TERMS = slice(3, 5)
"""Places of the friction parameters in a set."""

INERTIA_TERMS = slice(5, 8)
"""Places of the inertia parameters in a set."""

VELOCITY_WIDTH = 0.01  # rad/s: of the smooth sign, a twentieth of the slowest commanded velocity


def selection(slider: float) -> np.ndarray:
    """Matrix, (13, 8), with core vector = selection @ one set, the carriage at `slider` [m]."""
    one = {
        "moment_slope": {"gravity_sine": GRAVITY * slider},
        "moment": {"gravity_sine": GRAVITY},
        "cross_moment": {"gravity_cosine": GRAVITY},
        "coulomb": {"coulomb_positive": 1.0, "coulomb_negative": 1.0},
        "viscous": {"viscous_positive": 1.0, "viscous_negative": 1.0},
        "a0": {"inertia": 1.0},
        "a1": {"inertia": slider},
        "a2": {"inertia": slider**2},
    }
    matrix = np.zeros((len(NAMES), len(UNITS)))
    for column, name in enumerate(UNITS):
        for target, gain in one[name].items():
            matrix[PARAMETER_INDEX[target], column] = gain
    return matrix


def columns(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, slider: float) -> np.ndarray:
    """Torque per unit of each parameter, (n, 8), SI, along `position`, `velocity` and `acceleration`, (n,), with the
    carriage at `slider` [m]."""
    chosen = selection(slider)
    terms = tuple(np.flatnonzero(chosen.any(axis=1)).tolist())
    return regressor(position, velocity, acceleration, terms, VELOCITY_WIDTH) @ chosen[list(terms)]


@dataclass(frozen=True)
class DirectionalSliderModel:
    """Two sets of parameters, or twice the same."""

    up: np.ndarray  # up, down: (8,) While the velocity is positive (lifts) and negative; SI, in the order of `UNITS`
    down: np.ndarray

    def torque(self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, slider: float) -> np.ndarray:
        """Torque at the joint, shape (n,) [N*m]; it jumps where the velocity changes sign. `position`, `velocity`,
        `acceleration` (n,) [rad], [rad/s], [rad/s^2]; `slider` [m]; gives (n,)."""
        terms = columns(position, velocity, acceleration, slider)
        return np.where(velocity > 0.0, terms @ self.up, terms @ self.down)

    def gravity(self, direction: str, slider: np.ndarray, position: np.ndarray) -> np.ndarray:
        """The set's gravity torque. `slider`, `position` [m], [rad]; gives [N*m]."""
        s1, s0, c = (self.up if direction == "up" else self.down)[GRAVITY_TERMS]
        return GRAVITY * ((s1 * slider + s0) * np.sin(position) + c * np.cos(position))

    def inertia(self, direction: str, slider: np.ndarray) -> np.ndarray:
        """The set's J(x) [kg*m^2] at x [m]; `direction` is "up" or "down"."""
        a0, a1, a2 = (self.up if direction == "up" else self.down)[INERTIA_TERMS]
        return a0 + a1 * slider + a2 * slider**2
