"""The pieces of a recording between its cuts, each a recording of its own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from .cut import Cut
from .defects.garbage import KIND as GARBAGE_KIND
from .delay import SHIFTED_KIND
from .recording import EMPTY_END_KIND, Recording, channels_within

UNBROKEN_KINDS = (SHIFTED_KIND, GARBAGE_KIND, EMPTY_END_KIND)
"""Kinds of cuts that break no recording: they lie at its ends, or hold no sample of what is left."""


def breaking_cuts(recording: Recording) -> tuple[Cut, ...]:
    """Return the cuts that break a recording or one of its streams, in order of time."""
    parts = (recording, *recording.streams.values())
    return tuple(sorted((c for part in parts for c in _breaks(part)), key=lambda cut: cut.start))


def pieces_between_cuts(recording: Recording, shortest: float) -> tuple[Recording, ...]:
    """Return the pieces of a recording between the cuts of it and of its streams.

    Parameters
    ----------
    recording : Recording
    shortest : float
        Shortest duration of a piece; shorter ones are excluded [s].

    Returns
    -------
    tuple of Recording
        Without cuts, in order of time, named ``name.1``, ``name.2``, ... The recording itself if nothing breaks it. A
        stream, and the EMG around a window, reach from their own cut before the piece to the one after it, so that a
        filter has the samples around the piece.
    """
    if not breaking_cuts(recording):
        return (recording,)
    lost = [span for part in (recording, *recording.streams.values()) for span in _lost_spans(part)]
    made: list[Recording] = []
    for start, end in _between(lost):
        kept = _within(recording.time, start, end)
        if kept.stop - kept.start < 2 or recording.time[kept.stop - 1] - recording.time[kept.start] < shortest:
            continue
        made.append(_piece(recording, kept, f"{recording.name}.{len(made) + 1}"))
    return tuple(made)


def _piece(recording: Recording, kept: slice, name: str) -> Recording:
    """Return the samples `kept` of a recording, with its streams as far as they are whole around them."""
    middle = 0.5 * float(recording.time[kept.start] + recording.time[kept.stop - 1])
    streams = {key: _whole_around(stream, _lost_spans(stream), middle) for key, stream in recording.streams.items()}
    uncut = recording.uncut
    if uncut is not None:
        uncut = _whole_around(uncut, _lost_spans(recording), middle)
    return replace(
        recording, name=name, piece_of=recording.name, channels=channels_within(recording, kept), streams=streams,
        uncut=uncut, cuts=(),
    )  # fmt: skip


def _whole_around(part: Recording, lost: Iterable[tuple[float, float]], middle: float) -> Recording:
    """Return the stretch of a part around the time `middle` that no span in `lost` breaks."""
    start, end = next((s, e) for s, e in _between(lost) if s <= middle <= e)
    if (start, end) == (-np.inf, np.inf):
        return part
    return replace(part, channels=channels_within(part, _within(part.time, start, end)), cuts=())


def _breaks(part: Recording) -> list[Cut]:
    return [cut for cut in part.cuts if cut.kind not in UNBROKEN_KINDS]


def _lost_spans(part: Recording) -> list[tuple[float, float]]:
    """Return the times of the last sample before each cut and of the first one after it [s]; infinite at the ends."""
    time, n = part.time, len(part)
    return [
        (float(time[c.first - 1]) if c.first > 0 else -np.inf, float(time[c.last + 1]) if c.last + 1 < n else np.inf)
        for c in _breaks(part)
    ]


def _between(lost: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the spans of time between the lost ones, which may overlap [s]."""
    spans, start = [], -np.inf
    for last_before, first_after in sorted(lost):
        if last_before >= start and last_before > -np.inf:
            spans.append((start, last_before))
        start = max(start, first_after)
    return [*spans, (start, np.inf)] if start < np.inf else spans


def _within(time: np.ndarray, start: float, end: float) -> slice:
    """Return the samples from `start` to `end`, both included."""
    return slice(int(np.searchsorted(time, start, "left")), int(np.searchsorted(time, end, "right")))
