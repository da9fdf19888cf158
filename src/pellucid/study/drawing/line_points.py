"""Points of a drawn line: gaps where samples are missing, and outlines of long series. Arrays in, arrays out."""

from __future__ import annotations

import numpy as np

LINE_POINTS = 900
"""A drawn line has at most about this many points: the extremes of every stretch, so that no peak is lost."""


def broken(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Insert NaN wherever samples are missing, so that no line bridges a gap; both arrays have shape (n,)."""
    steps = np.diff(time)
    known = steps[np.isfinite(steps)]
    if not len(known):
        return time, values
    gaps = np.flatnonzero(steps > 3.5 * np.median(known)) + 1
    return np.insert(time, gaps, np.nan), np.insert(values, gaps, np.nan)


def outline(time: np.ndarray, values: np.ndarray, points: int = LINE_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Keep the smallest and the largest sample of each of `points` / 2 stretches, and all gaps."""
    if len(time) <= points:
        return time, values
    keep = {0, len(time) - 1, *np.flatnonzero(~np.isfinite(time) | ~np.isfinite(values)).tolist()}
    for part in np.array_split(np.arange(len(time)), points // 2):
        good = part[np.isfinite(values[part])]
        if len(good):
            keep.update((int(good[np.argmin(values[good])]), int(good[np.argmax(values[good])])))
    index = np.array(sorted(keep))
    return time[index], values[index]


def every(points: int, *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    """Keep about `points` evenly spaced samples of each array, and the gaps of the first one."""
    step = max(1, len(arrays[0]) // points)
    keep = np.zeros(len(arrays[0]), bool)
    keep[::step] = True
    keep |= ~np.isfinite(arrays[0])
    return tuple(a[keep] for a in arrays)
