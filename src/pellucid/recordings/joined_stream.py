"""Channels of another instrument's file, taken over onto the recording's own time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from .._errors import RecordingError
from .cut import GAP_STEPS
from .delay import at_times, with_channels
from .recording import Recording

LEAST_SHARED = 0.5
"""Share of a recording that a stream on the same clock has seen; one that has seen less is taken to begin with it."""


def joined(recording: Recording, stream: Recording, offset: float, drift: float) -> Recording:
    """The recording with a stream's channels, whose clock shows time * (1 + `drift`) + `offset` [s]; only where both
    were recorded, and not across a cut of the stream."""
    twice = [name for name in stream.channels if name != "time" and name in recording]
    if twice:
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found {', '.join(twice)} in {recording.path.name} too, "
            "expected each channel once"
        )
    time = recording.time
    at = time + (offset + drift * time)
    step = 1.0 / recording.fs
    # Of a faster instrument each step's mean: single samples would fold its noise into the recording.
    width = step if stream.fs > 1.5 * recording.fs else 0.0
    channels, lost = {}, np.ones(len(time), bool)
    spans = [part for span in stream.spans for part in _without_gaps(stream.time, span)]
    for span in spans:
        lost &= np.isnan(at_times(stream.time[span], np.zeros(span.stop - span.start), at))
    for name, channel in stream.channels.items():
        if name == "time":
            continue
        values, hold = np.full(len(time), np.nan), name.partition(".")[0] == "enabled"
        for span in spans:
            found = _taken(stream.time[span], channel.samples[span], at, width, hold=hold)
            values = np.where(np.isnan(values), found, values)
        channels[name] = replace(channel, samples=values)
    if lost.all():
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found times from {stream.time[0]:.6g} s to "
            f"{stream.time[-1]:.6g} s, with an offset of {offset:.6g} s none of the recording's; expected some of "
            f"{at[0]:.6g} s to {at[-1]:.6g} s"
        )
    return with_channels(recording, channels, lost, "gap", f"no sample of {', '.join(channels)} in {stream.path.name}")


def first_offset(recording: Recording, stream: Recording) -> float:
    """Where to look for a stream's offset first [s]: none on the same clock, else both begin together."""
    begin, end = recording.time[0], recording.time[-1]
    shared = min(end, stream.time[-1]) - max(begin, stream.time[0])
    return 0.0 if shared >= LEAST_SHARED * (end - begin) else float(stream.time[0] - begin)


def _without_gaps(time: np.ndarray, span: slice) -> list[slice]:
    """A span in the parts between its gaps."""
    steps = np.diff(time[span])
    if not steps.size:
        return []
    # Of an uneven clock the longest usual step counts.
    usual = max(float(np.median(steps)), float(np.quantile(steps, 0.99)))
    ends = [span.start, *(span.start + 1 + np.flatnonzero(steps > GAP_STEPS * usual)).tolist(), span.stop]
    return [slice(a, b) for a, b in pairwise(ends) if b - a > 1]


def _taken(time: np.ndarray, samples: np.ndarray, at: np.ndarray, width: float, *, hold: bool) -> np.ndarray:
    """Samples, (n,), at the times `at`, (m,), or their means over a `width` around them [s]."""
    if width == 0.0 or hold or len(time) < 3:
        return at_times(time, samples, at, hold=hold)
    known = np.isfinite(samples)
    steps = 0.5 * np.diff(time) * (samples[1:] + samples[:-1])
    whole = np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(steps), steps, 0.0))])
    mean = (at_times(time, whole, at + 0.5 * width) - at_times(time, whole, at - 0.5 * width)) / width
    if known.all():
        return mean
    return np.where(np.isnan(at_times(time, samples, at)), np.nan, mean)
