"""From the files of a study to its recordings: one list of steps, each of which makes a recording of the one before.

`read_recording` takes channels out of a file, in SI and with their signs. `OWN_FILE_STEPS` then repair the recording,
in order; `STREAM_STEPS` and `UNCUT_STEPS` are the steps for the files of other instruments, and for the EMG around a
window. The last step is `join_streams`, which stands alone because the clocks that it needs may have to be found first.
A study keeps the results (`KeptRecordings`), so that the steps run once for each recording, whichever commands follow.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._errors import RecordingError
from ..files.clock import first_deliveries, unwrap_clock
from ..files.cut import Cut
from ..files.defects.garbage import KIND as GARBAGE_KIND
from ..files.defects.garbage import find_garbage, zeroed_rows, zeroed_text
from ..files.defects.missing import interpolate_short_losses
from ..files.delay import initial_offset, join_stream, shift_channels, undo_lags
from ..files.kept_columns import KeptColumns, kept_columns
from ..files.optical import AXES, OpticalRecording
from ..files.pieces import pieces_between_cuts
from ..files.readers.read import find_lost_end
from ..files.recording import MAXIMAL_PROTOCOL, Channel, Payload, Recording, trim_missing_ends, within_streams
from ..files.stored_channels import MAX_HELD_BYTES, ChannelStore, SourcedChannel
from ..units import contradicts_unit
from .find_defects import find_cuts, regressed_joints, watched_part

if TYPE_CHECKING:
    from ..files.readers import Columns
    from .study_file import ChannelSpec, Optical, Processing, RecordingEntry
    from .study_place import StudySource

DISPLAYED_FILE_COUNT = 20
"""A message about a missing file lists at most this many of the files that are there."""

MAX_COUNTS_EXAMINED = 200_000
"""The range of a channel's counts is that of about this many samples, spread over the file."""


@dataclass(frozen=True, eq=False)
class RecordedFile:
    """A file of a recording with its statements in study.toml, for steps that use more than the recording."""

    study: StudySource
    entry: RecordingEntry
    name: str  # name of the recording
    path: Path
    contents: dict[Path, Columns] = field(default_factory=dict)  # files that were read; recordings may share one
    stream: str = ""  # name of the stream; "" for the recording's own file

    @property
    def specs(self) -> dict[str, ChannelSpec]:
        """Entries of study.toml for the file's channels.

        The file of a maximal contraction may lack all but time and EMG.
        """
        if self.stream:
            return self.study.config.streams[self.stream].channels
        specs = self.study.config.channels_of(self.entry)
        if self.entry.protocol != MAXIMAL_PROTOCOL:
            return specs
        return {
            name: spec
            for name, spec in specs.items()
            if name == "time" or name.startswith("emg.") or spec.value is not None or spec.column in self.columns
        }

    @property
    def processing(self) -> Processing:
        """Processing that study.toml states for the recording."""
        return self.entry.processing or self.study.config.processing

    @property
    def columns(self) -> Columns:
        """Contents of the file, which is read once."""
        if self.path not in self.contents:
            digest = self.study.digest(self.path)
            self.contents[self.path] = kept_columns(self.study.place("kept"), self.path, digest)
        return self.contents[self.path]

    def beside(self, file: str, what: str, stream: str = "") -> RecordedFile:
        """Return another file of the same recording; RecordingError, which says `what` it is, if there is none."""
        return replace(self, path=_require_file(self.study, self.entry, file, f"{what} of "), stream=stream)


def prepared_recordings(
    study: StudySource, use: str | None, on_progress: Callable[[str, float], None]
) -> tuple[Recording, ...]:
    """Return the recordings of a study with a `use`, or all; see `Study.recordings`."""
    if use not in (None, "fit", "validate"):
        raise RecordingError(f'use: found {use!r}, expected "fit", "validate" or None')
    chosen = [
        (entry, name, path)
        for entry in study.config.recordings
        if use is None or entry.use == use
        for name, path in recording_files(study, entry)
        if name not in study.left_out
    ]
    contents: dict[Path, Columns] = {}
    found: list[Recording] = []
    shortest = study.shortest_piece
    last_use = {file: i for i, (entry, _, path) in enumerate(chosen) for file in (path, *_further_files(study, entry))}
    for i, (entry, name, path) in enumerate(chosen):
        on_progress(f"reading {name}", i / len(chosen))
        recording = prepare(RecordedFile(study, entry, name, path, contents))
        # Several recordings may share a file.
        for file in [file for file in contents if last_use.get(file, i) <= i]:
            del contents[file]
        found.extend((recording,) if shortest is None else pieces_between_cuts(recording, shortest))
    return tuple(found)


