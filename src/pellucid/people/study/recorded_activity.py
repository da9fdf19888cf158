"""Muscle activity of a recording, for the EMG/Acc index."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._errors import RecordingError
from ...emg.signals.emg_chain import EmgChain, emg_chain
from ...files.recording import Recording
from ..emg_index import Activity
from .pointing import PointingSettings


def activity(recording: Recording, spec: PointingSettings) -> Activity | None:
    """Return the EMG of a recording, processed as published except for normalisation, which needs all recordings."""
    muscles = (*spec.agonists, *spec.antagonists)
    names = [f"emg.{muscle}" for muscle in muscles]
    source = recording.stream_or_self(spec.emg)
    present = [name for name in names if name in source]
    if not present:
        return None
    if len(present) < len(names):
        absent = ", ".join(name for name in names if name not in present)
        raise RecordingError(
            f"{source.path.name} (recording {recording.name}): found {', '.join(present)}, expected {absent} too"
        )
    chain = _chain(spec.advance)
    whole = source.uncut or source
    half = 0.5 / source.fs
    inside = slice(*map(int, np.searchsorted(whole.time, (source.time[0] - half, source.time[-1] + half))))
    rectified = {}
    for muscle, name in zip(muscles, names, strict=True):
        channel = whole.channels[name]
        try:
            if channel.unit == "1":
                rectified[muscle] = _later(channel.samples, round(spec.advance * source.fs))[inside]
            else:
                rectified[muscle] = chain.zero_phase(channel.samples, source.fs, inside=inside)
        except RecordingError as error:
            raise RecordingError(f"{source.path.name} (recording {recording.name}), {name}: {error}") from None
    return Activity(source.time, rectified, {muscle: float(samples.max()) for muscle, samples in rectified.items()})


def _chain(advance: float) -> EmgChain:
    """Return the published chain without normalisation, with this advance."""
    published = emg_chain("able")
    stages = [stage for stage in published.stages if stage.kind != "normalise"]
    return replace(published, stages=tuple(replace(s, seconds=advance) if s.kind == "advance" else s for s in stages))


def _later(samples: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate((np.full(count, samples[0]), samples[: len(samples) - count]))
