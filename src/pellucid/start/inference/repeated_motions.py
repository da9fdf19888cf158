"""Find recordings of the same motion with another effort: something was carried in one of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .motion_efforts import running_mean

MIN_SAME_MOTION = 0.97
"""Two motions are the same if they correlate at least so, at the best shift."""

MIN_EFFORT_RATIO = 1.08
"""Efforts differ if one's spread is at least so many times the other's."""

COMPARED_ROWS = 4000
"""Motions are resampled to at most so many rows before they are compared."""


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
    stride = max(1, n // COMPARED_ROWS)
    a, b = (running_mean(x, stride)[::stride] for x in (position_a, position_b))
    a, b = a - a.mean(), b - b.mean()
    size = 2 ** int(np.ceil(np.log2(len(a) + len(b))))
    product = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    correlation = float(product.max() / (np.linalg.norm(a) * np.linalg.norm(b) or 1.0))
    if correlation < MIN_SAME_MOTION or abs(np.std(a) / np.std(b) - 1.0) > 0.1:
        return None
    spread_a, spread_b = (float(np.std(running_mean(x, max(stride, 5)))) for x in (effort_a, effort_b))
    if min(spread_a, spread_b) <= 0.0:
        return None
    ratio = spread_b / spread_a
    if ratio >= MIN_EFFORT_RATIO:
        return RepeatedMotion(name_a, name_b, correlation, ratio)
    if 1.0 / ratio >= MIN_EFFORT_RATIO:
        return RepeatedMotion(name_b, name_a, correlation, 1.0 / ratio)
    return None
