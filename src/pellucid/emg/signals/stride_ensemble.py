"""Ensemble of strides: samples between events, brought to one phase from 0 to 100 %."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import RecordingError

DEFAULT_POINT_COUNT = 101
"""Number of points of each stride by default: one for every percent, both ends included."""


@dataclass(frozen=True, eq=False)
class StrideEnsemble:
    """Strides over their phase, with mean and standard deviation.

    Attributes
    ----------
    phase : ndarray, shape (points,)
        From 0 to 1 [1].
    mean, deviation : ndarray, shape (points,) or (points, channels)
        Mean and standard deviation over strides, in the unit of the samples.
    strides : ndarray, shape (strides, points) or (strides, points, channels)
        Each stride.
    duration : ndarray, shape (strides,)
        Duration of each stride [s].
    """

    phase: np.ndarray = field(repr=False)
    mean: np.ndarray = field(repr=False)
    deviation: np.ndarray = field(repr=False)
    strides: np.ndarray = field(repr=False)
    duration: np.ndarray


def stride_ensemble(
    samples: ArrayLike, *, rate: float, events: ArrayLike, points: int = DEFAULT_POINT_COUNT
) -> StrideEnsemble:
    """Return the strides between events over their phase, with mean and standard deviation.

    Parameters
    ----------
    samples : array_like, shape (n,) or (n, channels)
        Envelopes, angles or torques.
    rate : float
        Their sampling rate [Hz].
    events : array_like, shape (k,)
        Times at which strides begin, such as heel strikes, rising, from the first sample [s].
    points : int
        Number of points of each stride.

    Returns
    -------
    StrideEnsemble
        Of k - 1 strides.

    Raises
    ------
    RecordingError
        If samples are missing, or events do not rise, lie outside the samples, or are fewer than three.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> angle = np.sin(2.0 * np.pi * np.arange(500) / 100.0)
    >>> found = pl.stride_ensemble(angle, rate=100.0, events=[0.0, 1.0, 2.0, 3.0])
    >>> found.strides.shape, float(found.mean[25])
    ((3, 101), 1.0)
    """
    x, times = np.asarray(samples, dtype=np.float64), np.asarray(events, dtype=np.float64)
    if x.ndim not in (1, 2) or len(x) < 2 or not np.isfinite(x).all():
        raise RecordingError(
            f"stride ensemble: found samples of shape {x.shape} with {np.sum(~np.isfinite(x))} missing (NaN), expected "
            "(n,) or (n, channels) and a number in each"
        )
    if not (np.isfinite(rate) and rate > 0.0) or points < 2:
        raise RecordingError(f"stride ensemble: found {rate:g} Hz and {points} points, expected above 0 and at least 2")
    last = (len(x) - 1) / rate
    if times.ndim != 1 or len(times) < 3 or not (np.diff(times) > 0.0).all() or times[0] < 0.0 or times[-1] > last:
        raise RecordingError(
            f"stride ensemble: found events of shape {times.shape}, expected at least three that rise, from 0 to "
            f"{last:g} s"
        )
    phase = np.linspace(0.0, 1.0, points)
    at = times[:-1, None] + np.diff(times)[:, None] * phase
    time = np.arange(len(x)) / rate
    columns = [np.interp(at, time, column) for column in x.reshape(len(x), -1).T]
    strides = columns[0] if x.ndim == 1 else np.stack(columns, axis=-1)
    return StrideEnsemble(phase, strides.mean(axis=0), strides.std(axis=0, ddof=1), strides, np.diff(times))
