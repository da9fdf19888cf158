r"""Musculotendon length and moment arm as smooth functions of the angles of the joints that a muscle crosses.

Length is a tensor product of cubic splines, the rest its derivatives, so that muscle work and joint work agree:

.. math::
   l = \sum_{ij} c_{ij} B_i(\theta_1) B_j(\theta_2), \qquad r_k = -\frac{\partial l}{\partial \theta_k}, \qquad
   \dot l = -\sum_k r_k \dot\theta_k

Beyond a table's angles length goes on straight. Tables ship with the package (``data/``), each with its source and
licence; ``examples/muscle_geometry_tables.py`` makes them again. Angles have the model's own signs: in gait2392 hip
flexion, knee *extension* (0 straight) and ankle dorsiflexion are positive.

Functions of a model's coordinates, with their slopes: positions of joints, and values of coupled coordinates.

Length of a muscle with its tendon as a polynomial of the angles of the joints that it crosses.

.. math::
   l = \sum_t c_t \prod_k x_k^{p_{tk}}, \qquad x_k = (\theta_k - m_k) / h_k, \qquad
   r_k = -\frac{\partial l}{\partial \theta_k}

Lengths and moment arms are fitted together, so that muscle work and joint work agree, and the error is that of poses
that were not fitted. The degree is the lowest that keeps it small. A via point that begins to act makes a model's own
arm jump; a polynomial goes through.

Length of a muscle with its tendon over one or two angles, in the form that a robot steps.

Cubic splines on an even grid, :math:`l = \sum_{ij} c_{ij} B(u_1 - i) B(u_2 - j)`, straight beyond it
(``include/pellucid/muscle_path.hpp``). A `MuscleGeometry` with even knots becomes the same function exactly; lengths
that were recorded with angles are fitted.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from pathlib import Path
from typing import Protocol

import numpy as np

from ... import _core
from .hill import HillMuscle

_DATA_FOLDER = Path(__file__).parent / "data"


@dataclass(frozen=True)
class KeptPaths:
    """Evaluations of a muscle's path that are kept for other estimators of the same recordings."""

    max_count: int = 24
    max_size: int = 8192  # Largest number of angles in a kept evaluation


KEPT_PATHS = KeptPaths()


