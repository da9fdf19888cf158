r"""Muscle activity of a movement, and the EMG/Acc index: how much activity an acceleration costs.

EMG is band-passed from 20 to 450 Hz, centred and rectified, divided by the largest value of the muscle in all of a
participant's recordings, and taken 0.1 s earlier than the motion. Over a movement with its agonists,

.. math::  \mathrm{EMG/Acc} = \frac{1}{C} \, \frac{\mathrm{mean}_m\, \mathrm{RMS}(e_m)}{\ddot q_{max}} - 1,

with C the same ratio in the control condition, for the same participant and amplitude [1]_. It is 0 for control by its
definition, and is not computed for movements that gravity helps.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
   transparency of a robotic upper limb exoskeleton", Robotica 39, 2021, eq. 9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .._errors import RecordingError


@dataclass(frozen=True, eq=False)
class Activity:
    """Rectified EMG of one recording, advanced."""

    time: np.ndarray  # (m,) [s]
    # Rectified EMG by muscle, (m,), in the amplifier's unit; the sample at t causes the motion at t
    rectified: Mapping[str, np.ndarray]
    largest: Mapping[str, float]  # largest value by muscle

    def later(self, seconds: float) -> Activity:
        """Return the same activity, delayed by `seconds`."""
        return replace(self, time=self.time + seconds)

    def level(self, muscles: Sequence[str], maxima: Mapping[str, float], start: float, end: float) -> float:
        """Return the mean over `muscles` of the RMS activity from `start` to `end` [s], relative to the `maxima`.

        The value is NaN outside the record.
        """
        first, last = np.searchsorted(self.time, (start, end))
        if start < self.time[0] or end > self.time[-1] or last - first < 2:
            return float("nan")
        squares = ((self._sums[m][last] - self._sums[m][first]) / (last - first) for m in muscles)
        return float(np.mean([np.sqrt(max(s, 0.0)) / maxima[m] for m, s in zip(muscles, squares, strict=True)]))

    def envelope(self, muscles: Sequence[str], maxima: Mapping[str, float], at: np.ndarray, width: float) -> np.ndarray:
        """Return the level in a window of a `width` [s] about each time `at`, (k,) [s]; (k,), NaN outside the record.

        The level is that of `level`.
        """
        first, last = (np.searchsorted(self.time, at + side * 0.5 * width) for side in (-1.0, 1.0))
        inside = (at - 0.5 * width >= self.time[0]) & (at + 0.5 * width <= self.time[-1]) & (last - first >= 2)
        count = np.maximum(last - first, 1)
        squares = ((self._sums[m][last] - self._sums[m][first]) / count for m in muscles)
        levels = [np.sqrt(np.maximum(s, 0.0)) / maxima[m] for m, s in zip(muscles, squares, strict=True)]
        return np.where(inside, np.mean(levels, axis=0), np.nan)

    @cached_property
    def _sums(self) -> dict[str, np.ndarray]:
        """Cumulative sums of squares by muscle, so that the RMS of any stretch takes two look-ups."""
        return {m: np.concatenate(([0.0], np.cumsum(np.square(each)))) for m, each in self.rectified.items()}


def maxima(activities: Sequence[Activity]) -> dict[str, float]:
    """Return the largest activity of every muscle over all recordings of a participant."""
    found = {m: max(each.largest[m] for each in activities) for m in activities[0].largest} if activities else {}
    silent = [muscle for muscle, top in found.items() if not top > 0.0]
    if silent:
        raise RecordingError(f"EMG: found no activity at all of {', '.join(silent)}, expected some in every recording")
    return found


def emg_per_acceleration(level: float, acceleration: float) -> float:
    """Return the activity `level` divided by the largest `acceleration` [s^2/rad]: eq. 9 without the control's C."""
    return level / acceleration if acceleration > 0.0 else float("nan")
