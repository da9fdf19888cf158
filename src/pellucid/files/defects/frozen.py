"""Find frozen encoders: a position that repeats the same bits while the machine must have moved.

The thresholds were chosen by judgement; no measurement is recorded for any. `research/evidence/spoilt.py` counts
what they miss in recordings with known defects.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .rest import is_at_rest, is_only_noise
from .scale import Scale
from .watched import WatchedRecording, find_runs, repeats_next

KIND = "frozen_encoder"


@dataclass(frozen=True)
class FreezeLimits:
    """When a position that rests is that of a frozen encoder."""

    # A rest is examined only if it has at least this many samples and lasts `FREEZE_LIMITS.min_rest_s`.
    min_rest_samples: int = 20
    # A rest is examined only if it lasts at least this long [s] and has `FREEZE_LIMITS.min_rest_samples`.
    min_rest_s: float = 0.1
    # A rest is the encoder's if the effort passes both efforts that move the joint, by this share of their
    # difference. A joint sticks while it reverses, and more so under a load or where gravity is larger.
    breakaway_share: float = 0.5
    # An effort swings if it moves by at least this share of its whole range.
    swing_share: float = 0.6
    # A rest with this many swings of the effort is the encoder's. Fewer may be a test for the breakaway effort.
    min_swing_count: int = 3
    # A position with at most this many values in a whole recording is held, and its last digit flickers.
    max_flicker_levels: int = 3


FREEZE_LIMITS = FreezeLimits()

LEAP_AFTER_REST = "it then is far away after one sample"
"""The strongest sign of a frozen encoder: a body cannot have left its rest so fast."""


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for each rest of a joint's position in which the joint itself cannot have rested."""
    for position, drive in watched.drives.items():
        if {position, drive} <= set(watched.channels):
            yield from _find_in_joint(watched, position, drive)


