"""Turn a study's recordings into motions: evenly sampled, cut where the drive was off, and filtered.

From what a drive reports (current, voltage, duty, torque) to the effort at the joint.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from .._errors import RecordingError
from ..files.cut import BRIDGED_LOWPASS_PERIODS, MAX_EVEN_JITTER
from ..files.defects import gaps
from ..files.delay import advances_within_spans, interpolate_at
from ..files.fault import Fault
from ..files.recording import Recording, channels_within
from ..numerics.even_times import even_times
from ..numerics.filters import runs
from ..numerics.motion import MIN_LONG_SAMPLES, Filtering, Motion, motion_of, pieces, shortest
from .drive_channel import DRIVE_CHANNELS
from .stored_motions import store_motions
from .study import Study
from .study_file import Drive, JointTable, Processing, SeveralJoints


@dataclass(frozen=True)
class DriveModel:
    """tau = gain * command - back_emf * velocity."""

    gain: float  # Effort per unit of the command channel (1 where the constant is unknown)
    back_emf: float  # Effort per velocity that a voltage drive loses to its own motion [N*m*s/rad or N*s/m]
    effort_unit: str  # "N*m", "N", or the command's own unit "A" or "V" where the constant is unknown


COMMAND_UNITS = {"current": "A", "voltage": "V"}
"""Unit of the command of each kind of drive that is not commanded by its effort."""


def drive_model(rig: JointTable | SeveralJoints) -> DriveModel:
    """The drive's effort per command, from the rig's constants.

    A voltage drive with resistance R and joint-side constant K = gear ratio x torque constant gives
    tau = K/R u - K^2/R v; without R the constant is effort per volt (an amplifier that controls current).
    """
    drive: Drive = rig.drive
    si = {"rotary": "N*m", "prismatic": "N"}[rig.motion]
    if drive.kind == "torque":
        return DriveModel(1.0, 0.0, si)
    if drive.constant is None:
        return DriveModel(1.0, 0.0, COMMAND_UNITS[drive.kind])
    constant = drive.constant * drive.gear_ratio
    if drive.kind == "voltage" and drive.resistance is not None:
        return DriveModel(constant / drive.resistance, constant**2 / drive.resistance, si)
    return DriveModel(constant, 0.0, si)


def computed_effort(kinds: Iterable[str], effort_unit: str) -> str:
    """Return what an effort is computed from, in words, by the `kinds` of its drives; "" where it is recorded as such.
    """
    effort = {"N*m": "torque", "N": "force"}.get(effort_unit, "")
    sources = [kind for kind in dict.fromkeys(kinds) if kind != "torque"]
    return f"{effort} computed from the drive's {' or '.join(sources)}" if effort and sources else ""


def recorded_word(computed: str, *, is_simulated: bool = False) -> str:
    """Return the word for a recorded line; `computed` says what it was computed from, "" where it was recorded."""
    return "simulated" if is_simulated else "computed" if computed else "measured"


def command_of(recording: Recording, rig: JointTable | SeveralJoints) -> np.ndarray:
    """The drive's command as recorded: torque, current, or voltage (duty times supply where only duty is recorded).
    Gives (n,) [N*m], [N], [A], [V]."""
    drive = rig.drive
    for name in DRIVE_CHANNELS[drive.kind]:
        if name in recording and name != "duty":
            return recording[name]
    if drive.kind == "voltage" and "duty" in recording:
        supply = recording["supply"] if "supply" in recording.channels else drive.supply
        if supply is None:
            raise RecordingError(
                f"{recording.path}: channel 'duty' needs a supply voltage; found neither [rig.drive] supply "
                "nor a channel 'supply'"
            )
        return recording["duty"] * supply
    raise RecordingError(
        f"{recording.path}: a {drive.kind} drive needs one of the channels "
        f"{', '.join(DRIVE_CHANNELS[drive.kind])}; found {', '.join(recording.channels)}"
    )


EXCERPT_SAMPLE_COUNT = 12_000
"""Number of samples in an excerpt of fitted, and of held-out, recordings. Methods that simulate use the excerpt."""

EXCERPT_PART_COUNT = 4
"""Number of parts in which an excerpt is taken from one recording."""

MIN_ROWS_PER_PART = 100
"""Smallest number of regression rows in each part."""


def filtering_of(processing: Processing) -> Filtering:
    """Return the filtering of a study's [processing], without its resampling."""
    p = processing
    if p.sliding_means is not None:
        raise RecordingError(
            f"study.toml: [processing] found sliding_means = {list(p.sliding_means)}, expected a lowpass: sliding "
            "means are for a joint with a carriage"
        )
    return Filtering(p.lowpass, p.order, p.decimate, p.dead_band, p.trim)


