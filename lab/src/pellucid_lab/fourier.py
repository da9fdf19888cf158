r"""Periodic motions optimised so that a joint's parameters show as well as its limits allow.

A finite Fourier series is periodic, band-limited and differentiable in closed form, and its coefficients can be chosen
so that the regressor has the best condition [1]_ or the parameters the smallest joint confidence region, which is
D-optimality [2]_.

.. [1] J. Swevers, C. Ganseman, D. B. Tukel, J. De Schutter, H. Van Brussel, "Optimal robot excitation and
   identification", IEEE Trans. Robot. Autom. 13, 1997.
.. [2] A. C. Atkinson, A. N. Donev, R. D. Tobias, "Optimum Experimental Designs, with SAS", Oxford University Press,
   2007.
.. [3] H. Ehlich, K. Zeller, "Schwankung von Polynomen zwischen Gitterpunkten", Math. Z. 86, 1964.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from pellucid.arm.protocols.tree_fourier import fourier_basis

EXCITATION_CRITERIA = ("condition", "determinant")
"""Criteria of an excitation: condition number of the regressor, or determinant of the parameters' covariance."""

_MAX_EVALUATIONS = 6000
"""Evaluations of a search in all restarts. They are counted, not timed, so that equal seeds give equal motions."""

_DEPENDENT_COLUMNS_COST = 1e6
"""Cost of linearly dependent columns in a search. It is finite, so that a line search can pass such shapes."""

_SHAPES_PER_RESTART = 10
"""Random shapes drawn at each restart; the best one is refined."""

_MIN_GRID_POINTS = 1024
"""Peaks are sought on at least this many points per period."""

_EASE_PERIODS = np.arange(1.0, 4.01, 0.25)
"""Easing times that are tried if none is given, in periods."""


