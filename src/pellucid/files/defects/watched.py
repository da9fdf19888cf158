"""The recording that is searched for defects: the channels that the study reads, without the defects already found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..cut import Cut, sound_samples
from ..recording import Channel, Recording

INERTIAL_CHANNELS = ("position", "motor_position", "angle", "displacement")
"""Channels, by the first part of their names, that cannot jump because a body's inertia prevents it."""

CONTACT_CHANNELS = ("interaction", "moment", "torque", "force")
"""Channels, by the first part of their names, of what two bodies exert on each other. It is exactly zero where they do
not touch, as inside the slack of a strap."""

MAX_CONTACT_LEAP_SHARE = 0.2
"""A contact that ends or begins changes its force within one sample by at most this share of the force's usual size,
its 95th percentile. Chosen by judgement: a strap of 100 N*m/rad that is left at 5 rad/s changes by 1 N*m in 2 ms, and
carries 5 to 10 N*m."""


@dataclass(frozen=True)
class WatchedRecording:
    """A recording with the channels to search, and the study's settings that the search depends on."""

    recording: Recording
    channels: tuple[str, ...]  # names of the channels that the study reads, without time
    drives: Mapping[str, str] = field(default_factory=dict)  # name of the drive's command, by the joint's position
    limits: Mapping[str, tuple[float, ...]] = field(default_factory=dict)  # known limits of each command [SI]
    accepted: frozenset[str] = frozenset()  # channels that may rest at their largest value
    bridged: float = 0.0  # longest gap that the study's interpolation bridges [s]
    cuts: tuple[Cut, ...] = ()  # cuts found so far, beside those of the recording
    regressed: frozenset[str] = frozenset()  # channels that a regression reads; it interpolates their short losses

    def is_drive(self, name: str) -> bool:
        """Whether channel `name` is a drive's command."""
        return name in self.drives.values()

    @cached_property
    def usable(self) -> np.ndarray:
        """Mask of the samples that are neither cut nor recorded with the drive off, shape (n,) bool."""
        return self.recording.sound & self.recording.enabled & sound_samples(len(self.recording), self.cuts)

    def samples(self, name: str) -> np.ndarray:
        """Return a channel's samples, shape (n,) in SI; NaN where they are cut or the drive was off."""
        values = self.recording[name]
        return values if self.usable.all() else np.where(self.usable, values, np.nan)

    def reference(self, position: str) -> Channel | None:
        """Return the channel that a position follows; None without one, or in another unit, such as a velocity's."""
        channels = self.recording.channels
        found = channels.get(f"reference{joint_ending(position)}")
        return found if found is not None and found.unit == channels[position].unit else None

    def without(self, cuts: Iterable[Cut]) -> WatchedRecording:
        """Return a copy in which `cuts` are cut out too."""
        return replace(self, cuts=(*self.cuts, *cuts))


def joint_ending(name: str) -> str:
    """Return the joint's part of a channel's name, such as ``".elbow"``; "" if the rig has a single joint."""
    return name[len(name.partition(".")[0]) :]


def repeats_next(x: np.ndarray) -> np.ndarray:
    """Return a mask of the samples of `x`, (n,), that the next sample repeats, shape (n - 1,) bool.

    The comparison needs less memory than an array of steps, which matters for recordings of hours.
    """
    return (x[1:] == x[:-1]) & np.isfinite(x[1:])


def finite_range(x: np.ndarray) -> tuple[float, float]:
    """Return the smallest and the largest finite number of `x`, (n,); infinity and its negative without one."""
    low, high = float(np.min(x, initial=np.inf)), float(np.max(x, initial=-np.inf))
    if np.isfinite(high - low):  # so that most channels need no mask, which makes NumPy slow
        return low, high
    finite = np.isfinite(x)
    return float(np.min(x, where=finite, initial=np.inf)), float(np.max(x, where=finite, initial=-np.inf))


def find_runs(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return first index and length of each run of True in `mask`."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return edges[::2], np.diff(edges)[::2]


def is_out_of_contact(watched: WatchedRecording, name: str, first: int, last: int) -> bool:
    """Return whether a channel's samples `first` to `last` of one value are those of two bodies that do not touch.

    The value is exactly zero, and the force came to it or left it without a leap. A lost signal leaps at both ends.
    """
    if name.partition(".")[0] not in CONTACT_CHANNELS or watched.is_drive(name):
        return False
    x = watched.samples(name)
    if np.any(x[first : last + 1] != 0.0):
        return False
    beside = [abs(float(x[at])) for at in (first - 1, last + 1) if 0 <= at < len(x)]
    usual = float(np.nanquantile(np.abs(x), 0.95))
    return not beside or min(beside) <= MAX_CONTACT_LEAP_SHARE * usual
