r"""Base parameters of a robot, and its estimate: parameters with intervals, predicted effort, and the core's
parameters.

**Base parameters** are the combinations of inertial parameters that a robot's efforts determine.
Efforts are linear in ten inertial parameters of every link, a rotor inertia at each joint, and the inertia of motors
that several joints turn. Only r of these p columns are independent, whatever the motion [1]_. With the independent
columns first, Y = [Y_1 Y_2] and Y_2 = Y_1 B, so that

.. math::
   Y\theta = Y_1(\theta_1 + B\,\theta_2).

r is the rank of a regressor of random motions, by QR with pivoting. The choice of the r independent columns is a
convention. Links near the base come before those beyond. First moments and products come before moments of inertia and
masses. Rotors come after all links, so a rotor inertia is a base parameter only if no link can represent it.

.. [1] M. Gautier, "Numerical calculation of the base inertial parameters of robots", J. Robotic Systems 8, 1991.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ...models.estimates import NamedEstimates, Parameter
from ...models.friction_terms import STRIBECK_VELOCITY
from ...models.joint import PARALLEL_STIFFNESS
from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot
from .friction_terms import (
    MOTOR_PREFIX,
    STRIBECK_VELOCITY_NAME,
    coefficient_names,
    joint_core_parameters,
    motor_core_parameters,
    sum_filtered_friction,
)

if TYPE_CHECKING:
    from ..tree_motion import TreeMotion

@dataclass(frozen=True)
class BaseSettings:
    """How the base parameters are found."""

    states_per_column: int = 20  # number of random states per column of the regressor
    random_seed: int = 20261122  # random seed of these states
    # A unit column is independent if more than this share of it lies outside the span of the others. Rounding leaves
    # 1e-13.
    min_column_remainder: float = 1e-8
    # Members of a combination whose coefficient is below this are rounding and are not stated.
    min_stated_coefficient: float = 1e-6


BASE_SETTINGS = BaseSettings()


LINK_PARAMETER_ORDER = ("moment_x", "moment_y", "moment_z", "inertia_zz", "inertia_xy", "inertia_xz", "inertia_yz",
                        "inertia_xx", "inertia_yy", "mass")  # fmt: skip
"""Order in which the parameters of a link are chosen as base parameters."""

REGROUPED_SUFFIX = "regrouped"
"""Suffix of a base parameter that also represents others: ``link_2.moment_x.regrouped``."""


def rigid_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of all inertial parameters: links, then rotors, then shared motors, shape (10 l + m + s,)."""
    rotors = (f"{name}.rotor_inertia" for name in robot.names)
    motors = (f"{robot.names[i]}.motor_inertia" for i in robot.shared)
    return (*robot.tree.parameter_names, *rotors, *motors)


