r"""Where a muscle runs: through points on bodies, some of which move or come and go, and around surfaces.

.. math::
   l = \sum_i |x_{i+1} - x_i| + \sum_w l_w, \qquad
   r_k = -\frac{dl}{dq_k} = -\sum_i \frac{x_{i+1} - x_i}{|x_{i+1} - x_i|} \cdot \frac{d(x_{i+1} - x_i)}{dq_k}

Where a muscle wraps, its tangent points are carried by the surface's body: along a shortest way that is exact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import PellucidError
from .muscle_geometry import CoordinateFunction
from .skeleton import PlacedBody, Skeleton, follow_coordinates
from .wrapping import ENDS_INSIDE, MAY_WRAP, MUST_WRAP, NO_WRAP, Surface

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
            raise PellucidError(f"muscle {self.muscle}: found fewer than two points that it runs through, expected two")
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
            codes = np.full((count, many), NO_WRAP)
            for turn in range(many):
                for w, surface in enumerate(self.surfaces):
                    rows = np.flatnonzero(open_ & (order[:, turn] == w))
                    if len(rows):
                        codes[rows, turn] = nodes.wrap(w, surface, frames[w], placed[surface.body], rows, active)
            length, _ = nodes.length(derivative=False)
            if attempt == 0 and many > 1:
                swap = (codes[:, 0] == NO_WRAP) & (codes[:, 1] == ENDS_INSIDE)
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
        result = np.full(len(rows), NO_WRAP)
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
            take = (found.code == MUST_WRAP) | ((found.code == MAY_WRAP) & (change < least[at]))
            chosen = at[take]
            least[chosen], best[chosen], locked[chosen] = change[take], slot, (found.code == MUST_WRAP)[take]
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
