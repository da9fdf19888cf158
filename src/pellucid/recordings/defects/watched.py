"""What a defect is looked for in: the channels that are read, without what was found bad already."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..cut import Cut, sound_samples
from ..recording import Recording

MOTION = ("position", "motor_position", "angle", "displacement")
"""First parts of names of channels that a body's inertia keeps from jumping."""


@dataclass(frozen=True)
class Watched:
    """A recording, and what is known of how it was made."""

    recording: Recording
    channels: tuple[str, ...]  # That are read, time left out
    drives: Mapping[str, str] = field(default_factory=dict)  # Of them, the drive's command by its joint's position
    limits: Mapping[str, tuple[float, ...]] = field(default_factory=dict)  # Known ones of a command, in its SI unit
    accepted: frozenset[str] = frozenset()  # May rest at their largest value
    bridged: float = 0.0  # A gap up to this long is interpolated over, as the study asks [s]
    cuts: tuple[Cut, ...] = ()  # Found so far, beside those of the recording

    def is_drive(self, name: str) -> bool:
        """Whether a channel is a drive's command."""
        return name in self.drives.values()

    @cached_property
    def usable(self) -> np.ndarray:
        """Samples of which something may be made, shape (n,) bool."""
        return self.recording.sound & self.recording.enabled & sound_samples(len(self.recording), self.cuts)

    def samples(self, name: str) -> np.ndarray:
        """A channel, shape (n,) in SI; NaN where it is cut, or the drive was off."""
        values = self.recording[name]
        return values if self.usable.all() else np.where(self.usable, values, np.nan)

    def without(self, cuts: Iterable[Cut]) -> Watched:
        """The same with these cut out too."""
        return replace(self, cuts=(*self.cuts, *cuts))


def ending_of(name: str) -> str:
    """What a joint's channels end in, from the name of one of them: ``".elbow"``; "" where there is one joint alone."""
    return name[len(name.partition(".")[0]) :]


def stays(x: np.ndarray) -> np.ndarray:
    """Which samples of `x`, (n,), the next one repeats, shape (n - 1,) bool; of hours no array of steps is made."""
    return (x[1:] == x[:-1]) & np.isfinite(x[1:])


def runs(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First index and length of each run of True."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return edges[::2], np.diff(edges)[::2]
