"""Co-contraction from arrays of two envelopes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._errors import RecordingError
from .cocontraction import Cocontraction
from .cocontraction import cocontraction as cocontraction_over_time


def cocontraction(first: ArrayLike, second: ArrayLike, *, fs: float, level: float = 0.95) -> Cocontraction:
    """Return the co-contraction indices of two antagonists from their envelopes.

    Parameters
    ----------
    first, second : array_like, shape (n,)
        Envelopes, each relative to its muscle's own maximum [1].
    fs : float
        Sampling rate [Hz].
    level : float
        Confidence level of the intervals, from blocks of time left out in turn.

    Returns
    -------
    Cocontraction
        ``.common`` (Falconer and Winter) and ``.weighed`` (Rudolph), each with ``value`` [%] and ``interval``.

    Raises
    ------
    RecordingError
        If the shapes differ, a sample is missing or negative, or neither muscle is active.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0.0, 10.0, 0.01)
    >>> flexor, extensor = 0.5 + 0.4 * np.sin(t), 0.5 + 0.4 * np.sin(t + 1.0)
    >>> round(cocontraction(flexor, extensor, fs=100.0).common.value)
    78
    """
    one, other = np.asarray(first, float), np.asarray(second, float)
    if one.ndim != 1 or one.shape != other.shape or len(one) < 2:
        raise RecordingError(
            f"cocontraction: found envelopes of shapes {one.shape} and {other.shape}, expected both (n,)"
        )
    if not fs > 0.0:
        raise RecordingError(f"cocontraction: found a sampling rate of {fs:g} Hz, expected one above 0")
    try:
        return cocontraction_over_time(np.arange(len(one)) / fs, one, other, level=level)
    except RecordingError as error:
        raise RecordingError(f"cocontraction: {error}") from None
