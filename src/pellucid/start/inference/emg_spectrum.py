"""Tell raw EMG and its envelopes from other channels by their spectrum and their distribution."""

from __future__ import annotations

import numpy as np

MIN_EMG_RATE_HZ = 400.0
"""Raw EMG is recorded at this rate or faster."""

EMG_BAND_HZ = (20.0, 450.0)
"""Most of the power of surface EMG lies in this band."""

MIN_BAND_SHARE = 0.7
"""Raw EMG has at least this share of its power, its mean taken off, in `EMG_BAND_HZ`."""

MAX_LINE_SHARE = 0.6
"""A channel whose strongest line of the spectrum has more than this share of its power is mains hum, not EMG."""

MAX_ENVELOPE_FREQUENCY_HZ = 15.0
"""An envelope has nearly all of its power below this frequency."""


def is_raw_emg(values: np.ndarray, rate: float) -> bool:
    """Whether samples, shape (n,), taken at `rate` [Hz], are raw EMG by their spectrum.

    It swings about zero, its power lies between 20 and 450 Hz, and no single line holds most of it.
    """
    from scipy.signal import welch  # it loads all of scipy.stats

    if rate < MIN_EMG_RATE_HZ:
        return False
    known = values[np.isfinite(values)]
    if len(known) < 256 or np.ptp(known) == 0.0 or len(np.unique(known[:5000])) < 8:
        return False
    frequency, power = welch(known - np.median(known), rate, nperseg=min(1024, len(known)))
    total = power[1:].sum()
    if total <= 0.0:
        return False
    inside = power[(frequency >= EMG_BAND_HZ[0]) & (frequency <= EMG_BAND_HZ[1])].sum() / total
    peak = int(np.argmax(power[1:])) + 1
    line = power[max(peak - 1, 1) : peak + 2].sum() / total
    return bool(inside >= MIN_BAND_SHARE and line <= MAX_LINE_SHARE and _is_broad(frequency, power))


def _is_broad(frequency: np.ndarray, power: np.ndarray) -> bool:
    """Whether half of the power needs a band of at least 15 Hz; a vibration has it in a narrow one."""
    ordered = np.sort(power[1:])[::-1]
    count = int(np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())) + 1
    return count * (frequency[1] - frequency[0]) >= 15.0


def is_envelope(values: np.ndarray, rate: float) -> bool:
    """Whether samples, shape (n,), taken at `rate` [Hz], may be an envelope of EMG: never negative, and slow."""
    from scipy.signal import welch  # it loads all of scipy.stats

    known = values[np.isfinite(values)]
    if len(known) < 32 or np.ptp(known) == 0.0:
        return False
    largest = float(np.max(known))
    if largest <= 0.0 or float(np.min(known)) < -0.03 * largest or float(np.quantile(known, 0.1)) > 0.6 * largest:
        return False
    if rate < 4.0 * MAX_ENVELOPE_FREQUENCY_HZ:
        return True
    frequency, power = welch(known - known.mean(), rate, nperseg=min(1024, len(known)))
    total = power.sum()
    return bool(total > 0.0 and power[frequency <= MAX_ENVELOPE_FREQUENCY_HZ].sum() > 0.95 * total)


def swings_fast(values: np.ndarray) -> bool:
    """Whether a column swings about its mean within some samples and in bursts, whatever the rate is."""
    known = values[np.isfinite(values)]
    if len(known) < 500:
        return False
    centred = known - np.median(known)
    crossings = float(np.mean(np.diff(np.signbit(centred)) != 0))
    first = float(np.corrcoef(centred[:-1], centred[1:])[0, 1]) if np.ptp(centred) > 0.0 else 1.0
    return crossings > 0.05 and -0.3 < first < 0.98 and abs(float(np.mean(centred))) < 0.5 * float(np.std(centred))
