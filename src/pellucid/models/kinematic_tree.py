r"""Kinematic tree of rigid links, connected by revolute, prismatic and fixed joints.

The physics is the core's (``include/pellucid/kinematic_tree.hpp``, ``mass_matrix.hpp``, ``torque_regressor.hpp``):

.. math::
   \tau = M(q)\ddot q + h(q, \dot q) = Y(q, \dot q, \ddot q)\,\theta

with ten parameters of each link in theta. This file defines the parts of a tree and rejects invalid ones.

Fixed joints can be removed: the link of a fixed joint and its parent are merged into one body.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .. import _core
from .._errors import IdentificationError
from .fields import model_fields
from .joint import GRAVITY

MAX_LINKS = 32
KINDS = ("fixed", "revolute", "prismatic")
BODY_QUANTITIES = tuple(f.name for f in model_fields("link"))[-10:]
"""Ten numbers of a body, in the order of the regressor's columns."""

TRIANGLE_MARGIN = 1e-3
"""Share by which two principal moments of inertia of a body together exceed the third at least, where it is estimated
or exported. MuJoCo saves six digits, and refuses to load bodies whose moments rounding has brought below the bound."""

MAX_PLACE_M = 10.0
"""A larger distance between frames is refused as probably given in millimetres [m]."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Link:
    """A rigid body, by the ten numbers that effort is linear in; all in its own frame, moments about its origin."""

    name: str
    mass: float = 0.0  # kg
    moment: Vector = (0.0, 0.0, 0.0)  # m c: mass times its centre [kg m]
    inertia: tuple[float, float, float, float, float, float] = (0.0,) * 6  # I_xx I_xy I_xz I_yy I_yz I_zz [kg m^2]

    @classmethod
    def about_centre(
        cls,
        name: str,
        mass: float,
        centre: Vector,
        inertia: Sequence[float],
        turned: Vector = (0.0, 0.0, 0.0),
    ) -> Link:
        """A link whose six moments are about its centre of mass, in axes `turned` (roll, pitch, yaw) from its own."""
        c, turn = np.asarray(centre, float), rotation(turned)
        xx, xy, xz, yy, yz, zz = inertia
        own = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        about = own + mass * (c @ c * np.eye(3) - np.outer(c, c))
        return cls(name, float(mass), tuple(mass * c), tuple(about[np.triu_indices(3)]))

    @property
    def numbers(self) -> np.ndarray:
        """Shape (10,), in the order of `BODY_QUANTITIES`."""
        return np.array([self.mass, *self.moment, *self.inertia], float)


@dataclass(frozen=True)
class TreeJoint:
    """A joint from `parent` to `child`: pose of its frame in the parent's frame.

    The joint's frame is the child's own frame at position 0.
    """

    name: str
    parent: str
    child: str
    kind: str = "revolute"  # or "prismatic", "fixed"
    axis: Vector | None = None  # In the joint's frame, of length 1; of a fixed joint: None
    place: Vector = (0.0, 0.0, 0.0)  # m
    turned: Vector = (0.0, 0.0, 0.0)  # Roll, pitch and yaw about the parent's x, y, z, in this order [rad]
    rotor_inertia: float = 0.0  # inertia of the rotor, at the joint [kg m^2; kg]


@dataclass(frozen=True)
class Tree:
    """Links and the joints between them; every link but the base has one joint to its parent.

    Links are numbered outwards from the base, which does not move and has no number; coordinates are those of joints
    that move, in the order of the links behind them. Methods take samples of shape (n, coordinates), or one sample.
    """

    joints: tuple[TreeJoint, ...]
    links: tuple[Link, ...]
    gravity: Vector = (0.0, 0.0, -GRAVITY)  # In the base's frame [m/s^2]
    source: str = "tree"  # What messages call it: a file's name
    order: tuple[TreeJoint, ...] = field(init=False, repr=False)

    def __post_init__(self):
        object.__setattr__(self, "joints", tuple(self.joints))
        object.__setattr__(self, "links", tuple(self.links))
        object.__setattr__(self, "order", self._outwards())

    def _outwards(self) -> tuple[TreeJoint, ...]:
        """The joints, each after the one that carries its parent."""
        where, order = self.source, order_outwards(self.joints, self.links, self.source)
        if len(order) > MAX_LINKS:
            raise IdentificationError(
                f"{where}: found {len(order)} links, expected at most {MAX_LINKS}; weld what does not move into one"
            )
        if all(joint.kind == "fixed" for joint in order):
            raise IdentificationError(f"{where}: found no joint that moves, expected at least one")
        _check_masses(order, {link.name: link for link in self.links}, where)
        return order

    @property
    def base(self) -> str:
        """The link that does not move."""
        return self.order[0].parent

    @property
    def moving(self) -> tuple[TreeJoint, ...]:
        """The joints that have a coordinate, in its order."""
        return tuple(joint for joint in self.order if joint.kind != "fixed")

    @property
    def links_array(self) -> np.ndarray:
        """The numbers of every link as the core reads them, shape (links, 22)."""
        number = {self.base: 0} | {joint.child: i + 1 for i, joint in enumerate(self.order)}
        bodies = {link.name: link.numbers for link in self.links}
        rows = [
            [
                number[j.parent], KINDS.index(j.kind), *j.place, *j.turned, *(j.axis or (0.0, 0.0, 1.0)),
                j.rotor_inertia, *bodies[j.child],
            ]
            for j in self.order
        ]  # fmt: skip
        return np.array(rows, float)

    def __getstate__(self) -> dict:
        """For another process, which makes the core's own again."""
        return {key: value for key, value in vars(self).items() if key != "core"}

    @cached_property
    def core(self) -> _core.KinematicTree:
        """The same in the core: dynamics, regressor, normal equations."""
        return _core.KinematicTree(self.links_array, np.array(self.gravity, float))

    @property
    def parameters(self) -> np.ndarray:
        """The numbers of every link, shape (10 links,): theta of the regressor."""
        bodies = {link.name: link.numbers for link in self.links}
        return np.concatenate([bodies[joint.child] for joint in self.order])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of theta: link, then which of its ten."""
        return tuple(f"{joint.child}.{name}" for joint in self.order for name in BODY_QUANTITIES)


def order_outwards(joints: Sequence[TreeJoint], links: Sequence[Link], where: str) -> tuple[TreeJoint, ...]:
    """The joints, each after the one that carries its parent; an IdentificationError, which begins with `where`, of
    what hangs together otherwise."""
    if not joints:
        raise IdentificationError(f"{where}: found no joint, expected at least one")
    for what, names in (("joint", [j.name for j in joints]), ("link", [link.name for link in links])):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise IdentificationError(f"{where}: found two {what}s named {twice[0]!r}, expected a name for each")
    known = {link.name for link in links}
    carried_by: dict[str, TreeJoint] = {}
    for joint in joints:
        _check_joint(joint, where)
        if joint.child not in known:
            raise IdentificationError(
                f"{where}: joint {joint.name!r}: found no link {joint.child!r}, expected one of "
                f"{', '.join(sorted(known))}"
            )
        if joint.child in carried_by:
            other = carried_by[joint.child].name
            raise IdentificationError(
                f"{where}: link {joint.child!r} is the child of two joints, {other!r} and {joint.name!r}: a loop, "
                "expected a tree; open the loop by removing one joint"
            )
        carried_by[joint.child] = joint
    bases = sorted({j.parent for j in joints} - set(carried_by))
    if len(bases) != 1:
        found = ", ".join(map(repr, bases)) if bases else "none: every link is the child of another, in a loop"
        raise IdentificationError(
            f"{where}: links without a parent: {found}; expected one, the base; join the others to it, or remove one "
            "joint of a loop"
        )
    loose = sorted(known - set(carried_by) - set(bases))
    if loose:
        raise IdentificationError(f"{where}: link {loose[0]!r} has no joint, expected one to its parent")
    placed, order = {bases[0]}, []
    waiting = list(joints)
    while waiting:
        ready = [joint for joint in waiting if joint.parent in placed]
        if not ready:
            waiting_names = ", ".join(repr(joint.name) for joint in waiting)
            raise IdentificationError(f"{where}: joints {waiting_names} carry one another in a loop, expected a tree")
        order.append(ready[0])
        placed.add(ready[0].child)
        waiting.remove(ready[0])
    return tuple(order)


def rotation(turned: Vector) -> np.ndarray:
    """The core's matrix of roll, pitch and yaw, shape (3, 3)."""
    row = np.zeros((1, len(_core.LINK_PARAMETER_NAMES)))
    row[0, 1], row[0, 5:8], row[0, 10] = 1.0, turned, 1.0
    return _core.KinematicTree(row, np.zeros(3)).placements(np.zeros(1))[0, :, :3]


