"""One-way movements from a start line to a target line, corrections at the target included.

Where pointing is aimed at a line and nobody says when a movement ends, the end is the last rest before the return: a
corrected end belongs to the movement that it corrects, and so does the time that it took. The base distribution cuts by
shares of the speed (`pellucid.people.movements`) and stands where there are targets or rests between; this rule stands
where the pointer is carried back, or lifted off, after each movement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellucid.numerics.even_times import even_times
from pellucid.numerics.filters import central_difference, runs, zero_phase_lowpass


@dataclass(frozen=True)
class OneWayRule:
    """How a record of one coordinate [m] becomes one-way movements between a start line and a target line."""

    left: float = 0.030  # place below which a movement starts [m]
    reached: float = 0.110  # place that a movement must pass [m]
    back: float = 0.090  # place below which the pointer ends the movement at the latest [m]
    rate: float = 200.0  # rate to which the record is resampled [Hz]
    gap: float = 0.060  # longest time without a sample in a movement [s]
    lowpass: float = 10.0  # cut-off of the zero-phase Butterworth filter [Hz]
    order: int = 2  # order of one pass of the filter
    threshold: float = 0.05  # share of the peak speed at the onset
    still: float = 0.005  # speed below which the pointer rests [m/s]
    rest: float = 0.050  # shortest rest [s]
    longest: float = 6.0  # longest movement [s]


@dataclass(frozen=True)
class OneWay:
    """One movement."""

    onset: float  # onset, end: [s]
    end: float
    place: float  # Where it ended [m]
    first_stop: float  # When its speed was first below the onset's share again [s]: the primary movement's end ...
    first_place: float  # ... and where that was [m]

    @property
    def duration(self) -> float:
        """From onset to the last rest [s]."""
        return self.end - self.onset


def one_way_movements(time: np.ndarray, place: np.ndarray, rule: OneWayRule | None = None) -> list[OneWay]:
    """Return the movements in a record of a pointer's `place`, shape (n,) [m], at times (n,) [s].

    Times may be uneven; repeated times are excluded.

    A movement's onset is the last time before its peak speed at which the speed is below `threshold` of it; its end is
    the beginning of the last rest before the pointer returns or leaves. Candidates without rest, longer than `longest`
    or with a gap are rejected. Records of less than two samples have no movements.
    """
    rule = rule or OneWayRule()
    known = np.isfinite(time) & np.isfinite(place)
    time, first = np.unique(np.asarray(time, float)[known], return_index=True)
    place = np.asarray(place, float)[known][first]
    if len(time) < 2:
        return []
    grid = even_times(time, rule.rate)
    seen = _seen(time, grid, rule.gap)
    try:
        smooth = zero_phase_lowpass(np.interp(grid, time, place), rule.lowpass, rule.order, rule.rate)
    except ValueError:  # shorter than the filter's settling
        return []
    speed = central_difference(smooth, rule.rate)
    found = []
    for low, high in _crossings(smooth, rule):
        one = _movement(grid, smooth, speed, seen, (low, high), rule)
        if one is not None:
            found.append(one)
    return found


def _seen(time: np.ndarray, grid: np.ndarray, gap: float) -> np.ndarray:
    """Whether the samples around each time of the grid are close enough."""
    step = np.diff(time)
    return step[np.clip(np.searchsorted(time, grid) - 1, 0, len(step) - 1)] <= gap


def _crossings(smooth: np.ndarray, rule: OneWayRule) -> list[tuple[int, int]]:
    """Last sample at the start and first one beyond `reached`, of every way from one to the other."""
    low, beyond = np.flatnonzero(smooth < rule.left), np.flatnonzero(smooth > rule.reached)
    made: list[tuple[int, int]] = []
    for run in runs(smooth >= rule.left):
        if run.start == 0:  # nobody saw it start
            continue
        at = np.searchsorted(beyond, run.start)
        if at < len(beyond) and beyond[at] < run.stop:
            made.append((int(low[np.searchsorted(low, run.start) - 1]), int(beyond[at])))
    return made


def _movement(
    grid: np.ndarray,
    smooth: np.ndarray,
    speed: np.ndarray,
    seen: np.ndarray,
    crossing: tuple[int, int],
    rule: OneWayRule,
) -> OneWay | None:
    """The movement of a crossing, or None."""
    low, high = crossing
    peak = low + int(np.argmax(speed[low : high + 1]))
    slow = np.flatnonzero(speed[:peak] < rule.threshold * speed[peak])
    begin = int(slow[-1]) + 1 if slow.size else 0
    gone = np.flatnonzero((smooth[high:] < rule.back) | ~seen[high:])
    last = high + int(gone[0]) if gone.size else smooth.size - 1
    least = round(rule.rest * rule.rate)
    rests = [r for r in runs(np.abs(speed[peak:last]) < rule.still) if r.stop - r.start >= least]
    if not rests or not seen[begin:last].all():
        return None
    stop = peak + rests[-1].start
    if not grid[stop] - grid[begin] < rule.longest:
        return None
    slow = np.flatnonzero(speed[peak : stop + 1] < rule.threshold * speed[peak])
    first = peak + int(slow[0]) if slow.size else stop
    return OneWay(*(float(x) for x in (grid[begin], grid[stop], smooth[stop], grid[first], smooth[first])))


def robust_spread(values: np.ndarray) -> float:
    """Return 1.48 times the median absolute deviation of values, shape (n,), in their unit."""
    return 1.48 * float(np.median(np.abs(values - np.median(values))))
