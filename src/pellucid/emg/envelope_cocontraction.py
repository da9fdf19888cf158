"""Co-contraction from arrays of two envelopes, or of two muscle groups' moments."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._errors import RecordingError
from .cocontraction import Cocontraction, cocontraction_over_time

MAX_OPPOSED_SHARE = 0.01
"""A group's moment may have the other sign by this share of the largest moment, as filters leave it."""


def cocontraction(
    first: ArrayLike, second: ArrayLike, *, fs: float, level: float = 0.95, moments: bool = False
) -> Cocontraction:
    """Return the co-contraction indices of two antagonists from their envelopes, or from their moments.

    Parameters
    ----------
    first, second : array_like, shape (n,)
        Envelopes, each relative to its muscle's own maximum [1]. With `moments`, the moments of two opposed muscle
        groups about one joint [N m], of opposite signs, as calibrated muscles give them.
    fs : float
        Sampling rate [Hz].
    level : float
        Confidence level of the intervals, from blocks of time left out in turn.
    moments : bool
        Whether moments are given. Both are then relative to the largest of either, so that ``.weighed`` compares
        stretches of one call alone.

    Returns
    -------
    Cocontraction
        ``.common`` (Falconer and Winter) and ``.weighed`` (Rudolph), each with ``value`` [%] and ``interval``.

    Raises
    ------
    RecordingError
        If the shapes differ, a sample is missing, an envelope is negative, moments have the same sign, or neither
        muscle is active.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0.0, 10.0, 0.01)
    >>> flexor, extensor = 0.5 + 0.4 * np.sin(t), 0.5 + 0.4 * np.sin(t + 1.0)
    >>> round(cocontraction(flexor, extensor, fs=100.0).common.value)
    78
    >>> round(cocontraction(40.0 * flexor, -40.0 * extensor, fs=100.0, moments=True).common.value)
    78
    """
    one, other = np.asarray(first, float), np.asarray(second, float)
    if one.ndim != 1 or one.shape != other.shape or len(one) < 2:
        raise RecordingError(
            f"cocontraction: found envelopes of shapes {one.shape} and {other.shape}, expected both (n,)"
        )
    if not fs > 0.0:
        raise RecordingError(f"cocontraction: found a sampling rate of {fs:g} Hz, expected one above 0")
    if moments:
        one, other = _relative_moments(one, other)
    try:
        return cocontraction_over_time(np.arange(len(one)) / fs, one, other, level=level)
    except RecordingError as error:
        raise RecordingError(f"cocontraction: {error}") from None


def _relative_moments(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sizes of two moments of opposite signs over the largest of either [1]; NaN stays."""
    signs = [float(np.sign(np.nansum(x))) for x in (one, other)]
    largest = float(max(np.nanmax(np.abs(x), initial=0.0) for x in (one, other)))
    against = [float(np.nanmax(-sign * x, initial=0.0)) for sign, x in zip(signs, (one, other), strict=True)]
    if signs[0] * signs[1] > 0.0 or max(against) > MAX_OPPOSED_SHARE * largest:
        raise RecordingError(
            f"cocontraction: found moments from {np.nanmin(one):.3g} to {np.nanmax(one):.3g} and from "
            f"{np.nanmin(other):.3g} to {np.nanmax(other):.3g} N*m, expected one group's at or above 0 and the other's "
            "at or below: the moments of flexors and of extensors"
        )
    sizes = (np.maximum(sign * x, 0.0) / largest if largest else x for sign, x in zip(signs, (one, other), strict=True))
    flexing, extending = sizes
    return flexing, extending
