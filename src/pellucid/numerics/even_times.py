"""Evenly spaced times over recorded times."""

from __future__ import annotations

import numpy as np

from .._errors import RecordingError

MAX_SAMPLE_RATIO = 1000
"""An even grid has at most this many samples for each recorded one."""


def even_times(time: np.ndarray, fs: float, over: float = 0.0) -> np.ndarray:
    """Return an even grid at `fs` [Hz] from the first to the last of the times (n,) [s], plus at most `over` samples.

    RecordingError if the grid would have far more samples than were recorded.
    """
    n = float(time[-1] - time[0]) * fs + over
    if not n <= MAX_SAMPLE_RATIO * max(len(time), 1000):
        raise RecordingError(
            f"resampling: found {len(time)} samples from {time[0]:g} s to {time[-1]:g} s, expected no more than "
            f"{MAX_SAMPLE_RATIO} times as many at {fs:g} Hz"
        )
    return time[0] + np.arange(int(np.floor(n)) + 1) / fs
