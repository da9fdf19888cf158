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

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .._errors import RecordingError
from ..numerics.tied_ranks import tied_ranks
from ..units import COORDINATES_BY_UNIT, Coordinate


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


LABEL_TOLERANCE_RAD = 0.01
"""A label matches a movement's amplitude within this tolerance, because labels may be rounded."""

MAX_AMPLITUDE_COUNT = 12
"""With more amplitudes than this they were drawn at random, and lie too close together to tell exchanged labels."""

MAX_MISTAKEN_SHARE = 0.1
"""Largest share of a recording's movements that may end nearer to another label than to their own."""

HIT_DISTANCE_SHARE = 1 / 3
"""A movement hit a label if it ends within this share of the distance to the border between two labels."""

MIN_HIT_SHARE = 0.6
"""Movements nearer to another label were aimed at it if at least this share of them hit it."""

MIN_MOVED_LABEL_SHARE = 0.8
"""A label was exchanged as a whole if at least this share of its movements went to another label."""

MIN_RANK_CORRELATION = 0.5
"""Labelled and measured amplitudes are unrelated if their rank correlation is below this."""


@dataclass(frozen=True)
class Strays:
    """Movements that end nearer to another label than to their own."""

    wrong: np.ndarray  # (n,)
    nearest: np.ndarray  # (n,) The label that each movement ends nearest to [rad]
    mislabelled: str  # Why they are labelled wrongly; empty where people may just have missed
    along: Coordinate = COORDINATES_BY_UNIT["rad"]  # What they go along: of a length all that is [rad] here is [m]

    def commonest(self, label: np.ndarray) -> str:
        """The commonest mistake of movements with these labels [rad], in words."""
        pairs = zip(label[self.wrong], self.nearest[self.wrong], strict=True)
        shown = (tuple(round(self.along.factor * float(x), 1) for x in p) for p in pairs)
        (own, other), count = Counter(shown).most_common(1)[0]
        unit = self.along.shown
        return f"nearer to another amplitude than to their label ({count} labelled {own:g} {unit} go {other:g} {unit})"


def strays(
    reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate = COORDINATES_BY_UNIT["rad"]
) -> Strays:
    """Movements nearer to another label than to their own, and whether that is the labels' fault. `reach`, `label`
    (n,) [rad]; `labels` (k,) [rad]."""
    nearest = labels[np.argmin(np.abs(reach[:, None] - labels[None, :]), axis=1)]
    wrong = np.abs(nearest - label) > LABEL_TOLERANCE_RAD * along.radian
    if len(labels) > MAX_AMPLITUDE_COUNT:
        wrong[:] = False
        return Strays(wrong, nearest, _disordered(reach, label), along)
    said = _whole_label(reach, label, labels, along) or _aimed(reach, label, labels, along)
    return Strays(wrong, nearest, said, along)


def _to_labels(
    reach: np.ndarray, label: np.ndarray, labels: np.ndarray, own: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nearest label, whether it is another, and whether it was hit, once what everybody falls short by is taken out."""
    scaled = reach / np.median(reach / label)
    at = np.argmin(np.abs(scaled[:, None] - labels[None, :]), axis=1)
    gap = np.array([np.min(np.abs(np.delete(labels, i) - each)) for i, each in enumerate(labels)])
    hit = np.abs(scaled - labels[at]) < HIT_DISTANCE_SHARE * 0.5 * gap[at]
    return labels[at], np.abs(labels[at] - label) > own, hit


def _whole_label(reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate) -> str:
    if len(labels) < 2:
        return ""
    nearest, wrong, hit = _to_labels(reach, label, labels, LABEL_TOLERANCE_RAD * along.radian)
    for own in labels:
        of = np.abs(label - own) <= LABEL_TOLERANCE_RAD * along.radian
        if of.sum() < 2:
            continue
        for other in labels:
            there = of & wrong & (nearest == other)
            if there.sum() >= MIN_MOVED_LABEL_SHARE * of.sum() and np.mean(hit[there]) >= 0.5:
                said, went = (f"{along.factor * each:.4g} {along.shown}" for each in (own, other))
                return f"{there.sum()} of {of.sum()} movements labelled {said} go {went}"
    return ""


def _aimed(reach: np.ndarray, label: np.ndarray, labels: np.ndarray, along: Coordinate) -> str:
    if len(labels) < 2:
        return ""
    _, wrong, hit = _to_labels(reach, label, labels, LABEL_TOLERANCE_RAD * along.radian)
    aimed = int((wrong & hit).sum())
    if aimed >= 2 and aimed > MAX_MISTAKEN_SHARE * len(reach) and aimed > MIN_HIT_SHARE * wrong.sum():
        return f"{aimed} of {len(reach)} movements exactly as far as another label says"
    return ""


def _disordered(reach: np.ndarray, label: np.ndarray) -> str:
    if len(reach) < 10:
        return ""
    order = float(np.corrcoef(tied_ranks(reach), tied_ranks(label))[0, 1])
    return (
        f"a rank correlation of {order:.2f} between labelled and measured amplitudes"
        if order < MIN_RANK_CORRELATION
        else ""
    )
