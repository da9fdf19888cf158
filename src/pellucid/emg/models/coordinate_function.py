"""Functions of a model's coordinates, with their slopes: where a joint moves, what a coupled coordinate does."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np


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