@dataclass(frozen=True, eq=False)
class FourierSeries:
    r"""A periodic motion of h harmonics, in the coefficients of its velocity.

    .. math::  q(t) = q_0 + \sum_k \frac{a_k}{k\omega} \sin(k\omega t) - \frac{b_k}{k\omega} \cos(k\omega t),
       \qquad \omega = 2\pi f_0
    """

    fundamental: float  # f_0 [Hz], > 0
    centre: float  # q_0, the mean over a period [rad]
    a: np.ndarray  # (h,) cosine coefficients of the velocity [rad/s]
    b: np.ndarray  # (h,) sine coefficients of the velocity [rad/s]

    def __post_init__(self):
        _require_positive(fundamental=self.fundamental)
        if not np.isfinite(self.centre):
            raise ValueError(f"centre is {self.centre}; expected a finite angle [rad]")
        a, b = np.array(self.a, dtype=float), np.array(self.b, dtype=float)
        if a.ndim != 1 or a.shape != b.shape or not len(a):
            raise ValueError(f"a has shape {a.shape} and b {b.shape}; expected both (h,), h > 0")
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            raise ValueError("a and b hold values that are not finite")
        object.__setattr__(self, "a", a)
        object.__setattr__(self, "b", b)

    @property
    def period(self) -> float:
        """Duration of one period [s]."""
        return 1.0 / self.fundamental

    def motion(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position [rad], velocity [rad/s] and acceleration [rad/s^2], (n,) each, at `time` (n,) [s].

        The derivatives are exact.
        """
        position, velocity, acceleration = fourier_basis(time, self.fundamental, len(self.a)) @ np.concatenate(
            [self.a, self.b]
        )
        return self.centre + position, velocity, acceleration

    def peaks(self) -> tuple[float, float, float, float]:
        """Return bounds of the whole motion: lowest and highest position, largest speed and acceleration.

        A trigonometric polynomial of degree h exceeds its largest value on N evenly spaced points at most by the factor
        1 / cos(pi h / N) [3]_, here less than 1.002; the bounds include it.

        Gives `low`, `high`, `velocity`, `acceleration` [rad], [rad/s], [rad/s^2].
        """
        grid, factor = _grid(self.fundamental, len(self.a), 1)
        position, velocity, acceleration = self.motion(grid)
        middle, half = 0.5 * (position.max() + position.min()), 0.5 * np.ptp(position) * factor
        speed, change = factor * np.abs(velocity).max(), factor * np.abs(acceleration).max()
        return float(middle - half), float(middle + half), float(speed), float(change)


def scaled_to_limits(
    a: np.ndarray,
    b: np.ndarray,
    *,
    fundamental: float,
    low: float,
    high: float,
    velocity: float,
    acceleration: float,
) -> FourierSeries:
    """Return the largest motion of a given shape within all limits, its extremes centred between `low` and `high`.

    `a`, `b` (h,); `fundamental` [Hz]; `low`, `high` [rad]; `velocity`, `acceleration` [rad/s], [rad/s^2].
    """
    _require_limits(fundamental, low, high, velocity, acceleration)
    shape = FourierSeries(fundamental, 0.0, a, b)
    lowest, highest, speed, change = shape.peaks()
    if not speed > 0.0:
        raise ValueError("all of a and b are zero; expected a shape that moves")
    factor = min((high - low) / (highest - lowest), velocity / speed, acceleration / change)
    centre = 0.5 * (low + high) - 0.5 * factor * (highest + lowest)
    return FourierSeries(fundamental, centre, factor * shape.a, factor * shape.b)


def optimised_fourier(
    regressor: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    *,
    fundamental: float,
    harmonics: int,
    low: float,
    high: float,
    velocity: float,
    acceleration: float,
    rng: np.random.Generator,
    criterion: str = "condition",
    scales: np.ndarray | None = None,
    samples: int = 200,
    restarts: int = 8,
) -> FourierSeries:
    """Return the Fourier series that excites a regressor's parameters best within a joint's limits [1]_.

    Every candidate shape is scaled until it touches the limit that binds first (`scaled_to_limits`), so that the search
    is without constraints: the best of a few random shapes is refined by Powell's method, `restarts` times. The search
    is bounded by a count of evaluations, not by the clock: less than a second for 5 harmonics and 7 parameters.

    `regressor` (n,) [rad], [rad/s], [rad/s^2]; `fundamental` [Hz]; `low`, `high` [rad]; `velocity`,
    `acceleration` [rad/s], [rad/s^2]; `scales` (p,).
    """
    _require_limits(fundamental, low, high, velocity, acceleration)
    _require_criterion(criterion)
    _require_count(harmonics=(harmonics, 1), restarts=(restarts, 1))
    _require_count(samples=(samples, 2 * harmonics + 1))

    grid, factor = _grid(fundamental, harmonics, samples)
    basis, every = fourier_basis(grid, fundamental, harmonics), len(grid) // samples
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def motion(shape):
        # `scaled_to_limits` on the search's own grid, of which the regressor sees every few points.
        position, speed, change = basis @ shape
        lowest, highest = position.min(), position.max()
        most = (0.5 * (highest - lowest) / half, np.abs(speed).max() / velocity, np.abs(change).max() / acceleration)
        size = 1.0 / (factor * max(max(most), np.finfo(float).tiny))
        position = middle + size * (position[::every] - 0.5 * (lowest + highest))
        return position, size * speed[::every], size * change[::every]

    start = rng.standard_normal((restarts, _SHAPES_PER_RESTART, 2 * harmonics))
    first = np.asarray(regressor(*motion(start[0, 0])), dtype=float)
    if first.ndim != 2 or len(first) != samples or not 0 < first.shape[1] <= samples:
        raise ValueError(
            f"the regressor gives shape {first.shape} for {samples} samples; expected ({samples}, p), p <= {samples}"
        )
    scales = _checked_scales(scales, first.shape[1])

    def cost(shape):
        matrix = np.asarray(regressor(*motion(shape)), dtype=float)
        if not np.isfinite(matrix).all():
            raise ValueError("the regressor gives values that are not finite within the limits")
        value = _cost(matrix, criterion, scales)
        return min(float(np.log(value)) if criterion == "condition" else value, _DEPENDENT_COLUMNS_COST)

    best, least = None, _DEPENDENT_COLUMNS_COST
    allowed = max(_MAX_EVALUATIONS // restarts - _SHAPES_PER_RESTART, 2 * harmonics + 1)
    for shapes in start:
        costs = [cost(s) for s in shapes]
        chosen = int(np.argmin(costs))
        found = minimize(cost, shapes[chosen], method="Powell", options={"maxfev": allowed, "xtol": 1e-3, "ftol": 1e-4})
        for shape, value in ((shapes[chosen], costs[chosen]), (found.x, float(found.fun))):
            if value < least and np.any(shape):
                best, least = shape, value
    if best is None:
        raise ValueError(
            "the regressor's columns are linearly dependent on every motion tried; no motion tells them apart"
        )
    a, b = np.split(best, 2)
    return scaled_to_limits(
        a, b, fundamental=fundamental, low=low, high=high, velocity=velocity, acceleration=acceleration
    )


def play(
    series: FourierSeries,
    duration: float,
    fs: float,
    ease: float | None = None,
    *,
    velocity: float | None = None,
    acceleration: float | None = None,
) -> np.ndarray:
    """Return a series as a position to follow, starting and ending at rest at the series' centre.

    The excursion from the centre is multiplied by a quintic that rises from 0 to 1 while easing in and falls back while
    easing out; position, velocity and acceleration are continuous. The multiplier never exceeds 1 and the centre lies
    within the series' range, so the range holds always; that speed and acceleration hold is verified on a
    fine grid.

    `duration`, `fs` [s], [Hz]; `ease` [s]; `velocity`, `acceleration` [rad/s], [rad/s^2]; gives (n,) [rad].
    """
    _require_positive(duration=duration, fs=fs)
    *_, speed, change = series.peaks()
    velocity = speed if velocity is None else velocity
    acceleration = change if acceleration is None else acceleration
    _require_positive(velocity=velocity, acceleration=acceleration)
    if ease is not None:
        _require_positive(ease=ease)
    n = round(duration * fs)
    end = (n - 1) / fs
    eases = _EASE_PERIODS * series.period if ease is None else np.array([ease])
    fitting = eases[2.0 * eases <= end]
    if not len(fitting):
        raise ValueError(
            f"easing in and out takes {2.0 * eases[0]:g} s; the samples span {max(end, 0.0):g} s: play it for longer"
        )

    fine = np.linspace(0.0, end, max(n, int(np.ceil(end * series.fundamental * _grid_points(len(series.a))))) + 1)
    motion = series.motion(fine)
    reached = []
    for trial in fitting:
        _, speeds, changes = _ease_motion(series.centre, motion, fine, end, trial)
        reached.append((np.abs(speeds).max(), np.abs(changes).max()))
        if reached[-1][0] <= velocity * (1.0 + 1e-9) and reached[-1][1] <= acceleration * (1.0 + 1e-9):
            time = np.arange(n) / fs
            return _ease_motion(series.centre, series.motion(time), time, end, trial)[0]
    speed, change = min(reached, key=lambda r: max(r[0] / velocity, r[1] / acceleration))
    raise ValueError(
        f"eased over {' or '.join(f'{e:g}' for e in fitting)} s the motion reaches {speed:.4g} rad/s and "
        f"{change:.4g} rad/s^2; the limits are {velocity:.4g} and {acceleration:.4g}: ease for longer or raise them"
    )


def _grid_points(harmonics: int) -> int:
    return max(_MIN_GRID_POINTS, 64 * harmonics)


def _grid(fundamental: float, harmonics: int, multiple: int) -> tuple[np.ndarray, float]:
    """Return instants of one period, and the factor by which peaks between them may be higher.

    The number of instants is a multiple of `multiple`.
    """
    n = -(-_grid_points(harmonics) // multiple) * multiple
    return np.arange(n) / (n * fundamental), float(1.0 / np.cos(np.pi * harmonics / n))


def _cost(matrix: np.ndarray, criterion: str, scales: np.ndarray | None) -> float:
    n, p = matrix.shape
    if scales is not None:
        matrix = matrix * scales
    length = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
    if not length.all():
        return np.inf
    singular = np.linalg.svd(matrix / length, compute_uv=False)
    if singular[-1] <= n * np.finfo(float).eps * singular[0]:
        return np.inf
    if criterion == "determinant":
        return float(p * np.log(n) - 2.0 * np.log(singular).sum() - 2.0 * np.log(length).sum())
    if scales is not None:
        singular = np.linalg.svd(matrix, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else np.inf


def _ease_motion(centre, motion, time, end, ease):
    """Return the motion with its excursion multiplied by the quintics of easing in and out, which do not overlap."""
    position, velocity, acceleration = motion
    rising = time < 0.5 * end
    u = np.clip(np.where(rising, time, end - time) / ease, 0.0, 1.0)
    level = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    slope = np.where(rising, 1.0, -1.0) * 30.0 * u**2 * (1.0 - u) ** 2 / ease
    bend = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / ease**2
    excursion = position - centre
    return (
        centre + level * excursion,
        level * velocity + slope * excursion,
        level * acceleration + 2.0 * slope * velocity + bend * excursion,
    )


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value}; expected a finite number > 0")


def _require_count(**values: tuple[int, int]) -> None:
    for name, (value, least) in values.items():
        if not isinstance(value, (int, np.integer)) or value < least:
            raise ValueError(f"{name} is {value}; expected an integer >= {least}")


def _require_limits(fundamental: float, low: float, high: float, velocity: float, acceleration: float) -> None:
    _require_positive(fundamental=fundamental, velocity=velocity, acceleration=acceleration)
    if not (np.isfinite([low, high]).all() and low < high):
        raise ValueError(f"low is {low} and high {high}; expected finite angles, low < high")


def _require_criterion(criterion: str) -> None:
    if criterion not in EXCITATION_CRITERIA:
        raise ValueError(f"criterion is {criterion!r}; expected one of {', '.join(EXCITATION_CRITERIA)}")


def _checked_scales(scales: np.ndarray | None, columns: int) -> np.ndarray | None:
    if scales is None:
        return None
    scales = np.asarray(scales, dtype=float)
    if scales.shape != (columns,):
        raise ValueError(f"scales has shape {scales.shape}; the regressor has {columns} columns: expected ({columns},)")
    if not (np.isfinite(scales).all() and (scales > 0.0).all()):
        raise ValueError("scales holds values that are not finite and > 0")
    return scales
