r"""Periodic motions of several joints at once, optimised so that the parameters of all of them show.

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

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import null_space

from ..._errors import PellucidError
from ...numerics.protocols.fourier import fourier_basis
from ...numerics.protocols.interior_search import interior_search
from ...numerics.protocols.tree_limits import TreeLimits

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


def information_cost(information: np.ndarray, criterion: str = "D", scales: np.ndarray | None = None) -> float:
    """Return the log of the determinant of the covariance (D), or of the sum of variances (A).

    `information` (p, p). With A each variance is divided by its parameter's `scales`, (p,), squared. The cost is
    infinite if a parameter cannot be estimated.
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
    spread = np.square(np.linalg.inv(factor)).sum(axis=0) / size**2
    return float(np.log((spread / (1.0 if scales is None else np.square(scales))).sum()))


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
        "excitation: found no place about which the joints may move within their limits, of 200 drawn; expected one: "
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
    scales: np.ndarray | None = None,
    drawn: int = _DEFAULT_DRAW_COUNT,
    refined: int = 1,
) -> Excitation:
    """Return the best motion within the limits: the best `refined` of `drawn` random ones, each improved by a search.

    A search is bounded by counts, not by the clock, so that equal seeds give equal motions.

    `fundamental` [Hz]; `scales` (p,), of A alone.
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
        return information_cost(information(*series.motion(time)), criterion, scales)

    def aim(x: np.ndarray, weight: float) -> float:
        moved = motion(x)
        left = limits.slacks(*moved) - (1.0 - _LIMIT_SHARE)
        if not (left > 0.0).all():
            return np.inf
        # A slack of a whole range or more has no effect on the barrier.
        barrier = -np.log(np.minimum(left, 1.0)).mean(axis=0).sum()
        return information_cost(information(*moved), criterion, scales) + weight * barrier

    tried = [random_tree_fourier(limits, rng, fundamental=fundamental, harmonics=harmonics) for _ in range(drawn)]
    ranked = sorted(((cost(series), i, series) for i, series in enumerate(tried)), key=lambda one: one[:2])
    if not np.isfinite(ranked[0][0]):
        raise PellucidError(
            f"excitation: no motion of {drawn} drawn tells the parameters apart; expected base parameters, of which "
            "none is a sum of others, and limits that let every joint move"
        )
    best, least = ranked[0][2], ranked[0][0]
    parameters = len(information(*best.motion(time)))
    for _, _, series in ranked[:refined]:
        x = numbers(_shrink_inside_limits(series, limits, time))
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
    raise PellucidError(f"excitation: {passed}, however small the motion is")


def _shrink_inside_limits(series: TreeFourier, limits: TreeLimits, time: np.ndarray) -> TreeFourier:
    """Return a series reduced until every limit has some slack, so that barriers are finite."""
    while not (limits.slacks(*series.motion(time)) > 1.5 * (1.0 - _LIMIT_SHARE)).all():
        series = series.smaller(0.95)
        if np.abs(series.a).max() + np.abs(series.b).max() < 1e-9:
            raise PellucidError("excitation: found a place that is at a limit even at rest, expected room around it")
    return series


def _rest_basis(harmonics: int) -> np.ndarray:
    """Return a basis of the coefficients (a, then b) of series at rest at a period's start, (2 h, 2 h - 2)."""
    order = np.arange(1.0, harmonics + 1.0)
    still = np.concatenate([np.ones(harmonics), np.zeros(harmonics)])
    unhurried = np.concatenate([np.zeros(harmonics), order / harmonics])
    return null_space(np.stack([still, unhurried]))
