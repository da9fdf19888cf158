"""How far a signal remembers itself: coloured misfit counts as fewer samples than it has."""

from __future__ import annotations

import numpy as np


def correlation_length(misfit: np.ndarray) -> float:
    """Samples that share one independent value: the integrated autocorrelation up to its first zero. `misfit` (n,)."""
    misfit = np.asarray(misfit, float).reshape(len(misfit), -1)
    n = len(misfit)
    padded = 1 << (2 * n - 1).bit_length()  # a power of two is transformed fastest
    spectrum = np.abs(np.fft.rfft(misfit - misfit.mean(axis=0), padded, axis=0)) ** 2
    correlation = np.fft.irfft(spectrum.sum(axis=1))[:n]
    if correlation[0] <= 0.0:
        return 1.0
    end = int(np.argmax(correlation <= 0.0)) or n
    return float(np.clip(1.0 + 2.0 * np.sum(correlation[1:end]) / correlation[0], 1.0, np.sqrt(n)))
