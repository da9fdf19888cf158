"""Propose low-pass, decimation and dead band from the spectrum and the quantum of a position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...numerics.filters import zero_phase_lowpass
from .angle_units import find_quantum

FLOOR_MARGIN = 4.0
"""The acceleration's spectrum ends where it has fallen to this many times its floor."""

MIN_RATE_OVER_LOWPASS = 6.0
"""After decimation the rate is at least this many times the low-pass."""

MAX_LOWPASS_SHARE = 0.2
"""The low-pass is at most this share of the sampling rate."""

DEAD_BAND_SHARE = 0.02
"""The dead band is at least this share of the largest speed, where friction takes a sign for certain."""


@dataclass(frozen=True)
class ProcessingChoice:
    """Processing for a regression, with its reasons and the spectrum that they come from."""

    lowpass: float  # cut-off [Hz]
    decimate: int  # one of so many samples is kept
    dead_band: float  # speed below which samples are left out [unit of the position per second]
    trim: int  # samples left out at each border
    why: str  # reason, for a comment in study.toml
    frequency: np.ndarray  # frequencies of the spectrum, shape (f,) [Hz]
    acceleration_power: np.ndarray  # power of the computed acceleration, shape (f,)


def choose_processing(position: np.ndarray, rate: float) -> ProcessingChoice:
    """Return a proposal for a position, shape (n,), sampled evenly at `rate` [Hz].

    The power of the acceleration falls while motion ends, and rises again where quanta and noise, differentiated
    twice, outweigh it. The low-pass stands at the fall's end.
    """
    from scipy.signal import welch  # it loads all of scipy.stats

    known = position[np.isfinite(position)]
    length = int(min(len(known), max(256, 2 ** int(np.log2(max(rate * 4.0, 256.0))))))
    frequency, power = welch(known - known.mean(), rate, nperseg=length)
    frequency, power = frequency[1:], power[1:]
    acceleration = power * (2.0 * np.pi * frequency) ** 4
    smooth = _smoothed(acceleration)
    peak = int(np.argmax(smooth * (frequency < 0.25 * rate) / (1.0 + frequency) ** 4))
    lowest = peak + int(np.argmin(smooth[peak:])) if peak < len(smooth) - 2 else peak
    above = smooth[peak : lowest + 1] > FLOOR_MARGIN * smooth[lowest]
    end = peak + int(np.flatnonzero(above)[-1]) + 1 if above.any() else lowest
    cut = float(frequency[min(end, len(frequency) - 1)])
    lowpass = _rounded(min(max(cut, 4.0 * float(frequency[peak])), MAX_LOWPASS_SHARE * rate))
    decimate = max(1, int(rate / (MIN_RATE_OVER_LOWPASS * lowpass)))
    speed = np.abs(np.gradient(zero_phase_lowpass(known, lowpass, 4, rate))) * rate
    quantum = find_quantum(known) or 0.0
    # A quantum that passes the filter once is a speed of about quantum times the cut-off.
    dead_band = _rounded(max(DEAD_BAND_SHARE * float(np.quantile(speed, 0.99)), 2.0 * quantum * lowpass))
    why = (
        f"the acceleration's spectrum falls to its floor at {cut:.3g} Hz; above it, quanta and noise of the position "
        "outweigh motion"
    )
    return ProcessingChoice(
        lowpass, decimate, dead_band, max(20, round(0.5 * rate / lowpass)), why, frequency, acceleration
    )


def _smoothed(power: np.ndarray) -> np.ndarray:
    """Return a spectrum as running geometric means over a sixth of an octave, so that single lines do not decide."""
    logs = np.log(np.maximum(power, 1e-300))
    out = np.empty_like(logs)
    sums = np.concatenate(([0.0], np.cumsum(logs)))
    for i in range(len(logs)):
        half = max(1, round(0.06 * i))
        low, high = max(0, i - half), min(len(logs), i + half + 1)
        out[i] = (sums[high] - sums[low]) / (high - low)
    return np.exp(out)


def _rounded(value: float) -> float:
    """Return a number rounded to two digits, 0 for none."""
    if value <= 0.0 or not np.isfinite(value):
        return 0.0
    exponent = int(np.floor(np.log10(value)))
    return float(np.round(value / 10.0 ** (exponent - 1)) * 10.0 ** (exponent - 1))
