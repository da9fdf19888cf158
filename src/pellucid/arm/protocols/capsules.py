r"""How near an arm comes to itself: capsules along its links, and the distance between them.

A capsule is all within a radius of a segment, so that two of them are as far apart as their segments less both radii,
and the distance of two segments is found in closed form [1]_. No mesh is needed: a radius says how thick a link is.

.. [1] C. Ericson, "Real-Time Collision Detection", Morgan Kaufmann, 2005, section 5.1.9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

BASE_LINK = -1
"""Link number of the base, which does not move. Moving links are numbered from 0."""

_MIN_SEGMENT_LENGTH_M = 1e-9
"""A segment of at most this length counts as a point [m]."""


@dataclass(frozen=True)
class Capsule:
    """All points within a radius of a segment of a link; the segment's ends are in the link's own frame."""

    link: int  # number of the link from 0, or BASE_LINK
    start: tuple[float, float, float]  # [m]
    end: tuple[float, float, float]  # [m]
    radius: float  # [m]

    def __post_init__(self):
        if not (np.isfinite([*self.start, *self.end]).all() and np.isfinite(self.radius) and self.radius > 0.0):
            raise ValueError(f"capsule of link {self.link}: found {self}, expected finite ends and a radius > 0 [m]")


@dataclass(frozen=True)
class Capsules:
    """Shape of an arm, and the pairs of its parts that may touch."""

    parts: tuple[Capsule, ...]
    pairs: tuple[tuple[int, int], ...]  # pairs of indices into `parts` that are compared

    def distance(self, placements: np.ndarray) -> np.ndarray:
        """Return the distance of the nearest pair, (n,) [m], below 0 if it overlaps. `placements` (n, l, 3, 4)."""
        if not self.pairs:
            return np.full(len(placements), np.inf)
        ends = self.ends(placements)
        first, second = (np.array(index) for index in zip(*self.pairs, strict=True))
        apart = segment_distance(ends[:, first, 0], ends[:, first, 1], ends[:, second, 0], ends[:, second, 1])
        radius = np.array([part.radius for part in self.parts])
        return (apart - radius[first] - radius[second]).min(axis=1)

    def ends(self, placements: np.ndarray) -> np.ndarray:
        """Return both ends of every capsule in the base's frame, (n, parts, 2, 3) [m]."""
        still = np.broadcast_to(np.eye(3, 4), (len(placements), 1, 3, 4))
        frames = np.concatenate([placements, still], axis=1)[:, [part.link for part in self.parts]]
        own = np.array([[part.start, part.end] for part in self.parts])
        return np.einsum("npij,pej->npei", frames[..., :3], own) + frames[..., None, :, 3]

    def least(self, placements: np.ndarray) -> float:
        """Return a lower bound of the distance along a whole path [m], from its samples `placements` (n, l, 3, 4).

        Between two samples no part moves further than its ends do, and at most half of that from the nearer sample.
        """
        apart = self.distance(placements)
        if len(apart) < 2 or not self.pairs:
            return float(apart.min())
        moved = np.linalg.norm(np.diff(self.ends(placements), axis=0), axis=-1).max(axis=2)  # (n - 1, parts)
        first, second = (np.array(index) for index in zip(*self.pairs, strict=True))
        nearer = 0.5 * (moved[:, first] + moved[:, second]).max(axis=1)
        return float((np.minimum(apart[1:], apart[:-1]) - nearer).min())


def segment_distance(p0: np.ndarray, p1: np.ndarray, q0: np.ndarray, q1: np.ndarray) -> np.ndarray:
    """Return the least distance of segments p0 p1 and q0 q1, (...) [m]; each end is (..., 3)."""
    u, v, w = p1 - p0, q1 - q0, p0 - q0
    a, b, c = (np.einsum("...i,...i->...", x, y) for x, y in ((u, u), (u, v), (v, v)))
    d, e = (np.einsum("...i,...i->...", x, w) for x in (u, v))
    a, c = np.maximum(a, _MIN_SEGMENT_LENGTH_M**2), np.maximum(c, _MIN_SEGMENT_LENGTH_M**2)
    s = np.clip((b * e - c * d) / np.maximum(a * c - b * b, 1e-12 * a * c), 0.0, 1.0)
    t = np.clip((b * s + e) / c, 0.0, 1.0)
    s = np.clip((b * t - d) / a, 0.0, 1.0)  # nearest point for that t; nearly parallel segments need this second step
    t = np.clip((b * s + e) / c, 0.0, 1.0)
    return np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1)


def capsules_along_links(
    parents: Sequence[int],
    places: np.ndarray,
    tips: np.ndarray,
    radius: float | Sequence[float],
    clearance: float = 0.0,
) -> Capsules:
    """Return a capsule from each joint to each joint that its link carries, or to the tip of a last link.

    A pair is not compared if the way between its parts along the arm is at most a `clearance` [m] plus both radii.
    Such parts are always near each other, whatever the joints do.

    `parents` (l,), BASE where a link hangs on what does not move; `places` (l, 3) of each link's frame in its parent's
    [m]; `tips` (l, 3) in the link's own [m]; `radius` [m], one or (l,).
    """
    count = len(parents)
    thick = np.broadcast_to(np.asarray(radius, float), count)
    origin = (0.0, 0.0, 0.0)
    parts: list[Capsule] = []
    for link in range(BASE_LINK, count):
        ends = [tuple(places[k]) for k in range(count) if parents[k] == link]
        if link != BASE_LINK and not ends:
            ends = [tuple(tips[link])]
        parts += [
            Capsule(link, origin, end, float(thick[max(link, 0)]))
            for end in ends
            if np.linalg.norm(end) > _MIN_SEGMENT_LENGTH_M
            or (link != BASE_LINK and not any(p.link == link for p in parts))
        ]
    pairs, apart = [], clearance + 1e-9
    for one, other in combinations(range(len(parts)), 2):
        first, second = parts[one], parts[other]
        if (
            first.link != second.link
            and _arm_length_between(first, second, parents, places) > apart + first.radius + second.radius
        ):
            pairs.append((one, other))
    return Capsules(tuple(parts), tuple(pairs))


def _arm_length_between(first: Capsule, second: Capsule, parents: Sequence[int], places: np.ndarray) -> float:
    """Return the length of the arm between two of its parts, from nearest end to nearest end [m]."""

    def chain(link: int) -> list[int]:
        return [link] if link == BASE_LINK else [link, *chain(parents[link])]

    one, other = chain(first.link), chain(second.link)
    shared = next(link for link in one if link in other)
    up = [links[: links.index(shared)] for links in (one, other)]  # links between, each part's own first
    length = sum(float(np.linalg.norm(places[link])) for links in up for link in links[:-1])
    # Each branch leaves the shared link at a joint. A part of the shared link itself may leave it anywhere.
    leaves = [
        (places[links[-1]],) * 2 if links else (part.start, part.end)
        for links, part in zip(up, (first, second), strict=True)
    ]
    return length + float(segment_distance(*(np.asarray(end, float) for pair in leaves for end in pair)))