def _finite(values: Iterable[float], count: int) -> bool:
    values = tuple(values)
    return len(values) == count and all(isinstance(v, (int, float)) and np.isfinite(v) for v in values)


def _check_joint(joint: TreeJoint, where: str) -> None:
    """What one joint alone can have wrong."""
    at = f"{where}: joint {joint.name!r}"
    if joint.kind not in KINDS:
        raise IdentificationError(f"{at}: found kind {joint.kind!r}, expected one of {', '.join(KINDS)}")
    if joint.kind != "fixed":
        if joint.axis is None:
            raise IdentificationError(f"{at}: found no axis, expected three numbers of length 1")
        length = float(np.linalg.norm(joint.axis)) if _finite(joint.axis, 3) else float("nan")
        if not abs(length - 1.0) < 1e-3:
            raise IdentificationError(f"{at}: found an axis of length {length:g}, expected 1")
    for what, values, unit in (("place", joint.place, "m"), ("turned", joint.turned, "rad")):
        if not _finite(values, 3):
            raise IdentificationError(f"{at}: found {what} {values!r}, expected three finite numbers [{unit}]")
    if max(map(abs, joint.place)) > MAX_PLACE_M:
        raise IdentificationError(
            f"{at}: found place {tuple(joint.place)} m, expected at most {MAX_PLACE_M:g} m: are these millimetres?"
        )
    if not (_finite((joint.rotor_inertia,), 1) and joint.rotor_inertia >= 0.0):
        raise IdentificationError(f"{at}: found rotor inertia {joint.rotor_inertia!r}, expected >= 0")