class LengthOverAngles:
    """Length as a smooth function of `angles` within their `range`, straight beyond."""

    angles: tuple[str, ...]  # Joints that the muscle crosses

    def range(self, angle: str) -> tuple[float, float]:
        """First and last angle, of one of its angles [rad]."""
        raise NotImplementedError

    def _inside(self, points: np.ndarray, *derivatives: int) -> np.ndarray:
        """Length at `points` (n, k) within the ranges, or its derivative along some angles; (n,)."""
        raise NotImplementedError

    def length(self, angles: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the length of muscle and tendon, (n,) [m]. `angles` (n,) [rad]."""
        inside, beyond = self._split(angles)
        result = self._inside(inside)
        for k in range(len(self.angles)):
            if np.any(beyond[k]):
                result = result + beyond[k] * self._inside(inside, k)
        return result

    def moment_arm(self, joint: str, angles: Mapping[str, np.ndarray]) -> np.ndarray:
        """About a joint, positive where the muscle pulls towards positive angles. `angles` (n,) [rad]; gives (n,)
        [m]."""
        inside, beyond = self._split(angles)
        if joint not in self.angles:
            return np.zeros(len(inside))
        k = self.angles.index(joint)
        result = -self._inside(inside, k)
        for other in range(len(self.angles)):
            # Where another angle is beyond its table, the length that goes on straight there bends with this one.
            if other != k and np.any(beyond[other]):
                within = (beyond[k] == 0.0).astype(float)
                result = result - within * beyond[other] * self._inside(inside, k, other)
        return result

    def rate(self, angles: Mapping[str, np.ndarray], rates: Mapping[str, np.ndarray]) -> np.ndarray:
        """How fast the length grows. `angles`, `rates` (n,) [rad], [rad/s]; gives (n,) [m/s]."""
        return -sum(self.moment_arm(a, angles) * np.asarray(rates[a], float) for a in self.angles)

    def _split(self, angles: Mapping[str, np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
        columns = [np.atleast_1d(np.asarray(angles[a], float)) for a in self.angles]
        inside = [np.clip(c, *self.range(a)) for c, a in zip(columns, self.angles, strict=True)]
        return np.stack(inside, axis=-1), [c - i for c, i in zip(columns, inside, strict=True)]


@dataclass(frozen=True, eq=False)
class MuscleGeometry(LengthOverAngles):
    """Path of one muscle."""

    muscle: str
    angles: tuple[str, ...]  # Joints it crosses
    knots: tuple[np.ndarray, ...]  # (k + 4,) Of cubic splines, per angle [rad]
    coefficients: np.ndarray  # (k,) [m]

    def range(self, angle: str) -> tuple[float, float]:
        """First and last angle of the table, of one of its angles [rad]."""
        knots = self.knots[self.angles.index(angle)]
        return float(knots[0]), float(knots[-1])

    def _inside(self, points: np.ndarray, *derivatives: int) -> np.ndarray:
        order = [derivatives.count(k) for k in range(len(self.angles))]
        if points.size > KEPT_PATHS.max_size:
            return self._product(points, nu=order)
        key = (points.tobytes(), *order)
        if key not in self._kept:
            if len(self._kept) >= KEPT_PATHS.max_count:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = self._product(points, nu=order)
        return self._kept[key].copy()

    @cached_property
    def _kept(self) -> dict[tuple, np.ndarray]:
        """Last lengths and derivatives: many estimators are fitted to the same few recordings."""
        return {}

    @cached_property
    def _product(self):
        from scipy.interpolate import NdBSpline

        return NdBSpline(self.knots, self.coefficients, 3)


@dataclass(frozen=True, eq=False)
class MuscleTable:
    """Muscles of a musculoskeletal model."""

    source: str  # source, licence, citation: Where it is from, under which terms, and what to cite
    licence: str
    citation: str
    geometry: Mapping[str, MuscleGeometry]  # By muscle
    constants: Mapping[str, HillMuscle]  # The model's anatomical constants; everything else is `HillMuscle`'s own
    labels: Mapping[str, str]  # What the model calls its muscles


@lru_cache(maxsize=4)
def muscle_table(model: str = "gait2392") -> MuscleTable:
    """Muscles of one of the models that ship with the package."""
    path = _DATA_FOLDER / f"{model}.json"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in _DATA_FOLDER.glob("*.json")))
        raise ValueError(f"model: found {model!r}, expected one of {known}")
    raw = json.loads(path.read_text(encoding="utf-8"))
    geometry, constants = {}, {}
    for name, row in raw["muscles"].items():
        knots = tuple(np.array(k, float) for k in row["knots"])
        geometry[name] = MuscleGeometry(name, tuple(row["angles"]), knots, np.array(row["coefficients"], float))
        fixed = ("max_isometric_force", "optimal_fibre_length", "tendon_slack_length", "pennation")
        constants[name] = HillMuscle(name, **{key: row[key] for key in fixed})
    labels = {name: row["label"] for name, row in raw["muscles"].items()}
    return MuscleTable(raw["source"], raw["licence"], raw["citation"], geometry, constants, labels)


class CoordinateFunction(Protocol):
    """A number that follows from one or several coordinates."""

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Value (n,) and slopes (m, n) at coordinates `x` (m, n)."""
        ...


@dataclass(frozen=True)
class Constant:
    """The same everywhere."""

    value: float

    def __call__(self, x):
        return np.full(x.shape[1], self.value), np.zeros_like(x)


@dataclass(frozen=True)
class Linear:
    """A slope for each coordinate, and an offset."""

    slopes: tuple[float, ...]
    offset: float

    def __call__(self, x):
        slopes = np.array(self.slopes)
        return slopes @ x + self.offset, np.repeat(slopes[:, None], x.shape[1], axis=1)


@dataclass(frozen=True)
class Polynomial:
    """Polynomial of one coordinate, with coefficients from the highest power down."""

    coefficients: tuple[float, ...]

    def __call__(self, x):
        return np.polyval(self.coefficients, x[0]), np.polyval(np.polyder(self.coefficients), x[0])[None]


@dataclass(frozen=True)
class ScaledFunction:
    """A function times a factor, as scaling a model to a person leaves it."""

    function: CoordinateFunction
    factor: float

    def __call__(self, x):
        value, slope = self.function(x)
        return self.factor * value, self.factor * slope


@dataclass(frozen=True)
class PiecewiseLinear:
    """Straight from point to point, and on beyond the last."""

    x: tuple[float, ...]
    y: tuple[float, ...]

    def __call__(self, x):
        at, y = np.array(self.x), np.array(self.y)
        slopes = np.diff(y) / np.diff(at)
        i = np.clip(np.searchsorted(at, x[0], side="right") - 1, 0, len(slopes) - 1)
        return y[i] + slopes[i] * (x[0] - at[i]), slopes[i][None]


@dataclass(frozen=True)
class Spline:
    """Cubic through points, straight beyond them.

    Third derivatives at its ends are those of the cubics through the first and the last four points, as in Forsythe,
    Malcolm and Moler; with three points it is a parabola, with two a line. Models of OpenSim name it SimmSpline.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]

    def __call__(self, x):
        value, slope = self._pieces
        at = np.clip(x[0], self.x[0], self.x[-1])
        return value(at) + slope(at) * (x[0] - at), slope(at)[None]

    @cached_property
    def _pieces(self):
        from scipy.interpolate import PPoly

        x, y = np.array(self.x), np.array(self.y)
        n, h = len(x), np.diff(x)
        chord = np.diff(y) / h
        if n == 2:
            coefficients = np.array([np.zeros(1), np.zeros(1), chord, y[:-1]])
        else:
            matrix, right = np.zeros((n, n)), np.zeros(n)
            inner = np.arange(1, n - 1)
            matrix[inner, inner - 1], matrix[inner, inner + 1] = h[:-1], h[1:]
            matrix[inner, inner] = 2.0 * (h[:-1] + h[1:])
            right[1:-1] = np.diff(chord)
            matrix[0, :2], matrix[-1, -2:] = (-h[0], h[0]), (h[-1], -h[-1])
            if n > 3:
                first = right[2] / (x[3] - x[1]) - right[1] / (x[2] - x[0])
                last = right[-2] / (x[-1] - x[-3]) - right[-3] / (x[-2] - x[-4])
                right[0] = first * h[0] ** 2 / (x[3] - x[0])
                right[-1] = -last * h[-1] ** 2 / (x[-1] - x[-4])
            bend = np.linalg.solve(matrix, right)
            coefficients = np.array(
                [np.diff(bend) / h, 3.0 * bend[:-1], chord - h * (bend[1:] + 2.0 * bend[:-1]), y[:-1]]
            )
        pieces = PPoly(coefficients, x)
        return pieces, pieces.derivative()


@dataclass(frozen=True)
class PolynomialFit:
    """Settings of the polynomial fit, and its tolerances."""

    # RMS error of length that counts as much as `arm_error_m` [m]. The fit stops at half of both.
    length_error_m: float = 1e-4
    arm_error_m: float = 5e-4  # RMS error of a moment arm that counts as much as `length_error_m` [m]
    max_terms: int = 220
    # Number of poses of a fit over 0, 1, 2 and 3 angles; two in seven are held out
    pose_counts: tuple[int, ...] = (0, 300, 1200, 2400)


POLYNOMIAL_FIT = PolynomialFit()


POLYNOMIAL_DEGREES = range(2, 13)
HALTON_BASES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29)


@dataclass(frozen=True)
class PolynomialError:
    """Errors of a polynomial on poses not used in the fit [m]."""

    length: float  # length, arm: Root mean squares, of arms over the worst angle
    arm: float
    length_most: float  # length_most, arm_most: Largest
    arm_most: float


@dataclass(frozen=True, eq=False)
class MusclePolynomial(LengthOverAngles):
    """One muscle's length over angles in the signs of a study."""

    muscle: str
    angles: tuple[str, ...]
    middle: tuple[float, ...]  # middle, half: Of each angle's range [rad]
    half: tuple[float, ...]
    powers: np.ndarray  # (t, k)
    coefficients: np.ndarray  # (t,) [m]
    error: PolynomialError

    def range(self, angle: str) -> tuple[float, float]:
        """First and last angle, of one of its angles [rad]."""
        k = self.angles.index(angle)
        return self.middle[k] - self.half[k], self.middle[k] + self.half[k]

    def _inside(self, points: np.ndarray, *derivatives: int) -> np.ndarray:
        x = (points - np.array(self.middle)) / np.array(self.half)
        return _monomials(x, self.powers, np.array(self.half), derivatives) @ self.coefficients


def fit_muscle_polynomial(
    muscle: str,
    ranges: Mapping[str, tuple[float, float]],
    path: Callable[[Mapping[str, np.ndarray]], tuple[np.ndarray, np.ndarray]],
) -> MusclePolynomial:
    """The polynomial over `ranges` [rad] of what `path` gives: length (n,) and arms (k, n) [m] at angles (n,) [rad]."""
    names = tuple(ranges)
    low, high = np.array(list(ranges.values()), float).T
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    count = POLYNOMIAL_FIT.pose_counts[min(len(names), len(POLYNOMIAL_FIT.pose_counts) - 1)]
    # A little beyond the ends, and back onto them: errors are largest there.
    x = np.clip(1.04 * (2.0 * _halton_points(count, len(names)) - 1.0), -1.0, 1.0)
    length, arms = path(dict(zip(names, (middle + half * x).T, strict=True)))
    judged = np.arange(count) % 7 >= 5  # no multiple of a base: those would judge one corner
    best = None
    for degree in POLYNOMIAL_DEGREES:
        powers = np.array([p for p in product(range(degree + 1), repeat=len(names)) if sum(p) <= degree])
        if len(powers) > POLYNOMIAL_FIT.max_terms:
            break
        rows = [_monomials(x, powers, half)] + [-_monomials(x, powers, half, (k,)) for k in range(len(names))]
        told, scales = [length, *arms], [POLYNOMIAL_FIT.length_error_m] + [POLYNOMIAL_FIT.arm_error_m] * len(names)
        matrix = np.concatenate([r[~judged] / s for r, s in zip(rows, scales, strict=True)])
        right = np.concatenate([t[~judged] / s for t, s in zip(told, scales, strict=True)])
        coefficients = np.linalg.lstsq(matrix, right, rcond=None)[0]
        missed = [r[judged] @ coefficients - t[judged] for r, t in zip(rows, told, strict=True)]
        error = _polynomial_error(missed)
        worst = max(error.length / POLYNOMIAL_FIT.length_error_m, error.arm / POLYNOMIAL_FIT.arm_error_m)
        # More terms have to be worth it.
        if best is None or worst < 0.9 * best[0]:
            found = MusclePolynomial(
                muscle, names, tuple(middle.tolist()), tuple(half.tolist()), powers, coefficients, error
            )
            best = worst, found
        if worst < 0.5:
            break
    assert best is not None  # the first polynomial that is tried becomes the best
    return best[1]


def _halton_points(count: int, dimensions: int) -> np.ndarray:
    """Points evenly spread over the unit cube: Halton's, each number written backwards behind the point; (n, k)."""
    made = np.zeros((count, dimensions))
    for column, base in zip(made.T, HALTON_BASES, strict=False):
        left, share = np.arange(1, count + 1), 1.0 / base
        while left.any():
            column += share * (left % base)
            left, share = left // base, share / base
    return made


def _polynomial_error(missed: Sequence[np.ndarray]) -> PolynomialError:
    squares = [float(np.sqrt(np.mean(e**2))) for e in missed]
    most = [float(np.abs(e).max()) for e in missed]
    return PolynomialError(squares[0], max(squares[1:]), most[0], max(most[1:]))


def _monomials(x: np.ndarray, powers: np.ndarray, half: np.ndarray, derivatives: Sequence[int] = ()) -> np.ndarray:
    """Each term at `x` (n, k), or its derivative along angles, (n, t)."""
    made = np.ones((len(x), len(powers)))
    for k in range(x.shape[1]):
        power, factor = powers[:, k].copy(), np.ones(len(powers))
        for _ in range(list(derivatives).count(k)):
            factor = factor * power / half[k]
            power = np.maximum(power - 1, 0)
        column = np.vander(x[:, k], int(powers[:, k].max(initial=0)) + 1, increasing=True)
        made *= factor * column[:, power]
    return made


@dataclass(frozen=True)
class SurfaceFit:
    """Grid and smoothness of a surface."""

    # Number of cells of a fitted surface along a joint's own angle, and along a neighbour's
    fitted_cell_counts: tuple[int, int] = (10, 4)
    range_margin_share: float = 0.05  # A fitted surface goes on beyond the angles seen by this share of their range
    sampled_cell_count: int = 12  # Cells along each angle of a surface through another function's values
    roughness_weight: float = 1e-6  # Weight of a fitted surface's bending: what angles seen leave open is straight


SURFACE_FIT = SurfaceFit()


@dataclass(frozen=True)
class SurfaceAxis:
    """One angle of a surface and its grid."""

    angle: str  # Joint; empty: no angle, the surface is taken at `offset`
    sign: float  # -1 where the surface's angle grows the other way
    offset: float  # Added to it [rad]
    start: float  # start, step: Of the grid [rad]
    step: float
    cells: int


@dataclass(frozen=True)
class MuscleSurface:
    """Length over one or two angles."""

    axes: tuple[SurfaceAxis, ...]
    coefficients: tuple[float, ...]  # cells + 3 along each axis, the last fastest [m]

    def rows(self, angles: Sequence[str]) -> np.ndarray:
        """The core's rows, shape (2, 6), for angles in this order."""
        made = np.zeros((2, 6))
        for row, a in zip(made, self.axes, strict=False):
            place = list(angles).index(a.angle) if a.angle in angles else -1
            row[:] = (place, a.sign, a.offset, a.start, a.step, a.cells)
        return made

    def path(self, angles: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray], dict]:
        """Length (n,) [m], its slope by each angle (n,) [m/rad], its bend by each pair (n,) [m/rad^2]. `angles` (n,)
        [rad].
        """
        names = list(angles)
        length, slope, bend = _core.muscle_path(
            self.rows(names), np.array(self.coefficients), np.array([angles[n] for n in names], float)
        )
        own = [(i, a.angle) for i, a in enumerate(self.axes) if a.angle in names]
        return length, {a: slope[i] for i, a in own}, {(a, b): bend[i, j] for i, a in own for j, b in own}

    def held(self, angles: Mapping[str, float]) -> MuscleSurface:
        """The same with some angles held where they are said to be [rad], in the surface's own signs."""
        axes = tuple(replace(a, angle="", offset=angles[a.angle]) if a.angle in angles else a for a in self.axes)
        return replace(self, axes=axes)


