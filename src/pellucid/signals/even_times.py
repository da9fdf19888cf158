"""An even grid of times over times as they were recorded."""

from __future__ import annotations

import numpy as np

from .._errors import RecordingError

MOST = 1000
"""Samples of an even grid for each that there was."""


def even_times(time: np.ndarray, fs: float, over: float = 0.0) -> np.ndarray:
    """An even grid at `fs` [Hz] from the first of the times (n,) to the last [s], and `over` samples more at most;
    RecordingError where far more samples would be on it than were recorded."""
    n = float(time[-1] - time[0]) * fs + over
    if not n <= MOST * max(len(time), 1000):
        raise RecordingError(
            f"resampling: found {len(time)} samples from {time[0]:g} s to {time[-1]:g} s, expected no more than "
            f"{MOST} times as many at {fs:g} Hz"
        )
    return time[0] + np.arange(int(np.floor(n)) + 1) / fs
