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

import numpy as np
from scipy.linalg import null_space

from .._errors import PellucidError
from .fourier import fourier_basis
from .interior_search import interior_search
from .tree_limits import TreeLimits

CRITERIA = ("D", "A")

Information = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Position, velocity, acceleration (n, m) to the information of p parameters that n samples bear, (p, p)."""

_SAMPLES = 40  # per period of the highest harmonic, in a search
_FINE = 8  # times as many where limits are verified
_DRAWN = 60  # random motions of which a search refines the best
_RESERVE = 0.97  # of each limit, in a search: peaks between samples, and efforts have higher harmonics than motions
_BARRIERS = (0.1, 0.01, 0.001)  # weights of the limits, in shares of the number of parameters
_STEPS = 30  # of each barrier's search
_LEAST = 0.02  # that two steps must gain; of a determinant of thirty parameters, a thousandth of an interval


@dataclass(frozen=True, eq=False)
class TreeFourier:
    """A periodic motion of m joints in h harmonics, at rest at the ends of every period."""

    fundamental: float  # Hz
    centre: np.ndarray  # (m,) the mean over a period [rad; m]
    a: np.ndarray  # a, b: (m, h) of the velocity's cosines and sines [rad/s; m/s]
    b: np.ndarray

    @property
    def period(self) -> float:
        """[s]."""
        return 1.0 / self.fundamental

    def motion(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity, acceleration, (n, m) each, in closed form. `time` (n,) [s]."""
        basis = fourier_basis(time, self.fundamental, self.a.shape[1])
        position, velocity, acceleration = basis @ np.concatenate([self.a, self.b], axis=1).T
        return self.centre + position, velocity, acceleration

    def smaller(self, share: float) -> TreeFourier:
        """The same shape about the same centre."""
        return TreeFourier(self.fundamental, self.centre, share * self.a, share * self.b)

    def one_period(self) -> np.ndarray:
        """Instants of a period on which limits are verified, its end with it, (n,) [s]."""
        return np.linspace(0.0, self.period, _FINE * _SAMPLES * self.a.shape[1] + 1)


@dataclass(frozen=True, eq=False)
class Excitation:
    """A motion, and how well it shows the parameters."""

    series: TreeFourier
    cost: float  # Less is better; a difference of D's costs is that of log determinants
    drawn: np.ndarray  # Costs of the random motions within the same limits, in order


def information_cost(information: np.ndarray, criterion: str = "D", scales: np.ndarray | None = None) -> float:
    """Log of what is to be small: D: the determinant of the covariance; A: the sum of variances, each in shares of its
    parameter's `scales` (p,) squared. `information` (p, p); infinite where a parameter does not show."""
    if criterion not in CRITERIA:
        raise PellucidError(f"criterion: found {criterion!r}, expected one of {', '.join(CRITERIA)}")
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
    """A random shape about a random place, as large as the limits of the joints allow, then smaller until all hold."""
    at_rest = _at_rest(harmonics)
    time = np.arange(_SAMPLES * harmonics) / (_SAMPLES * harmonics * fundamental)
    basis = fourier_basis(time, fundamental, harmonics) @ at_rest
    count = len(limits.names)
    for _ in range(200):
        drawn = rng.standard_normal((count, at_rest.shape[1]))
        position, velocity, acceleration = basis @ drawn.T
        size = np.minimum.reduce([
            (limits.high - limits.low) / np.ptp(position, axis=0),
            limits.velocity / np.abs(velocity).max(axis=0),
            limits.acceleration / np.abs(acceleration).max(axis=0),
        ]) * (_RESERVE**2)  # fmt: skip
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
    drawn: int = _DRAWN,
    refined: int = 1,
) -> Excitation:
    """The best of `drawn` random motions within the limits, the best `refined` of them each improved from inside them.

    A search is bounded by counts, not by the clock, so that equal seeds give equal motions.

    `fundamental` [Hz]; `scales` (p,), of A alone.
    """
    if harmonics < 2:
        raise PellucidError(f"harmonics: found {harmonics}, expected at least 2: one cannot start and end at rest")
    at_rest = _at_rest(harmonics)
    count, free, samples = len(limits.names), at_rest.shape[1], _SAMPLES * harmonics
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
        left = limits.slacks(*moved) - (1.0 - _RESERVE)
        if not (left > 0.0).all():
            return np.inf
        # A slack of a whole range and more does not pull.
        barrier = -np.log(np.minimum(left, 1.0)).mean(axis=0).sum()
        return information_cost(information(*moved), criterion, scales) + weight * barrier

    tried = [random_tree_fourier(limits, rng, fundamental=fundamental, harmonics=harmonics) for _ in range(drawn)]
    tried = sorted(((cost(series), i, series) for i, series in enumerate(tried)), key=lambda one: one[:2])
    if not np.isfinite(tried[0][0]):
        raise PellucidError(
            f"excitation: no motion of {drawn} drawn tells the parameters apart; expected base parameters, of which "
            "none is a sum of others, and limits that let every joint move"
        )
    best, least = tried[0][2], tried[0][0]
    parameters = len(information(*best.motion(time)))
    for _, _, series in tried[:refined]:
        x = numbers(_inside(series, limits, time))
        for share in _BARRIERS:
            x = interior_search(lambda y, w=share * parameters: aim(y, w), x, steps=_STEPS, least=_LEAST)
        a, b = np.split(speed[:, None] * (x[count:].reshape(count, free) @ at_rest.T), 2, axis=1)
        found = within(TreeFourier(fundamental, limits.low + half * (1.0 + x[:count]), a, b), limits)
        if cost(found) < least:
            best, least = found, cost(found)
    return Excitation(within(best, limits), least, np.array([one[0] for one in tried]))


def within(series: TreeFourier, limits: TreeLimits) -> TreeFourier:
    """A series made smaller until it keeps every limit between the samples of a search too."""
    time = series.one_period()
    for _ in range(200):
        passed = limits.passed(*series.motion(time))
        if passed is None:
            return series
        series = series.smaller(0.99)
    raise PellucidError(f"excitation: {passed}, however small the motion is")


def _inside(series: TreeFourier, limits: TreeLimits, time: np.ndarray) -> TreeFourier:
    """A series small enough that a barrier can be seen from it."""
    while not (limits.slacks(*series.motion(time)) > 1.5 * (1.0 - _RESERVE)).all():
        series = series.smaller(0.95)
        if np.abs(series.a).max() + np.abs(series.b).max() < 1e-9:
            raise PellucidError("excitation: found a place that is at a limit even at rest, expected room around it")
    return series


def _at_rest(harmonics: int) -> np.ndarray:
    """Coefficients, those of a before those of b, of series at rest where a period begins, (2 h, 2 h - 2)."""
    order = np.arange(1.0, harmonics + 1.0)
    still = np.concatenate([np.ones(harmonics), np.zeros(harmonics)])
    unhurried = np.concatenate([np.zeros(harmonics), order / harmonics])
    return null_space(np.stack([still, unhurried]))