def surface_from_geometry(geometry: MuscleGeometry, signs: Mapping[str, float] | None = None) -> MuscleSurface:
    """The same function as a geometry whose knots are even; `signs` of its angles."""
    coefficients, axes = geometry.coefficients, []
    for k, (angle, knots) in enumerate(zip(geometry.angles, geometry.knots, strict=True)):
        cells = len(knots) - 7
        start, step = float(knots[0]), float(knots[-1] - knots[0]) / cells
        if not np.allclose(knots[3:-3], start + step * np.arange(cells + 1), atol=1e-9):
            raise ValueError(f"{geometry.muscle}, {angle}: found knots that are not even, expected even ones")
        change = _even_knots_matrix(knots, start, step, cells)
        coefficients = np.moveaxis(np.tensordot(change, coefficients, axes=(1, k)), 0, k)
        axes.append(SurfaceAxis(angle, (signs or {}).get(angle, 1.0), 0.0, start, step, cells))
    return MuscleSurface(tuple(axes), tuple(coefficients.ravel().tolist()))


def sampled_surface(path: LengthOverAngles, moved: Sequence[str], held: Mapping[str, float]) -> MuscleSurface:
    """The surface through a path's lengths over one or two of its angles; its others are `held` [rad]."""
    axes, at = [], []
    for angle in moved:
        low, high = path.range(angle)
        step = (high - low) / SURFACE_FIT.sampled_cell_count
        axes.append(SurfaceAxis(angle, 1.0, 0.0, low, step, SURFACE_FIT.sampled_cell_count))
        at.append(
            np.sort(
                np.concatenate(
                    (np.linspace(low, high, SURFACE_FIT.sampled_cell_count + 1), [low + 0.5 * step, high - 0.5 * step])
                )
            )
        )
    grid = np.meshgrid(*at, indexing="ij")
    every = {a: q.ravel() for a, q in zip(moved, grid, strict=True)}
    every |= {a: np.full(grid[0].size, held[a]) for a in path.angles if a not in moved}
    coefficients = path.length(every).reshape(grid[0].shape)
    for k, (axis, q) in enumerate(zip(axes, at, strict=True)):
        found = np.linalg.solve(_basis(axis, q)[0], np.moveaxis(coefficients, k, 0))
        coefficients = np.moveaxis(found, 0, k)
    return MuscleSurface(tuple(axes), tuple(coefficients.ravel().tolist()))


