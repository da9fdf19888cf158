r"""Periodic motions of several joints at once, optimised so that all parameters show; shapes that must not collide.

Each joint's velocity is a finite Fourier series [1]_. Two linear conditions on its coefficients, that velocity and
acceleration are 0 at the period's ends, let it start and end at rest without easing, however many periods are played.
What is optimised is the information of the parameters: its determinant (D-optimality: the volume that all parameters
are confined to) or the trace of its inverse (A-optimality: the mean of their variances) [2]_. A search from inside,
with a barrier at every limit, never leaves what a robot may do.

.. [1] J. Swevers, C. Ganseman, D. B. Tukel, J. De Schutter, H. Van Brussel, "Optimal robot excitation and
   identification", IEEE Trans. Robot. Autom. 13, 1997.
.. [2] A. C. Atkinson, A. N. Donev, R. D. Tobias, "Optimum Experimental Designs, with SAS", Oxford University Press,
   2007.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
from scipy.linalg import null_space

from ..._errors import PellucidError
from ...numerics.protocols.interior_search import interior_search
from ...numerics.protocols.tree_limits import TreeLimits

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

    `parents` (l,), BASE where a link is attached to the fixed base; `places` (l, 3) of each link's frame in its
    parent's [m]; `tips` (l, 3) in the link's own [m]; `radius` [m], one or (l,).
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


INFORMATION_CRITERIA = ("D", "A")
"""Criteria of an excitation: determinant (D) or trace (A) of the parameters' covariance."""

Information = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Function from position, velocity and acceleration, (n, m) each, to the information matrix of p parameters, (p, p)."""

_SAMPLES_PER_HARMONIC = 40
"""Samples of a search per period of the highest harmonic."""

_VERIFICATION_OVERSAMPLING = 8
"""Limits are verified on a grid this many times finer than that of a search."""

_DEFAULT_DRAW_COUNT = 60
"""Number of random motions that are drawn; a search refines the best ones."""

_LIMIT_SHARE = 0.97
"""A search uses this share of each limit. Peaks lie between samples, and efforts have higher harmonics than motions."""

_BARRIER_WEIGHTS = (0.1, 0.01, 0.001)
"""Weights of the limits' barriers in successive searches, as shares of the number of parameters."""

_MAX_STEPS = 30
"""Steps of the search with each barrier weight, at most."""

_MIN_GAIN = 0.02
"""A search ends when two steps gain less. For 30 parameters it is a thousandth of a confidence interval."""


