"""Repetitions of a movement that leaves a rest position and returns, found from an angle, as cross-validation groups.

Ensemble of strides: samples between events, brought to one phase from 0 to 100 %.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import RecordingError
from ...numerics.arguments import with_checked_arguments
from ...numerics.filters import runs, zero_phase_lowpass


@dataclass(frozen=True)
class RepetitionSearch:
    """Criteria of a repetition."""

    # Cut-off of the low-pass before the search, so that tremor and a goniometer's steps are not taken for repetitions
    lowpass_hz: float = 3.0
    min_away_share: float = 0.5  # A repetition goes beyond this share of the whole range
    max_back_share: float = 0.25  # A repetition comes back below this share of the whole range
    max_rest_speed: float = np.radians(8.0)  # Speeds below this count as rest [rad/s]


REPETITION_SEARCH = RepetitionSearch()


@dataclass(frozen=True)
class Repetition:
    """One repetition."""

    start: int  # start, end: First sample, and the one after the last
    end: int
    turn: int  # Sample furthest from rest
    excursion: float  # From rest to there [rad]; signed

    @property
    def samples(self) -> slice:
        """Its samples."""
        return slice(self.start, self.end)


@dataclass(frozen=True)
class Repetitions:
    """All of a recording."""

    # In order; one begins where the one before it ends, in the middle of the rest between them
    each: tuple[Repetition, ...]
    rest: float  # Angle of rest: the median where the angle is still and near where the repetitions begin [rad]
    # A last movement that did not come back before the recording's end; it is none of them
    unfinished: slice | None = field(default=None)

    def __len__(self) -> int:
        return len(self.each)

    def labels(self, count: int) -> np.ndarray:
        """Number of the repetition that each sample belongs to, shape (count,); -1 for none."""
        labels = np.full(count, -1)
        for number, repetition in enumerate(self.each):
            labels[repetition.samples] = number
        return labels


def find_repetitions(
    angle: np.ndarray,
    fs: float,
    *,
    smallest: float = np.radians(15.0),
    rest: Literal["first", "low", "high"] = "first",
    where: str = "the recording",
) -> Repetitions:
    """Cut a recording into its repetitions.

    The whole range is between the 2nd and 98th percentiles of the low-passed angle. Beyond half of it a repetition has
    left its rest, below a quarter it is back.

    `angle` (n,) [rad]; `fs` [Hz]; `smallest` [rad].
    """
    angle = np.asarray(angle, dtype=float)
    missing = np.flatnonzero(~np.isfinite(angle))
    if len(missing):
        raise RecordingError(
            f"{where}: found {len(missing)} missing samples (NaN), the first at index {missing[0]}, expected a number "
            "in every sample; choose a window without them"
        )
    smooth = zero_phase_lowpass(angle, REPETITION_SEARCH.lowpass_hz, 2, fs)
    low, high = np.percentile(smooth, [2.0, 98.0])
    if high - low < smallest:
        raise RecordingError(
            f"{where}: found a range of {np.degrees(high - low):.3g} deg, expected at least "
            f"{np.degrees(smallest):.3g} deg of a movement"
        )
    begins_low = abs(smooth[0] - low) < abs(smooth[0] - high) if rest == "first" else rest == "low"
    base, way = (low, high - low) if begins_low else (high, low - high)
    share = (smooth - base) / way
    trips, unfinished = _trips(share)
    if not trips:
        raise RecordingError(
            f"{where}: found no movement that leaves {np.degrees(base):.3g} deg by "
            f"{np.degrees(abs(way)) * REPETITION_SEARCH.min_away_share:.3g} "
            "deg and comes back, expected at least one"
        )
    settled = (np.abs(np.gradient(smooth, 1.0 / fs)) < REPETITION_SEARCH.max_rest_speed) & (
        share < REPETITION_SEARCH.max_back_share
    )
    at_rest = float(np.median(angle[settled])) if np.any(settled) else float(base)
    ends = [trip.stop for trip in trips]
    starts = [trip.start for trip in trips[1:]] + ([unfinished.start] if unfinished else [])
    cuts = [0, *(_middle(share, a, b) for a, b in zip(ends, starts, strict=False))]
    if unfinished is None:
        cuts.append(len(angle))
    each = []
    for trip, start, end in zip(trips, cuts[:-1], cuts[1:], strict=True):
        turn = trip.start + int(np.argmax(share[trip]))
        each.append(Repetition(start, end, turn, float(smooth[turn]) - at_rest))
    return Repetitions(tuple(each), at_rest, slice(cuts[-1], len(angle)) if unfinished else None)


def _trips(share: np.ndarray) -> tuple[list[slice], slice | None]:
    """Stretches away from rest that go far enough and come back, and a last one that does not come back."""
    found = [
        run
        for run in runs(share > REPETITION_SEARCH.max_back_share)
        if share[run].max() > REPETITION_SEARCH.min_away_share
    ]
    # One that is away at the very beginning did not begin here.
    found = [run for run in found if run.start > 0]
    if found and found[-1].stop == len(share):
        return found[:-1], found[-1]
    return found, None


def _middle(share: np.ndarray, end: int, start: int) -> int:
    """The middle of the rest between two trips."""
    between = share[end:start]
    near = np.flatnonzero(between <= between.min() + 0.05)
    return end + round(float(np.mean(near)))


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


@with_checked_arguments
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
