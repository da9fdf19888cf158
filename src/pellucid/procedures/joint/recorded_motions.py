"""A study's recordings as motions: evenly sampled, cut where the drive was off, filtered as study.toml says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..._errors import RecordingError
from ...recordings.recording import Recording
from ...recordings.study import Study
from ...recordings.study_file import Processing
from ...signals.effort import DriveModel, command_of, drive_model
from ...signals.filters import runs
from ...signals.motion import Filtering, Motion, motion_of, shortest


def filtering_of(processing: Processing) -> Filtering:
    """A study's [processing], but for its resampling."""
    p = processing
    return Filtering(p.lowpass, p.order, p.decimate, p.dead_band, p.trim)


def motions(study: Study, use: str | None = None) -> tuple[Motion, ...]:
    """Every stretch of every recording of a study in which the drive was enabled, filtered and differentiated."""
    model = drive_model(study.rig)
    return tuple(m for r in study.recordings(use) for m in _stretches(r, study, model))


def _stretches(recording: Recording, study: Study, model: DriveModel) -> Iterator[Motion]:
    processing, loop = study.processing, study.rig.loop
    if "position" not in recording:
        raise RecordingError(
            f"{recording.path}: no channel 'position'; found {', '.join(recording.channels)}. "
            "Identification needs the joint's position in [channels]"
        )
    fs, time, channels = evenly_sampled(recording, processing)
    even = replace(
        recording,
        channels={
            "time": replace(recording.channels["time"], samples=time),
            **{n: replace(recording.channels[n], samples=x) for n, x in channels.items()},
        },
    )
    command = command_of(even, study.rig)
    injected = even[loop.injected] if loop is not None and loop.injected and loop.injected in even else None
    reference = even["reference"] if "reference" in even.channels else None
    filtering = filtering_of(processing)
    fewest = shortest(filtering)
    stretches = [s for s in runs(np.asarray(even.enabled, bool)) if s.stop - s.start >= fewest]
    if not stretches:
        raise RecordingError(
            f"{recording.path}: {len(time)} samples, no enabled stretch of at least {fewest}; "
            "expected a longer recording, a smaller [processing] decimate or trim"
        )
    for part in stretches:
        try:
            yield motion_of(
                time[part],
                even["position"][part],
                command[part],
                filtering,
                gain=model.gain,
                back_emf=model.back_emf,
                fs=fs,
                start=recording.start,
                recording=recording.name,
                split="fitted" if recording.use == "fit" else "heldout",
                reference=None if reference is None else reference[part],
                injected=None if injected is None else injected[part],
                payload=(0.0, 0.0)
                if recording.payload is None
                else (recording.payload.mass, recording.payload.distance),
            )
        except RecordingError as error:
            raise RecordingError(f"{recording.path}: {error}") from None


def evenly_sampled(recording: Recording, processing: Processing) -> tuple[float, np.ndarray, dict[str, np.ndarray]]:
    """Sampling rate [Hz], time, shape (n,), and channels on an even grid; interpolated only where the study says so.
    `processing` [Hz]."""
    time = recording.time
    values = {name: channel.samples for name, channel in recording.channels.items() if name != "time"}
    if processing.resample is None:
        return recording.fs, time, values
    fs = processing.resample
    grid = time[0] + np.arange(int(np.floor((time[-1] - time[0]) * fs)) + 1) / fs
    held = {"enabled"}
    nearest = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, len(time) - 1)
    return fs, grid, {n: x[nearest] if n in held else np.interp(grid, time, x) for n, x in values.items()}
