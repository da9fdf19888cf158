"""Find gaps: stretches of time without any sample."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .watched import WatchedRecording

KIND = "gap"


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for each time step that is longer than a clock's jitter explains and longer than what is bridged."""
    max_step = max(watched.recording.longest_step, watched.bridged)
    if watched.recording.steps_within(max_step):
        return
    time, step = watched.recording.time, 1.0 / watched.recording.fs
    steps = np.diff(time)
    if np.any(steps <= 0.0):
        return
    for before in np.flatnonzero(steps > max_step).tolist():
        if watched.usable[before] and watched.usable[before + 1]:
            found = f"a gap of {steps[before]:.4g} s instead of {step:.4g} s"
            yield make_cut(watched.recording, KIND, "time", first=before + 1, last=before, found=found)
