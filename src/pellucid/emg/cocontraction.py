r"""Co-contraction: how much antagonists work against each other, from their envelopes.

With envelopes :math:`e_1, e_2` relative to each muscle's own maximum, at every sample the lower
:math:`e_l` and the higher :math:`e_h`,

.. math::
   \mathrm{CCI}_{FW} = 100\,\frac{2\int e_l\,dt}{\int (e_1 + e_2)\,dt}, \qquad
   \mathrm{CCI}_R = \frac{100}{T} \int \frac{e_l}{e_h}\,(e_l + e_h)\,dt

The first [1]_ is the share of activity that is common, 100 % where both do the same, and does not know how hard they
work; the second [2]_ weighs it by how hard, and reaches 200 % where both are at their maximum all the time.

.. [1] K. Falconer, D. A. Winter, "Quantitative assessment of co-contraction at the ankle joint in walking",
   Electromyography and Clinical Neurophysiology 25, 1985.
.. [2] K. S. Rudolph, M. J. Axe, L. Snyder-Mackler, "Dynamic stability after ACL injury: who can hop?", Knee Surgery,
   Sports Traumatology, Arthroscopy 8, 2000.

Co-contraction from arrays of two envelopes, or of two muscle groups' moments.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from .._errors import RecordingError

MIN_BLOCK_S = 1.0
"""Each block of time that the jackknife leaves out is at least this long [s]."""

BLOCK_COUNT_BOUNDS = (4, 20)
"""Number of jackknife blocks: with fewer than the first no interval is given, and no more than the second are used."""


@dataclass(frozen=True)
class CocontractionIndex:
    """A co-contraction index with its confidence interval; None if the recording is too short for an interval."""

    value: float  # [%]
    interval: tuple[float, float] | None


@dataclass(frozen=True)
class Cocontraction:
    """Both co-contraction indices of a pair of muscles over one stretch of time."""

    common: CocontractionIndex  # index of Falconer and Winter
    weighed: CocontractionIndex  # index of Rudolph


def cocontraction_over_time(
    time: np.ndarray, first: np.ndarray, second: np.ndarray, *, level: float = 0.95
) -> Cocontraction:
    """Return both indices of two envelopes, (n,) [1], over `time`, (n,) [s].

    The intervals are those of a jackknife that leaves out one block of time after the other.
    """
    first, second = (np.asarray(x, float) for x in (first, second))
    for x in (first, second):
        if not np.isfinite(x).all():
            at = int(np.flatnonzero(~np.isfinite(x))[0])
            raise RecordingError(f"found missing samples (NaN), the first at {time[at]:.6g} s, expected none")
        if np.min(x) < 0.0:
            raise RecordingError(f"found {np.min(x):.3g} in an envelope, expected none below 0")
    if not np.any(first + second > 0.0):
        raise RecordingError("found no activity in either muscle, expected some")
    low, both = np.minimum(first, second), first + second
    high = np.maximum(first, second)
    weighed = np.where(high > 0.0, low / np.where(high > 0.0, high, 1.0), 0.0) * both
    steps = np.gradient(np.asarray(time, float))
    span = float(np.sum(steps))
    blocks = int(min(span / MIN_BLOCK_S, BLOCK_COUNT_BOUNDS[1]))
    edges = np.linspace(0, len(time), max(blocks, 1) + 1).astype(int)[:-1]
    sums = np.array([np.add.reduceat(x * steps, edges) for x in (2.0 * low, both, weighed, np.ones_like(low))])
    return Cocontraction(
        _index_with_interval(sums[0], sums[1], level, blocks), _index_with_interval(sums[2], sums[3], level, blocks)
    )


def _index_with_interval(above: np.ndarray, below: np.ndarray, level: float, blocks: int) -> CocontractionIndex:
    value = 100.0 * float(above.sum() / below.sum())
    rest = below.sum() - below
    if blocks < BLOCK_COUNT_BOUNDS[0] or not (rest > 0.0).all():
        return CocontractionIndex(value, None)
    without = 100.0 * (above.sum() - above) / rest
    error = float(np.sqrt((blocks - 1) / blocks * np.sum((without - without.mean()) ** 2)))
    half = float(stats.t.isf(0.5 * (1.0 - level), blocks - 1)) * error
    return CocontractionIndex(value, (max(value - half, 0.0), value + half))


MAX_OPPOSED_SHARE = 0.01
"""A group's moment may have the other sign by this share of the largest moment, as filters leave it."""


def cocontraction(
    first: ArrayLike, second: ArrayLike, *, fs: float, level: float = 0.95, moments: bool = False
) -> Cocontraction:
    """Return the co-contraction indices of two antagonists from their envelopes or moments.

    Parameters
    ----------
    first, second : array_like, shape (n,)
        Envelopes, each relative to its muscle's own maximum [1]. With `moments`, the moments of two opposed muscle
        groups about one joint [N m], of opposite signs, as calibrated muscles give them.
    fs : float
        Sampling rate [Hz].
    level : float
        Confidence level of the intervals, by the jackknife over blocks of time.
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
