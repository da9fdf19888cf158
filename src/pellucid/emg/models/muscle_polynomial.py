r"""Length of a muscle with its tendon as a polynomial of the angles of the joints that it crosses.

.. math::
   l = \sum_t c_t \prod_k x_k^{p_{tk}}, \qquad x_k = (\theta_k - m_k) / h_k, \qquad
   r_k = -\frac{\partial l}{\partial \theta_k}

Lengths and moment arms are fitted together, so that muscle work and joint work agree, and the error is that of poses
that were not fitted. The degree is the lowest that keeps it small. A via point that begins to act makes a model's own
arm jump; a polynomial goes through.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from .muscle_geometry import LengthOverAngles


@dataclass(frozen=True)
class PolynomialFit:
    """How a polynomial is fitted, and when it is good enough."""

    # RMS error of length that counts as much as `arm_error_m` [m]. The fit stops at half of both.
    length_error_m: float = 1e-4
    arm_error_m: float = 5e-4  # RMS error of a moment arm that counts as much as `length_error_m` [m]
    max_terms: int = 220
    # Number of poses of a fit over 0, 1, 2 and 3 angles; two in seven are held out
    pose_counts: tuple[int, ...] = (0, 300, 1200, 2400)


POLYNOMIAL = PolynomialFit()


POLYNOMIAL_DEGREES = range(2, 13)
HALTON_BASES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29)


@dataclass(frozen=True)
class PolynomialError:
    """What a polynomial misses, on poses that were not fitted [m]."""

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
    count = POLYNOMIAL.pose_counts[min(len(names), len(POLYNOMIAL.pose_counts) - 1)]
    # A little beyond the ends, and back onto them: errors are largest there.
    x = np.clip(1.04 * (2.0 * _halton_points(count, len(names)) - 1.0), -1.0, 1.0)
    length, arms = path(dict(zip(names, (middle + half * x).T, strict=True)))
    judged = np.arange(count) % 7 >= 5  # no multiple of a base: those would judge one corner
    best = None
    for degree in POLYNOMIAL_DEGREES:
        powers = np.array([p for p in product(range(degree + 1), repeat=len(names)) if sum(p) <= degree])
        if len(powers) > POLYNOMIAL.max_terms:
            break
        rows = [_monomials(x, powers, half)] + [-_monomials(x, powers, half, (k,)) for k in range(len(names))]
        told, scales = [length, *arms], [POLYNOMIAL.length_error_m] + [POLYNOMIAL.arm_error_m] * len(names)
        matrix = np.concatenate([r[~judged] / s for r, s in zip(rows, scales, strict=True)])
        right = np.concatenate([t[~judged] / s for t, s in zip(told, scales, strict=True)])
        coefficients = np.linalg.lstsq(matrix, right, rcond=None)[0]
        missed = [r[judged] @ coefficients - t[judged] for r, t in zip(rows, told, strict=True)]
        error = _polynomial_error(missed)
        worst = max(error.length / POLYNOMIAL.length_error_m, error.arm / POLYNOMIAL.arm_error_m)
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
