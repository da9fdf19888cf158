"""Join another instrument's channels to a recording, resampled at the recording's own times."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from .._errors import RecordingError
from .cut import MIN_GAP_STEP_RATIO
from .delay import interpolate_at, replace_channels
from .recording import Recording

MIN_SHARED_SHARE = 0.5
"""A stream that overlaps at least this share of the recording is taken to have the same clock. Otherwise both are taken
to begin together."""


def join_stream(recording: Recording, stream: Recording, offset: float, drift: float) -> Recording:
    """Return the recording with a stream's channels, whose clock shows time * (1 + `drift`) + `offset` [s].

    The result covers the time in which both were recorded, without the stream's cuts.
    """
    repeated = [name for name in stream.channels if name != "time" and name in recording]
    if repeated:
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found {', '.join(repeated)} in {recording.path.name} too, "
            "expected each channel once"
        )
    time = recording.time
    at = time + (offset + drift * time)
    step = 1.0 / recording.fs
    # The samples of a faster instrument are averaged over each time step, which avoids aliasing of its noise.
    width = step if stream.fs > 1.5 * recording.fs else 0.0
    channels, lost = {}, np.ones(len(time), bool)
    spans = [part for span in stream.spans for part in _without_gaps(stream.time, span)]
    for span in spans:
        lost &= np.isnan(interpolate_at(stream.time[span], np.zeros(span.stop - span.start), at))
    for name, channel in stream.channels.items():
        if name == "time":
            continue
        values, hold = np.full(len(time), np.nan), name.partition(".")[0] == "enabled"
        for span in spans:
            resampled = _resample(stream.time[span], channel.samples[span], at, width, hold=hold)
            values = np.where(np.isnan(values), resampled, values)
        channels[name] = replace(channel, samples=values)
    if lost.all():
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found times from {stream.time[0]:.6g} s to "
            f"{stream.time[-1]:.6g} s, with an offset of {offset:.6g} s none of the recording's; expected some of "
            f"{at[0]:.6g} s to {at[-1]:.6g} s"
        )
    found = f"no sample of {', '.join(channels)} in {stream.path.name}"
    return replace_channels(recording, channels, lost, kind="gap", found=found)


def initial_offset(recording: Recording, stream: Recording) -> float:
    """Return the first guess of a stream's offset [s]: 0 on the same clock, otherwise as if both began together."""
    begin, end = recording.time[0], recording.time[-1]
    shared = min(end, stream.time[-1]) - max(begin, stream.time[0])
    return 0.0 if shared >= MIN_SHARED_SHARE * (end - begin) else float(stream.time[0] - begin)


def _without_gaps(time: np.ndarray, span: slice) -> list[slice]:
    """Return the parts of a span between its gaps."""
    steps = np.diff(time[span])
    if not steps.size:
        return []
    # An uneven clock has longer usual steps than its median, so the 99th percentile counts too.
    usual = max(float(np.median(steps)), float(np.quantile(steps, 0.99)))
    ends = [span.start, *(span.start + 1 + np.flatnonzero(steps > MIN_GAP_STEP_RATIO * usual)).tolist(), span.stop]
    return [slice(a, b) for a, b in pairwise(ends) if b - a > 1]


def _resample(time: np.ndarray, samples: np.ndarray, at: np.ndarray, width: float, *, hold: bool) -> np.ndarray:
    """Return samples, (n,), interpolated at the times `at`, (m,), or averaged over a `width` around each [s]."""
    if width == 0.0 or hold or len(time) < 3:
        return interpolate_at(time, samples, at, hold=hold)
    known = np.isfinite(samples)
    steps = 0.5 * np.diff(time) * (samples[1:] + samples[:-1])
    whole = np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(steps), steps, 0.0))])
    mean = (interpolate_at(time, whole, at + 0.5 * width) - interpolate_at(time, whole, at - 0.5 * width)) / width
    if known.all():
        return mean
    return np.where(np.isnan(interpolate_at(time, samples, at)), np.nan, mean)
