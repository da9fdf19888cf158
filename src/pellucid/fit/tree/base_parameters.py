r"""Which of a robot's numbers its efforts can tell: base parameters, and what each of them stands for.

Efforts are linear in ten numbers of every link, a rotor at each joint and the inertia of motors that several joints
turn. Of these p columns only r are independent, whatever the motion [1]_. With the independent ones first,
Y = [Y_1 Y_2] and Y_2 = Y_1 B, so that

.. math::
   Y\theta = Y_1(\theta_1 + B\,\theta_2).

r is the rank of a regressor of random motions, by QR with pivoting. Which r columns stand for the others is a choice:
numbers of links near the base before those beyond, first moments and products before moments of inertia and masses,
rotors after all links. What a rotor adds is then its own parameter only where no link can stand for it.

.. [1] M. Gautier, "Numerical calculation of the base inertial parameters of robots", J. Robotic Systems 8, 1991.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot

SAMPLES = 20  # random motions for each column
SEED = 20261122
INDEPENDENT = 1e-8  # of a unit column, what others must leave of it; rounding leaves 1e-13
SHOWN = 1e-6  # of a combination's leading member: smaller members are rounding
READ_FIRST = ("moment_x", "moment_y", "moment_z", "inertia_zz", "inertia_xy", "inertia_xz", "inertia_yz", "inertia_xx",
              "inertia_yy", "mass")  # fmt: skip
REGROUPED = "regrouped"
"""Ending of a parameter that stands for others too: ``link_2.moment_x.regrouped``."""


def rigid_names(robot: Robot) -> tuple[str, ...]:
    """Numbers that efforts are linear in: of every link, of the rotor of every joint, of every motor that joints share,
    shape (10 l + m + s,)."""
    rotors = (f"{name}.rotor_inertia" for name in robot.names)
    motors = (f"{robot.names[i]}.motor_inertia" for i in robot.shared)
    return (*robot.tree.parameter_names, *rotors, *motors)


def rigid_columns(robot: Robot, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Their regressor along states of shape (n, m), shape (n, m, 10 l + m + s)."""
    turned = acceleration @ np.asarray(robot.turns).T
    shared = None
    if robot.shared:
        turns = np.asarray(robot.turns)[list(robot.shared)]
        shared = turned[:, None, list(robot.shared)] * turns.T[None]
    return robot.tree.core.regressor(position, velocity, acceleration, own=acceleration[:, :, None], shared=shared)


@dataclass(frozen=True)
class BaseParameters:
    """Numbers of a robot that its efforts can tell.

    Attributes
    ----------
    names : tuple of str
        Of the base parameters: the member that stands for the others, marked where it does.
    members : tuple of str
        All p numbers.
    chosen : ndarray of int, shape (r,)
        Which of these stand for the others.
    combination : ndarray, shape (r, p)
        Base parameters = combination @ numbers.
    """

    names: tuple[str, ...]
    members: tuple[str, ...]
    chosen: np.ndarray
    combination: np.ndarray

    @property
    def rigid(self) -> int:
        """How many of them belong to links."""
        return sum(not name.endswith((".rotor_inertia", ".motor_inertia")) for name in self.names)

    @property
    def rotors(self) -> int:
        """How many are rotors that can be told from links."""
        return sum(name.endswith(".rotor_inertia") for name in self.names)

    def reading(self, name: str) -> str:
        """What a base parameter stands for: "link_2.moment_x + 0.225 link_3.mass"."""
        row = self.combination[self.names.index(name)]
        lead = self.chosen[self.names.index(name)]
        others = [i for i in np.flatnonzero(np.abs(row) > SHOWN) if i != lead]
        return _sum_of([(1.0, self.members[lead]), *((row[i], self.members[i]) for i in others)])


def _sum_of(parts: Sequence[tuple[float, str]]) -> str:
    """ "a - b + 0.2 c"."""
    said = ""
    for factor, name in parts:
        size = "" if abs(abs(factor) - 1.0) < SHOWN else f"{abs(factor):.3g} "
        sign = (" - " if factor < 0.0 else " + ") if said else ("-" if factor < 0.0 else "")
        said += f"{sign}{size}{name}"
    return said


def base_parameters(robot: Robot) -> BaseParameters:
    """Of a robot, from its kinematics alone."""
    members = rigid_names(robot)
    rng = np.random.default_rng(SEED)
    m = len(robot.names)
    states = (rng.uniform(-scale, scale, (SAMPLES * len(members), m)) for scale in (np.pi, 3.0, 10.0))
    y = rigid_columns(robot, *states).reshape(-1, len(members))
    size = np.linalg.norm(y, axis=0)
    seen = size > INDEPENDENT * size.max()
    y = np.divide(y, size, where=seen, out=np.zeros_like(y))
    square = np.linalg.qr(y, mode="r")
    order = sorted(np.flatnonzero(seen), key=lambda i: _place(i, members[i], len(robot.tree.order)))
    chosen, spanned = [], np.zeros((len(square), 0))
    for i in order:
        column = square[:, i]
        for _ in range(2):  # twice is enough: what rounding left of the first projection goes in the second
            column = column - spanned @ (spanned.T @ column)
        left = np.linalg.norm(column)
        if left > INDEPENDENT:
            chosen.append(i)
            spanned = np.column_stack([spanned, column / left])
    if len(chosen) != _rank(square):
        raise AssertionError("independent columns are as many as the rank")
    chosen = np.sort(chosen)
    stands = np.linalg.lstsq(square[:, chosen], square, rcond=None)[0] * (size / size[chosen][:, None])
    stands[np.abs(stands) < 1e-9 * np.abs(stands).max(axis=1, keepdims=True)] = 0.0
    stands[:, chosen] = np.eye(len(chosen))
    alone = [np.count_nonzero(np.abs(row) > SHOWN) == 1 for row in stands]
    names = tuple(members[i] if a else f"{members[i]}.{REGROUPED}" for i, a in zip(chosen, alone, strict=True))
    return BaseParameters(names, members, chosen, stands)


def _rank(square: np.ndarray) -> int:
    """By QR with pivoting: `square`, (p, p), has columns of length 1 or 0."""
    from scipy.linalg import qr

    diagonal = np.abs(np.diag(qr(square, mode="r", pivoting=True)[0]))
    return int(np.sum(diagonal > INDEPENDENT))


def _place(index: int, name: str, links: int) -> tuple[int, int]:
    """Where a number stands in the order in which columns are chosen."""
    link, number = divmod(index, len(BODY_QUANTITIES))
    return (link, READ_FIRST.index(BODY_QUANTITIES[number])) if link < links else (links, index)
