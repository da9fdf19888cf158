"""Trim the ends of a recording at which channels that are needed have no samples.

An amplifier is stopped before the motion capture, or started after it, and exports fill the rest with empty cells. What
lies between the ends is whole, and is used.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from .cut import Cut
from .recording import Recording

EMPTY_END_KIND = "empty_end"
"""Kind of the cut that tells what was trimmed. It holds no sample of what is left."""

MAX_TRIMMED_SHARE = 0.5
"""A recording is trimmed only if at least half of it is left. Chosen by judgement; no measurement is recorded."""


def trim_missing_ends(recording: Recording, channels: Collection[str]) -> Recording:
    """Return a recording without the rows at its ends in which one of some channels has no sample (NaN).

    Missing samples between two whole parts stay, and so does everything if less than half would be left.
    """
    missing = [~np.isfinite(recording[name]) for name in channels]
    if not missing:
        return recording
    whole = np.flatnonzero(~np.any(missing, axis=0))
    if not len(whole):
        return recording
    lacking = [
        name
        for name, lost in zip(channels, missing, strict=True)
        if lost[: whole[0]].any() or lost[whole[-1] + 1 :].any()
    ]
    text = f"no samples (NaN) of {', '.join(lacking)}"
    return _keep_rows(recording, slice(int(whole[0]), int(whole[-1]) + 1), text)


def within_streams(recording: Recording) -> Recording:
    """Return a recording cut to the times of those of its streams whose ends were trimmed."""
    for name, stream in recording.streams.items():
        if not any(cut.kind == EMPTY_END_KIND for cut in stream.cuts):
            continue
        first = int(np.searchsorted(recording.time, stream.time[0]))
        kept = slice(first, int(np.searchsorted(recording.time, stream.time[-1], side="right")))
        recording = _keep_rows(recording, kept, f"nothing of the stream {name}, which was trimmed")
    return recording


def _keep_rows(recording: Recording, kept: slice, text: str) -> Recording:
    """Return some rows of a recording, with a cut at each end that was trimmed; all if too few would be left."""
    n = len(recording)
    if (kept.start, kept.stop) == (0, n) or kept.stop - kept.start < max(2, (1.0 - MAX_TRIMMED_SHARE) * n):
        return recording
    channels = {name: replace(c, samples=c.samples[kept]) for name, c in recording.channels.items()}
    time, left = recording.time, kept.stop - kept.start
    cuts = [
        replace(cut, first=cut.first - kept.start, last=cut.last - kept.start)
        for cut in recording.cuts
        if cut.first < kept.stop and cut.last >= kept.start
    ]
    if kept.start:
        found = f"{text} in the first {kept.start} of {n} rows"
        cuts.insert(0, Cut(EMPTY_END_KIND, "time", float(time[0]), float(time[kept.start]), 0, -1, found))
    if kept.stop < n:
        found = f"{text} in the last {n - kept.stop} of {n} rows"
        at = float(time[kept.stop - 1])
        cuts.append(Cut(EMPTY_END_KIND, "time", at, at, left, left - 1, found))
    return replace(recording, channels=channels, cuts=tuple(cuts))
