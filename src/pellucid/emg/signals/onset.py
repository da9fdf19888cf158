"""Onsets of muscles from arrays of raw EMG."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import RecordingError
from .emg_onset import Activations, activations


def onset(
    emg: ArrayLike | Mapping[str, ArrayLike],
    *,
    fs: float,
    rest: tuple[float, float] | None = None,
    level: float = 0.95,
    **thresholds: float,
) -> Activations | dict[str, Activations]:
    """Find the bursts of raw EMG, each onset and end with its interval.

    Parameters
    ----------
    emg : array_like, shape (n,), or mapping of str to array_like
        Raw EMG of one muscle [V], or of several by name.
    fs : float
        Sampling rate [Hz].
    rest : tuple of float, optional
        Beginning and end of a stretch of rest [s]; the quietest stretch by default.
    level : float
        Probability of the intervals.
    **thresholds : float
        ``height`` (standard deviations of rest), ``shortest`` (duration of a burst [s]) and ``pause`` between two
        bursts [s].

    Returns
    -------
    Activations, or dict of str to Activations
        ``.bursts`` have ``onset`` and ``end``, each with ``time``, ``low`` and ``high`` [s].

    Raises
    ------
    RecordingError
        If a sample is missing, the rate is too low for EMG, or there is no rest or no activity.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> found = onset(rng.standard_normal(t.size) * np.where((t > 1.0) & (t < 2.0), 1.0, 0.02), fs=1000.0)
    >>> burst = found.bursts[0]
    >>> burst.onset.low < 1.0 < burst.onset.high
    True
    """
    if not fs > 0.0:
        raise RecordingError(f"onset: found a sampling rate of {fs:g} Hz, expected one above 0")
    if isinstance(emg, Mapping):
        return {name: _onset(each, fs, rest, level, name, thresholds) for name, each in emg.items()}
    return _onset(emg, fs, rest, level, "", thresholds)


def _onset(emg: ArrayLike, fs: float, rest, level: float, name: str, thresholds) -> Activations:
    samples = np.asarray(emg, float)
    where = f"onset, {name}" if name else "onset"
    if samples.ndim != 1 or len(samples) < 2:
        raise RecordingError(f"{where}: found EMG of shape {samples.shape}, expected (n,), one muscle")
    try:
        return activations(np.arange(len(samples)) / fs, samples, rest=rest, level=level, **thresholds)
    except RecordingError as error:
        raise RecordingError(f"{where}: {error}") from None