def prepared_recording(study: StudySource, name: str) -> Recording:
    """Return the recording of a name; see `Study.recording`."""
    names = []
    for entry in study.config.recordings:
        # A pattern's recordings are known only once their files are listed.
        if entry.files is None and entry.name != name:
            names.append(entry.name)
            continue
        for each, path in recording_files(study, entry):
            names.append(each)
            if each == name:
                return prepare(RecordedFile(study, entry, each, path))
    raise RecordingError(f'{study.path}: no recording "{name}", expected one of {", ".join(names) or "none"}')


def prepare(file: RecordedFile) -> Recording:
    """Return the recording of a file after all steps; it is made once and kept."""
    kept, entry, name = file.study.kept, file.entry, file.name
    if name not in kept.recordings:
        if entry.file is None and entry.files is None:
            # A maximal contraction may have the stream with EMG alone.
            (stream,) = entry.streams
            apart = joined = replace(_stream_recording(file, stream), name=name)
        else:
            apart = _after(OWN_FILE_STEPS, read_recording(file, entry.window), file)
            joined = join_streams(apart, file.study, entry)
        if kept.store is None:
            kept.store = ChannelStore()
        kept.apart[name], kept.recordings[name] = kept.store.keep(apart, joined)
    return kept.recordings[name]


def read_recording(file: RecordedFile, window: tuple[float, float] | None = None) -> Recording:
    """Return what a file holds, in SI, and what study.toml says of the trial; no step is taken yet."""
    entry = file.entry
    recording = Recording(
        name=f"{file.name}.{file.stream}" if file.stream else file.name,
        path=file.path,
        checksum=file.study.digest(file.path),
        use=entry.use,
        channels=make_channels(file.columns, file.specs, window),
        protocol=entry.protocol,
        participant=entry.participant,
    )
    if file.stream:
        return recording
    return replace(
        recording,
        condition=entry.condition,
        payload=Payload(entry.payload.mass, entry.payload.distance) if entry.payload else None,
        start=entry.start,
        slider=entry.slider,
        amplitude=entry.amplitude,
        repetition=entry.repetition,
        period=entry.period,
    )