def _check_masses(order: Sequence[TreeJoint], links: dict[str, Link], where: str) -> None:
    """Every number finite, and every joint that moves has something to move."""
    carried = {joint.child: links[joint.child].mass for joint in order}
    for joint in reversed(order):
        link = links[joint.child]
        if not _finite(link.numbers, 10):
            raise IdentificationError(f"{where}: link {link.name!r}: expected ten finite numbers, found {link}")
        if link.mass < 0.0:
            raise IdentificationError(f"{where}: link {link.name!r}: found mass {link.mass:g} kg, expected >= 0")
        if link.mass > 0.0 and np.linalg.norm(link.moment) > MAX_PLACE_M * link.mass:
            raise IdentificationError(
                f"{where}: link {link.name!r}: found its centre of mass {np.linalg.norm(link.moment) / link.mass:g} m "
                f"from its frame, expected at most {MAX_PLACE_M:g} m: are these millimetres?"
            )
        if joint.kind != "fixed" and carried[link.name] == 0.0 and joint.rotor_inertia == 0.0:
            raise IdentificationError(
                f"{where}: link {link.name!r}: found mass 0 on joint {joint.name!r}, which moves, and no mass on the "
                "links after it; expected > 0: state a rough mass, identification corrects it"
            )
        if joint.parent in carried:
            carried[joint.parent] += carried[link.name]


