"""A position that stays the same bits while the machine must have moved."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from ..cut import Cut, cut_of
from .scale import Scale
from .watched import Watched, ending_of, runs, stays

KIND = "frozen_encoder"

SHORTEST = (20, 0.1)
"""Samples, and seconds, of which the larger number is the shortest rest that is looked at."""

BREAKAWAY = 0.5
"""How far beyond what moves a joint either way the effort passes before its rest is an encoder's: a share of the
difference between both ways. A joint sticks while it reverses, and more so under a load or where gravity is larger."""


def find(watched: Watched) -> Iterator[Cut]:
    """Rests of a joint's position that cannot be the joint's own."""
    for position, drive in watched.drives.items():
        if {position, drive} <= set(watched.channels):
            yield from _of_a_joint(watched, position, drive)


def _of_a_joint(watched: Watched, position: str, drive: str) -> Iterator[Cut]:
    q = watched.samples(position)
    finite = np.isfinite(q)
    if not finite.any():
        return
    effort, reference = watched.samples(drive), _reference(watched, position)
    known = q[finite]
    if known.min() == known.max():
        moves = [s for s in (effort, reference) if s is not None and np.nanmax(s, initial=-np.inf) > np.nanmin(s)]
        if moves:
            found = f"a frozen encoder, the one value {known[0]:.6g} in every sample"
            yield cut_of(watched.recording, KIND, position, 0, len(q) - 1, found)
        return
    first, length = runs(stays(q))
    length = length + 1
    long = np.flatnonzero(length >= max(SHORTEST[0], SHORTEST[1] * watched.recording.fs))
    if long.size == 0:
        return
    machine = _Machine(q, effort, reference)
    for i in long.tolist():
        a, b = int(first[i]), int(first[i] + length[i] - 1)
        why = machine.why_frozen(a, b)
        if why:
            found = f"a frozen encoder, the one value {q[a]:.6g} for {length[i]} samples while {why}"
            yield cut_of(watched.recording, KIND, position, a, b, found)


def _reference(watched: Watched, position: str) -> np.ndarray | None:
    """Where the position should be; a velocity loop's reference says nothing of that."""
    channels, name = watched.recording.channels, f"reference{ending_of(position)}"
    if name not in channels or channels[name].unit != channels[position].unit:
        return None
    return watched.samples(name)


class _Machine:
    """What is known of how the machine moves, computed once for every rest."""

    def __init__(self, q: np.ndarray, effort: np.ndarray, reference: np.ndarray | None):
        self.q, self.effort = q, effort
        self.scale = Scale(q)
        self.low, self.high = float(np.nanmin(q)), float(np.nanmax(q))
        self.moved = np.abs(np.diff(q))
        self.moved[~np.isfinite(self.moved)] = 0.0
        self.fastest = np.argsort(self.moved)[-3:] if len(q) < 4 else np.argpartition(self.moved, -3)[-3:]
        self.error = None if reference is None else np.nan_to_num(np.abs(reference - q))

    def why_frozen(self, first: int, last: int) -> str | None:
        """What the rest from `first` to `last` cannot be the joint's for; None where it can."""
        return (
            self._leaves_at_once(first, last)
            or self._arrives_at_speed(first, last)
            or self._departs(first, last)
            or self._driven(first, last)
        )

    def _leaves_at_once(self, first: int, last: int) -> str | None:
        elsewhere = [float(self.moved[i]) for i in self.fastest if not first - 1 <= i <= last]
        largest = max(elsewhere, default=0.0)
        if last < len(self.moved) and self.moved[last] > max(3 * largest, 3 * self.scale.resolution) and largest > 0:
            return f"it then is {self.moved[last]:.4g} away after one sample"
        return None

    def _arrives_at_speed(self, first: int, last: int) -> str | None:
        scale, stride = self.scale, self.scale.stride
        # A machine rests at its end stop, and arrives there at speed.
        margin = max(0.01 * scale.range, 2.5 * scale.resolution)
        inside = self.low + margin < self.q[first] < self.high - margin
        # Where a machine turns around, it leaves a rest as slowly as it came.
        leaves = last >= len(self.moved) or self.moved[last] > 2.5 * scale.resolution
        if inside and leaves and scale.resolved and first > 3 * stride:
            # Two strides at speed up to the last sample: a single step may be two recordings joined into one.
            approach = np.diff(self.q[first - 1 - 2 * stride : first : stride])
            speed = np.abs(approach).min()
            lost = speed / stride * (last - first)
            if speed > 0.35 * scale.typical and lost > 8 * scale.resolution:
                return "the samples before it move at speed"
        return None

    def _departs(self, first: int, last: int) -> str | None:
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
        """Of the samples up to, and from, each one."""
        return np.maximum.accumulate(self.error), np.maximum.accumulate(self.error[::-1])[::-1]

    def _driven(self, first: int, last: int) -> str | None:
        run = self.effort[first : last + 1]
        swings = _swings(run, *self._effort_range)
        if swings >= 3:
            # Fewer may be a test for the effort at which a joint breaks away.
            return f"the effort swings {swings} times through most of its range"
        inner = run[1:-1]
        if not self.scale.resolved or not np.isfinite(inner).any():
            return None
        up, down = self._moving_effort
        # A joint that reverses sticks until the effort breaks it away, which takes a little more than to move it.
        more = BREAKAWAY * (up - down)
        if up > down and np.nanmax(inner) > up + more and np.nanmin(inner) < down - more:
            return f"the effort passes from {np.nanmin(inner):.4g} to {np.nanmax(inner):.4g}, which moves it elsewhere"
        return None

    @cached_property
    def _effort_range(self) -> tuple[float, float]:
        finite = self.effort[np.isfinite(self.effort)]
        return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)

    @cached_property
    def _moving_effort(self) -> tuple[float, float]:
        """Median effort while it moves forth, and back; (0, 0) where it does not move both ways."""
        stride, enough = self.scale.stride, 0.25 * self.scale.typical
        velocity, effort = self.q[stride:] - self.q[:-stride], self.effort[stride:]
        forth, back = effort[velocity > enough], effort[velocity < -enough]
        if not (np.isfinite(forth).any() and np.isfinite(back).any()):
            return 0.0, 0.0
        return float(np.nanmedian(forth)), float(np.nanmedian(back))


def _swings(run: np.ndarray, lowest: float, highest: float) -> int:
    """How many times in a row, up and down, the effort moves by 60 % of its whole range between two samples."""
    enough = 0.6 * (highest - lowest)
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
