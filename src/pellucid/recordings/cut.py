"""Stretches of a recording that are left out, and what is left between them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .recording import Recording

GAP_STEPS = 1.5
"""A time step longer than this many typical ones is a gap: a sample is missing."""


BEYOND_JITTER = 1.3
"""Neither is a step a gap that is not this many times as long as all but 2 in 100 of a clock that jitters."""

JITTER_SHARE = 0.1
"""Share of the time step by which 1 sample in 100 may be off before samples count as unevenly spaced."""


@dataclass(frozen=True)
class Cut:
    """A stretch of a recording that nothing is made of.

    Attributes
    ----------
    kind : str
        ``"spike"``, ``"gap"``, ``"missing_samples"``, ...; ``"excluded"`` where study.toml says so.
    channel : str
        In which it was found; ``"time"`` where it is of all channels.
    start, stop : float
        Time of its first sample, and of the first one after it [s].
    first, last : int
        Its samples, both included; of a gap, which holds none, `first` is the sample after it and `last` the one
        before.
    found : str
        What, in words.
    by : str
        ``"hand"`` or ``"automatic"``.
    """

    kind: str
    channel: str
    start: float
    stop: float
    first: int
    last: int
    found: str
    by: str = "automatic"

    @property
    def samples(self) -> int:
        """How many samples it holds."""
        return self.last - self.first + 1

    @property
    def where(self) -> str:
        """Its samples in words."""
        if self.samples == 0:
            return f"after sample {self.last}"
        return f"sample {self.first}" if self.samples == 1 else f"samples {self.first} to {self.last}"


def cut_of(recording: Recording, kind: str, channel: str, first: int, last: int, found: str) -> Cut:
    """A recording's samples `first` to `last`, both included; none where `last` is before `first`."""
    time = recording.time
    stop = float(time[last + 1] if last + 1 < len(time) else time[-1] + 1.0 / recording.fs)
    start = float(time[first] if first <= last else time[last])
    return Cut(kind, channel, start, stop, int(first), int(last), found)


def sound_samples(n: int, cuts: Iterable[Cut]) -> np.ndarray:
    """Those of `n` samples that no cut holds, shape (n,) bool."""
    sound = np.ones(n, dtype=bool)
    for cut in cuts:
        sound[cut.first : cut.last + 1] = False
    return sound


def spans_between(n: int, cuts: Iterable[Cut]) -> tuple[slice, ...]:
    """What is left of `n` samples between cuts, in order; a gap ends a span though it holds no sample."""
    spans, start = [], 0
    for cut in sorted(cuts, key=lambda cut: cut.first):
        if cut.first > start:
            spans.append(slice(start, cut.first))
        start = max(start, cut.last + 1)
    return (*spans, slice(start, n)) if start < n else tuple(spans)
