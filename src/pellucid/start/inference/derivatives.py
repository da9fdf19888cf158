"""Find which column is the derivative of which, and by what factor: that tells velocities from positions, and their
units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .motion_efforts import running_mean


@dataclass(frozen=True)
class DerivativeLimits:
    """When a column is the derivative of another, and when a motion is repeated."""

    # Only this many rows of a table are compared, those with the most motion.
    max_compared_rows: int = 40_000
    # A column is another one's derivative if it correlates with that one's difference quotient at least so.
    min_correlation: float = 0.9
    # A pair with a ratio that no two units have, such as counts and rad/s, needs at least this correlation.
    min_correlation_without_units: float = 0.998
    # A ratio is one of `UNIT_RATIOS` if it is within this share of it: filters and delays lower the ratio by some
    # percent.
    ratio_tolerance: float = 0.08
    # Two motions are the same if they correlate at least so, at the best shift.
    min_same_motion: float = 0.97
    # Efforts differ if one's spread is at least so many times the other's.
    min_effort_ratio: float = 1.08
    # Motions are resampled to at most so many rows before they are compared.
    compared_rows: int = 4000


DERIVATIVE_LIMITS = DerivativeLimits()

UNIT_RATIOS = (
    ("rad", "rad/s", 1.0), ("deg", "deg/s", 1.0), ("deg", "rad/s", math.pi / 180.0), ("rad", "deg/s", 180.0 / math.pi),
    ("rad", "rpm", 30.0 / math.pi), ("deg", "rpm", 1.0 / 6.0), ("turn", "turn/s", 1.0), ("turn", "rpm", 60.0),
    ("turn", "rad/s", 2.0 * math.pi), ("turn", "deg/s", 360.0), ("rad", "turn/s", 0.5 / math.pi),
    ("deg", "turn/s", 1.0 / 360.0), ("m", "mm/s", 1000.0), ("mm", "m/s", 0.001), ("m", "m/s", 1.0),
    ("mm", "mm/s", 1.0),
)  # fmt: skip
"""Units of a column and of its derivative, with the ratio of the recorded to the computed derivative."""


@dataclass(frozen=True)
class DerivativePair:
    """A column that is the derivative of another."""

    of: str  # column that is differentiated
    by: str  # column that is its derivative
    ratio: float  # recorded derivative over the computed one, per second of the table's clock
    correlation: float  # correlation of both

    @property
    def units(self) -> tuple[tuple[str, str], ...]:
        """Pairs of units that fit the ratio, such as ``("deg", "rad/s")``."""
        return tuple(
            (a, b)
            for a, b, ratio in UNIT_RATIOS
            if abs(abs(self.ratio) / ratio - 1.0) < DERIVATIVE_LIMITS.ratio_tolerance
        )


def find_derivatives(columns: Mapping[str, np.ndarray], time: np.ndarray) -> list[DerivativePair]:
    """Return the pairs of columns of which one is the other's derivative, best first; each column is one's derivative
    once.

    Both are smoothed alike before they are compared, so that noise of difference quotients does not hide a pair. The
    correlation of a difference quotient with the column must exceed that of the column itself, which a decaying
    exponential would also fulfil.

    Parameters
    ----------
    columns : mapping of ndarray
        Columns, each shape (n,), without counters and clocks.
    time : ndarray, shape (n,)
        Times [s]; rows whose time falls back are not used.
    """
    names = [name for name, x in columns.items() if np.isfinite(x).mean() > 0.98 and np.ptp(x[np.isfinite(x)]) > 0.0]
    if len(names) < 2 or len(time) < 50:
        return []
    rows = _busiest_rows([columns[name] for name in names], len(time))
    times = time[rows]
    # Stamps of arrival fall back: only a row later than all rows before it has a slope.
    keep = np.isfinite(times) & (times > np.fmax.accumulate(np.concatenate(([-np.inf], times[:-1]))))
    times = times[keep]
    if len(times) < 50:
        return []
    matrix = np.column_stack([np.nan_to_num(columns[name][rows][keep]) for name in names])
    slopes = np.gradient(matrix, times, axis=0)
    width = max(3, len(times) // 2000)
    level, slope = _smoothed(matrix, width), _smoothed(slopes, width)
    correlation = _correlations(slope, level)
    own = np.abs(_correlations(level, level))
    found = []
    for j, by in enumerate(names):
        strengths = np.abs(correlation[:, j]).copy()
        strengths[j] = 0.0
        i = int(np.argmax(strengths))
        if strengths[i] < DERIVATIVE_LIMITS.min_correlation or own[i, j] > 0.6:
            continue
        centred = slope[:, i] - slope[:, i].mean()
        ratio = float(centred @ (level[:, j] - level[:, j].mean()) / (centred @ centred))
        pair = DerivativePair(names[i], by, ratio, float(correlation[i, j]))
        # Friction makes an effort resemble a velocity; then the ratio is none of units, and the fit is worse.
        if pair.units or abs(pair.correlation) > DERIVATIVE_LIMITS.min_correlation_without_units:
            found.append(pair)
    return sorted(found, key=lambda pair: -abs(pair.correlation))


def _busiest_rows(columns: list[np.ndarray], n: int) -> slice:
    """Return the rows, at most `DERIVATIVE_LIMITS.max_compared_rows`, in which the columns vary most."""
    if n <= DERIVATIVE_LIMITS.max_compared_rows:
        return slice(0, n)
    best, start = -1.0, 0
    for first in range(0, n - DERIVATIVE_LIMITS.max_compared_rows + 1, DERIVATIVE_LIMITS.max_compared_rows // 2):
        part = [column[first : first + DERIVATIVE_LIMITS.max_compared_rows : 20] for column in columns]
        total = sum(
            float(np.nanstd(x) / (np.nanstd(column[::20]) or 1.0)) for x, column in zip(part, columns, strict=True)
        )
        if total > best:
            best, start = total, first
    return slice(start, start + DERIVATIVE_LIMITS.max_compared_rows)


def _smoothed(matrix: np.ndarray, width: int) -> np.ndarray:
    """Return running means of `width` rows, twice, so that quanta and noise lose most of their power."""
    for _ in range(2):
        sums = np.cumsum(np.vstack([np.zeros((1, matrix.shape[1])), matrix]), axis=0)
        matrix = (sums[width:] - sums[:-width]) / width
    return matrix


def _correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    norms = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)[None, :]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num((a.T @ b) / norms)


@dataclass(frozen=True)
class RepeatedMotion:
    """Two recordings of one motion with different efforts."""

    lighter: str  # recording with the smaller effort
    heavier: str  # recording with the larger effort
    correlation: float  # correlation of both motions at the best shift
    ratio: float  # spread of the larger effort over that of the smaller one


def find_repeated_motion(
    first: tuple[str, np.ndarray, np.ndarray], second: tuple[str, np.ndarray, np.ndarray]
) -> RepeatedMotion | None:
    """Return whether two recordings repeat a motion with another effort; None if they do not.

    Each is its name, positions and efforts, shape (n,), at one rate.
    """
    (name_a, position_a, effort_a), (name_b, position_b, effort_b) = first, second
    n = max(len(position_a), len(position_b))
    if min(len(position_a), len(position_b)) < 0.6 * n:
        return None
    stride = max(1, n // DERIVATIVE_LIMITS.compared_rows)
    a, b = (running_mean(x, stride)[::stride] for x in (position_a, position_b))
    a, b = a - a.mean(), b - b.mean()
    size = 2 ** int(np.ceil(np.log2(len(a) + len(b))))
    product = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    correlation = float(product.max() / (np.linalg.norm(a) * np.linalg.norm(b) or 1.0))
    if correlation < DERIVATIVE_LIMITS.min_same_motion or abs(np.std(a) / np.std(b) - 1.0) > 0.1:
        return None
    spread_a, spread_b = (float(np.std(running_mean(x, max(stride, 5)))) for x in (effort_a, effort_b))
    if min(spread_a, spread_b) <= 0.0:
        return None
    ratio = spread_b / spread_a
    if ratio >= DERIVATIVE_LIMITS.min_effort_ratio:
        return RepeatedMotion(name_a, name_b, correlation, ratio)
    if 1.0 / ratio >= DERIVATIVE_LIMITS.min_effort_ratio:
        return RepeatedMotion(name_b, name_a, correlation, 1.0 / ratio)
    return None
