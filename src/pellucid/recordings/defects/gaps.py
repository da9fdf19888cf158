"""Stretches of time without any sample."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..cut import Cut, cut_of
from .watched import Watched

KIND = "gap"


def find(watched: Watched) -> Iterator[Cut]:
    """Every step of time that is longer than what a clock's jitter makes, and than what is interpolated over."""
    most = max(watched.recording.longest_step, watched.bridged)
    if watched.recording.steps_within(most):
        return
    time, step = watched.recording.time, 1.0 / watched.recording.fs
    steps = np.diff(time)
    if np.any(steps <= 0.0):
        return
    for before in np.flatnonzero(steps > most):
        if watched.usable[before] and watched.usable[before + 1]:
            found = f"a gap of {steps[before]:.4g} s instead of {step:.4g} s"
            yield cut_of(watched.recording, KIND, "time", before + 1, before, found)