def _find_in_joint(watched: WatchedRecording, position: str, drive: str) -> Iterator[Cut]:
    q = watched.samples(position)
    finite = np.isfinite(q)
    if not finite.any():
        return
    effort, reference = watched.samples(drive), _reference(watched, position)
    measured = q[finite]
    if measured.min() == measured.max():
        moves = [s for s in (effort, reference) if s is not None and np.nanmax(s, initial=-np.inf) > np.nanmin(s)]
        # A posture that is held has an effort with its sensor's noise, and nothing else.
        width = max(FREEZE_LIMITS.min_rest_samples, round(FREEZE_LIMITS.min_rest_s * watched.recording.fs))
        held = all(is_only_noise(s, width) for s in moves) or is_at_rest(watched, position, 0, len(q) - 1)
        if moves and not held:
            found = f"a frozen encoder, the one value {measured[0]:z.6g} in every sample"
            yield make_cut(watched.recording, KIND, position, first=0, last=len(q) - 1, found=found)
        return
    few = measured[:: max(1, len(measured) // 1000)]  # which mostly show already that there are more
    if all(len(np.unique(each)) <= FREEZE_LIMITS.max_flicker_levels for each in (few, measured)):
        return  # the last digit of a joint that is held
    min_samples = max(FREEZE_LIMITS.min_rest_samples, round(FREEZE_LIMITS.min_rest_s * watched.recording.fs))
    for a, b, why in frozen_rests(q, effort, reference, min_samples):
        if why != LEAP_AFTER_REST and is_at_rest(watched, position, a, b):
            continue
        found = f"a frozen encoder, the one value {q[a]:z.6g} for {b - a + 1} samples while {why}"
        yield make_cut(watched.recording, KIND, position, first=a, last=b, found=found)


def frozen_rests(
    position: np.ndarray,
    effort: np.ndarray,
    reference: np.ndarray | None,
    min_samples: int = FREEZE_LIMITS.min_rest_samples,
) -> Iterator[tuple[int, int, str]]:
    """Yield first and last sample of each rest that is the encoder's, not the joint's, and what shows that.

    Parameters
    ----------
    position, effort : ndarray, shape (n,) each
        Position of a joint, and what drives it, in any unit.
    reference : ndarray, shape (n,), or None
        What the position is to follow, in its unit.
    min_samples : int
        Shorter rests are not examined.
    """
    first, length = find_runs(repeats_next(position))
    length = length + 1
    long = np.flatnonzero(length >= min_samples)
    if long.size == 0:
        return
    statistics = _MotionStatistics(position, effort, reference)
    for i in long.tolist():
        a, b = int(first[i]), int(first[i] + length[i] - 1)
        why = statistics.why_frozen(a, b)
        if why:
            yield a, b, why


def _reference(watched: WatchedRecording, position: str) -> np.ndarray | None:
    """Return the position's reference; None if there is none, or if it is a velocity."""
    found = watched.reference(position)
    return None if found is None else watched.samples(found.name)


class _MotionStatistics:
    """Statistics of how the joint moves in the whole recording, computed once for all rests."""

    def __init__(self, q: np.ndarray, effort: np.ndarray, reference: np.ndarray | None):
        self.q, self.effort = q, effort
        self.scale = Scale(q)
        self.low, self.high = float(np.nanmin(q)), float(np.nanmax(q))
        self.moved = np.abs(np.diff(q))
        self.moved[~np.isfinite(self.moved)] = 0.0
        self.fastest = np.argsort(self.moved)[-3:] if len(q) < 4 else np.argpartition(self.moved, -3)[-3:]
        self.error = None if reference is None else np.nan_to_num(np.abs(reference - q))

    def why_frozen(self, first: int, last: int) -> str | None:
        """Return why samples `first` to `last` cannot be a rest of the joint itself; None if they can."""
        return (
            self._leap_after_rest(first, last)
            or self._speed_before_rest(first, last)
            or self._departing_reference(first, last)
            or self._moving_effort_during(first, last)
        )

    def _leap_after_rest(self, first: int, last: int) -> str | None:
        elsewhere = [float(self.moved[i]) for i in self.fastest if not first - 1 <= i <= last]
        largest = max(elsewhere, default=0.0)
        if last < len(self.moved) and self.moved[last] > max(3 * largest, 3 * self.scale.resolution) and largest > 0:
            return LEAP_AFTER_REST
        return None

    def _speed_before_rest(self, first: int, last: int) -> str | None:
        scale, stride = self.scale, self.scale.stride
        # A machine rests at its end stop, and arrives there at speed.
        margin = max(0.01 * scale.range, 2.5 * scale.resolution)
        inside = self.low + margin < self.q[first] < self.high - margin
        # A machine that reverses leaves its rest as slowly as it arrived.
        leaves = last >= len(self.moved) or self.moved[last] > 2.5 * scale.resolution
        if inside and leaves and scale.resolved and first > 3 * stride:
            # Two strides at speed up to the last sample: a single step may be two recordings joined into one.
            approach = np.diff(self.q[first - 1 - 2 * stride : first : stride])
            speed = np.abs(approach).min()
            lost = speed / stride * (last - first)
            if speed > 0.35 * scale.typical and lost > 8 * scale.resolution:
                return "the samples before it move at speed"
        return None

    def _departing_reference(self, first: int, last: int) -> str | None:
        if self.error is None or len(self.q) - (last + 1 - first) <= len(self.q) // 4:
            return None
        before, after = self._largest_errors
        usual = max(before[first - 1] if first else 0.0, after[last + 1] if last + 1 < len(after) else 0.0)
        worst = float(self.error[first : last + 1].max())
        if worst > 5 * usual and worst > 0.1 * self.scale.range:
            return f"the reference departs from it by {worst:.4g}, elsewhere by at most {usual:.4g}"
        return None

    @cached_property
    def _largest_errors(self) -> tuple[np.ndarray, np.ndarray]:
        """Largest tracking errors up to each sample, and from each sample on, shape (n,) each."""
        error = np.zeros(len(self.q)) if self.error is None else self.error
        return np.maximum.accumulate(error), np.maximum.accumulate(error[::-1])[::-1]

    def _moving_effort_during(self, first: int, last: int) -> str | None:
        run = self.effort[first : last + 1]
        swings = _count_swings(run, *self._effort_range)
        if swings >= FREEZE_LIMITS.min_swing_count:
            return f"the effort swings {swings} times through most of its range"
        inner = run[1:-1]
        if not self.scale.resolved or not np.isfinite(inner).any():
            return None
        up, down = self._moving_effort
        # A joint that reverses sticks until the effort breaks it away, which takes a little more than to move it.
        margin = FREEZE_LIMITS.breakaway_share * (up - down)
        if up > down and np.nanmax(inner) > up + margin and np.nanmin(inner) < down - margin:
            return f"the effort passes from {np.nanmin(inner):.4g} to {np.nanmax(inner):.4g}, which moves it elsewhere"
        return None

    @cached_property
    def _effort_range(self) -> tuple[float, float]:
        finite = self.effort[np.isfinite(self.effort)]
        return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)

    @cached_property
    def _moving_effort(self) -> tuple[float, float]:
        """Median efforts while the joint moves forth and back; (0, 0) if it does not move both ways."""
        stride, enough = self.scale.stride, 0.25 * self.scale.typical
        velocity, effort = self.q[stride:] - self.q[:-stride], self.effort[stride:]
        forth, back = effort[velocity > enough], effort[velocity < -enough]
        if not (np.isfinite(forth).any() and np.isfinite(back).any()):
            return 0.0, 0.0
        return float(np.nanmedian(forth)), float(np.nanmedian(back))


def _count_swings(run: np.ndarray, lowest: float, highest: float) -> int:
    """Return how many times in turn the effort rises and falls by `swing_share` of its range `lowest` to `highest`."""
    enough = FREEZE_LIMITS.swing_share * (highest - lowest)
    run = run[np.isfinite(run)]
    if run.size == 0 or enough <= 0.0 or np.ptp(run) < enough:
        return 0
    swings, way = 0, 0
    low = high = run[0]
    for value in run[np.flatnonzero(np.diff(run, prepend=np.nan))].tolist():
        low, high = min(low, value), max(high, value)
        if way <= 0 and value - low >= enough:
            swings, way, high = swings + 1, 1, value
        elif way >= 0 and high - value >= enough:
            swings, way, low = swings + 1, -1, value
    return swings