def remove_garbage(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording without rows of garbage at either end, and with a cut that says so."""
    n = len(recording)
    found = find_garbage(recording.time, _samples_beside_time(recording))
    if found is None or n - found.head - found.tail < 2:
        return recording
    sane = _with_rows(recording, found.between(n))
    text = f"{found.where} of {n} rows of garbage: {found.cause}"
    start = float(sane.time[0 if found.head else -1])
    first = 0 if found.head else len(sane)
    return replace(sane, cuts=(Cut(GARBAGE_KIND, "time", start, start, first, first - 1, text),))


def remove_zeroed_rows(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording without the rows of packets that were filled with zeros, and with a cut that says so."""
    zeroed = zeroed_rows(_samples_beside_time(recording))
    if not zeroed.any():
        return recording
    rest = _with_rows(recording, ~zeroed)
    n, end = len(rest), float(rest.time[-1])
    return replace(rest, cuts=(*rest.cuts, Cut(GARBAGE_KIND, "time", end, end, n, n - 1, zeroed_text(zeroed))))


def remove_repeated_rows(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording without the rows of packets delivered twice, and with the number of those rows."""
    first = first_deliveries(recording.time, _samples_beside_time(recording))
    repeats = int(np.sum(~first))
    return replace(_with_rows(recording, first), repeats=repeats) if repeats else recording


def integrate_velocities(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording with the integral of each velocity whose joint has no position, from 0 on.

    Its zero is arbitrary; a joint's weight has a sine and a cosine, so that the fit finds it.
    """
    if not regressed_joints(file.study.config):
        return recording
    time, made = recording.time, {}
    for name, velocity in recording.channels.items():
        head, _, joint = name.partition(".")
        ending = f".{joint}" if joint else ""
        if head != "velocity" or velocity.unit not in ("rad/s", "m/s"):
            continue
        if any(f"{place}{ending}" in recording for place in ("position", "motor_position")):
            continue
        steps = np.diff(time, prepend=time[0]) * 0.5 * (velocity.samples + np.roll(velocity.samples, 1))
        place = np.cumsum(np.where(np.isfinite(steps), steps, 0.0))
        place[~np.isfinite(velocity.samples)] = np.nan
        unit = velocity.unit.removesuffix("/s")
        made[f"position{ending}"] = Channel(f"position{ending}", place, unit, velocity.column)
    return replace(recording, channels={**recording.channels, **made}) if made else recording


def add_optical(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording with the motion capture of the trial."""
    spec = file.study.config.optical
    if file.entry.optical is None or spec is None:
        return recording
    return replace(recording, optical=read_optical(file.beside(file.entry.optical, "optical"), spec))


def add_streams(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording with those of other instruments, each on its own clock."""
    return replace(recording, streams={stream: _stream_recording(file, stream) for stream in file.entry.streams})


def exclude_by_hand(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording with the cuts that study.toml asks for."""
    time, cuts = recording.time, []
    for start, stop in file.entry.exclude:
        inside = np.flatnonzero((time >= start) & (time < stop))
        if inside.size:
            first, last = int(inside[0]), int(inside[-1])
            found = "what study.toml excludes"
            cuts.append(Cut("excluded", "time", float(time[first]), stop, first, last, found, by="hand"))
        elif file.entry.file is not None:
            # A pattern may match files of different lengths. In a single file, a missing stretch is a mistake.
            raise RecordingError(
                f"{file.path.name} (recording {file.entry.name}): exclude {start:g} s to {stop:g} s holds no sample, "
                f"found times from {np.nanmin(time):g} s to {np.nanmax(time):g} s; correct the stated times"
            )
    return replace(recording, cuts=(*cuts, *recording.cuts))


def mark_lost_end(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording with a cut for the missing end of a truncated file, if its window reaches the end."""
    lost = find_lost_end(file.path)
    if not lost:
        return recording
    n, end = len(recording), float(recording.time[-1])
    # A window is that of the recording's own file; streams are whole.
    window = None if file.stream else file.entry.window
    if window is not None and window[1] <= end:
        return recording
    cut = Cut("truncated", "time", end, end, n, n - 1, f"{lost}, where the file is truncated")
    return replace(recording, cuts=(cut, *recording.cuts))


def mark_damaged_rows(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording with a cut that states which rows of its file are excluded as damaged."""
    damaged = file.columns.damaged
    if not damaged:
        return recording
    # The rows lie at unknown times, where their absence leaves a gap; the cut itself contains no sample.
    n, end = len(recording), float(recording.time[-1])
    cut = Cut("damaged_rows", "time", end, end, n, n - 1, f"excluded {damaged}")
    return replace(recording, cuts=(*recording.cuts, cut))


def add_uncut_emg(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording with the EMG of the whole file, if it is a window of it: filters need the samples around."""
    specs = {n: s for n, s in file.study.config.channels_of(file.entry).items() if n == "time" or n.startswith("emg.")}
    if file.entry.window is None or len(specs) < 2:
        return recording
    whole = Recording(
        name=file.name,
        path=file.path,
        checksum=recording.checksum,
        use=file.entry.use,
        channels=make_channels(file.columns, specs, None),
        protocol=file.entry.protocol,
        participant=file.entry.participant,
    )
    return replace(recording, uncut=_after(UNCUT_STEPS, whole, file))


def bridge_missing(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording whose short runs of missing samples are interpolated, if the study interpolates gaps."""
    config, processing = file.study.config, file.processing
    if processing.resample is None or processing.cut == "none" or len(recording) < 2 or not recording.advances:
        return recording
    watched = watched_part(recording, config, file.specs, processing, stream=file.stream)
    return interpolate_short_losses(recording, sorted(watched.regressed), watched.bridged)


def cut_defects(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording with its defects cut out, and with what is done to its stamps."""
    config, processing = file.study.config, file.processing
    found = find_cuts(recording, config, file.specs, processing, stream=file.stream)
    cuts = tuple(sorted((*recording.cuts, *found), key=lambda cut: cut.first))
    return replace(recording, cuts=cuts, smooth_stamps=processing.stamp_smoothing)


def undo_delays(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording without the lags and delays that study.toml states for its channels."""
    specs = file.specs
    recording = undo_lags(recording, {n: spec.lag for n, spec in specs.items() if spec.lag is not None})
    return shift_channels(recording, {n: spec.delay for n, spec in specs.items() if isinstance(spec.delay, float)})


def trim_empty_ends(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording without the rows at its ends that lack EMG, or what it is compared with.

    Recordings whose joints are identified are cut into pieces instead.
    """
    config = file.study.config
    tables = [table for table in config.procedures.values() if not table.bridges]
    if regressed_joints(config) or not tables:
        return recording
    read = [name for name in recording.channels if any(table.reads(name, file.stream) for table in tables)]
    return trim_missing_ends(recording, read)


def trim_to_streams(recording: Recording, file: RecordedFile) -> Recording:
    """Return a recording within the times of its streams whose ends were trimmed."""
    return within_streams(recording)


def join_streams(
    recording: Recording,
    study: StudySource,
    entry: RecordingEntry,
    clocks: Mapping[str, tuple[float, float]] | None = None,
) -> Recording:
    """Return a recording with the channels of the streams that study.toml joins.

    `clocks` gives the offset [s] and the drift of streams by their names. A stream without one has those of study.toml,
    or a first guess.
    """
    for stream in entry.streams:
        table, other = study.config.streams[stream], recording.streams[stream]
        if not table.join:
            continue
        offset, drift = entry.offsets.get(stream, table.offset), table.drift
        first = initial_offset(recording, other) if offset == "auto" else offset
        guess = first, 0.0 if drift == "auto" else drift
        recording = join_stream(recording, other, *(clocks or {}).get(stream, guess))
    return recording


Step = Callable[[Recording, RecordedFile], Recording]
"""A step makes a recording of the one before and of what study.toml says of its file."""

OWN_FILE_STEPS: tuple[Step, ...] = (
    remove_garbage,
    remove_zeroed_rows,
    remove_repeated_rows,
    integrate_velocities,
    add_optical,
    add_streams,
    mark_lost_end,
    mark_damaged_rows,
    exclude_by_hand,
    add_uncut_emg,
    bridge_missing,
    cut_defects,  # after everything that changes rows, because cuts are counted in rows
    undo_delays,  # after the cuts, which no interpolation may cross
    trim_empty_ends,
    trim_to_streams,
)
"""Steps from what a recording's own file holds to the recording with its streams apart."""

STREAM_STEPS: tuple[Step, ...] = (
    remove_repeated_rows,
    mark_lost_end,
    mark_damaged_rows,
    bridge_missing,
    cut_defects,
    undo_delays,
    trim_empty_ends,
)
"""Steps for the file of another instrument."""

UNCUT_STEPS: tuple[Step, ...] = (remove_repeated_rows, undo_delays)
"""Steps for the EMG of a whole file, which only filters read."""


def _after(steps: tuple[Step, ...], recording: Recording, file: RecordedFile) -> Recording:
    for step in steps:
        recording = step(recording, file)
    return recording


def _stream_recording(file: RecordedFile, stream: str) -> Recording:
    other = file.beside(file.entry.streams[stream], f"the stream {stream}", stream)
    return _after(STREAM_STEPS, read_recording(other), other)


def _samples_beside_time(recording: Recording) -> dict[str, np.ndarray]:
    return {name: channel.samples for name, channel in recording.channels.items() if name != "time"}


def _with_rows(recording: Recording, rows: slice | np.ndarray) -> Recording:
    """Return a recording with some of its rows; its cuts stay as they are."""
    channels = {name: replace(channel, samples=channel.samples[rows]) for name, channel in recording.channels.items()}
    return replace(recording, channels=channels)


def recording_files(study: StudySource, entry: RecordingEntry) -> list[tuple[str, Path]]:
    """Return name and own file of each recording of an entry; RecordingError if there is none."""
    if entry.file is None and entry.files is None:
        ((stream, file),) = entry.streams.items()
        return [(entry.name, _require_file(study, entry, file, f"the stream {stream} of "))]
    if entry.file is not None:
        return [(entry.name, _require_file(study, entry, entry.file, ""))]
    paths = _matching_files(study, entry, entry.files or "")
    if not paths:
        raise RecordingError(
            f'{entry_text(study, entry)}: no file matches "{entry.files}"'
            f"{_folder_contents((study.folder / str(entry.files)).parent)}"
        )
    if len(paths) == 1:
        return [(entry.name, paths[0])]
    # Pages and formulas interpret other characters.
    stems = [re.sub(r"[^\w .()+,=-]", "_", path.stem) for path in paths]
    return [(f"{entry.name}.{stem}", path) for stem, path in zip(stems, paths, strict=True)]


def every_file(study: StudySource) -> Iterator[Path]:
    """Yield every file that study.toml names among the recordings; one may come twice."""
    for entry in study.config.recordings:
        yield from (path for _, path in recording_files(study, entry))
        yield from _further_files(study, entry)


def _further_files(study: StudySource, entry: RecordingEntry) -> Iterator[Path]:
    """Yield the files of other instruments that an entry names."""
    for file in (entry.optical, *entry.streams.values()):
        if file is not None:
            yield study.inside(file, entry_text(study, entry))


def entry_text(study: StudySource, entry: RecordingEntry) -> str:
    """Return where study.toml has an entry, for messages."""
    return f'{study.path}: [[recordings]] "{entry.name}"'


def _matching_files(study: StudySource, entry: RecordingEntry, pattern: str) -> list[Path]:
    where, parts = entry_text(study, entry), Path(pattern).parts
    # A pattern must not list files outside the folder either.
    if ".." in parts or Path(pattern).is_absolute():
        study.inside(pattern, where)
    if any("**" in part and part != "**" for part in parts):  # Python 3.13 changes its meaning
        raise RecordingError(f'{where}: found files = "{pattern}", expected ** between slashes, such as "**/*.csv"')
    try:
        paths = sorted(path for path in study.folder.glob(pattern) if path.is_file())
    except (ValueError, NotImplementedError) as error:
        raise RecordingError(f'{where}: found files = "{pattern}": {error}') from None
    return [study.inside(path.relative_to(study.folder), where) for path in paths]


def _require_file(study: StudySource, entry: RecordingEntry, file: str, what: str) -> Path:
    path = study.inside(file, entry_text(study, entry))
    if not path.is_file():
        raise RecordingError(
            f'{path}: no such file, expected by {what}[[recordings]] "{entry.name}"{_folder_contents(path.parent)}'
        )
    return path


def _folder_contents(folder: Path) -> str:
    if not folder.is_dir():
        return f"; there is no folder {folder.name}"
    names = sorted(path.name for path in folder.iterdir())
    return f"; {folder.name} holds {', '.join(names[:DISPLAYED_FILE_COUNT]) or 'nothing'}"


def read_optical(file: RecordedFile, spec: Optical) -> OpticalRecording:
    """Return the markers in the file of a motion capture, as ``[optical]`` of study.toml says."""
    columns, rail = file.columns, file.study.config.rail
    time = _to_si(columns.column(spec.time.column, "time"), spec.time)
    markers = {}
    for marker in spec.markers:
        stored = [columns.column(spec.column(marker, axis), f"of marker {marker}") for axis in AXES]
        file_unit = columns.units.get(spec.column(marker, AXES[0]), spec.unit)
        if file_unit != spec.unit:
            raise RecordingError(
                f'{columns.path.name}: marker {marker}: study.toml says {spec.unit}, the file itself "{file_unit}": '
                "correct the unit in study.toml"
            )
        for axis, samples in zip(AXES, stored, strict=True):
            if len(samples) != len(time):
                raise RecordingError(
                    f"{columns.path.name}: marker {marker} (column {spec.column(marker, axis)!r}) has {len(samples)} "
                    f"samples, expected {len(time)} as in time"
                )
        markers[marker] = spec.si_factor * np.column_stack(stored)
    carriage = rail.marker if rail is not None else None
    return OpticalRecording(file.path, file.study.digest(file.path), time, markers, np.array(spec.down), carriage)


def make_channels(
    columns: Columns, specs: Mapping[str, ChannelSpec], window: tuple[float, float] | None
) -> dict[str, Channel]:
    """Return the channels of a file in SI, as study.toml says, within a `window` [s]."""
    _require_file_units(columns, specs)
    for name, spec in specs.items():
        if columns.angle_unit not in (None, spec.unit) and spec.unit in ("deg", "rad"):
            raise RecordingError(
                f"{columns.path.name}: channel {name}: study.toml says {spec.unit}, the file's header says "
                f"{columns.angle_unit}: correct the unit in study.toml"
            )
    values = {n: _read_samples(columns, n, spec) for n, spec in specs.items() if spec.rate is None}
    rate = specs["time"].rate
    if rate is not None:
        values = _without_empty_ends(values)
        values["time"] = np.arange(max((len(samples) for samples in values.values()), default=0)) / rate
    time = values["time"]
    n, single = len(time), {name for name, samples in values.items() if len(samples) == 1}
    for name, samples in values.items():
        if len(samples) == 1 and n != 1:
            values[name] = np.full(n, samples[0])
        elif len(samples) != n:
            raise RecordingError(
                f"{columns.path.name}: channel {name} (column {specs[name].column!r}) has {len(samples)} samples, "
                f"expected {n} as in time"
            )
    if window is not None:
        inside = (time >= window[0]) & (time < window[1])  # half-open: adjoining windows share no sample
        if not inside.any():
            raise RecordingError(
                f"{columns.path.name}: window {window[0]:g} s to {window[1]:g} s holds no sample, "
                f"found times from {np.nanmin(time):g} s to {np.nanmax(time):g} s; correct the stated times"
            )
        values = {name: samples[inside] for name, samples in values.items()}
    for samples in values.values():
        samples.flags.writeable = False  # so that the channel does not copy them
    channels = {name: Channel(name, values[name], spec.si_unit, spec.column) for name, spec in specs.items()}
    if window is not None or rate is not None or not isinstance(columns.values, KeptColumns):
        return channels
    sourced = {
        name: SourcedChannel.of(channel, _KeptSamples(columns, channel, specs[name]))
        for name, channel in channels.items()
        if _converts_each_sample(specs[name]) and name not in single
    }
    return channels | sourced


def _converts_each_sample(spec: ChannelSpec) -> bool:
    """Return whether each sample follows from one stored number, whatever the others are."""
    other = (spec.value, spec.minus, spec.interleaved, spec.stacked, spec.wrap_bits, spec.wrap)
    return all(each is None for each in other)


class _KeptSamples:
    """Samples of a channel, from the kept columns of its file."""

    def __init__(self, columns: Columns, channel: Channel, spec: ChannelSpec):
        self._columns, self._name, self._spec, self.shape = columns, channel.name, spec, channel.samples.shape

    def read(self) -> np.ndarray:
        return self.read_rows(0, self.shape[0])

    def read_rows(self, first: int, stop: int) -> np.ndarray:
        samples = _to_si(self._columns.column(self._spec.column, self._name)[first:stop], self._spec)
        samples.flags.writeable = False
        return samples


def _without_empty_ends(values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return channels without the empty cells at the ends of those that are longer than the shortest one.

    Columns of different lengths share a sheet; the shorter ones end in empty cells.
    """
    lengths = {name: len(x) for name, x in values.items() if len(x) > 1}
    shortest = min(lengths.values(), default=0)
    return {
        name: x[:shortest] if name in lengths and not np.isfinite(x[shortest:]).any() else x
        for name, x in values.items()
    }


def _read_samples(columns: Columns, name: str, spec: ChannelSpec) -> np.ndarray:
    less = columns.column(spec.minus.column, name) if spec.minus is not None else None
    stored = _listed(columns, name, spec) if spec.value is None else np.array([spec.value])
    if less is not None and len(less) != len(stored) and min(len(less), len(stored)) != 1:
        raise RecordingError(
            f"{columns.path.name}: channel {name}: column {spec.column!r} has {len(stored)} samples, column "
            f"{spec.minus.column!r}, which is subtracted from it, {len(less)}; expected equal numbers"
        )
    if spec.wrap_bits is not None and np.isfinite(stored).any():
        known = stored[np.isfinite(stored)][:: max(1, len(stored) // MAX_COUNTS_EXAMINED)]
        low, high = np.quantile(known, (0.01, 0.99))
        if high - low > 2.0**spec.wrap_bits:
            raise RecordingError(
                f"{columns.path.name}: channel {name} (column {spec.column!r}): found counts from {low:.6g} to "
                f"{high:.6g}, expected all within {2.0**spec.wrap_bits:.6g}, as wrap_bits = {spec.wrap_bits} says"
            )
    return _to_si(stored, spec, less)


def _listed(columns: Columns, name: str, spec: ChannelSpec) -> np.ndarray:
    """Return the stored numbers of a channel; of a flat list with several columns, those of its own."""
    stored = columns.column(spec.column, name)
    place = spec.interleaved or spec.stacked
    if place is None:
        return stored
    number, count = place
    if len(stored) % count:
        raise RecordingError(
            f"{columns.path.name}: channel {name} (column {spec.column!r}) has {len(stored)} numbers, expected a "
            f"multiple of {count}, as study.toml says of the list"
        )
    if spec.interleaved is not None:
        return np.ascontiguousarray(stored[number::count])
    rows = len(stored) // count
    return np.ascontiguousarray(stored[number * rows : (number + 1) * rows])


def _require_file_units(columns: Columns, specs: Mapping[str, ChannelSpec]) -> None:
    for name, spec in specs.items():
        used = (spec.column,) if spec.minus is None else (spec.column, spec.minus.column)
        # A scale says that the stored numbers are counts, or in another unit than the one that follows from them.
        stated = [] if spec.scale != 1.0 else [columns.units[c] for c in used if c in columns.units]
        file_unit = next((unit for unit in stated if contradicts_unit(unit, spec.unit)), None)
        if file_unit is not None:
            raise RecordingError(
                f'{columns.path.name}: channel {name}: study.toml says {spec.unit}, the file itself "{file_unit}": '
                "correct the unit in study.toml"
            )


def _to_si(stored: np.ndarray, spec: ChannelSpec, less: np.ndarray | None = None) -> np.ndarray:
    """Convert stored numbers, minus those of the column `less`, to SI, in the order that `ChannelSpec` states."""
    values = _decode_counts(stored, spec)
    # Each pass over a recording of hours takes long, so steps without an effect are skipped.
    if spec.sign * spec.scale != 1.0:
        values = values * (spec.sign * spec.scale)
    if less is not None:
        values = values - spec.sign * (spec.minus.scale or spec.scale) * _decode_counts(less, spec)
    is_changed = spec.offset or spec.si_factor != 1.0 or spec.si_offset or spec.wrap is not None
    # Columns that are kept are mapped into memory. Only the long ones are used so: each mapping has a file descriptor.
    if values is stored and (is_changed or stored.flags.writeable or stored.nbytes <= MAX_HELD_BYTES):
        values = np.array(values)
    if spec.offset:
        values += spec.offset
    if spec.si_factor != 1.0:
        values *= spec.si_factor
    if spec.si_offset:
        values += spec.si_offset
    if spec.wrap is not None and spec.name == "time":
        return unwrap_clock(values, spec.wrap)
    if spec.wrap is not None:
        _unwrap(values, spec.wrap)
    return values


def _decode_counts(stored: np.ndarray, spec: ChannelSpec) -> np.ndarray:
    """Return stored numbers with their sign, without jumps of a rolling count, and with missing samples as NaN.

    Numbers of which none changes are the given ones.
    """
    if not isinstance(spec.missing, float) and all(
        each is None for each in (spec.signed_bits, spec.sign_bit, spec.wrap_bits)
    ):
        return stored
    values = np.array(stored, dtype=np.float64)
    if isinstance(spec.missing, float):
        values[values == spec.missing] = np.nan
    if spec.signed_bits is not None:
        values = np.where(values >= 2.0 ** (spec.signed_bits - 1), values - 2.0**spec.signed_bits, values)
    if spec.sign_bit is not None:
        values = np.where(values >= 2.0**spec.sign_bit, 2.0**spec.sign_bit - values, values)
    if spec.wrap_bits is not None:
        _unwrap(values, 2.0**spec.wrap_bits)
    return values


def _unwrap(values: np.ndarray, period: float) -> None:
    """Remove jumps of whole periods in place, across gaps too; missing samples stay missing."""
    known = np.isfinite(values)
    values[known] = np.unwrap(values[known], period=period)
