"""A study's recordings as motions: evenly sampled, cut where the drive was off, filtered as study.toml says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import RecordingError
from ...recordings.cut import MAX_EVEN_JITTER
from ...recordings.delay import interpolate_at
from ...recordings.fault import Fault
from ...recordings.recording import Recording, channels_within
from ...recordings.study import Study
from ...recordings.study_file import Processing
from ...signals.effort import DriveModel, command_of, drive_model
from ...signals.even_times import even_times
from ...signals.filters import runs
from ...signals.long_motion import MIN_LONG_SAMPLES, pieces
from ...signals.motion import Filtering, Motion, motion_of, shortest

EXCERPT = 12_000
"""Samples of fitted recordings, and of held-out ones, that simulations and what needs them get where there are more."""

PARTS = 4
"""Parts of an excerpt, of one recording."""

FEWEST_ROWS = 100
"""Rows that each part gives at least."""


def filtering_of(processing: Processing) -> Filtering:
    """A study's [processing], but for its resampling."""
    p = processing
    return Filtering(p.lowpass, p.order, p.decimate, p.dead_band, p.trim)


def motions_of(recordings: Iterable[Recording], study: Study) -> tuple[Motion, ...]:
    """Every stretch of `recordings` of a study in which nothing was cut out and the drive was enabled, filtered and
    differentiated."""
    model = drive_model(study.rig)
    return tuple(m for r in recordings for m in _motions_of(r, study, model))


@dataclass(frozen=True)
class Excerpt:
    """Parts of long recordings as they were sampled: what would take hours on all of them is done on these."""

    motions: tuple[Motion, ...]
    said: str  # How much of what, in words; empty where it is everything


def excerpt_of(recordings: Iterable[Recording], study: Study, everything: tuple[Motion, ...]) -> Excerpt:
    """`everything` itself, the motions of all `recordings`, where it is little; parts of each recording otherwise."""
    long = [m for m in everything if m.command is None]
    samples = {s: sum(len(m.position) for m in everything if m.split == s) for s in ("fitted", "heldout")}
    if not long and max(samples.values()) < MIN_LONG_SAMPLES:
        return Excerpt(everything, "")
    model, made, told = drive_model(study.rig), [], []
    for recording in recordings:
        needed = shortest(filtering_of(study.processing_of(recording)))
        least = PARTS * (needed + everything[0].filtering.decimate * FEWEST_ROWS)
        split = "fitted" if recording.use == "fit" else "heldout"
        share = len(recording) / max(samples[split], 1)
        parts = list(_motions_of(recording, study, model, within=max(int(EXCERPT * min(share, 1.0)), least)))
        made += parts
        lasts = sum(m.time[-1] - m.time[0] for m in parts)
        told.append(f"{lasts:.0f} s of {recording.name} from {', '.join(f'{m.time[0]:.0f}' for m in parts)} s")
    return Excerpt(tuple(made), "; ".join(told[:4]) + (f" and of {len(told) - 4} more" if len(told) > 4 else ""))


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


def _motions_of(recording: Recording, study: Study, model: DriveModel, within: int | None = None) -> Iterator[Motion]:
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
    if within is not None:
        stretches = _parts(stretches, within)
    for stretch in stretches:
        command = command_of(stretch.recording, study.rig)
        injected = loop.injected if loop is not None else None
        more = dict(
            gain=model.gain,
            back_emf=model.back_emf,
            fs=stretch.fs,
            start=stretch.start,
            recording=recording.name,
            split="fitted" if recording.use == "fit" else "heldout",
            velocity=stretch.recording["velocity"] if processing.velocity == "recorded" else None,
            payload=(0.0, 0.0) if recording.payload is None else (recording.payload.mass, recording.payload.distance),
        )
        arrays = stretch.time, stretch.recording["position"], command
        try:
            if len(stretch.time) >= MIN_LONG_SAMPLES:
                yield from pieces(*arrays, filtering, **more)
                continue
            yield motion_of(
                *arrays,
                filtering,
                reference=stretch.recording["reference"] if "reference" in recording else None,
                injected=stretch.recording[injected] if injected and injected in recording else None,
                **more,
            )
        except RecordingError as error:
            raise RecordingError(f"{recording.path}: {error}") from None


def _parts(stretches: list[Stretch], samples: int) -> list[Stretch]:
    """About so many `samples` of them: parts of equal length, as far apart as may be."""
    whole = sum(len(s.time) for s in stretches)
    if whole <= samples:
        return stretches
    length, made, before = samples // PARTS, [], 0
    places = [(i + 0.5) * whole / PARTS for i in range(PARTS)]
    for stretch in stretches:
        n = len(stretch.time)
        for place in (x for x in places if before <= x < before + n):
            first = int(np.clip(place - before - length // 2, 0, max(n - length, 0)))
            made.append(stretch.part(slice(first, min(first + length, n))))
        before += n
    return made


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

    def part(self, samples: slice) -> Stretch:
        """Some of its samples."""
        start = "measured" if samples.start else self.start
        return Stretch(replace(self.recording, channels=channels_within(self.recording, samples)), self.fs, start)


def stretches_of(recording: Recording, processing: Processing) -> Iterator[Stretch]:
    """Every stretch of a recording in which nothing was cut out and the drive was enabled."""
    for span in recording.spans:
        fs, channels = evenly_sampled(recording, span, processing)
        enabled = np.ones(len(channels["time"]), bool)
        for name in channels:
            if name.partition(".")[0] == "enabled":
                enabled &= channels[name] != 0.0
        for part in runs(enabled):
            cut = {n: replace(recording.channels[n], samples=x[part]) for n, x in channels.items()}
            # Where it was cut the machine moves, wherever the recording itself begins.
            start = "measured" if part.start == 0 and span.start > 0 else recording.start
            yield Stretch(replace(recording, channels=cut, cuts=()), fs, start)


def evenly_sampled(recording: Recording, span: slice, processing: Processing) -> tuple[float, dict[str, np.ndarray]]:
    """Sampling rate [Hz] and channels, each shape (n,), of a span on an even grid; interpolated only where the study
    says so or the clock jitters."""
    values = {name: channel.samples[span] for name, channel in recording.channels.items()}
    jitters = recording.jitter > MAX_EVEN_JITTER
    if processing.resample is None and not jitters:
        return recording.fs, values
    fs, time = processing.resample or recording.fs, recording.clock.time[span] if jitters else values["time"]
    if processing.resample is None and recording.stamped_evenly and len(time) > 2:
        step, first = np.polyfit(np.arange(len(time)), time, 1)
        line = first + step * np.arange(len(time))
        if np.abs(time - line).max() <= MAX_EVEN_JITTER * step:
            return 1.0 / step, {**values, "time": line}
        # Packets that come in batches leave a usual step between stamps that says nothing of the rate.
        fs = (len(time) - 1) / float(time[-1] - time[0])
    grid = even_times(time, fs)
    held = {name for name in values if name.partition(".")[0] == "enabled"}
    nearest = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, len(time) - 1)
    # Where nobody asked for straight lines there are cubics through neighbours, which lose less.
    curved = processing.resample is None
    even = {
        n: x[nearest] if n in held else interpolate_at(time, x, grid) if curved else np.interp(grid, time, x)
        for n, x in values.items()
        if n != "time"
    }
    return fs, {"time": grid, **even}
