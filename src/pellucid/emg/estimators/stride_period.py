"""Period of a movement that repeats, such as a stride or a lift, from the autocorrelation of a signal of it."""

from __future__ import annotations

import numpy as np

MIN_STRIDE_S = 0.4
"""Shortest period of a movement that is looked for [s]. Chosen by judgement; no measurement is recorded."""

MIN_STRIDE_COUNT = 4
"""Smallest number of periods that a signal must hold.

Chosen by judgement; no measurement is recorded.
"""

MIN_PERIODIC_AUTOCORRELATION = 0.5
"""A signal counts as periodic if its autocorrelation reaches at least this value at the period.

Chosen by judgement; no measurement is recorded.
"""


def find_period(signal: np.ndarray, fs: float) -> int:
    """Return the period of a signal, shape (n,) at `fs` [Hz], in samples; 0 if it does not repeat often enough."""
    n = len(signal)
    r = np.fft.irfft(np.abs(np.fft.rfft(signal - signal.mean(), 2 * n)) ** 2)[:n] / np.arange(n, 0, -1)
    first, last = round(MIN_STRIDE_S * fs), n // MIN_STRIDE_COUNT
    period = first + int(np.argmax(r[first:last])) if last > first else 0
    return period if period and r[period] >= MIN_PERIODIC_AUTOCORRELATION * r[0] else 0
