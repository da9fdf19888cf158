r"""What a moving average of n samples does to a signal: how much of it is left, and how late.

.. math::
   |H(f)| = \left|\frac{\sin(\pi n f / f_s)}{n \sin(\pi f / f_s)}\right|, \qquad \text{delay} = \frac{n-1}{2 f_s}
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from pellucid._errors import PellucidError


def gain(n: int, fs: float, frequency: float | np.ndarray) -> float | np.ndarray:
    """Share of the amplitude that is left; fs [Hz], frequency [Hz]."""
    x = np.pi * np.asarray(frequency, float) / fs
    return np.abs(np.sin(n * x) / (n * np.sin(x)))


def cutoff(n: int, fs: float) -> float:
    """Frequency [Hz] at which half the power is left; fs [Hz]."""
    if n < 2:
        raise PellucidError(f"a moving average of {n} samples has no cutoff; expected 2 or more")
    return float(brentq(lambda f: gain(n, fs, f) - np.sqrt(0.5), 1e-9 * fs, fs / n))


def delay(n: int, fs: float) -> float:
    """How late a causal average of `n` samples at `fs` [Hz] is [s]."""
    return (n - 1) / (2.0 * fs)
