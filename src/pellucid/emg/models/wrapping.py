r"""Surfaces that muscles wrap around: cylinders, spheres and ellipsoids on bodies.

Around a circle in a plane the way from p_1 to p_2 leaves and comes back along tangents,

.. math::
   \theta_1 = \varphi_1 + s \arccos(r / |p_1|), \qquad \theta_2 = \varphi_2 - s \arccos(r / |p_2|)

with s = 1 counter-clockwise. On a cylinder it rises evenly with the way, on a sphere the plane holds the centre: both
are shortest ways, so that a length's derivative is what its straight ends do with the tangent points held on the body.
On an ellipsoid the plane is SIMM's and OpenSim's, through the point nearest to the straight line's middle
or in the middle of a fan of nearest points; stretched to a sphere its section is a circle again.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np


class Wrap(IntEnum):
    """Kind of path of a segment at a surface."""

    NO_WRAP = 0  # It passes the surface
    MAY_WRAP = 1  # It wraps if that is shortest
    MUST_WRAP = 2  # It hits the surface and must wrap
    ENDS_INSIDE = 3  # It begins or ends inside the surface


METHODS = ("hybrid", "midpoint")
"""Methods for the plane on an ellipsoid: main plane blended with the fan, or middle of the straight line's chord."""


@dataclass(frozen=True)
class CrestSettings:
    """How the plane of a way on an ellipsoid is found."""

    # Cosines with an axis between which the fan of nearest points gives way to the one on the main plane
    blend_cosines: tuple[float, float] = (0.7073, 0.9)
    edge_share: float = 0.3  # The main plane is trusted less within this share of a stretch from the ends of its chord
    fan_sample_count: int = 300  # Number of samples of the fan of nearest points


CREST_SETTINGS = CrestSettings()

ARC_QUADRATURE = np.polynomial.legendre.leggauss(24)
"""Nodes and weights of an arc's length."""


@dataclass(frozen=True, eq=False)
class WrapResult:
    """Paths of n segments on a surface, in the surface's frame."""

    code: np.ndarray  # (n,) Codes of `Wrap`
    first: np.ndarray  # (n, 3) first, last: Tangent points [m]
    last: np.ndarray
    length: np.ndarray  # (n,) Between them, on the surface [m]


class Surface(Protocol):
    """A surface that a segment may wrap around."""

    def wrapped(self, p: np.ndarray, q: np.ndarray) -> WrapResult:
        """From points `p` to points `q`, (n, 3), in the surface's frame."""
        ...


@dataclass(frozen=True)
class Side:
    """The half of a surface that is wrapped around; axis -1: all of it."""

    axis: int = -1
    sign: float = 1.0

    def has(self, x: np.ndarray) -> np.ndarray:
        """Whether points (n, 3) lie there."""
        return np.where(x[:, self.axis] >= 0.0, 1.0, -1.0) == self.sign


