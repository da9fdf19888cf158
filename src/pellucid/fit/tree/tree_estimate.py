"""An identified robot: its numbers with their intervals, what effort it predicts, and the core's numbers for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot
from ..estimates import Estimates
from ..parameter import Parameter
from .base_parameters import REGROUPED
from .friction_terms import MOTOR, SPEED, friction, joint_row, motor_row, numbers_of

if TYPE_CHECKING:
    from ...signals.tree_motion import TreeMotion


@dataclass(frozen=True)
class Ripple:
    """What a drive adds with its motor's angle, gears taken out: `order` periods a turn (of a slide: in 2 pi m)."""

    motor: int
    order: float
    sine: float  # [N m; N]
    cosine: float

    @property
    def amplitude(self) -> float:
        """[N m; N]."""
        return float(np.hypot(self.sine, self.cosine))

    def effort(self, angle: np.ndarray) -> np.ndarray:
        """Along the motor's angle, (n,)."""
        phase = self.order * angle
        return self.sine * np.sin(phase) + self.cosine * np.cos(phase)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TreeEstimate(Estimates):
    """An identified robot.

    Attributes
    ----------
    name : str
        "base", "best", "consistent", ...
    robot : Robot
    families : tuple of tuple of str
        Friction terms of each joint, out of `friction_terms`.
    parameters : mapping of str to Parameter
        In the order of the covariance: ``joint_3.viscous``, ``link_2.mass``, ``link_2.moment_x.regrouped``.
    covariance : ndarray, shape (p, p)
    velocity_width : float
        Of the smooth sign of friction; 0: the true sign [rad/s; m/s].
    ripples : tuple of Ripple
        What drives add with their angle. `effort` has it, the core's numbers have not.
    readings : mapping of str to str
        What regrouped parameters stand for.
    residual_sd : tuple of float
        Of each joint, over the rows that were fitted [N m; N].
    freedom : float
        Degrees of freedom of the intervals.
    method : str
        Which estimator.
    notes : tuple of str
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
        """Their values, shape (p,), SI."""
        return np.array([p.value for p in self.every])

    def value(self, name: str) -> float:
        """Of a parameter; 0 where this estimate has none of this name."""
        return self.parameters[name].value if name in self.parameters else 0.0

    def links(self) -> np.ndarray:
        """Numbers of every link for the core, shape (l, 22): regrouped ones are given to the member they are called by,
        which no effort can tell from any other share."""
        made = self.robot.tree.links_array.copy()
        first = _core.LINK_PARAMETER_NAMES.index(BODY_QUANTITIES[0])
        rotor = _core.LINK_PARAMETER_NAMES.index("rotor_inertia")
        moving = {joint.name: name for joint, name in zip(self.robot.tree.moving, self.robot.names, strict=True)}
        for i, joint in enumerate(self.robot.tree.order):
            made[i, first:] = [self._rigid(f"{joint.child}.{number}") for number in BODY_QUANTITIES]
            made[i, rotor] = self._rigid(f"{moving[joint.name]}.rotor_inertia") if joint.name in moving else 0.0
        return made

    def _rigid(self, name: str) -> float:
        return self.value(name) or self.value(f"{name}.{REGROUPED}")

    def joint_numbers(self, k: int, of_motor: bool = False) -> dict[str, float]:
        """Coefficients of the friction of joint k, or of the motor of its number."""
        prefix = f"{self.robot.names[k]}.{MOTOR if of_motor else ''}"
        names = numbers_of(self.families[k], of_motor)
        names += (SPEED,) if "stribeck" in names else ()
        return {name: self.value(prefix + name) for name in names}

    def joints(self) -> np.ndarray:
        """What loses effort at each joint, for the core, shape (m, k)."""
        each = enumerate(self.robot.names)
        return np.array([joint_row(self.joint_numbers(k), self.velocity_width, name) for k, name in each])

    def motors(self) -> np.ndarray | None:
        """Of motors, where some turn with several joints, for the core, shape (m, k); else None."""
        if not self.robot.shared:
            return None
        made = np.zeros((len(self.robot.names), len(_core.TREE_MOTOR_PARAMETER_NAMES)))
        for i in self.robot.shared:
            name = self.robot.names[i]
            inertia = self._rigid(f"{name}.{MOTOR}inertia")
            made[i] = motor_row(self.joint_numbers(i, True), inertia, self.velocity_width, name)
        return made

    def load(self, motion: TreeMotion) -> np.ndarray:
        """What bodies, rotors and motors' inertias need, without friction, shape (n, m) [N m; N]."""
        tree = _core.KinematicTree(self.links(), np.array(self.robot.tree.gravity, float))
        y = tree.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)
        turns = np.asarray(self.robot.turns)
        for i in self.robot.shared:
            inertia = self._rigid(f"{self.robot.names[i]}.{MOTOR}inertia")
            y += inertia * np.outer(motion.acceleration @ turns[i], turns[i])
        return y

    def effort(self, motion: TreeMotion, *, ripple: bool = True) -> np.ndarray:
        """Predicted at the joints, shape (n, m) [N m; N]; drives' ripple with it, unless it is left out."""
        turns = np.asarray(self.robot.turns)
        y = self.load(motion)
        made = y.copy()
        for k in range(y.shape[1]):
            made[:, k] += friction(self.joint_numbers(k), motion.velocity[:, k], y[:, k], self.velocity_width)
        for i in self.robot.shared:
            lost = friction(self.joint_numbers(i, True), motion.velocity @ turns[i], None, self.velocity_width)
            made += np.outer(lost, turns[i])
        for each in self.ripples if ripple else ():
            made += np.outer(each.effort(motion.position @ turns[each.motor]), turns[each.motor])
        return made

    def _facts(self) -> tuple[str, ...]:
        return self.notes