def fit_muscle_surface(
    length: np.ndarray, angles: Mapping[str, np.ndarray], arms: Mapping[str, np.ndarray]
) -> tuple[MuscleSurface, float, float]:
    """The surface nearest to lengths (n,) [m] and arms by joint (n,) [m] that were recorded with angles (n,) [rad].

    Over one joint and the neighbour that explains most of what it leaves; gives the RMSE of length and of arms too [m].
    """
    own = tuple(arms)
    if not 1 <= len(own) <= 2 or any(name not in angles for name in own):
        raise ValueError(f"found arms about {', '.join(own) or 'no joint'}, expected one or two joints with angles")
    best: tuple[MuscleSurface, float, float] | None = None
    for others in ((), *((name,) for name in angles if len(own) == 1 and name not in own)):
        found = _fit_surface(length, {n: angles[n] for n in (*own, *others)}, arms)
        if best is None or found[1] + found[2] < 0.8 * (best[1] + best[2]):
            best = found
    assert best is not None  # the first is without a neighbour, and becomes the best
    return best


def _fit_surface(
    length: np.ndarray, angles: Mapping[str, np.ndarray], arms: Mapping[str, np.ndarray]
) -> tuple[MuscleSurface, float, float]:
    axes = []
    for (name, q), cells in zip(
        angles.items(),
        SURFACE_FIT.fitted_cell_counts if len(arms) == 1 else SURFACE_FIT.fitted_cell_counts[:1] * 2,
        strict=False,
    ):
        low, high = float(q.min()), float(q.max())
        more = SURFACE_FIT.range_margin_share * max(high - low, 0.1)
        axes.append(SurfaceAxis(name, 1.0, 0.0, low - more, (high - low + 2.0 * more) / cells, cells))
    bases = [_basis(a, angles[a.angle]) for a in axes]

    def product(bent: int | None) -> np.ndarray:
        parts = [basis[int(k == bent)] for k, basis in enumerate(bases)]
        return parts[0] if len(parts) == 1 else np.einsum("ni,nj->nij", *parts).reshape(len(length), -1)

    # One metre of length and one metre per radian count alike; differences of third order keep it smooth.
    names = [a.angle for a in axes]
    rows, told = [product(None)], [length]
    for joint, arm in arms.items():
        rows.append(product(names.index(joint)))
        told.append(-arm)
    smooth: list[np.ndarray] = [np.diff(np.eye(a.cells + 3), 3, axis=0) for a in axes]
    if len(axes) == 2:
        first, second = (np.eye(a.cells + 3) for a in axes)
        smooth = [np.kron(smooth[0], second), np.kron(first, smooth[1])]
    weight = np.sqrt(SURFACE_FIT.roughness_weight * len(length))
    a = np.vstack([*rows, *(weight * s for s in smooth)])
    b = np.concatenate([*told, np.zeros(sum(len(s) for s in smooth))])
    coefficients = np.linalg.lstsq(a, b, rcond=None)[0]
    left = [row @ coefficients - x for row, x in zip(rows, told, strict=True)]
    surface = MuscleSurface(tuple(axes), tuple(coefficients.tolist()))
    of_length, of_arms = (float(np.sqrt(np.mean(np.square(e)))) for e in (left[0], left[1:]))
    return surface, of_length, of_arms


def _basis(axis: SurfaceAxis, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and slopes of every spline of an axis at angles `q` (n,) [rad]; (n, cells + 3) each."""
    from scipy.interpolate import BSpline

    knots = axis.start + axis.step * np.arange(-3, axis.cells + 4)
    spline = BSpline(knots, np.eye(axis.cells + 3), 3)
    return spline(q), spline(q, 1)


def _even_knots_matrix(knots: np.ndarray, start: float, step: float, cells: int) -> np.ndarray:
    """What turns coefficients of a spline with repeated knots at its ends into those of even knots, (n, n)."""
    from scipy.interpolate import BSpline

    even = start + step * np.arange(-3, cells + 4)
    at = start + step * cells * (0.5 - 0.5 * np.cos(np.pi * np.arange(4 * (cells + 3)) / (4 * (cells + 3) - 1)))
    old, new = (BSpline(t, np.eye(cells + 3), 3)(np.clip(at, start, start + step * cells)) for t in (knots, even))
    return np.linalg.lstsq(new, old, rcond=None)[0]