@dataclass(frozen=True)
class Cylinder:
    """About z; only ways that touch within its length wrap."""

    radius: float
    length: float
    side: Side = Side()

    def wrapped(self, p: np.ndarray, q: np.ndarray) -> WrapResult:
        """See `Surface`."""
        inside = (np.hypot(p[:, 0], p[:, 1]) < self.radius) | (np.hypot(q[:, 0], q[:, 1]) < self.radius)
        p, q = _replace_inside(p, self.radius, inside), _replace_inside(q, self.radius, inside)
        way = q - p
        flat = np.sum(way[:, :2] ** 2, axis=1)
        share = -np.sum(p[:, :2] * way[:, :2], axis=1) / np.where(flat > 0.0, flat, 1.0)
        near = p + share[:, None] * way
        hit = (np.hypot(near[:, 0], near[:, 1]) < self.radius) & (share > 0.0) & (share < 1.0)
        ways = [_tangent_angles(p[:, :2], q[:, :2], self.radius, s) for s in (1.0, -1.0)]
        if self.side.axis < 0:
            clockwise = ways[1][2] < ways[0][2]
            code = np.where(hit, Wrap.MUST_WRAP, Wrap.NO_WRAP)
        else:
            clockwise, code = self._sided(p, q, near, hit, ways)
        a, b, arc = (np.where(clockwise, right, left) for left, right in zip(*ways, strict=True))
        first, last = _circle(a, self.radius), _circle(b, self.radius)
        ends = [np.hypot(*(x - y[:, :2]).T) for x, y in ((first, p), (last, q))]
        turn = self.radius * arc
        rise = way[:, 2] / (ends[0] + turn + ends[1])
        first = np.column_stack((first, p[:, 2] + rise * ends[0]))
        last = np.column_stack((last, q[:, 2] - rise * ends[1]))
        beyond = (np.abs(first[:, 2]) > 0.5 * self.length) & (np.abs(last[:, 2]) > 0.5 * self.length)
        code = np.where(inside, Wrap.ENDS_INSIDE, np.where(beyond, Wrap.NO_WRAP, code))
        return WrapResult(code, first, last, np.hypot(turn, rise * turn))

    def _sided(self, p, q, near, hit, ways) -> tuple[np.ndarray, np.ndarray]:
        """Whether to go clockwise so as to pass on the side, and whether stretches wrap at all."""
        has = self.side.has
        own = has(p) | has(q)
        over = (has(p) != has(q)) & ~has(near)
        code = np.where(own, np.where(hit, Wrap.MUST_WRAP, np.where(over, Wrap.MAY_WRAP, Wrap.NO_WRAP)), Wrap.MAY_WRAP)
        (a, b, _), (a_, b_, _) = ways
        on = {k: has(_circle(x, self.radius)) for k, x in (("a", a), ("b", b), ("a_", a_), ("b_", b_))}
        wide = np.abs(_fold_angle(b - a)) > np.abs(_fold_angle(b_ - a_))
        neither = np.where(on["b_"], True, np.where(on["b"], False, ~wide))
        clockwise = np.where(on["a"] & on["a_"], on["b_"], np.where(on["a"], False, np.where(on["a_"], True, neither)))
        return clockwise, code


@dataclass(frozen=True)
class Sphere:
    """About the origin."""

    radius: float
    side: Side = Side()

    def wrapped(self, p: np.ndarray, q: np.ndarray) -> WrapResult:
        """See `Surface`."""
        unit = np.ones(3) * self.radius
        hit, inside = _hits_ellipsoid(p, q, unit)
        p, q = _replace_inside(p, self.radius, inside, 3), _replace_inside(q, self.radius, inside, 3)
        x = p / np.linalg.norm(p, axis=1)[:, None]
        normal = np.cross(p, q)
        size = np.linalg.norm(normal, axis=1)
        hit &= size > 1e-12
        y = np.cross(np.where(size[:, None] > 1e-12, normal / np.maximum(size, 1e-12)[:, None], _perpendicular(x)), x)
        start, end = (np.stack([np.sum(v * x, 1), np.sum(v * y, 1)], axis=1) for v in (p, q))
        ways = [_tangent_angles(start, end, self.radius, s) for s in (1.0, -1.0)]
        space = [[c[:, :1] * x + c[:, 1:] * y for c in (_circle(w[k], self.radius) for k in (0, 1))] for w in ways]
        clockwise = ways[1][2] < ways[0][2]
        if self.side.axis >= 0:
            constrained = ~(self.side.has(p) & self.side.has(q))
            inward = -(p + q)
            under = np.sum(space[1][0] * inward, 1) > np.sum(space[0][0] * inward, 1)
            towards = [(s[0] - p + s[1] - q)[:, self.side.axis] * self.side.sign for s in space]
            flip = np.where(under, towards[1], towards[0]) < 0.0
            clockwise = np.where(constrained, under ^ flip, clockwise)
        first, last = (np.where(clockwise[:, None], space[1][k], space[0][k]) for k in (0, 1))
        arc = np.where(clockwise, ways[1][2], ways[0][2])
        code = np.where(inside, Wrap.ENDS_INSIDE, np.where(hit, Wrap.MUST_WRAP, Wrap.NO_WRAP))
        return WrapResult(code, first, last, self.radius * arc)