def rigid_columns(robot: Robot, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return the regressor of all inertial parameters at states of shape (n, m), shape (n, m, 10 l + m + s)."""
    turned = acceleration @ np.asarray(robot.turns).T
    shared = None
    if robot.shared:
        turns = np.asarray(robot.turns)[list(robot.shared)]
        shared = turned[:, None, list(robot.shared)] * turns.T[None]
    return robot.tree.core.regressor(position, velocity, acceleration, own=acceleration[:, :, None], shared=shared)


@dataclass(frozen=True)
class BaseParameters:
    """Base parameters of a robot.

    Attributes
    ----------
    names : tuple of str
        Names of the base parameters. Each is called by its leading member, with a suffix if it has other members.
    members : tuple of str
        Names of all p inertial parameters.
    chosen : ndarray of int, shape (r,)
        Indices of the leading members.
    combination : ndarray, shape (r, p)
        Matrix from inertial parameters to base parameters.
    """

    names: tuple[str, ...]
    members: tuple[str, ...]
    chosen: np.ndarray
    combination: np.ndarray

    @property
    def rigid(self) -> int:
        """Number of base parameters that belong to links."""
        return sum(not name.endswith((".rotor_inertia", ".motor_inertia")) for name in self.names)

    def reading(self, name: str) -> str:
        """Return the combination of a base parameter in words: "link_2.moment_x + 0.225 link_3.mass"."""
        row = self.combination[self.names.index(name)]
        lead = self.chosen[self.names.index(name)]
        others = [i for i in np.flatnonzero(np.abs(row) > BASE_SETTINGS.min_stated_coefficient) if i != lead]
        return _format_sum([(1.0, self.members[lead]), *((row[i], self.members[i]) for i in others)])


def _format_sum(parts: Sequence[tuple[float, str]]) -> str:
    """Format a sum such as "a - b + 0.2 c"."""
    said = ""
    for factor, name in parts:
        size = "" if abs(abs(factor) - 1.0) < BASE_SETTINGS.min_stated_coefficient else f"{abs(factor):.3g} "
        sign = (" - " if factor < 0.0 else " + ") if said else ("-" if factor < 0.0 else "")
        said += f"{sign}{size}{name}"
    return said


def find_base_parameters(robot: Robot) -> BaseParameters:
    """Compute the base parameters of a robot from its kinematics alone."""
    members = rigid_names(robot)
    rng = np.random.default_rng(BASE_SETTINGS.random_seed)
    m = len(robot.names)
    states = (
        rng.uniform(-scale, scale, (BASE_SETTINGS.states_per_column * len(members), m)) for scale in (np.pi, 3.0, 10.0)
    )
    y = rigid_columns(robot, *states).reshape(-1, len(members))
    size = np.linalg.norm(y, axis=0)
    seen = size > BASE_SETTINGS.min_column_remainder * size.max()
    y = np.divide(y, size, where=seen, out=np.zeros_like(y))
    square = np.asarray(np.linalg.qr(y, mode="r"))
    order = sorted(np.flatnonzero(seen).tolist(), key=lambda i: _choice_order(i, len(robot.tree.order)))
    leading, spanned = [], np.zeros((len(square), 0))
    for i in order:
        column = square[:, i]
        for _ in range(2):  # the second projection removes the rounding errors of the first
            column = column - spanned @ (spanned.T @ column)
        left = np.linalg.norm(column)
        if left > BASE_SETTINGS.min_column_remainder:
            leading.append(i)
            spanned = np.column_stack([spanned, column / left])
    if len(leading) != _rank(square):
        raise AssertionError("independent columns are as many as the rank")
    chosen = np.sort(leading)
    stands = np.linalg.lstsq(square[:, chosen], square, rcond=None)[0] * (size / size[chosen][:, None])
    stands[np.abs(stands) < 1e-9 * np.abs(stands).max(axis=1, keepdims=True)] = 0.0
    stands[:, chosen] = np.eye(len(chosen))
    alone = [np.count_nonzero(np.abs(row) > BASE_SETTINGS.min_stated_coefficient) == 1 for row in stands]
    names = tuple(members[i] if a else f"{members[i]}.{REGROUPED_SUFFIX}" for i, a in zip(chosen, alone, strict=True))
    return BaseParameters(names, members, chosen, stands)


def _rank(square: np.ndarray) -> int:
    """Return the rank of `square`, (p, p), whose columns have length 1 or 0, by QR with pivoting."""
    from scipy.linalg import qr

    diagonal = np.abs(np.diag(qr(square, mode="r", pivoting=True)[0]))
    return int(np.sum(diagonal > BASE_SETTINGS.min_column_remainder))


def _choice_order(index: int, links: int) -> tuple[int, int]:
    """Return the sort key of an inertial parameter in the order in which columns are chosen."""
    link, number = divmod(index, len(BODY_QUANTITIES))
    return (link, LINK_PARAMETER_ORDER.index(BODY_QUANTITIES[number])) if link < links else (links, index)


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

    def friction(self, motion: TreeMotion, load: np.ndarray) -> np.ndarray:
        """Return the friction of each joint under its `load`, filtered as the effort is; both (n, m) [N m; N]."""
        turns, width = np.eye(load.shape[1]), self.velocity_width
        each = [
            sum_filtered_friction(self.joint_numbers(k), motion, turns[k], y, width) for k, y in enumerate(load.T)
        ]
        return np.column_stack(each)

    def effort(self, motion: TreeMotion) -> np.ndarray:
        """Predict the effort at the joints, shape (n, m) [N m; N], drive ripple included."""
        turns = np.asarray(self.robot.turns)
        y = self.load(motion)
        made = y + self.friction(motion, y)
        for k in range(y.shape[1]):
            made[:, k] += self.joint_numbers(k).get(PARALLEL_STIFFNESS, 0.0) * motion.position[:, k]
        for i in self.robot.shared:
            lost = sum_filtered_friction(self.joint_numbers(i, True), motion, turns[i], None, self.velocity_width)
            made += np.outer(lost, turns[i])
        for each in self.ripples:
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


FROM_PRIOR_VERDICT = "from the prior"
"""Verdict on a parameter that stated or guessed bodies determine more than the efforts do."""

FROM_PRIOR_REASON = "from the prior: the motion does not identify it"
"""Reason for refusing the interval of such a parameter."""


def parameter_verdict(parameter: Parameter) -> str:
    """Return the verdict on a parameter: identified, weak, on a bound, from the prior, or not identifiable."""
    if parameter.refused == FROM_PRIOR_REASON:
        return FROM_PRIOR_VERDICT
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
