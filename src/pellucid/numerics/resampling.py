"""From one clock to another without delay: cubic splines, whose bandwidth is known, and straight lines."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

from .._errors import RecordingError


@dataclass(frozen=True, eq=False)
class Resampled:
    """Samples on another clock."""

    # (m,) NaN where the record does not reach: a spline does not know what comes after its last sample
    samples: np.ndarray
    bandwidth: float  # Where the interpolation is 3 dB down [Hz]
    delay: float = 0.0  # 0: a spline is symmetric in time [s]


def resample(time: np.ndarray, samples: np.ndarray, wanted: np.ndarray) -> Resampled:
    """Interpolate by a cubic spline, 20 Hz to 500 Hz say; the spline passes through every sample. `time` (n,) [s];
    `samples` (n,); `wanted` (m,) [s]."""
    from scipy.interpolate import CubicSpline  # loads slowly, and most studies have one clock

    samples = np.asarray(samples, float)
    if len(time) < 4 or np.any(np.diff(time) <= 0.0):
        raise RecordingError(f"resampling: found {len(time)} samples, expected four or more at increasing times")
    if not np.isfinite(samples).all():
        raise RecordingError(
            f"resampling: found {np.sum(~np.isfinite(samples))} missing samples, expected none; bridge dropouts first"
        )
    found = CubicSpline(time, samples, extrapolate=False)(wanted)
    return Resampled(found, spline_bandwidth((len(time) - 1) / float(time[-1] - time[0])))


def linear(time: np.ndarray, samples: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Straight lines between samples, of a short part of a long record as fast as of a short record. `time`,
    `samples` (n,) [s]; `wanted` (m,) [s]; gives (m,)."""
    if not len(wanted):
        return np.empty(0)
    first, last = np.searchsorted(time, (wanted[0], wanted[-1]))
    # NumPy copies a whole record that is read-only.
    part = slice(max(first - 1, 0), last + 1)
    return np.interp(wanted, time[part], samples[part])


def spline_bandwidth(fs: float) -> float:
    """Frequency at which a cubic spline through samples at `fs` [Hz] is 3 dB down [Hz]: its response is
    sinc^4(f/fs) 3 / (2 + cos(2 pi f/fs))."""

    from scipy.optimize import brentq

    def response(x):
        return (sin(pi * x) / (pi * x)) ** 4 * 3.0 / (2.0 + cos(2.0 * pi * x)) - 0.5**0.5

    return fs * brentq(response, 0.1, 0.5)