@dataclass(frozen=True)
class Ellipsoid:
    """About the origin, along the axes."""

    radii: tuple[float, float, float]
    side: Side = Side()
    method: str = METHODS[0]  # How the plane of the way is found

    def wrapped(self, p: np.ndarray, q: np.ndarray) -> WrapResult:
        """See `Surface`."""
        radii = np.array(self.radii)
        hit, inside = _hits_ellipsoid(p, q, radii)
        far = 1.0 - np.sum(p * q, 1) / (np.linalg.norm(p, axis=1) * np.linalg.norm(q, axis=1)) < 1e-4
        hit &= ~far
        count = len(p)
        blank = WrapResult(
            np.where(inside, Wrap.ENDS_INSIDE, Wrap.NO_WRAP),
            np.zeros((count, 3)),
            np.zeros((count, 3)),
            np.zeros(count),
        )
        if not hit.any():
            return blank
        blank.code[hit] = Wrap.MUST_WRAP
        blank.first[hit], blank.last[hit], blank.length[hit] = self._way(p[hit], q[hit], radii)
        return blank

    def _way(self, p: np.ndarray, q: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        through = self._crest(p, q, radii)
        # Stretched to the unit sphere, the plane's section is a circle and tangents stay tangents.
        a, b, c = p / radii, q / radii, through / radii
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        centre = np.sum(a * normal, 1)[:, None] * normal
        radius = np.sqrt(np.maximum(1.0 - np.sum(centre**2, 1), 1e-12))
        x = a - centre
        x /= np.linalg.norm(x, axis=1)[:, None]
        y = np.cross(normal, x)
        a2, b2, c2 = (np.stack([np.sum((v - centre) * x, 1), np.sum((v - centre) * y, 1)], 1) for v in (a, b, c))
        # The way passes on the crest's side of the straight line.
        side = _cross(b2 - a2, c2 - a2)
        sense = -np.sign(side)
        one, two, arc = _tangent_angles(a2, b2, radius, sense)
        nodes, weights = ARC_QUADRATURE
        angle = one[:, None] + sense[:, None] * arc[:, None] * 0.5 * (1.0 + nodes)
        step = (-np.sin(angle)[..., None] * x[:, None] + np.cos(angle)[..., None] * y[:, None]) * radii
        length = radius * 0.5 * arc * (np.linalg.norm(step, axis=2) @ weights)
        ends = [(centre + c[:, :1] * x + c[:, 1:] * y) * radii for c in (_circle(t, radius) for t in (one, two))]
        return *ends, length

    def _crest(self, p, q, radii):
        """The point on the surface that the plane goes through."""
        scale = 3.0 / radii.sum()
        p, q, radii = p * scale, q * scale, radii * scale
        near, far = _crossings(p, q, radii)
        chord = far - near
        middle = near + 0.5 * chord
        fan_share = np.ones(len(p))
        if self.method == "midpoint":
            crest = _nearest_points(middle, radii)
        else:
            mu = np.abs(q - p) / np.linalg.norm(q - p, axis=1)[:, None]
            best, row = np.argmax(mu, axis=1), np.arange(len(p))
            mu = mu[row, best]
            t = -near[row, best] / chord[row, best]
            start = near + t[:, None] * chord
            start[row, best] = 0.0
            flat = _nearest_points_in_plane(start, radii, best)
            low, high = CREST_SETTINGS.blend_cosines
            trust = np.clip(np.minimum(t, 1.0 - t) / CREST_SETTINGS.edge_share, 0.0, 1.0)
            mu = np.where(mu > low, low + trust * (mu - low), mu)
            fan_share = 1.0 - np.clip((mu - low) / (high - low), 0.0, 1.0)
            points = (
                near
                + (np.arange(1, CREST_SETTINGS.fan_sample_count - 1) / CREST_SETTINGS.fan_sample_count)[:, None, None]
                * chord
            )
            blade = _nearest_points(points.reshape(-1, 3), radii).reshape(points.shape) - points
            blade /= np.maximum(np.linalg.norm(blade, axis=2), 1e-300)[..., None]
            total = blade.sum(axis=0)
            total /= np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]
            fan = _nearest_points(middle + total, radii)
            mixed = (1.0 - fan_share)[:, None] * flat + fan_share[:, None] * fan
            inner = (fan_share > 0.0) & (fan_share < 1.0)
            crest = np.where(inner[:, None], _nearest_points(mixed, radii), mixed)
        if self.side.axis >= 0:
            k = self.side.axis
            turned = crest.copy()
            turned[:, k] = -crest[:, k] * (1.0 - fan_share)
            crest = np.where(self.side.has(crest)[:, None], crest, _nearest_points(turned, radii))
        return crest / scale


