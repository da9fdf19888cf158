"""Fatigue in raw EMG: the trend of its median frequency.

While a contraction lasts, action potentials travel more slowly along the fibres, and the spectrum of surface EMG moves
to lower frequencies. The median frequency divides the power of a window into halves; its slope over time is the usual
index [1]_. It presupposes a contraction of nearly constant force and length.

.. [1] C. J. De Luca, "Myoelectrical manifestations of localized muscular fatigue in humans", Critical Reviews in
   Biomedical Engineering 11, 1984.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import welch

from ..._errors import RecordingError

MIN_WINDOW_COUNT = 4
"""Smallest number of windows through which a trend is laid."""

SEGMENT_SHARE = 0.5
"""Length of the segments over which a window's spectrum is averaged, as a share of the window."""

MEDIAN_FREQUENCY_BAND_HZ = (20.0, 450.0)
"""Frequencies of surface EMG that count [Hz]; those below are of moving cables."""


@dataclass(frozen=True, eq=False)
class FrequencyTrend:
    """Median frequency of EMG over time, with its slope.

    Attributes
    ----------
    slope : float
        Slope of the median frequency [Hz/s]; negative in fatigue.
    low, high : float
        Ends of its interval [Hz/s].
    initial : float
        Median frequency at the first sample, by the line [Hz].
    time : ndarray, shape (windows,)
        Middle of each window, from the first sample [s].
    median_frequency : ndarray, shape (windows,)
        Median frequency of each window [Hz].
    """

    slope: float
    low: float
    high: float
    initial: float
    time: np.ndarray = field(repr=False)
    median_frequency: np.ndarray = field(repr=False)


def median_frequency_trend(
    emg: ArrayLike, *, rate: float, window: float = 1.0, confidence: float = 0.95
) -> FrequencyTrend:
    """Return the median frequency of raw EMG in consecutive windows, and its slope with an interval.

    Parameters
    ----------
    emg : array_like, shape (n,)
        Raw EMG of one muscle during a steady contraction [V].
    rate : float
        Its sampling rate [Hz], above 900.
    window : float
        Length of each window [s].
    confidence : float
        Confidence level of the slope's interval, in (0, 1).

    Returns
    -------
    FrequencyTrend

    Raises
    ------
    RecordingError
        If a sample is missing, the rate is too low, no sample lies below 0, or there are fewer than four windows.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> rng = np.random.default_rng(0)
    >>> found = pl.median_frequency_trend(1e-4 * rng.standard_normal(20000), rate=2000.0)
    >>> found.low < 0.0 < found.high
    True
    """
    from scipy.stats import t as student

    x = np.asarray(emg, dtype=np.float64)
    if x.ndim != 1:
        raise RecordingError(f"median frequency: found EMG of shape {x.shape}, expected (n,)")
    if not np.isfinite(x).all():
        raise RecordingError(
            f"median frequency: found {np.sum(~np.isfinite(x))} missing samples (NaN), expected a number in each"
        )
    low, high = MEDIAN_FREQUENCY_BAND_HZ
    if not (np.isfinite(rate) and rate > 2.0 * high):
        raise RecordingError(f"median frequency: found a rate of {rate:g} Hz, expected more than {2.0 * high:g} Hz")
    if len(x) and np.min(x) >= 0.0:
        raise RecordingError("median frequency: found no sample below 0, as in an envelope, expected raw EMG")
    length = round(window * rate)
    count = len(x) // length if length > 0 else 0
    if count < MIN_WINDOW_COUNT or length < 2.0 * rate / low:
        raise RecordingError(
            f"median frequency: found {len(x) / rate:.3g} s and windows of {window:g} s, expected at least "
            f"{MIN_WINDOW_COUNT} windows of {2.0 / low:g} s or more"
        )
    frequency, power = welch(x[: count * length].reshape(count, length), fs=rate, nperseg=int(SEGMENT_SHARE * length))
    inside = (frequency >= low) & (frequency <= high)
    share = np.cumsum(power[:, inside], axis=1)
    found = np.array([np.interp(0.5 * each[-1], each, frequency[inside]) for each in share])
    time = (np.arange(count) + 0.5) * length / rate
    slope, initial = np.polyfit(time, found, 1)
    left = found - initial - slope * time
    error = np.sqrt(left @ left / (count - 2) / np.sum((time - time.mean()) ** 2))
    half = float(student.ppf(0.5 + 0.5 * confidence, count - 2) * error)
    return FrequencyTrend(float(slope), float(slope) - half, float(slope) + half, float(initial), time, found)
