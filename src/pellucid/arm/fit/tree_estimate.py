"""Estimate of a robot: parameters with intervals, predicted effort, and the core's parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ...models.estimates import NamedEstimates, Parameter
from ...models.friction_terms import STRIBECK_VELOCITY
from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot
from .base_parameters import REGROUPED_SUFFIX
from .friction_terms import (
    MOTOR_PREFIX,
    STRIBECK_VELOCITY_NAME,
    coefficient_names,
    joint_core_parameters,
    motor_core_parameters,
    sum_friction,
)

if TYPE_CHECKING:
    from ..tree_motion import TreeMotion

@dataclass(frozen=True)
class Ripple:
    """Periodic effort of a drive over its motor's angle, measured at the joint side of the gear."""

    motor: int  # index of the motor
    order: float  # periods per turn, or per 2 pi m for a prismatic joint
    sine: float  # coefficient of the sine [N m; N]
    cosine: float  # coefficient of the cosine [N m; N]

    @property
    def amplitude(self) -> float:
        """Amplitude of the ripple [N m; N]."""
        return float(np.hypot(self.sine, self.cosine))

    def effort(self, angle: np.ndarray) -> np.ndarray:
        """Return the effort along the motor's angle, (n,)."""
        phase = self.order * angle
        return self.sine * np.sin(phase) + self.cosine * np.cos(phase)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TreeEstimate(NamedEstimates):
    """An identified robot.

    Attributes
    ----------
    name : str
        Name of the estimate: "base", "best", "consistent", ...
    robot : Robot
        Robot that was identified.
    families : tuple of tuple of str
        Friction terms of each joint, from `friction_terms`.
    parameters : mapping of str to Parameter
        Parameters in the order of the covariance: ``joint_3.viscous``, ``link_2.mass``, ``link_2.moment_x.regrouped``.
    covariance : ndarray, shape (p, p)
        Covariance of the parameters, SI.
    velocity_width : float
        Width of the smooth sign of friction; 0 for the true sign [rad/s; m/s].
    ripples : tuple of Ripple
        Drive ripple. `effort` includes it, the core's parameters do not.
    readings : mapping of str to str
        Combinations that regrouped parameters represent.
    residual_sd : tuple of float
        Standard deviation of each joint's residual over the fitted rows [N m; N].
    freedom : float
        Degrees of freedom of the intervals.
    method : str
        Name of the estimator.
    notes : tuple of str
        Sentences on the choices and bounds of the fit.
    """

    name: str
    robot: Robot
    families: tuple[tuple[str, ...], ...]
    parameters: Mapping[str, Parameter]
    velocity_width: float = 0.0
    ripples: tuple[Ripple, ...] = ()
    readings: Mapping[str, str] = field(default_factory=dict)
    residual_sd: tuple[float, ...] = ()
    freedom: float = float("inf")
    method: str = "weighted"
    notes: tuple[str, ...] = ()

    @property
    def every(self) -> tuple[Parameter, ...]:
        """The parameters in the order of the covariance."""
        return tuple(self.parameters.values())

    @property
    def array(self) -> np.ndarray:
        """Values of the parameters, shape (p,), SI."""
        return np.array([p.value for p in self.every])

    def value(self, name: str) -> float:
        """Return the value of a parameter, or 0 if this estimate has none of this name."""
        return self.parameters[name].value if name in self.parameters else 0.0

    def links(self) -> np.ndarray:
        """Return the core's parameters of every link, shape (l, 22).

        A regrouped parameter is assigned to its leading member. No effort can distinguish this from other shares.
        """
        made = self.robot.tree.links_array.copy()
        first = _core.LINK_PARAMETER_NAMES.index(BODY_QUANTITIES[0])
        rotor = _core.LINK_PARAMETER_NAMES.index("rotor_inertia")
        moving = {joint.name: name for joint, name in zip(self.robot.tree.moving, self.robot.names, strict=True)}
        for i, joint in enumerate(self.robot.tree.order):
            made[i, first:] = [self._rigid(f"{joint.child}.{number}") for number in BODY_QUANTITIES]
            made[i, rotor] = self._rigid(f"{moving[joint.name]}.rotor_inertia") if joint.name in moving else 0.0
        return made

    def _rigid(self, name: str) -> float:
        """Return the value of an inertial parameter, plain or regrouped."""
        return self.value(name) or self.value(f"{name}.{REGROUPED_SUFFIX}")

    def joint_numbers(self, k: int, of_motor: bool = False) -> dict[str, float]:
        """Return the friction coefficients of joint k, or of the motor with its number."""
        prefix = f"{self.robot.names[k]}.{MOTOR_PREFIX if of_motor else ''}"
        names = coefficient_names(self.families[k], of_motor)
        names += (STRIBECK_VELOCITY_NAME,) if STRIBECK_VELOCITY.shapes in names else ()
        return {name: self.value(prefix + name) for name in names}

    def joints(self) -> np.ndarray:
        """Return the core's friction parameters of each joint, shape (m, k)."""
        each = enumerate(self.robot.names)
        return np.array([joint_core_parameters(self.joint_numbers(k), self.velocity_width, name) for k, name in each])

    def motors(self) -> np.ndarray | None:
        """Return the core's parameters of the motors, shape (m, k); None if no motor turns with several joints."""
        if not self.robot.shared:
            return None
        made = np.zeros((len(self.robot.names), len(_core.TREE_MOTOR_PARAMETER_NAMES)))
        for i in self.robot.shared:
            name = self.robot.names[i]
            inertia = self._rigid(f"{name}.{MOTOR_PREFIX}inertia")
            made[i] = motor_core_parameters(self.joint_numbers(i, True), inertia, self.velocity_width, name)
        return made

    def load(self, motion: TreeMotion) -> np.ndarray:
        """Return the effort of links, rotors and motor inertias without friction, shape (n, m) [N m; N]."""
        tree = _core.KinematicTree(self.links(), np.array(self.robot.tree.gravity, float))
        y = tree.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)
        turns = np.asarray(self.robot.turns)
        for i in self.robot.shared:
            inertia = self._rigid(f"{self.robot.names[i]}.{MOTOR_PREFIX}inertia")
            y += inertia * np.outer(motion.acceleration @ turns[i], turns[i])
        return y

    def effort(self, motion: TreeMotion, *, ripple: bool = True) -> np.ndarray:
        """Predict the effort at the joints, shape (n, m) [N m; N], with or without drive ripple."""
        turns = np.asarray(self.robot.turns)
        y = self.load(motion)
        made = y.copy()
        for k in range(y.shape[1]):
            made[:, k] += sum_friction(self.joint_numbers(k), motion.velocity[:, k], y[:, k], self.velocity_width)
        for i in self.robot.shared:
            lost = sum_friction(self.joint_numbers(i, True), motion.velocity @ turns[i], None, self.velocity_width)
            made += np.outer(lost, turns[i])
        for each in self.ripples if ripple else ():
            made += np.outer(each.effort(motion.position @ turns[each.motor]), turns[each.motor])
        return made

    def _facts(self) -> tuple[str, ...]:
        return self.notes


IDENTIFIED_VERDICT = "identified"
"""Verdict on a parameter whose 95 % interval excludes 0."""

WEAK_VERDICT = "weak"
"""Verdict on a parameter whose 95 % interval contains 0."""

ON_BOUND_VERDICT = "on a bound"
"""Verdict on a parameter that a physical bound holds."""

NOT_IDENTIFIABLE_VERDICT = "not identifiable"
"""Verdict on a parameter that the recordings do not determine."""


def parameter_verdict(parameter: Parameter) -> str:
    """Return the verdict on a parameter: identified, weak, on a bound, or not identifiable."""
    if parameter.at_bound:
        return ON_BOUND_VERDICT
    if parameter.refused and not parameter.standard_error:
        return NOT_IDENTIFIABLE_VERDICT
    return IDENTIFIED_VERDICT if parameter.identifiable else WEAK_VERDICT


def parameter_verdicts(estimate: TreeEstimate) -> dict[str, str]:
    """Return the verdict on every fitted parameter by name."""
    return {
        name: parameter_verdict(p)
        for name, p in estimate.parameters.items()
        if not name.endswith(STRIBECK_VELOCITY_NAME)
    }