@dataclass(frozen=True, eq=False)
class TreeFourier:
    """A periodic motion of m joints in h harmonics, at rest at the ends of every period."""

    fundamental: float  # fundamental frequency [Hz]
    centre: np.ndarray  # (m,) mean over a period [rad; m]
    a: np.ndarray  # (m, h) cosine coefficients of the velocity [rad/s; m/s]
    b: np.ndarray  # (m, h) sine coefficients of the velocity [rad/s; m/s]

    @property
    def period(self) -> float:
        """Duration of one period [s]."""
        return 1.0 / self.fundamental

    def motion(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position, velocity and acceleration, (n, m) each, in closed form. `time` (n,) [s]."""
        basis = fourier_basis(time, self.fundamental, self.a.shape[1])
        position, velocity, acceleration = basis @ np.concatenate([self.a, self.b], axis=1).T
        return self.centre + position, velocity, acceleration

    def smaller(self, share: float) -> TreeFourier:
        """Return the same shape about the same centre, multiplied by `share`."""
        return TreeFourier(self.fundamental, self.centre, share * self.a, share * self.b)

    def one_period(self) -> np.ndarray:
        """Return the instants of a period, its end included, on which limits are verified, (n,) [s]."""
        return np.linspace(0.0, self.period, _VERIFICATION_OVERSAMPLING * _SAMPLES_PER_HARMONIC * self.a.shape[1] + 1)


@dataclass(frozen=True, eq=False)
class Excitation:
    """An optimised motion with its cost."""

    series: TreeFourier
    cost: float  # cost, less is better; differences of D's costs are those of log determinants
    drawn: np.ndarray  # costs of the random motions within the same limits, in ascending order


def information_cost(information: np.ndarray, criterion: str = "D") -> float:
    """Return the log of the determinant of the covariance (D), or of the sum of variances (A).

    `information` (p, p). The cost is infinite if a parameter cannot be estimated.
    """
    if criterion not in INFORMATION_CRITERIA:
        raise PellucidError(f"criterion: found {criterion!r}, expected one of {', '.join(INFORMATION_CRITERIA)}")
    size = np.sqrt(np.diag(information))
    if not (np.isfinite(size).all() and (size > 0.0).all()):
        return np.inf
    try:
        factor = np.linalg.cholesky(information / np.outer(size, size))
    except np.linalg.LinAlgError:
        return np.inf
    if criterion == "D":
        return float(-2.0 * (np.log(np.diag(factor)).sum() + np.log(size).sum()))
    return float(np.log((np.square(np.linalg.inv(factor)).sum(axis=0) / size**2).sum()))


def random_tree_fourier(
    limits: TreeLimits, rng: np.random.Generator, *, fundamental: float, harmonics: int
) -> TreeFourier:
    """Return a random shape about a random position, as large as the joints' limits allow, reduced until all hold."""
    at_rest = _rest_basis(harmonics)
    time = np.arange(_SAMPLES_PER_HARMONIC * harmonics) / (_SAMPLES_PER_HARMONIC * harmonics * fundamental)
    basis = fourier_basis(time, fundamental, harmonics) @ at_rest
    count = len(limits.names)
    for _ in range(200):
        drawn = rng.standard_normal((count, at_rest.shape[1]))
        position, velocity, acceleration = basis @ drawn.T
        size = np.minimum.reduce([
            (limits.high - limits.low) / np.ptp(position, axis=0),
            limits.velocity / np.abs(velocity).max(axis=0),
            limits.acceleration / np.abs(acceleration).max(axis=0),
        ]) * (_LIMIT_SHARE**2)  # fmt: skip
        room_below = limits.low - (size * position).min(axis=0)
        room_above = limits.high - (size * position).max(axis=0)
        centre = room_below + (room_above - room_below) * rng.uniform(0.05, 0.95, count)
        a, b = np.split(size[:, None] * (drawn @ at_rest.T), 2, axis=1)
        series = TreeFourier(fundamental, centre, a, b)
        for _ in range(20):
            if limits.passed(*series.motion(time)) is None:
                break
            series = series.smaller(0.85)
        else:
            continue  # not even nearly still: what holds it there, or the arm itself, is in the way
        return series
    raise PellucidError(
        "excitation: found no centre of motion within the limits of the joints among 200 random ones, expected one: "
        + (limits.passed(*(x[None, :] for x in (centre, 0.0 * centre, 0.0 * centre))) or "give larger limits")
    )


def optimised_tree_fourier(
    information: Information,
    limits: TreeLimits,
    rng: np.random.Generator,
    *,
    fundamental: float,
    harmonics: int = 5,
    criterion: str = "D",
    drawn: int = _DEFAULT_DRAW_COUNT,
) -> Excitation:
    """Return the best motion within the limits: the best of `drawn` random ones, improved by a search.

    A search is bounded by counts, not by the clock, so that equal seeds give equal motions.

    `fundamental` [Hz].
    """
    if harmonics < 2:
        raise PellucidError(f"harmonics: found {harmonics}, expected at least 2: one cannot start and end at rest")
    at_rest = _rest_basis(harmonics)
    count, free, samples = len(limits.names), at_rest.shape[1], _SAMPLES_PER_HARMONIC * harmonics
    time = np.arange(samples) / (samples * fundamental)
    basis = fourier_basis(time, fundamental, harmonics) @ at_rest
    half = 0.5 * (limits.high - limits.low)
    speed = np.minimum(limits.velocity, half * 2.0 * np.pi * fundamental * harmonics)

    def motion(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        place, shape = x[:count], x[count:].reshape(count, free)
        position, velocity, acceleration = basis @ (speed[:, None] * shape).T
        return limits.low + half * (1.0 + place) + position, velocity, acceleration

    def numbers(series: TreeFourier) -> np.ndarray:
        shape = np.concatenate([series.a, series.b], axis=1) @ at_rest / speed[:, None]
        return np.concatenate([(series.centre - limits.low) / half - 1.0, shape.ravel()])

    def cost(series: TreeFourier) -> float:
        return information_cost(information(*series.motion(time)), criterion)

    def aim(x: np.ndarray, weight: float) -> float:
        moved = motion(x)
        left = limits.slacks(*moved) - (1.0 - _LIMIT_SHARE)
        if not (left > 0.0).all():
            return np.inf
        # A slack of a whole range or more has no effect on the barrier.
        barrier = -np.log(np.minimum(left, 1.0)).mean(axis=0).sum()
        return information_cost(information(*moved), criterion) + weight * barrier

    tried = [random_tree_fourier(limits, rng, fundamental=fundamental, harmonics=harmonics) for _ in range(drawn)]
    ranked = sorted(((cost(series), i, series) for i, series in enumerate(tried)), key=lambda one: one[:2])
    if not np.isfinite(ranked[0][0]):
        raise PellucidError(
            f"excitation: none of {drawn} sampled motions identifies all parameters; expected independent base "
            "parameters and limits that let every joint move"
        )
    best, least = ranked[0][2], ranked[0][0]
    parameters = len(information(*best.motion(time)))
    x = numbers(_shrink_inside_limits(best, limits, time))
    for share in _BARRIER_WEIGHTS:
        x = interior_search(partial(aim, weight=share * parameters), x, steps=_MAX_STEPS, least=_MIN_GAIN)
    a, b = np.split(speed[:, None] * (x[count:].reshape(count, free) @ at_rest.T), 2, axis=1)
    found = shrink_within_limits(TreeFourier(fundamental, limits.low + half * (1.0 + x[:count]), a, b), limits)
    if cost(found) < least:
        best, least = found, cost(found)
    return Excitation(shrink_within_limits(best, limits), least, np.array([one[0] for one in ranked]))


def shrink_within_limits(series: TreeFourier, limits: TreeLimits) -> TreeFourier:
    """Return a series reduced until it keeps every limit, also between the samples of a search."""
    time = series.one_period()
    for _ in range(200):
        passed = limits.passed(*series.motion(time))
        if passed is None:
            return series
        series = series.smaller(0.99)
    raise PellucidError(f"excitation: {passed}, however small the motion is: give larger limits, or another centre")


def _shrink_inside_limits(series: TreeFourier, limits: TreeLimits, time: np.ndarray) -> TreeFourier:
    """Return a series reduced until every limit has some slack, so that barriers are finite."""
    while not (limits.slacks(*series.motion(time)) > 1.5 * (1.0 - _LIMIT_SHARE)).all():
        series = series.smaller(0.95)
        if np.abs(series.a).max() + np.abs(series.b).max() < 1e-9:
            raise PellucidError(
                "excitation: found a centre of motion at a limit even at rest, expected room around it: give larger "
                "limits"
            )
    return series


def _rest_basis(harmonics: int) -> np.ndarray:
    """Return a basis of the coefficients (a, then b) of series at rest at a period's start, (2 h, 2 h - 2)."""
    order = np.arange(1.0, harmonics + 1.0)
    still = np.concatenate([np.ones(harmonics), np.zeros(harmonics)])
    unhurried = np.concatenate([np.zeros(harmonics), order / harmonics])
    return null_space(np.stack([still, unhurried]))


def fourier_basis(time: np.ndarray, fundamental: float, harmonics: int) -> np.ndarray:
    """Return position, velocity and acceleration per unit of each coefficient, (3, n, 2 h), a before b."""
    rate = 2.0 * np.pi * fundamental * np.arange(1, harmonics + 1)
    angle = np.asarray(time, dtype=float)[..., None] * rate
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.stack(
        [
            np.concatenate([sine / rate, -cosine / rate], axis=-1),
            np.concatenate([cosine, sine], axis=-1),
            np.concatenate([-sine * rate, cosine * rate], axis=-1),
        ]
    )
