"""Electromechanical delay: by how much a muscle's torque follows its EMG.

The delay is the lag at which the correlation of an envelope with the torque is largest. Blocks of time that are left
out in turn give its interval. The envelope must not be late itself: use one whose filters ran both ways.

Fatigue in raw EMG: the trend of its median frequency.

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
from scipy import stats
from scipy.signal import welch

from ..._errors import RecordingError
from ...numerics.arguments import with_checked_arguments


@dataclass(frozen=True)
class DelaySearch:
    """Search range of a delay, and criteria of its detection."""

    max_s: float = 0.5  # Delays are searched from minus to plus this time
    # Smallest correlation between envelope and torque at which a delay counts as found. Chosen by judgement.
    min_correlation: float = 0.5
    peak_share: float = 0.95  # Lags whose correlation is at least this share of the largest belong to its peak
    block_count: int = 10  # Number of blocks of time that are left out in turn
    min_block_s: float = 1.0  # Smallest length of such a block


DELAY_SEARCH = DelaySearch()


@dataclass(frozen=True)
class ElectromechanicalDelay:
    """Time by which a torque follows an envelope of EMG."""

    value: float  # Delay [s]; positive where EMG comes first
    interval: tuple[float, float]  # Confidence interval [s]
    correlation: float  # Correlation of envelope and torque at this delay


@with_checked_arguments
def electromechanical_delay(
    envelope: ArrayLike, torque: ArrayLike, *, fs: float, level: float = 0.95
) -> ElectromechanicalDelay:
    """Return the time by which a torque follows an envelope of EMG, with its interval.

    Parameters
    ----------
    envelope : array_like, shape (n,)
        Envelope of one muscle, in any unit, by filters that ran both ways.
    torque : array_like, shape (n,)
        Torque or force that the muscle makes, in any unit; its sign does not matter.
    fs : float
        Sampling rate of both [Hz].
    level : float
        Confidence level of the interval.

    Returns
    -------
    ElectromechanicalDelay

    Raises
    ------
    RecordingError
        If the shapes differ, a sample is missing, the recording is shorter than ten seconds, or no delay is found: the
        correlation is below 0.5, or largest at an end of the search.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> effort = lambda t: np.clip(np.sin(2.0 * np.pi * 0.7 * t) + 0.3 * np.sin(2.0 * np.pi * 0.31 * t), 0.0, None)
    >>> found = pl.electromechanical_delay(effort(t), 30.0 * effort(t - 0.08), fs=100.0)
    >>> round(found.value, 3)
    0.08
    """
    x, y = np.asarray(envelope, float), np.asarray(torque, float)
    if x.ndim != 1 or x.shape != y.shape:
        raise RecordingError(
            f"electromechanical_delay: found shapes {x.shape} and {y.shape} of envelope and torque, expected both (n,)"
        )
    if not fs > 0.0:
        raise RecordingError(f"electromechanical_delay: found a sampling rate of {fs:g} Hz, expected one above 0")
    for name, samples in (("envelope", x), ("torque", y)):
        missing = np.flatnonzero(~np.isfinite(samples))
        if missing.size:
            raise RecordingError(
                f"electromechanical_delay: found {missing.size} missing samples (NaN) in the {name}, the first at "
                f"{missing[0] / fs:.6g} s, expected none"
            )
    reach = round(DELAY_SEARCH.max_s * fs)
    if len(x) < DELAY_SEARCH.block_count * DELAY_SEARCH.min_block_s * fs:
        raise RecordingError(
            f"electromechanical_delay: found {len(x) / fs:.3g} s of envelope and torque, expected at least "
            f"{DELAY_SEARCH.block_count * DELAY_SEARCH.min_block_s:g} s"
        )
    sums = _block_sums(x, y, reach)
    correlation = _correlations(sums.sum(axis=0))
    best = int(np.argmax(np.abs(correlation)))
    largest = float(abs(correlation[best]))
    if largest < DELAY_SEARCH.min_correlation or best in (0, 2 * reach):
        where = ", at the end of the search" if best in (0, 2 * reach) else ""
        raise RecordingError(
            f"electromechanical_delay: found a largest correlation of {largest:.2g} at {(best - reach) / fs:.3g} s"
            f"{where}, expected one of at least {DELAY_SEARCH.min_correlation:g} within {DELAY_SEARCH.max_s:g} s: "
            "the delay is not identifiable"
        )
    sign = np.sign(correlation[best])
    value = _peak(sign * correlation, reach, fs)
    without = np.array([_peak(sign * _correlations(sums.sum(axis=0) - one), reach, fs) for one in sums])
    error = np.sqrt((len(sums) - 1) / len(sums) * np.sum((without - without.mean()) ** 2))
    half = float(stats.t.isf(0.5 * (1.0 - level), len(sums) - 1) * error)
    return ElectromechanicalDelay(value, (value - half, value + half), largest)


def _block_sums(x: np.ndarray, y: np.ndarray, reach: int) -> np.ndarray:
    """Return sums of 1, x, y, x^2, y^2 and xy at every lag of each block, shape (blocks, 6, lags)."""
    x, y = x - x.mean(), y - y.mean()
    middle = np.arange(reach, len(x) - reach)
    made = np.empty((DELAY_SEARCH.block_count, 6, 2 * reach + 1))
    for i, at in enumerate(np.array_split(middle, DELAY_SEARCH.block_count)):
        for j, lag in enumerate(range(-reach, reach + 1)):
            a, b = x[at], y[at + lag]
            made[i, :, j] = len(at), a.sum(), b.sum(), a @ a, b @ b, a @ b
    return made


def _correlations(sums: np.ndarray) -> np.ndarray:
    """Return the correlation at every lag from sums of shape (6, lags)."""
    count, x, y, xx, yy, xy = sums
    below = np.sqrt(np.maximum(xx - x**2 / count, 0.0) * np.maximum(yy - y**2 / count, 0.0))
    return np.where(below > 0.0, (xy - x * y / count) / np.where(below > 0.0, below, 1.0), 0.0)


def _peak(correlation: np.ndarray, reach: int, fs: float) -> float:
    """Return the lag of the largest correlation [s], from a parabola through all neighbouring lags almost as large.

    A parabola through only three samples would follow their noise.
    """
    top = int(np.clip(np.argmax(correlation), 1, len(correlation) - 2))
    below = np.flatnonzero(correlation < DELAY_SEARCH.peak_share * correlation[top])
    first = int(max(below[below < top].max(initial=-1) + 1, 0))
    last = int(min(below[below > top].min(initial=len(correlation)) - 1, len(correlation) - 1))
    half = max(min(top - first, last - top), 1)
    lags = np.arange(-half, half + 1)
    bend, slope, _ = np.polyfit(lags, correlation[top - half : top + half + 1], 2)
    between = float(np.clip(-0.5 * slope / bend, -half, half)) if bend < 0.0 else 0.0
    return (top - reach + between) / fs


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


@with_checked_arguments
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
