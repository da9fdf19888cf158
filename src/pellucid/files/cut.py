"""Cuts, which are excluded stretches of a recording, and the spans between them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

MIN_GAP_STEP_RATIO = 1.5
"""A time step longer than this many usual steps is a gap, because at least one sample is missing there."""

MIN_GAP_JITTER_RATIO = 1.3
"""A time step is a gap only if it is also longer than this many times the 98th percentile of all steps. The bound
keeps the long steps of a clock that jitters. Chosen by judgement; no measurement is recorded."""

MAX_EVEN_JITTER = 0.1
"""Samples count as unevenly spaced if 1 in 100 time steps is off by more than this share of the usual step. Chosen by
judgement; no measurement is recorded."""

DEFAULT_CUT_SHARE = 0.1
"""A recording is used if at most this share of its samples is cut out, unless its study states another share."""

MAX_MISSING_SHARE = 0.5
"""Above this share of missing samples, a recording has other faults than losses. Chosen by judgement."""

BRIDGED_LOWPASS_PERIODS = 0.5
"""Interpolation over a gap of up to so many periods of the low-pass loses nothing that the filter would keep."""


@dataclass(frozen=True)
class Cut:
    """A stretch of a recording that every computation excludes.

    Attributes
    ----------
    kind : str
        Kind of defect: ``"spike"``, ``"gap"``, ``"missing_samples"``, ...; ``"excluded"`` if study.toml excludes it.
    channel : str
        Channel with the defect; ``"time"`` if it concerns all channels.
    start, stop : float
        Time of its first sample, and of the first sample after it [s].
    first, last : int
        Its first and last sample. A gap contains no sample: `first` is then the sample after it, `last` the one before.
    found : str
        Description of the defect.
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
        """Number of samples in the cut."""
        return self.last - self.first + 1

    @property
    def where(self) -> str:
        """Text that names its samples."""
        if self.samples == 0 and self.last < 0:
            return "before sample 0"
        if self.samples == 0:
            return f"after sample {self.last}"
        return f"sample {self.first}" if self.samples == 1 else f"samples {self.first} to {self.last}"


def sound_samples(n: int, cuts: Iterable[Cut]) -> np.ndarray:
    """Return a mask of the samples outside all cuts, shape (n,) bool."""
    sound = np.ones(n, dtype=bool)
    for cut in cuts:
        sound[cut.first : cut.last + 1] = False
    return sound


def spans_between(n: int, cuts: Iterable[Cut]) -> tuple[slice, ...]:
    """Return the spans of `n` samples between the cuts, in order; a gap also ends a span, although it has no sample."""
    spans, start = [], 0
    for cut in sorted(cuts, key=lambda cut: cut.first):
        if cut.first > start:
            spans.append(slice(start, cut.first))
        start = max(start, cut.last + 1)
    return (*spans, slice(start, n)) if start < n else tuple(spans)
