"""Follow the clock of a stream while it arrives: its offset and drift, its jumps, batches and lost samples.

A sample arrives later than it was measured, by a delay that is never negative. So the smallest difference between
arrival and time stamp in each second is the offset of the clocks plus the smallest delay; a line through the last
minute's minima gives offset and drift.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

INTERVAL_S = 1.0
"""Interval of which the smallest difference is kept."""

MEMORY_INTERVALS = 60
"""Number of intervals through which the line is fitted."""

MIN_DRIFT_INTERVALS = 5
"""Smallest number of intervals from which a drift is stated."""

JUMP_THRESHOLD_S = 0.02
"""A difference that leaves the line by more, in this direction or the other for a whole interval, is a jump."""

MIN_GAP_PERIODS = 1.5
"""Two stamps that are farther apart than this many periods have lost samples between them."""

MIN_BATCH_SAMPLES = 4
"""Smallest number of samples with one stamp that is a batch; in pairs a coarse clock is likelier."""


@dataclass(frozen=True)
class ClockState:
    """What is known of a stream's clock."""

    offset: float  # host's time less the stream's, with the smallest delay in it [s]
    drift: float  # rate at which that grows [1]
    jumps: int  # how often the clock jumped
    batches: int  # how often several samples had one stamp
    lost: int  # samples that are missing by their stamps
    rate: float  # measured rate [Hz]; NaN before it is known


class ClockTracker:
    """Follow one stream, chunk by chunk.

    Parameters
    ----------
    rate : float
        Nominal rate [Hz]; 0 for events.
    """

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate if rate > 0.0 else 0.0
        self._minima: deque[tuple[float, float]] = deque(maxlen=MEMORY_INTERVALS)
        self._begun: float | None = None
        self._least = np.inf
        self._line = (0.0, 0.0, 0.0)  # time about which the line turns, offset there, drift
        self._known = False
        self._last_stamp: float | None = None
        self._first: tuple[float, int] | None = None
        self._count = 0
        self._jumps = self._batches = self._lost = 0

    def _offset_at(self, stamp: float) -> float:
        about, offset, drift = self._line
        return offset + drift * (stamp - about)

    def take(self, stamps: np.ndarray, arrival: float) -> np.ndarray:
        """Follow a chunk of time stamps, shape (n,) [s], that arrived at a host's time; return host times."""
        stamps = np.asarray(stamps, float)
        if not len(stamps):
            return stamps
        differences = arrival - stamps
        if not self._known:
            self._line, self._known = (stamps[-1], float(differences.min()), 0.0), True
        self._count_losses(stamps)
        apart = float(differences[-1]) - self._offset_at(stamps[-1])
        if apart < -JUMP_THRESHOLD_S:
            # Nothing arrives before it is measured: the stream's clock was set forward. In the first interval it may
            # also be that the first samples had waited, as those do that were sent before anybody listened.
            if self._minima:
                self._restart(stamps[-1], float(differences[-1]))
            else:
                self._line = (stamps[-1], float(differences[-1]), 0.0)
        self._least = min(self._least, float(differences.min()))
        if self._begun is None:
            self._begun = arrival
        if arrival - self._begun >= INTERVAL_S:
            if self._least - self._offset_at(stamps[-1]) > JUMP_THRESHOLD_S and len(self._minima) > 1:
                # For a whole interval everything was late: the clock was set back.
                self._restart(stamps[-1], self._least)
            else:
                self._minima.append((float(stamps[-1]), self._least))
                self._fit()
            self._begun, self._least = arrival, np.inf
        return stamps + np.array([self._offset_at(stamp) for stamp in stamps])

    def _restart(self, stamp: float, difference: float) -> None:
        self._jumps += 1
        self._minima.clear()
        self._line = (stamp, difference, 0.0)
        self._begun, self._least = None, np.inf
        self._first = None

    def _fit(self) -> None:
        t, d = np.array(self._minima).T
        about = float(t.mean())
        if len(t) < MIN_DRIFT_INTERVALS:
            self._line = (about, float(d.min()), 0.0)
            return
        slope = float(np.dot(t - about, d - d.mean()) / max(np.dot(t - about, t - about), 1e-12))
        self._line = (about, float(d.mean()), slope)

    def _count_losses(self, stamps: np.ndarray) -> None:
        before = stamps[0] - self._period if self._last_stamp is None else self._last_stamp
        steps = np.diff(stamps, prepend=before)
        self._last_stamp = float(stamps[-1])
        self._count += len(stamps)
        if self._first is None:
            self._first = (float(stamps[-1]), self._count)
        if self._period == 0.0:
            return
        gaps = steps[(steps > MIN_GAP_PERIODS * self._period) & (steps < 1e3)]
        equal = int(np.count_nonzero(steps[1:] == 0.0)) + int(self._last_stamp is not None and steps[0] == 0.0)
        if equal + 1 >= MIN_BATCH_SAMPLES:
            self._batches += 1
            gaps = gaps[:0]  # a batch's stamps say nothing about what is between them
        self._lost += int(np.sum(np.round(gaps / self._period) - 1.0)) if len(gaps) else 0

    @property
    def state(self) -> ClockState:
        """What is known of the clock now."""
        rate = np.nan
        if self._first is not None and self._last_stamp is not None and self._last_stamp > self._first[0]:
            rate = (self._count - self._first[1]) / (self._last_stamp - self._first[0])
        offset = self._offset_at(self._last_stamp) if self._last_stamp is not None else 0.0
        drift = self._line[2] if self._known else 0.0
        return ClockState(float(offset), float(drift), self._jumps, self._batches, self._lost, float(rate))
