"""Find missing samples: NaN in time or in a channel that the study reads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ..cut import Cut
from ..delay import interpolate_at
from ..recording import Recording, make_cut
from .watched import WatchedRecording, find_runs

KIND = "missing_samples"


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for each run of NaN while the drive was on."""
    for name in ("time", *watched.channels):
        for first, length in zip(*find_runs(~np.isfinite(watched.recording[name]) & watched.usable), strict=True):
            many = "1 missing sample" if length == 1 else f"{length} missing samples"
            yield make_cut(watched.recording, KIND, name, first=first, last=first + length - 1, found=f"{many} (NaN)")


def interpolate_short_losses(recording: Recording, names: Iterable[str], longest: float) -> Recording:
    """Return a recording whose runs of NaN in the channels `names` are interpolated if they last at most `longest` [s].

    A run lasts from the sample before it to the one after it, both of which have to be sound.
    """
    time, usable = recording.time, recording.sound & recording.enabled
    filled, bridged = {}, np.zeros(len(recording), bool)
    for name in names:
        x = np.where(usable, recording[name], np.nan)
        lost, known = np.zeros(len(x), bool), np.isfinite(x)
        for first, length in zip(*find_runs(~known & usable), strict=True):
            after = first + length
            if first > 0 and after < len(x) and known[first - 1] and known[after]:
                lost[first:after] = time[after] - time[first - 1] <= longest
        if lost.any():
            samples = np.array(recording[name])
            samples[lost] = interpolate_at(time[known], x[known], time[lost])
            filled[name] = replace(recording.channels[name], samples=samples)
            bridged |= lost
    if not filled:
        return recording
    return replace(recording, channels={**recording.channels, **filled}, bridged=int(bridged.sum()))
