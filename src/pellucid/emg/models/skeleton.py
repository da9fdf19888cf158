r"""Bodies joined to each other, and where they are at given coordinates, with the exact derivatives.

A joint turns its child about three axes in turn and shifts it along three, each by a function of coordinates:

.. math::
   T_{child} = T_{parent}\,F_p\,\begin{pmatrix} R(a_1, \theta_1) R(a_2, \theta_2) R(a_3, \theta_3) & \sum_i d_i b_i \\
   0 & 1 \end{pmatrix} F_c^{-1}

Pins, sliders, balls and welds are cases of it. A coordinate that a constraint couples to others follows them, in value
and in derivative: a moment arm about the knee honours a patella that moves with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import PellucidError
from .muscle_geometry import CoordinateFunction

GROUND_BODY = "ground"


@dataclass(frozen=True)
class Coordinate:
    """A number that says how joints stand."""

    name: str
    default: float  # default, lower, upper: [rad], [m] of a translation
    lower: float
    upper: float
    turns: bool = True  # Whether it is an angle


@dataclass(frozen=True, eq=False)
class Axis:
    """A turn about an axis, or a shift along it."""

    direction: np.ndarray  # (3,) Of length 1
    coordinates: tuple[str, ...]
    function: CoordinateFunction


@dataclass(frozen=True, eq=False)
class SkeletonJoint:
    """What holds a body to another."""

    name: str
    parent: str  # parent, child: Bodies
    child: str
    parent_frame: np.ndarray  # parent_frame, child_frame: (4, 4) The joint's frames on the bodies
    child_frame: np.ndarray
    turns: tuple[Axis, ...] = ()
    shifts: tuple[Axis, ...] = ()
    refused: str = ""  # Why no pose can be given, where a body beyond it is asked for


@dataclass(frozen=True)
class Coupling:
    """A coordinate that follows others."""

    dependent: str
    independent: tuple[str, ...]
    function: CoordinateFunction


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """A body at n poses."""

    at: np.ndarray  # (n, 4, 4) From the body's frame to the ground's
    along: np.ndarray  # (k, n, 4, 4) Its derivatives along k coordinates

    def point(self, local: np.ndarray, moving: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (n, 3) and derivatives (k, n, 3) of points `local` (n, 3) on the body.

        `moving` (k, n, 3) are derivatives of the points on the body itself.
        """
        where = np.einsum("nij,nj->ni", self.at[:, :3, :3], local) + self.at[:, :3, 3]
        carried = np.einsum("knij,nj->kni", self.along[:, :, :3, :3], local) + self.along[:, :, :3, 3]
        if moving is not None:
            carried = carried + np.einsum("nij,knj->kni", self.at[:, :3, :3], moving)
        return where, carried


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Bodies, joints and what couples coordinates."""

    coordinates: Mapping[str, Coordinate]
    joints: Mapping[str, SkeletonJoint]  # By child
    couplings: Mapping[str, Coupling]  # By dependent coordinate

    def chain(self, body: str) -> list[SkeletonJoint]:
        """Joints from the ground to a body."""
        found: list[SkeletonJoint] = []
        while body != GROUND_BODY:
            if body not in self.joints or len(found) > len(self.joints):
                raise PellucidError(f"body {body}: found no joint that leads from it to the ground, expected one")
            found.append(self.joints[body])
            body = found[-1].parent
        return found[::-1]

    def moves(self, body: str) -> set[str]:
        """Independent coordinates that move a body."""
        named = {c for joint in self.chain(body) for axis in (*joint.turns, *joint.shifts) for c in axis.coordinates}
        return {source for name in named for source in self.sources(name)}

    def sources(self, name: str, seen: tuple[str, ...] = ()) -> set[str]:
        """Independent coordinates that a coordinate follows; itself where it is one."""
        if name not in self.couplings:
            return {name}
        if name in seen:
            raise PellucidError(f"coordinate {name}: found couplings in a circle, expected an independent coordinate")
        return {s for other in self.couplings[name].independent for s in self.sources(other, (*seen, name))}

    def values(self, given: Mapping[str, np.ndarray], along: Sequence[str]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Every coordinate and its derivatives along some, (n,) and (k, n); what is not `given` has its default."""
        for name in (*given, *along):
            if name not in self.coordinates:
                known = ", ".join(list(self.coordinates)[:40])
                raise PellucidError(f"coordinate {name}: found none of that name in the model, expected one of {known}")
            if name in self.couplings:
                others = ", ".join(self.couplings[name].independent)
                raise PellucidError(f"coordinate {name}: found it coupled to {others}, expected an independent one")
        count = len(next(iter(given.values()))) if given else 1
        made: dict[str, tuple[np.ndarray, np.ndarray]] = {}

        def value(name: str) -> tuple[np.ndarray, np.ndarray]:
            if name not in made:
                if name in self.couplings:
                    self.sources(name)
                    coupling = self.couplings[name]
                    made[name] = follow_coordinates(
                        coupling.function, [value(c) for c in coupling.independent], count, along
                    )
                else:
                    q = np.asarray(given.get(name, np.full(count, self.coordinates[name].default)), float)
                    made[name] = q, np.outer([float(name == other) for other in along], np.ones(count))
            return made[name]

        for name in self.coordinates:
            value(name)
        return made

    def placed(
        self, bodies: Sequence[str], values: Mapping[str, tuple[np.ndarray, np.ndarray]]
    ) -> dict[str, PlacedBody]:
        """Bodies at the poses of `values`."""
        q, dq = next(iter(values.values()))
        count, k = len(q), len(dq)
        made = {GROUND_BODY: PlacedBody(np.broadcast_to(np.eye(4), (count, 4, 4)), np.zeros((k, count, 4, 4)))}
        for body in bodies:
            for joint in self.chain(body):
                if joint.child in made:
                    continue
                if joint.refused:
                    raise PellucidError(f"joint {joint.name}: {joint.refused}")
                at, along = _joint_transform(joint, values, count, k)
                before, after = made[joint.parent], np.linalg.inv(joint.child_frame)
                base, base_along = before.at @ joint.parent_frame, before.along @ joint.parent_frame
                made[joint.child] = PlacedBody(base @ at @ after, (base_along @ at + base @ along) @ after)
        return made


