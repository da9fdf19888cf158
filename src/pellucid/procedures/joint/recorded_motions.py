"""A study's recordings as motions: evenly sampled, cut where the drive was off, filtered as study.toml says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import RecordingError
from ...recordings.quality import Fault
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


def motions_of(recordings: Iterable[Recording], study: Study) -> tuple[Motion, ...]:
    """Every stretch of `recordings` of a study in which nothing was cut out and the drive was enabled, filtered and
    differentiated."""
    model = drive_model(study.rig)
    return tuple(m for r in recordings for m in _motions_of(r, study, model))


def left_out(study: Study) -> list[Fault]:
    """Stretches between cuts that are too short to be used."""
    faults = []
    for recording in study.recordings():
        processing = study.processing_of(recording)
        fewest = shortest(filtering_of(processing))
        for stretch in stretches_of(recording, processing) if recording.cuts else ():
            n = len(stretch.time)
            if n < fewest:
                found = f"{n} samples between cuts, from {stretch.time[0]:.6g} s to {stretch.time[-1]:.6g} s"
                where = f"{recording.path.name} (recording {recording.name})"
                message = f"{where}: found {found}, expected at least {fewest}; left out"
                faults.append(
                    Fault("cut", "short_stretch", recording.path.name, "time", found, f"{fewest} samples", message)
                )
    return faults


def _motions_of(recording: Recording, study: Study, model: DriveModel) -> Iterator[Motion]:
    processing, loop = study.processing_of(recording), study.rig.loop
    if "position" not in recording:
        raise RecordingError(
            f"{recording.path}: no channel 'position'; found {', '.join(recording.channels)}. "
            "Identification needs the joint's position in [channels]"
        )
    filtering = filtering_of(processing)
    fewest = shortest(filtering)
    stretches = [s for s in stretches_of(recording, processing) if len(s.time) >= fewest]
    if not stretches:
        raise RecordingError(
            f"{recording.path}: {len(recording)} samples, no enabled stretch of at least {fewest}; "
            "expected a longer recording, a smaller [processing] decimate or trim"
        )
    for stretch in stretches:
        command = command_of(stretch.recording, study.rig)
        injected = loop.injected if loop is not None else None
        try:
            yield motion_of(
                stretch.time,
                stretch.recording["position"],
                command,
                filtering,
                gain=model.gain,
                back_emf=model.back_emf,
                fs=stretch.fs,
                start=stretch.start,
                velocity=stretch.recording["velocity"] if processing.velocity == "recorded" else None,
                recording=recording.name,
                split="fitted" if recording.use == "fit" else "heldout",
                reference=stretch.recording["reference"] if "reference" in recording else None,
                injected=stretch.recording[injected] if injected and injected in recording else None,
                payload=(0.0, 0.0)
                if recording.payload is None
                else (recording.payload.mass, recording.payload.distance),
            )
        except RecordingError as error:
            raise RecordingError(f"{recording.path}: {error}") from None


@dataclass(frozen=True)
class Stretch:
    """Consecutive samples of a recording on an even grid, with the drive enabled."""

    recording: Recording
    fs: float
    start: str

    @property
    def time(self) -> np.ndarray:
        """Shape (n,) [s]."""
        return self.recording.time


def stretches_of(recording: Recording, processing: Processing) -> Iterator[Stretch]:
    """Every stretch of a recording in which nothing was cut out and the drive was enabled."""
    for span in recording.spans:
        fs, channels = evenly_sampled(recording, span, processing)
        enabled = channels["enabled"] != 0.0 if "enabled" in channels else np.ones(len(channels["time"]), bool)
        for part in runs(enabled):
            cut = {n: replace(recording.channels[n], samples=x[part]) for n, x in channels.items()}
            # Where it was cut the machine moves, wherever the recording itself begins.
            start = "measured" if part.start == 0 and span.start > 0 else recording.start
            yield Stretch(replace(recording, channels=cut, cuts=()), fs, start)


def evenly_sampled(recording: Recording, span: slice, processing: Processing) -> tuple[float, dict[str, np.ndarray]]:
    """Sampling rate [Hz] and channels, each shape (n,), of a span on an even grid; interpolated only where the study
    says so."""
    values = {name: channel.samples[span] for name, channel in recording.channels.items()}
    if processing.resample is None:
        return recording.fs, values
    fs, time = processing.resample, values["time"]
    grid = time[0] + np.arange(int(np.floor((time[-1] - time[0]) * fs)) + 1) / fs
    held = {"enabled"}
    nearest = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, len(time) - 1)
    even = {n: x[nearest] if n in held else np.interp(grid, time, x) for n, x in values.items() if n != "time"}
    return fs, {"time": grid, **even}