Pose = tuple[np.ndarray, np.ndarray]
"""Rotation (3, 3) and place (3,) [m] of a frame in another."""

IDENTITY_POSE: Pose = (np.eye(3), np.zeros(3))


def weld_fixed_joints(
    joints: Sequence[TreeJoint], links: Sequence[Link], where: str
) -> tuple[tuple[TreeJoint, ...], tuple[Link, ...], Mapping[str, tuple[str, Pose]]]:
    """Joints that move and the links behind them, each with what is welded to it; and of every link by its name the one
    that carries it, and where on that it is."""
    on: dict[str, tuple[str, Pose]] = {}
    kept, bodies = [], {link.name: link for link in links}
    for joint in order_outwards(joints, links, where):
        carrier, pose = on.setdefault(joint.parent, (joint.parent, IDENTITY_POSE))
        if joint.kind == "fixed":
            on[joint.child] = carrier, compose_poses(pose, joint_pose(joint))
            if carrier in bodies and joint.child in bodies:
                bodies[carrier] = join_links(bodies[carrier], bodies.pop(joint.child), on[joint.child][1])
            continue
        on[joint.child] = joint.child, IDENTITY_POSE
        if carrier != joint.parent:
            turn, place = compose_poses(pose, joint_pose(joint))
            joint = replace(joint, parent=carrier, place=_vector(place), turned=roll_pitch_yaw(turn))
        kept.append(joint)
    moving = [joint.child for joint in kept]
    return tuple(kept), tuple(bodies[name] for name in moving), on


def hold_joint(joint: TreeJoint, coordinate: float) -> TreeJoint:
    """A joint that moves, fixed at its coordinate [rad; m]."""
    turn, place = joint_pose(joint)
    axis = np.asarray(joint.axis, float)
    if joint.kind == "prismatic":
        place = place + turn @ axis * coordinate
    else:
        turn = turn @ _rotation_about(axis, coordinate)
    return replace(joint, kind="fixed", axis=None, place=_vector(place), turned=roll_pitch_yaw(turn), rotor_inertia=0.0)


def joint_pose(joint: TreeJoint) -> Pose:
    """Return the pose of a joint's frame in its parent's."""
    return rotation(joint.turned), np.asarray(joint.place, float)


def compose_poses(outer: Pose, inner: Pose) -> Pose:
    """A pose in a frame that has one itself."""
    return outer[0] @ inner[0], outer[1] + outer[0] @ inner[1]


def join_links(body: Link, other: Link, pose: Pose) -> Link:
    """A link with another welded to it at a pose."""
    turn, place = pose
    moment = turn @ np.asarray(other.moment)
    xx, xy, xz, yy, yz, zz = other.inertia
    about = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    about += (other.mass * place @ place + 2.0 * place @ moment) * np.eye(3)
    about -= other.mass * np.outer(place, place) + np.outer(place, moment) + np.outer(moment, place)
    return Link(
        body.name,
        body.mass + other.mass,
        _vector(np.asarray(body.moment) + moment + other.mass * place),
        tuple((np.asarray(body.inertia) + about[np.triu_indices(3)]).tolist()),
    )


def roll_pitch_yaw(turn: np.ndarray) -> Vector:
    """Roll, pitch and yaw [rad] of a rotation (3, 3); exact where pitch is a right angle too."""
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    s, c = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-turn[2, 0], c * turn[0, 0] + s * turn[1, 0])
    roll = np.arctan2(s * turn[0, 2] - c * turn[1, 2], c * turn[1, 1] - s * turn[0, 1])
    return float(roll), float(pitch), float(yaw)


def _rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def _vector(values: np.ndarray) -> Vector:
    x, y, z = values
    return float(x), float(y), float(z)
