"""Smooth the time stamps of an evenly sampled stream, whose samples arrive late by turns, and keep its gaps."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

COMPARED_TIME_S = 1.0
"""Duration before and after a gap whose time stamps show it [s]."""

MIN_COMPARED_SAMPLES = 400
"""Fewest compared samples of a slow stream, if it has as many."""

SPREAD_WINDOWS = 50
"""The usual spread of stamps is taken from so many windows of a stream."""

MIN_GAP_PERIODS = 1.5
"""A gap is longer than a sampling period by at least this many periods."""

MIN_GAP_SPREADS = 3.0
"""The stamps behind a gap stay later by at least this many times their usual spread; after a delay they do not. With
fewer samples to compare it are more, because samples that were sent together are late together."""

MAX_CANDIDATES = 1000
"""At most so many of a stream's longest steps are examined."""


def smoothed_stamps(stamps: np.ndarray, rate: float, joints: Sequence[int] = ()) -> tuple[np.ndarray, float]:
    """Return even time stamps between gaps, shape (n,) [s], and the rate at which samples were taken [Hz].

    A line fitted over a gap would spread the lost samples over the whole recording. One period holds for all parts, so
    that a short part between two gaps has no period of its own.

    Parameters
    ----------
    stamps : ndarray, shape (n,)
        Recorded stamps [s].
    rate : float
        Nominal rate [Hz].
    joints : sequence of int
        Samples before which the stream began anew.
    """
    n = len(stamps)
    borders = sorted({0, n, *joints, *_gaps(stamps, rate)})
    parts = [(start, end) for start, end in pairwise(borders) if end > start]
    index = np.arange(n, dtype=np.float64)
    centred = [(index[a:b] - index[a:b].mean(), stamps[a:b] - stamps[a:b].mean()) for a, b in parts]
    weight = sum(float(i @ i) for i, _ in centred)
    period = sum(float(i @ t) for i, t in centred) / weight if weight > 0.0 else 1.0 / rate
    smooth = np.concatenate([period * i + stamps[a:b].mean() for (a, b), (i, _) in zip(parts, centred, strict=True)])
    return smooth, 1.0 / period if period > 0.0 else rate


def _gaps(stamps: np.ndarray, rate: float) -> list[int]:
    """Return the samples before which others were lost, or the clock was set."""
    n, period = len(stamps), 1.0 / rate
    width = max(int(COMPARED_TIME_S * rate), MIN_COMPARED_SAMPLES)
    late = stamps - period * np.arange(n)
    excess = np.abs(np.diff(late))
    candidates = np.flatnonzero(excess > MIN_GAP_PERIODS * period) + 1
    if not candidates.size:
        return []
    windows = np.array_split(late, min(SPREAD_WINDOWS, max(n // width, 1)))
    usual = float(np.median([_spread(window[:width]) for window in windows]))
    # The longest steps come first, so that no window reaches over a longer gap.
    order = candidates[np.argsort(-excess[candidates - 1], kind="stable")][:MAX_CANDIDATES]
    borders = [0, n]
    for i in order.tolist():
        place = bisect.bisect(borders, i)
        before = late[max(borders[place - 1], i - width) : i]
        after = late[i : min(borders[place], i + width)]
        shift = abs(float(np.median(after)) - float(np.median(before)))
        fewest = min(len(before), len(after))
        spread = max(usual, _spread(before), _spread(after)) * max(1.0, math.sqrt(MIN_COMPARED_SAMPLES / fewest))
        if shift > max(MIN_GAP_PERIODS * period, MIN_GAP_SPREADS * spread, 0.5 * excess[i - 1]):
            borders.insert(place, i)
    return borders[1:-1]


def _spread(values: np.ndarray) -> float:
    """Return a robust standard deviation."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))
