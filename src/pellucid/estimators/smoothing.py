"""Moving average of an estimator's output: trees answer in steps."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d


def width(seconds: float, fs: float) -> int:
    """Samples of a window of `seconds` [s] at a rate of `fs` [Hz]; odd, so that it has a middle."""
    return 2 * round((seconds * fs - 1.0) / 2.0) + 1 if seconds * fs > 1.0 else 1


def smooth(samples: np.ndarray, seconds: float, fs: float, *, causal: bool = False) -> np.ndarray:
    """`samples`, shape (n,), averaged over `seconds` at `fs` [Hz]: centred, or of the past alone and late by
    `smoothing_delay` if `causal`. Beyond the ends the first and last sample are taken to go on; 0.05 s are the
    thesis's 25 at 500 Hz.
    """
    n = width(seconds, fs)
    return uniform_filter1d(np.asarray(samples, float), n, mode="nearest", origin=(n - 1) // 2 if causal else 0)


def smoothing_delay(seconds: float, fs: float) -> float:
    """By how much the causal average is late [s], at a rate of `fs` [Hz]."""
    return (width(seconds, fs) - 1) / (2.0 * fs)