def motions_of(recordings: Iterable[Recording], study: Study) -> tuple[Motion, ...]:
    """Return the motion of every uncut stretch with the drive enabled, filtered and differentiated."""
    model = drive_model(study.rig)
    return tuple(store_motions(m for r in recordings for m in _motions_of(r, study, model)))


@dataclass(frozen=True)
class Excerpt:
    """Parts of long recordings, for methods that would take hours on all samples."""

    motions: tuple[Motion, ...]
    said: str  # description of the parts, in words; empty if they are everything


def take_excerpt(recordings: Iterable[Recording], study: Study, everything: tuple[Motion, ...]) -> Excerpt:
    """Return an excerpt of `recordings`, or `everything`, the motions of all of them, if that is little.

    Fitted recordings alone decide whether fits use an excerpt of them, and held-out ones are shortened on their own
    account.
    """
    samples = {s: sum(m.count for m in everything if m.split == s) for s in ("fitted", "heldout")}
    in_pieces = {m.split for m in everything if m.command is None}
    long = {split: count >= MIN_LONG_SAMPLES or split in in_pieces for split, count in samples.items()}
    if not any(long.values()):
        return Excerpt(everything, "")
    model, made, told = drive_model(study.rig), [], []
    for recording in recordings:
        if not long["fitted" if recording.use == "fit" else "heldout"]:
            made += [m for m in everything if m.recording == recording.name]
            continue
        needed = shortest(filtering_of(study.processing_of(recording)))
        least = EXCERPT_PART_COUNT * (needed + everything[0].filtering.decimate * MIN_ROWS_PER_PART)
        split = "fitted" if recording.use == "fit" else "heldout"
        share = len(recording) / max(samples[split], 1)
        parts = list(
            _motions_of(recording, study, model, within=max(int(EXCERPT_SAMPLE_COUNT * min(share, 1.0)), least))
        )
        made += parts
        if split == "heldout":
            continue
        lasts = sum(m.time[-1] - m.time[0] for m in parts)
        told.append(f"{lasts:.0f} s of {recording.name} from {', '.join(f'{m.time[0]:.0f}' for m in parts)} s")
    return Excerpt(tuple(made), "; ".join(told[:4]) + (f" and of {len(told) - 4} more" if len(told) > 4 else ""))


def short_stretch_faults(study: Study) -> list[Fault]:
    """Return a fault for each stretch between cuts that is too short to be used, and for held-out files without any."""
    faults = []
    for recording in study.recordings():
        if not advances_within_spans(recording):
            continue  # the check of time refuses it, and no even grid exists
        processing = study.processing_of(recording)
        fewest = shortest(filtering_of(processing))
        short: list[tuple[str, str]] = []  # what was found, and the end of the message about it
        if recording.use != "fit" and not usable_stretches(recording, processing):
            found = f"{len(recording)} samples, no enabled stretch of at least {fewest}"
            short.append((found, "; it is held out, and is excluded"))
        else:
            for stretch in stretches_of(recording, processing) if recording.cuts else ():
                n, time = len(stretch.time), stretch.time
                if n < fewest:
                    found = f"{n} samples between cuts, from {time[0]:.6g} s to {time[-1]:.6g} s"
                    short.append((found, f", expected at least {fewest}; excluded"))
        file, where = recording.path.name, f"{recording.path.name} (recording {recording.name})"
        for found, end in short:
            message = f"{where}: found {found}{end}"
            faults.append(Fault("cut", "short_stretch", file, "time", found, f"{fewest} samples", message))
    return faults


def usable_stretches(recording: Recording, processing: Processing) -> list[Stretch]:
    """Return the stretches between cuts with the drive on that are long enough to be filtered.

    A fitted recording without any is refused. A held-out one refuses no fit: `short_stretch_faults` names it.
    """
    fewest = shortest(filtering_of(processing))
    found = [s for s in stretches_of(recording, processing) if len(s.time) >= fewest]
    if not found and recording.use == "fit":
        raise RecordingError(
            f"{recording.path}: {len(recording)} samples, no enabled stretch of at least {fewest}; "
            f"expected a longer recording, {_remedy(recording, processing)}"
        )
    return found


def _remedy(recording: Recording, processing: Processing) -> str:
    """Return the keys of [processing] that make the stretches of a recording longer, or the needed length shorter."""
    lengths = [cut.stop - cut.start for cut in recording.cuts if cut.kind == gaps.KIND]
    if len(lengths) < 2:
        return "a smaller [processing] decimate or trim"
    if processing.resample is None:
        key = f'[processing] resample = "{recording.fs:.5g} Hz"'
        return f"or {key}, which bridges the short ones of {len(lengths)} gaps"
    usual = float(np.quantile(lengths, 0.9))
    return (
        f"a [processing] lowpass of at most {BRIDGED_LOWPASS_PERIODS / usual:.2g} Hz, at which gaps of up to "
        f"{usual:.3g} s are interpolated, or a smaller decimate or trim"
    )


