"""Moving average of an estimator's output. Trees need it, since their output changes in steps."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d


def count_window_samples(seconds: float, fs: float) -> int:
    """Return the number of samples in a window of `seconds` [s] at a rate of `fs` [Hz]. It is odd, for a middle."""
    return 2 * round((seconds * fs - 1.0) / 2.0) + 1 if seconds * fs > 1.0 else 1


def smooth(samples: np.ndarray, seconds: float, fs: float, *, causal: bool = False) -> np.ndarray:
    """Return the moving average of `samples`, shape (n,), over `seconds` [s] at `fs` [Hz].

    The window is centred, or if `causal`, covers the past alone and is late by `smoothing_delay`. Beyond the ends, the
    first and last sample are repeated. The thesis averages 25 samples at 500 Hz, which are 0.05 s.
    """
    n = count_window_samples(seconds, fs)
    return uniform_filter1d(np.asarray(samples, float), n, mode="nearest", origin=(n - 1) // 2 if causal else 0)


def smoothing_delay(seconds: float, fs: float) -> float:
    """Return the delay of the causal average [s], at a rate of `fs` [Hz]."""
    return (count_window_samples(seconds, fs) - 1) / (2.0 * fs)
