r"""Where a muscle runs: through points on bodies, some of which move or come and go, and around surfaces.

.. math::
   l = \sum_i |x_{i+1} - x_i| + \sum_w l_w, \qquad
   r_k = -\frac{dl}{dq_k} = -\sum_i \frac{x_{i+1} - x_i}{|x_{i+1} - x_i|} \cdot \frac{d(x_{i+1} - x_i)}{dq_k}

Where a muscle wraps, its tangent points are carried by the surface's body: along a shortest way that is exact.

Bodies joined to each other, and where they are at given coordinates, with the exact derivatives.

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
from .wrapping import Surface, Wrap

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
    """A joint between two bodies."""

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
        """Return every coordinate and its derivatives along some, (n,) and (k, n), with defaults unless `given`."""
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


MAX_WRAP_PASSES = 40
"""The surfaces of a path are gone through at most this often."""

LENGTH_TOLERANCE_M = 1e-8
"""Wrapping has converged when the path's length changes by less than this in a pass [m]."""


@dataclass(frozen=True, eq=False)
class PathPoint:
    """A point that a muscle runs through."""

    body: str
    place: np.ndarray  # (3,) On the body [m]
    # A point that moves: a function and its coordinates for x, y and z
    moves: tuple[tuple[CoordinateFunction, tuple[str, ...]], ...] = ()
    only: tuple[str, float, float] | None = None  # A coordinate and the range in which the muscle runs through it


@dataclass(frozen=True, eq=False)
class PathSurface:
    """A surface that a muscle may wrap around."""

    name: str
    body: str
    frame: np.ndarray  # (4, 4) On the body
    surface: Surface
    first: int = 0  # first, last: Points of the path between which it may
    last: int = -1


@dataclass(frozen=True, eq=False)
class MusclePath:
    """One muscle's way."""

    muscle: str
    points: tuple[PathPoint, ...]
    surfaces: tuple[PathSurface, ...] = ()
    refused: str = ""  # Why its length cannot be given

    @property
    def bodies(self) -> tuple[str, ...]:
        """Bodies that it touches."""
        return tuple(dict.fromkeys([p.body for p in self.points] + [s.body for s in self.surfaces]))

    def coordinates(self, skeleton: Skeleton) -> tuple[str, ...]:
        """Independent coordinates that change its length, in the model's order."""
        self._require()
        moved = [skeleton.moves(body) for body in self.bodies]
        # What moves all of its bodies together does not move it.
        carriers = [self._carriers(skeleton, body) for body in self.bodies]
        names = set().union(*moved) - carriers[0].intersection(*carriers[1:])
        for point in self.points:
            names |= {s for _, own in point.moves for c in own for s in skeleton.sources(c)}
        return tuple(name for name in skeleton.coordinates if name in names)

    def _carriers(self, skeleton: Skeleton, body: str) -> set[str]:
        shared = set.intersection(*({j.name for j in skeleton.chain(b)} for b in self.bodies))
        joints = [j for j in skeleton.chain(body) if j.name in shared]
        alone = {c for j in joints for a in (*j.turns, *j.shifts) for c in a.coordinates}
        others = {
            c
            for b in self.bodies
            for j in skeleton.chain(b)
            if j.name not in shared
            for a in (*j.turns, *j.shifts)
            for c in a.coordinates
        }
        sources = {s for c in others for s in skeleton.sources(c)}
        return {s for c in alone for s in skeleton.sources(c)} - sources

    def _require(self) -> None:
        if self.refused:
            raise PellucidError(f"muscle {self.muscle}: {self.refused}")

    def length(
        self, skeleton: Skeleton, angles: Mapping[str, np.ndarray], along: Sequence[str] = ()
    ) -> tuple[np.ndarray, np.ndarray]:
        """Length (n,) [m] and moment arms (k, n) about coordinates [m; 1 about a translation]; `angles` (n,) [rad]."""
        self._require()
        values = skeleton.values(angles, along)
        placed = skeleton.placed(self.bodies, values)
        count = len(next(iter(values.values()))[0])
        points, carried, active = self._points(skeleton, placed, values, count, along)
        if not active[:, [0, -1]].all() and (active.sum(axis=1) < 2).any():
            raise PellucidError(
                f"muscle {self.muscle}: found fewer than two path points, expected at least two: correct the model"
            )
        nodes = _Nodes(points, carried, active, len(self.surfaces))
        if self.surfaces:
            self._wrap(nodes, placed, active)
        length, derivative = nodes.length()
        return length, -derivative

    def _points(self, skeleton, placed: Mapping[str, PlacedBody], values, count, along):
        where, carried, active = [], [], np.ones((count, len(self.points)), bool)
        for i, point in enumerate(self.points):
            local, moving = np.broadcast_to(point.place, (count, 3)), None
            if point.moves:
                made = [follow_coordinates(f, [values[c] for c in own], count, along) for f, own in point.moves]
                local = np.stack([x for x, _ in made], axis=1)
                moving = np.stack([dx for _, dx in made], axis=2)
            x, dx = placed[point.body].point(local, moving)
            where.append(x)
            carried.append(dx)
            if point.only is not None:
                name, low, high = point.only
                q = values[name][0]
                active[:, i] = (q >= low - 1e-5) & (q <= high + 1e-5)
        return np.stack(where, axis=1), np.stack(carried, axis=2), active

    def _wrap(self, nodes: _Nodes, placed: Mapping[str, PlacedBody], active: np.ndarray) -> None:
        """Go through the surfaces until the way is settled, in OpenSim's order."""
        count, many = len(active), len(self.surfaces)
        frames = [placed[s.body].at @ s.frame for s in self.surfaces]
        order = np.tile(np.arange(many), (count, 1))
        last_length, open_ = np.full(count, np.inf), np.ones(count, bool)
        for attempt in range(MAX_WRAP_PASSES if many > 1 else 1):
            codes = np.full((count, many), Wrap.NO_WRAP)
            for turn in range(many):
                for w, surface in enumerate(self.surfaces):
                    rows = np.flatnonzero(open_ & (order[:, turn] == w))
                    if len(rows):
                        codes[rows, turn] = nodes.wrap(w, surface, frames[w], placed[surface.body], rows, active)
            length, _ = nodes.length(derivative=False)
            if attempt == 0 and many > 1:
                swap = (codes[:, 0] == Wrap.NO_WRAP) & (codes[:, 1] == Wrap.ENDS_INSIDE)
                order[swap, :2] = order[swap, 1::-1]
                nodes.drop(0, np.flatnonzero(swap))
            open_ &= np.abs(length - last_length) >= LENGTH_TOLERANCE_M
            last_length = length
            if not open_.any():
                break


