"""Moving average of an estimator's output: trees answer in steps."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d


def width(seconds: float, fs: float) -> int:
    """Samples of a window of `seconds` [s] at a rate of `fs` [Hz]; odd, so that it has a middle."""
    return 2 * round((seconds * fs - 1.0) / 2.0) + 1 if seconds * fs > 1.0 else 1


def smooth(samples: np.ndarray, seconds: float, fs: float, *, causal: bool = False) -> np.ndarray:
    """Average over a window, centred for analysis or of the past alone.

    Parameters
    ----------
    samples : ndarray, shape (n,)
    seconds : float
        Length of the window [s]; 0.05 s are the thesis's 25 samples at 500 Hz.
    fs : float
        [Hz]
    causal : bool
        Of the past alone: late by half a window, `smoothing_delay`.

    Returns
    -------
    ndarray, shape (n,)
        Beyond its ends, the first and last sample are taken to go on.
    """
    n = width(seconds, fs)
    return uniform_filter1d(np.asarray(samples, float), n, mode="nearest", origin=(n - 1) // 2 if causal else 0)


def smoothing_delay(seconds: float, fs: float) -> float:
    """By how much the causal average is late [s], at a rate of `fs` [Hz]."""
    return (width(seconds, fs) - 1) / (2.0 * fs)