def follow_coordinates(
    function: CoordinateFunction, sources: Sequence[tuple[np.ndarray, np.ndarray]], count: int, along: Sequence[object]
) -> tuple[np.ndarray, np.ndarray]:
    """A function of coordinates and its derivatives, (n,) and (k, n), by the chain rule."""
    x = np.array([q for q, _ in sources]).reshape(len(sources), count)
    value, slopes = function(x)
    carried = np.zeros((len(along), count))
    for slope, (_, dq) in zip(slopes, sources, strict=True):
        carried += slope * dq
    return value, carried


def rotation(angles: Sequence[float]) -> np.ndarray:
    """Return the rotation (3, 3) by angles about x, y and z in turn, each about the axis as already turned."""
    made = np.eye(3)
    for axis, angle in zip(np.eye(3), angles, strict=True):
        made = made @ _rotation_about(axis, np.array([angle]))[0][0]
    return made


def frame(translation: Sequence[float], orientation: Sequence[float]) -> np.ndarray:
    """A frame on a body, (4, 4)."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation(orientation), translation
    return made


def _rotation_about(axis: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A rotation (n, 3, 3), and the constant matrix (3, 3) that makes its derivative from it."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, versine = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    return np.eye(3) + sine * skew + versine * (skew @ skew), skew


def _joint_transform(
    joint: SkeletonJoint, values: Mapping[str, tuple[np.ndarray, np.ndarray]], count: int, k: int
) -> tuple[np.ndarray, np.ndarray]:
    """What a joint does, (n, 4, 4), and its derivatives, (k, n, 4, 4)."""
    at = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    along = np.zeros((k, count, 4, 4))
    for axis in joint.turns:
        angle, slope = follow_coordinates(axis.function, [values[c] for c in axis.coordinates], count, range(k))
        turn, skew = _rotation_about(axis.direction, angle)
        along[:, :, :3, :3] = along[:, :, :3, :3] @ turn
        at[:, :3, :3] = at[:, :3, :3] @ turn
        along[:, :, :3, :3] += slope[:, :, None, None] * (at[:, :3, :3] @ skew)
    for axis in joint.shifts:
        way, slope = follow_coordinates(axis.function, [values[c] for c in axis.coordinates], count, range(k))
        at[:, :3, 3] += way[:, None] * axis.direction
        along[:, :, :3, 3] += slope[:, :, None] * axis.direction
    return at, along
