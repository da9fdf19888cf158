"""Bring channels onto one clock: shift those that are late, undo lags, and join another instrument's channels.

Channels are interpolated at the recording's own times, and never across a cut.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from .._errors import RecordingError
from .cut import MIN_GAP_STEP_RATIO
from .defects.watched import find_runs
from .recording import Channel, Recording, channels_within, make_cut

SHIFTED_KIND = "moved"
"""Kind of a cut in which a shifted channel has no sample. Reports list the delay, but not these cuts."""

TIME_TOLERANCE = 1e-6
"""A time counts as that of a sample if both differ by at most this share of a step."""


def shift_channels(recording: Recording, delays: Mapping[str, float]) -> Recording:
    """Return the recording with each channel of `delays` shifted to earlier times by its delay [s].

    The result is shortened to the time that all channels cover.
    """
    delays = {name: delay for name, delay in delays.items() if delay != 0.0 and name in recording}
    if not delays or not advances_within_spans(recording):
        return recording  # a later check refuses time that does not increase
    time, channels = recording.time, {}
    for name, delay in delays.items():
        old, new = recording[name], np.full(len(time), np.nan)
        for span in recording.spans:
            new[span] = interpolate_at(
                time[span], old[span], time[span] + delay, hold=name.partition(".")[0] == "enabled"
            )
        channels[name] = replace(recording.channels[name], samples=new)
    lost = np.any([np.isnan(c.samples) & ~np.isnan(recording[name]) for name, c in channels.items()], axis=0)
    return replace_channels(recording, channels, lost)


def advances_within_spans(recording: Recording) -> bool:
    """Whether time increases within every span between cuts."""
    if recording.steps_within(np.inf):  # found once, with some samples in memory at a time
        return True
    return all((np.diff(recording.time[span]) > 0.0).all() for span in recording.spans)


def undo_lags(recording: Recording, lags: Mapping[str, float]) -> Recording:
    """Return the recording with the first-order lag of each channel of `lags` undone: x + lag * dx/dt, lags [s]."""
    lags = {name: lag for name, lag in lags.items() if name in recording}
    if not lags or not advances_within_spans(recording):
        return recording
    channels = dict(recording.channels)
    for name, lag in lags.items():
        samples = np.array(recording[name])
        for span in recording.spans:
            if span.stop - span.start > 2:
                samples[span] += lag * np.gradient(samples[span], recording.time[span])
        channels[name] = replace(channels[name], samples=samples)
    return replace(recording, channels=channels)


def replace_channels(
    recording: Recording,
    channels: Mapping[str, Channel],
    lost: np.ndarray,
    *,
    kind: str = SHIFTED_KIND,
    found: str = "",
) -> Recording:
    """Return the recording with `channels` added or replaced, without the samples in which they are `lost`, (n,) bool.

    Lost samples at either end shorten the recording. Elsewhere they become cuts with a `kind` and the text `found`.
    """
    inside = np.zeros(len(recording), bool)
    for span in recording.spans:
        inside[span] = True
    channels = {**recording.channels, **channels}
    kept = np.flatnonzero(~lost)
    if not kept.size:
        everything = make_cut(recording, kind, "time", first=0, last=len(lost) - 1, found=found)
        return replace(recording, channels=channels, cuts=(*recording.cuts, everything))
    whole = slice(int(kept[0]), int(kept[-1]) + 1)
    firsts, lengths = find_runs((lost & inside)[whole])
    cuts = [
        make_cut(recording, kind, "time", first=first, last=first + length - 1, found=found)
        for first, length in zip(whole.start + firsts, lengths, strict=True)
    ]
    return recording_part(replace(recording, channels=channels, cuts=(*recording.cuts, *cuts)), whole.start, whole.stop)


def recording_part(recording: Recording, first: int, stop: int) -> Recording:
    """Return a recording's samples from `first` to before `stop`, with the cuts among them."""
    cuts = (cut for cut in recording.cuts if cut.last >= first and cut.first < stop)
    within = (
        replace(cut, first=max(cut.first, first) - first, last=min(cut.last, stop - 1) - first)
        for cut in sorted(cuts, key=lambda cut: cut.first)
    )
    return replace(recording, channels=channels_within(recording, slice(first, stop)), cuts=tuple(within))


def interpolate_at(time: np.ndarray, samples: np.ndarray, wanted: np.ndarray, *, hold: bool = False) -> np.ndarray:
    """Interpolate samples, (n,) at `time`, (n,) [s], at the times `wanted`, (m,), by cubics through neighbours.

    With `hold` the last sample counts instead. The result is NaN outside the record and next to a missing sample.
    """
    n = len(time)
    if n < 2:
        return np.full(len(wanted), np.nan)
    step = float(np.median(np.diff(time)))
    left = np.clip(np.searchsorted(time, wanted, side="right") - 1, 0, n - 2)
    width = time[left + 1] - time[left]
    x = (wanted - time[left]) / width
    near = TIME_TOLERANCE * step / width
    known = (x > -near) & (x < 1.0 + near)
    start, end = samples[left], samples[left + 1]
    on = np.abs(x) <= near, np.abs(x - 1.0) <= near
    if hold:
        value = np.where(x >= 1.0 - near, end, start)
    else:
        slope = _slopes(time, samples)
        # A straight line replaces the cubic if a neighbour is missing.
        chord = (end - start) / width
        first, last = (np.where(np.isfinite(s), s, chord) * width for s in (slope[left], slope[left + 1]))
        rise = end - start
        value = start + x * (first + x * (3.0 * rise - 2.0 * first - last + x * (first + last - 2.0 * rise)))
        value = np.where(on[0], start, np.where(on[1], end, value))
    return np.where(known, value, np.nan)


def _slopes(time: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return the slope at each sample of the parabola through it and its neighbours, shape (n,)."""
    if len(time) < 3:
        return np.full(len(time), np.nan)
    return np.gradient(samples, time)


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
    steps = 0.5 * np.diff(time) * (samples[1:] + samples[:-1])
    whole = np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(steps), steps, 0.0))])
    # At the stream's ends the mean is over the part of the width that it covers.
    begin, end = (np.clip(at + side * width, time[0], time[-1]) for side in (-0.5, 0.5))
    covered = np.where(end > begin, end - begin, np.nan)
    mean = (interpolate_at(time, whole, end) - interpolate_at(time, whole, begin)) / covered
    return np.where(np.isnan(interpolate_at(time, samples, at)), np.nan, mean)