class _Nodes:
    """Points and tangent points of n poses in each pose's order; those of surface w are P + 2w and P + 2w + 1."""

    def __init__(self, points: np.ndarray, carried: np.ndarray, active: np.ndarray, surfaces: int):
        self.count, self.fixed = active.shape
        extra = 2 * surfaces
        self.where = np.concatenate([points, np.zeros((self.count, extra, 3))], axis=1)
        self.carried = np.concatenate([carried, np.zeros((len(carried), self.count, extra, 3))], axis=2)
        self.arc = np.zeros((self.count, surfaces))
        # Ranks along the way; infinite where a node is not on it.
        self.rank = np.full((self.count, self.fixed + extra), np.inf)
        self.rank[:, : self.fixed] = np.where(active, np.arange(self.fixed, dtype=float), np.inf)

    def drop(self, w: int, rows: np.ndarray) -> None:
        """Take a surface's points off the way."""
        self.rank[np.ix_(rows, [self.fixed + 2 * w, self.fixed + 2 * w + 1])] = np.inf

    def wrap(self, w: int, surface: PathSurface, frame, placed: PlacedBody, rows: np.ndarray, active) -> np.ndarray:
        """Wrap the best stretch of each of some poses around a surface; gives what it did."""
        self.drop(w, rows)
        order, ranks = self._ordered(rows)
        within = self._within(surface, rows, active)
        result = np.full(len(rows), Wrap.NO_WRAP)
        best, least, locked = np.full(len(rows), -1), np.full(len(rows), np.inf), np.zeros(len(rows), bool)
        kept = [np.zeros((len(rows), 3)), np.zeros((len(rows), 3)), np.zeros(len(rows))]
        to_local = np.linalg.inv(frame[rows])
        for slot in range(order.shape[1] - 1):
            a, b = order[:, slot], order[:, slot + 1]
            same = (a >= self.fixed) & (b >= self.fixed) & ((a - self.fixed) // 2 == (b - self.fixed) // 2)
            ok = np.isfinite(ranks[:, slot + 1]) & ~same & ~locked
            ok &= (ranks[:, slot] >= within[0]) & (ranks[:, slot + 1] <= within[1])
            at = np.flatnonzero(ok)
            if not len(at):
                continue
            ends = [
                np.einsum("nij,nj->ni", to_local[at, :3, :3], self.where[rows[at], node[at]]) + to_local[at, :3, 3]
                for node in (a, b)
            ]
            found = surface.surface.wrapped(*ends)
            result[at] = found.code
            way = np.linalg.norm(found.first - ends[0], axis=1) + np.linalg.norm(found.last - ends[1], axis=1)
            change = way + found.length - np.linalg.norm(ends[1] - ends[0], axis=1)
            take = (found.code == Wrap.MUST_WRAP) | ((found.code == Wrap.MAY_WRAP) & (change < least[at]))
            chosen = at[take]
            least[chosen], best[chosen], locked[chosen] = change[take], slot, (found.code == Wrap.MUST_WRAP)[take]
            for to, source in zip(kept, (found.first, found.last, found.length), strict=True):
                to[chosen] = source[take]
        chosen = np.flatnonzero(best >= 0)
        best_slot = best[chosen]
        low, high = ranks[chosen, best_slot], ranks[chosen, best_slot + 1]
        poses = rows[chosen]
        self.arc[poses, w] = kept[2][chosen]
        on = PlacedBody(placed.at[poses], placed.along[:, poses])
        for k in (0, 1):
            node = self.fixed + 2 * w + k
            local = np.einsum(
                "nij,nj->ni", np.linalg.inv(placed.at[poses]) @ frame[poses], _homogeneous(kept[k][chosen])
            )
            where, carried = on.point(local[:, :3])
            self.where[poses, node], self.carried[:, poses, node] = where, carried
            self.rank[poses, node] = low + (high - low) * (k + 1) / 3.0
        return result

    def _within(self, surface: PathSurface, rows: np.ndarray, active: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ranks of the first and the last active point between which a surface may be wrapped around."""
        last = surface.last if surface.last >= 0 else self.fixed - 1
        part = active[rows, surface.first : last + 1]
        size = part.shape[1]
        low = surface.first + np.argmax(part, axis=1)
        high = surface.first + size - 1 - np.argmax(part[:, ::-1], axis=1)
        none = ~part.any(axis=1)
        return np.where(none, np.inf, low), np.where(none, -np.inf, high)

    def _ordered(self, rows) -> tuple[np.ndarray, np.ndarray]:
        order = np.argsort(self.rank[rows], axis=1, kind="stable")
        return order, np.take_along_axis(self.rank[rows], order, axis=1)

    def length(self, derivative: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """Return the length of the whole way, (n,), and its derivatives, (k, n)."""
        rows = np.arange(self.count)
        order, ranks = self._ordered(slice(None))
        total, slopes = np.zeros(self.count), np.zeros((len(self.carried), self.count))
        for slot in range(order.shape[1] - 1):
            a, b = order[:, slot], order[:, slot + 1]
            on = np.isfinite(ranks[:, slot + 1])
            pair = (a - self.fixed) // 2
            around = on & (a >= self.fixed) & (b >= self.fixed) & (pair == (b - self.fixed) // 2)
            if self.arc.shape[1]:
                total += np.where(around, self.arc[rows, np.clip(pair, 0, None)], 0.0)
            straight = on & ~around
            way = self.where[rows, b] - self.where[rows, a]
            size = np.linalg.norm(way, axis=1)
            total += np.where(straight, size, 0.0)
            if derivative:
                unit = np.where((straight & (size > 0.0))[:, None], way / np.maximum(size, 1e-300)[:, None], 0.0)
                slopes += np.einsum("nj,knj->kn", unit, self.carried[:, rows, b] - self.carried[:, rows, a])
        return total, slopes


def _homogeneous(x: np.ndarray) -> np.ndarray:
    return np.column_stack((x, np.ones(len(x))))