def _motions_of(recording: Recording, study: Study, model: DriveModel, within: int | None = None) -> Iterator[Motion]:
    processing, loop = study.processing_of(recording), study.rig.loop
    if "position" not in recording:
        raise RecordingError(
            f"{recording.path}: no channel 'position'; found {', '.join(recording.channels)}. "
            "Identification needs the joint's position in [channels]"
        )
    filtering = filtering_of(processing)
    stretches = usable_stretches(recording, processing)
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
            payload=_stated_payload(recording),
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


def carries_unknown_payload(recording: Recording) -> bool:
    """Return whether study.toml says of a recording that it carries a payload, and not which."""
    return recording.payload is not None and recording.payload.mass is None


def _stated_payload(recording: Recording) -> tuple[float, float]:
    """Return the mass [kg] and distance [m] that study.toml states for a recording; zeros without a mass."""
    payload = recording.payload
    return (0.0, 0.0) if payload is None or payload.mass is None else (payload.mass, payload.distance)


def _parts(stretches: list[Stretch], samples: int) -> list[Stretch]:
    """Return parts of stretches with about `samples` samples together, equally long and evenly spaced."""
    whole = sum(len(s.time) for s in stretches)
    if whole <= samples:
        return stretches
    length, made, before = samples // EXCERPT_PART_COUNT, [], 0
    places = [(i + 0.5) * whole / EXCERPT_PART_COUNT for i in range(EXCERPT_PART_COUNT)]
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
        """Time of the samples, shape (n,) [s]."""
        return self.recording.time

    def part(self, samples: slice) -> Stretch:
        """Return some of the samples as a stretch."""
        start = "measured" if samples.start else self.start
        # Copies let the whole stretch be released.
        channels = {
            name: replace(channel, samples=np.array(channel.samples))
            for name, channel in channels_within(self.recording, samples).items()
        }
        return Stretch(replace(self.recording, channels=channels), self.fs, start)


def stretches_of(recording: Recording, processing: Processing) -> Iterator[Stretch]:
    """Yield every stretch of a recording without cuts in which the drive was enabled."""
    for span in recording.spans:
        fs, channels = sample_evenly(recording, span, processing)
        enabled = np.ones(len(channels["time"]), bool)
        for name in channels:
            if name.partition(".")[0] == "enabled":
                enabled &= channels[name] != 0.0
        for part in runs(enabled):
            cut = {n: replace(recording.channels[n], samples=x[part]) for n, x in channels.items()}
            # A stretch after a cut begins in motion, whatever the start of the recording is.
            start = "measured" if part.start == 0 and span.start > 0 else recording.start
            yield Stretch(replace(recording, channels=cut, cuts=()), fs, start)


def sample_evenly(recording: Recording, span: slice, processing: Processing) -> tuple[float, dict[str, np.ndarray]]:
    """Return the sampling rate [Hz] and the channels, each (n,), of a span on an even grid.

    Samples are interpolated only if the study says so, the clock jitters, or its stamps are smoothed.
    """
    values = {name: channel.samples[span] for name, channel in recording.channels.items()}
    smoothed = recording.stamped_evenly
    if processing.resample is None and not smoothed and recording.jitter <= MAX_EVEN_JITTER:
        return recording.fs, values
    fs, time = processing.resample or recording.fs, recording.clock.time[span]
    if processing.resample is None and smoothed and len(time) > 2:
        step, first = np.polyfit(np.arange(len(time)), time, 1)
        line = first + step * np.arange(len(time))
        if np.abs(time - line).max() <= MAX_EVEN_JITTER * step:
            return 1.0 / step, {**values, "time": line}
        # Packets that arrive in batches have a median step between stamps that does not give the rate.
        fs = (len(time) - 1) / float(time[-1] - time[0])
    grid = even_times(time, fs)
    held = {name for name in values if name.partition(".")[0] == "enabled"}
    nearest = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, len(time) - 1)
    # Cubic interpolation loses less than linear; linear is used only if the study asks for resampling.
    curved = processing.resample is None
    even = {
        n: x[nearest] if n in held else interpolate_at(time, x, grid) if curved else np.interp(grid, time, x)
        for n, x in values.items()
        if n != "time"
    }
    return fs, {"time": grid, **even}
