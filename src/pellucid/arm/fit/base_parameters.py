r"""Base parameters of a robot: the combinations of inertial parameters that its efforts determine.

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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot


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
