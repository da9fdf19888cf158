r"""Musculotendon length and moment arm as smooth functions of the angles of the joints that a muscle crosses.

Length is a tensor product of cubic splines, the rest its derivatives, so that muscle work and joint work agree:

.. math::
   l = \sum_{ij} c_{ij} B_i(\theta_1) B_j(\theta_2), \qquad r_k = -\frac{\partial l}{\partial \theta_k}, \qquad
   \dot l = -\sum_k r_k \dot\theta_k

Beyond a table's angles length goes on straight. Tables ship with the package (``data/``), each with its source and
licence; ``examples/muscle_geometry_tables.py`` makes them again. Angles have the model's own signs: in gait2392 hip
flexion, knee *extension* (0 straight) and ankle dorsiflexion are positive.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np

from .hill import HillMuscle

_DATA_FOLDER = Path(__file__).parent / "data"


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
        return self._product(points, nu=order)

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
