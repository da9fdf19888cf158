r"""An exoskeleton's elbow as its paper prints it: Table II evaluated, and nothing corrected.

Eq. 3 and 4 of the paper, with one set of numbers for each direction of motion:

.. math::
   \tau &= g\,(m x(s) \cos q_4 + m y \sin q_4) + \nu \dot q_4 + J(s)\,\ddot q_4 + \tau_C\,\mathrm{sign}\,\dot q_4 \\
   m x(s) &= c_1 s + c_0, \qquad J(s) = a_0 + a_1 s + a_2 s^2, \qquad k_t\,i = \tau / r_4

s is the slider's position. The numbers do not describe a joint that can exist (`coherence.inconsistencies`,
``docs/errata.md``): this model is for comparing with the paper, never a plant or a compensation.

The paper measures the angle from the horizontal; the rest of Pellucid from hanging. `published_angle` converts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pellucid._errors import PellucidError
from pellucid.models.joint import GRAVITY

from ..printed import printed

TABLE_DIRECTIONS = ("down", "static", "up")
"""Directions of motion for which Table II of the paper has a set of parameters; "static" is rest."""


@dataclass(frozen=True)
class DirectionSet:
    """The parameters of one direction; None where the table is empty."""

    m_x_slope: float  # c_1: first moment along the forearm per metre of slider [kg]
    m_x_offset: float  # c_0 [kg*m]
    m_y: float  # First moment across the forearm [kg*m]
    adherence: float | None = None  # Friction at rest [N*m]
    coulomb: float | None = None  # Coulomb friction in motion [N*m]
    viscous: float | None = None  # Viscous friction [N*m*s/rad]; the paper prints another unit
    inertia: tuple[float, float, float] | None = None  # a_0 [kg*m^2], a_1 [kg*m], a_2 [kg]


@dataclass(frozen=True)
class PublishedElbow:
    """A direction-dependent elbow with a slider, in the paper's own angle: 0 is horizontal [rad]."""

    source: str  # Publication and table of its numbers
    sets: Mapping[str, DirectionSet]  # Sets by direction, one of `TABLE_DIRECTIONS`

    def direction(self, name: str) -> DirectionSet:
        """Return the set of a direction."""
        if name not in self.sets:
            raise PellucidError(f"direction {name!r}; expected one of {', '.join(self.sets)}")
        return self.sets[name]

    def first_moment(self, direction: str, slider: float | np.ndarray) -> float | np.ndarray:
        """Return m x(s) [kg*m], of the shape of `slider` [m]; `direction` is one of `TABLE_DIRECTIONS`."""
        found = self.direction(direction)
        return found.m_x_slope * np.asarray(slider, float) + found.m_x_offset

    def gravity(self, direction: str, slider: float | np.ndarray, angle: float | np.ndarray) -> float | np.ndarray:
        """Return the gravity term [N*m], with the paper's plus sign before the sine; slider [m], angle [rad]."""
        m_y = self.direction(direction).m_y
        return GRAVITY * (self.first_moment(direction, slider) * np.cos(angle) + m_y * np.sin(angle))

    def inertia(self, direction: str, slider: float | np.ndarray) -> float | np.ndarray:
        """Return J(s) [kg*m^2], negative where the table makes it so; slider [m]."""
        found = self.direction(direction).inertia
        if found is None:
            raise PellucidError(f"{self.source} gives no inertia for direction {direction!r}")
        slider = np.asarray(slider, float)
        return found[0] + found[1] * slider + found[2] * slider**2

    def friction(self, direction: str, velocity: float | np.ndarray) -> float | np.ndarray:
        """Return Coulomb and viscous friction, or at rest the adherence as printed, sign included.

        velocity [rad/s]; gives [N*m].
        """
        found = self.direction(direction)
        velocity = np.asarray(velocity, float)
        if found.coulomb is None or found.viscous is None:
            return np.full(velocity.shape, found.adherence if found.adherence is not None else 0.0)
        return found.coulomb * np.sign(velocity) + found.viscous * velocity

    def torque(
        self,
        direction: str,
        slider: float | np.ndarray,
        angle: float | np.ndarray,
        velocity: float | np.ndarray,
        acceleration: float | np.ndarray,
    ) -> float | np.ndarray:
        """Return the torque at the joint: gravity, friction, and except for the static set inertia.

        slider [m], angle [rad], velocity [rad/s], acceleration [rad/s^2]; gives [N*m].
        """
        total = self.gravity(direction, slider, angle) + self.friction(direction, velocity)
        if self.direction(direction).inertia is None:
            return total
        return total + self.inertia(direction, slider) * np.asarray(acceleration, float)

    def current(self, torque: float | np.ndarray, *, torque_constant: float, reduction: float) -> float | np.ndarray:
        """Return the motor current for a torque at the joint; neither constant is printed, so neither has a default.

        torque [N*m], torque_constant [N*m/A]; gives [A].
        """
        if not torque_constant > 0.0 or not reduction > 0.0:
            raise PellucidError(f"torque constant {torque_constant}, reduction {reduction}: both must be positive")
        return np.asarray(torque, float) / (torque_constant * reduction)


def published_angle(position: float | np.ndarray) -> float | np.ndarray:
    """Return the paper's angle for Pellucid's: both grow while the forearm rises, by eq. 2 with Y upward.

    position [rad]; gives [rad].
    """
    return np.asarray(position, float) - 0.5 * np.pi


def able_elbow() -> PublishedElbow:
    """Return Table II of the paper ``able``."""
    paper = printed("able")
    table = paper.tables["elbow"]
    sets = {}
    for name in TABLE_DIRECTIONS:
        cells = {column: cell.value for column, cell in table[name].items()}
        inertia = tuple(cells.pop(a) for a in ("a0", "a1", "a2")) if "a0" in cells else None
        sets[name] = DirectionSet(**cells, inertia=inertia)
    return PublishedElbow(f"{paper.authors}, {paper.journal} {paper.year}, {table.where}", sets)
