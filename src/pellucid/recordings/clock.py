"""Recover the times at which samples were taken: remove packets delivered twice, and smooth time stamps that jitter.

A packet that was delivered twice makes two rows with the same samples, the second stamped at the same time or a little
later. The second row is left out. Stamps that jitter are smoothed over a window of neighbours, so that drift, pauses
and changes of rate stay as they were stamped. The chosen window makes the positions smoothest over time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

MAX_REPEAT_STEP_SHARE = 0.5
"""A row with the samples of the row before is the same packet again if it comes within this share of a usual step."""

SMOOTHING_WINDOWS = (8, 16, 32, 64, 128, 256, 512)
"""Candidate windows for smoothing stamps [samples]."""

MIN_SMOOTHNESS_GAIN = 0.05
"""Stamps are smoothed only if positions then deviate from their neighbours by this share less. Position noise alone
makes the smoothness differ by less."""

ONE_SIDED_SHARE = 0.5
"""A line through the neighbours on one side replaces the line through both sides if it leaves less than this share of
the variance: between the two sides the rate changes, or samples are missing."""


@dataclass(frozen=True)
class SampleClock:
    """Estimated times at which samples were taken.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Time of each sample [s], read-only; the stamps themselves if `window` is 0.
    window : int
        Number of samples over which stamps were smoothed; 0 if they were not smoothed.
    moved : float
        Root mean square of the changes of the stamps [s].
    farthest : float
        Largest change of a stamp [s].
    """

    time: np.ndarray
    window: int = 0
    moved: float = 0.0
    farthest: float = 0.0


def first_deliveries(time: np.ndarray, samples: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return a mask of the rows that do not repeat the packet before, shape (n,) bool.

    `time` holds the stamps, (n,) [s], and `samples` every channel, (n,).
    """
    first = np.ones(len(time), dtype=bool)
    steps = np.diff(time)
    if not samples or len(time) < 3 or not np.isfinite(steps).all() or np.any(steps < 0.0):
        return first
    positive = steps[steps > 0.0]
    if not positive.size or steps.min() > MAX_REPEAT_STEP_SHARE * float(np.median(positive)):
        return first
    repeats = np.ones(len(steps), dtype=bool)
    for values in samples.values():
        repeats &= (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
        if not repeats.any():
            return first
    # A packet may come three times: its age counts from its first delivery.
    starts = np.maximum.accumulate(np.where(np.append(True, ~repeats), np.arange(len(time)), 0))
    usual = np.diff(time[np.append(True, ~repeats)])
    usual = float(np.median(usual[usual > 0.0])) if np.any(usual > 0.0) else 0.0
    age = time - time[starts]
    first[1:] = ~(repeats & (age[1:] <= MAX_REPEAT_STEP_SHARE * usual))
    return first


def sample_clock(time: np.ndarray, positions: np.ndarray, spans: Sequence[slice], near: np.ndarray) -> SampleClock:
    """Estimate the clock of samples stamped at `time`, (n,) [s], by the smoothness of `positions`, (n, k).

    The `spans` have no break. The mask `near`, (n - 1,), marks the stamps that the next one follows without a gap.
    """
    recorded = _roughness(time, positions, spans, near)
    best, clock = (1.0 - MIN_SMOOTHNESS_GAIN) * recorded, SampleClock(time)
    for window in SMOOTHING_WINDOWS if np.isfinite(recorded) and recorded > 0.0 else ():
        smoothed = np.array(time)
        for span in spans:
            smoothed[span] = _smooth_stamps(time[span], window)
        roughness = _roughness(smoothed, positions, spans, near)
        if roughness < best:
            moved = smoothed - time
            smoothed.flags.writeable = False
            best = roughness
            clock = SampleClock(
                smoothed, window, float(np.sqrt(np.mean((moved - moved.mean()) ** 2))), float(np.abs(moved).max())
            )
    return clock


def _roughness(time: np.ndarray, positions: np.ndarray, spans: Sequence[slice], near: np.ndarray) -> float:
    """Return the mean distance of positions, (n, k), from the straight line between neighbours; NaN without any."""
    inside = np.zeros(len(time), dtype=bool)
    for span in spans:
        inside[span.start + 1 : span.stop - 1] = True
    inner = near[1:] & near[:-1] & inside[1:-1]
    width = time[2:] - time[:-2]
    share = np.divide(time[1:-1] - time[:-2], width, out=np.full(len(width), 0.5), where=width > 0.0)
    off = np.abs(positions[1:-1] - positions[:-2] - share[:, None] * (positions[2:] - positions[:-2]))[inner]
    off = off[np.isfinite(off)]
    return float(off.mean()) if off.size else np.nan


def _smooth_stamps(time: np.ndarray, window: int) -> np.ndarray:
    """Return stamps, (n,), on straight lines through `window` neighbours each; the stamps themselves if the result
    would not increase."""
    n = len(time)
    if n < 4:
        return time
    index = np.arange(n)
    step, first = np.polyfit(index, time, 1)
    off = time - (first + step * index)
    half = max(window // 2, 2)
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, n)
    value, variance = _local_lines(off, index, low, high)
    chosen = np.array(value)
    for low, high in ((np.maximum(index - window, 0), index + 1), (index, np.minimum(index + window + 1, n))):
        one_value, one_variance = _local_lines(off, index, low, high)
        better = (high - low > half) & (one_variance < ONE_SIDED_SHARE * variance)
        chosen = np.where(better, one_value, chosen)
        variance = np.where(better, one_variance / ONE_SIDED_SHARE, variance)
    for candidate in (chosen, value):
        smoothed = candidate + first + step * index
        if np.all(np.diff(smoothed) > 0.0):
            return smoothed
    return time


def _local_lines(
    off: np.ndarray, index: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit a line to samples `low` to before `high` of `off`, (n,), for each sample; return its value and the residual
    variance, shape (n,) each."""

    def sums(values: np.ndarray) -> np.ndarray:
        total = np.concatenate([[0.0], np.cumsum(values)])
        return total[high] - total[low]

    count = (high - low).astype(float)
    # Exact sums of x = j - i over the window, from its ends.
    a, b = (low - index).astype(float), (high - 1 - index).astype(float)
    x = 0.5 * (a + b) * count
    xx = (b * (b + 1.0) * (2.0 * b + 1.0) - (a - 1.0) * a * (2.0 * a - 1.0)) / 6.0
    y, yy = sums(off), sums(off**2)
    xy = sums(index * off) - index * y
    spread = xx - x * x / count
    slope = np.divide(xy - x * y / count, spread, out=np.zeros(len(off)), where=spread > 0.0)
    value = (y - slope * x) / count
    left = yy - y * y / count - slope * slope * spread
    return value, np.maximum(left, 0.0) / np.maximum(count - 2.0, 1.0)