def _tangent_angles(p: np.ndarray, q: np.ndarray, radius, sense) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles of the tangent points around a circle, and the arc between them; `p`, `q` (n, 2)."""
    angles = []
    for x, way in ((p, sense), (q, -np.asarray(sense))):
        reach = np.arccos(np.clip(radius / np.maximum(np.hypot(*x.T), 1e-300), -1.0, 1.0))
        angles.append(np.arctan2(x[:, 1], x[:, 0]) + way * reach)
    return angles[0], angles[1], np.mod(sense * (angles[1] - angles[0]), 2.0 * np.pi)


def _circle(angle: np.ndarray, radius) -> np.ndarray:
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _fold_angle(angle: np.ndarray) -> np.ndarray:
    return np.mod(angle + np.pi, 2.0 * np.pi) - np.pi


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _perpendicular(x: np.ndarray) -> np.ndarray:
    """Some unit vector at right angles to each of `x` (n, 3)."""
    least = np.eye(3)[np.argmin(np.abs(x), axis=1)]
    made = np.cross(x, least)
    return made / np.linalg.norm(made, axis=1)[:, None]


def _replace_inside(x: np.ndarray, radius: float, inside: np.ndarray, dimensions: int = 2) -> np.ndarray:
    """Points where no root is taken of what is negative; those `inside` are answered for already."""
    safe = np.zeros(3)
    safe[: dimensions - 1] = 2.0 * radius
    return np.where(inside[:, None], safe, x)


def _crossings(p: np.ndarray, q: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points where straight lines enter and leave an ellipsoid."""
    enter, leave, _ = _crossing_shares(p, q, radii)
    way = q - p
    return p + enter[:, None] * way, p + leave[:, None] * way


def _crossing_shares(p: np.ndarray, q: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    way, start = (q - p) / radii, p / radii
    aa, bb, cc = np.sum(way * way, 1), 2.0 * np.sum(way * start, 1), np.sum(start * start, 1) - 1.0
    under = bb * bb - 4.0 * aa * cc
    root = np.sqrt(np.maximum(under, 0.0))
    aa = np.maximum(aa, 1e-300)
    return (-bb - root) / (2.0 * aa), (-bb + root) / (2.0 * aa), under


def _hits_ellipsoid(p: np.ndarray, q: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether stretches pass through an ellipsoid, and whether one of their ends is in it."""
    inside = (np.sum((p / radii) ** 2, 1) < 0.9999) | (np.sum((q / radii) ** 2, 1) < 0.9999)
    enter, leave, under = _crossing_shares(p, q, radii)
    return ~inside & (under > 0.0) & (enter > 0.0) & (leave < 1.0), inside


def _nearest_points(x: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Nearest points of an ellipsoid to points (n, 3), by the one root of its secular equation that is nearest."""
    square = radii**2
    signs = np.where(x >= 0.0, 1.0, -1.0)
    y = np.maximum(np.abs(x), 1e-9 * radii)
    low = np.max(-square + radii * y, axis=1)
    high = np.linalg.norm(radii * y, axis=1) - square.min()
    # Convex and falling to the right of `low`: steps from the left never pass the root.
    t = low
    for _ in range(60):
        part = (radii * y / (t[:, None] + square)) ** 2
        value, slope = part.sum(axis=1) - 1.0, -2.0 * np.sum(part / (t[:, None] + square), axis=1)
        step = value / slope
        t = np.clip(t - step, low, np.maximum(high, low))
        if np.all(np.abs(step) < 1e-14 * (1.0 + np.abs(t))):
            break
    return signs * square * y / (t[:, None] + square)


def _nearest_points_in_plane(x: np.ndarray, radii: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Nearest points within the main plane across each point's `axis`."""
    made = np.zeros_like(x)
    for k in range(3):
        rows = axis == k
        if rows.any():
            flat = x[rows].copy()
            flat[:, k] = 0.0
            made[rows] = _nearest_points(flat, radii)
            made[rows, k] = 0.0
    return made
