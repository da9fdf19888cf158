"""A study: a folder with study.toml, the recordings that it names, and their results."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._errors import IdentificationError, RecordingError, StudyError
from .._given import require_folder, require_inside
from ..files.clock import first_deliveries
from ..files.cut import Cut
from ..files.defects.garbage import KIND as GARBAGE_KIND
from ..files.defects.garbage import find_garbage
from ..files.delay import shift_channels, undo_lags
from ..files.joined_stream import initial_offset, join_stream
from ..files.optical import OpticalRecording
from ..files.pieces import pieces_between_cuts
from ..files.recording import MAXIMAL_PROTOCOL, Channel, Payload, Recording, trim_missing_ends, within_streams
from ..units import contradicts_unit
from .drive_channel import command_channel
from .find_defects import find_cuts, regressed_joints
from .optical_columns import read_optical
from .results import ResultRow, read_rows

if TYPE_CHECKING:
    from ..files.readers import Columns
    from .study_fields import Table
    from .study_file import ChannelSpec, Model, OneJoint, Processing, RecordingEntry, RigJoint, SeveralJoints, StudyFile

@dataclass(frozen=True)
class StudyPlace:
    """The folder of a study, and where commands write.

    Attributes
    ----------
    folder : Path
        Folder of the study.
    out : Path or None
        Folder for everything that is written, instead of the study's own, which may be read-only.
    allow_outside : bool
        Whether files outside the study's folder may be read, if study.toml names them or a link leads there.
    """

    folder: Path
    out: Path | None = None
    allow_outside: bool = False

    @property
    def made(self) -> Path:
        """Folder for everything that commands write."""
        return self.folder if self.out is None else self.out

    @property
    def report_dir(self) -> Path:
        """Folder of the report."""
        return self.place("report")

    def place(self, name: str) -> Path:
        """Return the path `name` in the folder `made`; raise a PellucidError if a link leads out of the study."""
        path = self.made / name
        return path if self.out is not None else require_inside(path, self.folder, self.allow_outside, name)


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


STUDY_FILE = "study.toml"
"""Name of the file that describes a study."""

RESULTS_FILE = "results.json"
"""Name of the file with every figure that the commands printed."""

DISPLAYED_FILE_COUNT = 20
"""A message about a missing file lists at most this many of the files that are there."""


@dataclass(frozen=True, eq=False)
class Study:
    """A study's folder and the contents of its study.toml.

    Attributes
    ----------
    folder : Path
        Folder of the study.
    config : StudyFile
        Contents of study.toml, in SI.
    out : Path or None
        Folder for everything that is written, instead of the study's own, which may be read-only.
    allow_outside : bool
        Whether files outside the study's folder may be read, if study.toml names them or a link leads there.
    accept_stale : bool
        Whether a model card may be used that was made from an earlier state of the study.
    """

    folder: Path
    config: StudyFile = field(repr=False)
    _loaded: dict = field(default_factory=dict, repr=False)
    _digests: dict[Path, str] = field(default_factory=dict, repr=False)
    _apart: dict[str, Recording] = field(default_factory=dict, repr=False)  # recordings before streams were joined
    found: dict = field(default_factory=dict, repr=False)  # cache for results that procedures need more than once
    _left_out: frozenset[str] = field(default=frozenset(), repr=False)
    _shortest_piece: float | None = field(default=None, repr=False)  # [s]; None: recordings are not taken in pieces
    out: Path | None = None
    allow_outside: bool = False
    accept_stale: bool = False

    @property
    def name(self) -> str:
        """Name of the study, which begins every figure's id."""
        return self.config.name

    @property
    def rig(self) -> OneJoint | RigJoint | SeveralJoints:
        """The machine: its joint, or several joints in `joints`."""
        return self.config.rig

    @property
    def processing(self) -> Processing:
        """Processing of samples before a regression."""
        return self.config.processing

    @property
    def model(self) -> Model:
        """The model that is identified."""
        return self.config.model

    def has_table(self, name: str) -> bool:
        """Return whether study.toml has the table of a procedure, such as ``"tree"``."""
        return name in self.config.procedures

    def find_table(self, kind: type[Table]) -> Table | None:
        """Return the table of a class that asks for a procedure; None where study.toml has none."""
        return self.config.find_table(kind)

    def table(self, kind: type[Table]) -> Table:
        """Return the table of a class that asks for a procedure.

        Parameters
        ----------
        kind : type of ProcedureTable
            Class of the table, as the procedure's own folder defines it.

        Raises
        ------
        IdentificationError
            If study.toml has no such table.
        """
        found = self.find_table(kind)
        if found is None:
            name = self.config.table_name(kind)
            raise IdentificationError(f"{self.folder}: found no table [{name}] in study.toml, expected one")
        return found

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks that the report repeats."""
        return self.config.notes

    @property
    def models_dir(self) -> Path:
        """Folder for model cards."""
        return self.place("models")

    @property
    def results_path(self) -> Path:
        """File with every figure that the commands printed."""
        return self.made / RESULTS_FILE

    @property
    def report_dir(self) -> Path:
        """Folder of the report."""
        return self.place("report")

    def kept_path(self, procedure: str) -> Path:
        """Return the file with a procedure's complete result, from which the report draws its figures."""
        return self.place("kept") / f"{procedure}.npz"

    @property
    def made(self) -> Path:
        """Folder for everything that the commands write."""
        return self._place.made

    @property
    def _place(self) -> StudyPlace:
        """Where the study's files lie."""
        return StudyPlace(self.folder, self.out, self.allow_outside)

    def place(self, name: str) -> Path:
        """Return the path `name` in the folder `made`; raise a PellucidError if a link leads out of the study."""
        return self._place.place(name)

    def inside(self, file: str | Path, where: str) -> Path:
        """Return a file of the study by its path from the folder.

        Raise a PellucidError, which says `where` the file was named, if it lies outside the folder.
        """
        return require_inside(self.folder / file, self.folder, self.allow_outside, where)

    def cards(self, pattern: str = "*.json") -> tuple[Path, ...]:
        """Return the model cards whose names match, in order of name; `models_dir` has precedence."""
        found = {path.name: path for path in sorted((self.folder / "models").glob(pattern))}
        found = {name: self.inside(Path("models") / name, f"model card {name}") for name in found}
        found |= {path.name: path for path in self.models_dir.glob(pattern) if self.out is not None}
        return tuple(found[name] for name in sorted(found))

    def card(self, name: str) -> Path:
        """Return the path of the model card with the file name `name`, whether or not it exists."""
        where = f"model card {name}"
        if self.out is not None:
            own = require_inside(self.models_dir / name, self.out, self.allow_outside, where)
            if own.is_file():
                return own
        return self.inside(Path("models") / name, where)

    def files(self) -> tuple[Path, ...]:
        """Return every file that study.toml names among the recordings, once."""
        found = []
        for entry in self.config.recordings:
            found += [path for _, path in self._paths(entry)]
            others = [file for file in (entry.optical, *entry.streams.values()) if file is not None]
            found += [self.inside(file, self._entry_text(entry)) for file in others]
        return tuple(dict.fromkeys(found))

    def fingerprint(self, more: Iterable[Path] = ()) -> str:
        """Return the SHA-256 of study.toml, of all recordings' files, of `more` files and of Pellucid's own code."""
        from .kept import code_fingerprint

        digests = {}
        for path in (self.folder / STUDY_FILE, *self.files()):
            digests[path] = self.digest(path)
        # Cards may change while a study is open, so they are read again. Recordings are read once.
        digests |= {path: checksum(path) if path.is_file() else "" for path in more}
        parts = [code_fingerprint()]
        # relpath also works for a file outside the study's folder.
        parts += [f"{os.path.relpath(path, self.folder)} {digest}" for path, digest in digests.items()]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()

    def recordings(
        self, use: str | None = None, *, on_progress: Callable[[str, float], None] = lambda text, share: None
    ) -> tuple[Recording, ...]:
        """Return the recordings in the order of study.toml; each file is read once.

        Parameters
        ----------
        use : str or None
            ``"fit"`` or ``"validate"``; None for all.
        on_progress : callable, optional
            Function that is called before each recording, with a text and the share of recordings done, 0 to 1.

        Raises
        ------
        RecordingError
            If a file is missing or unreadable, or lacks a column. The message names the file and the channel.
        """
        if use not in (None, "fit", "validate"):
            raise RecordingError(f'use: found {use!r}, expected "fit", "validate" or None')
        files: dict[Path, Columns] = {}
        chosen = [
            (entry, name, path)
            for entry in self.config.recordings
            if use is None or entry.use == use
            for name, path in self._paths(entry)
            if name not in self._left_out
        ]
        found: list[Recording] = []
        for i, (entry, name, path) in enumerate(chosen):
            on_progress(f"reading {name}", i / len(chosen))
            loaded = self._load(entry, name, path, files)
            pieces = (loaded,) if self._shortest_piece is None else pieces_between_cuts(loaded, self._shortest_piece)
            found.extend(pieces)
        return tuple(found)

    def without(self, names: Iterable[str]) -> Study:
        """Return the same study without the recordings `names`."""
        return replace(self, _left_out=self._left_out | frozenset(names))

    @property
    def left_out(self) -> frozenset[str]:
        """Names of the recordings that this study is without."""
        return self._left_out

    def in_pieces(self, shortest: float) -> Study:
        """Return the same study, whose recordings with cuts are taken as the pieces between them of `shortest` [s]."""
        return replace(self, _shortest_piece=shortest)

    def recording(self, name: str) -> Recording:
        """Return one recording by its name.

        Raises
        ------
        RecordingError
            If study.toml names no such recording, or it cannot be read.
        """
        names = []
        for entry in self.config.recordings:
            # A pattern's recordings are known only once their files are listed.
            if entry.files is None and entry.name != name:
                names.append(entry.name)
                continue
            for each, path in self._paths(entry):
                names.append(each)
                if each == name:
                    return self._load(entry, each, path, {})
        raise RecordingError(f'{self.folder / STUDY_FILE}: no recording "{name}", found {", ".join(names) or "none"}')

    def _entry_text(self, entry: RecordingEntry) -> str:
        return f'{self.folder / STUDY_FILE}: [[recordings]] "{entry.name}"'

    def _matching(self, entry: RecordingEntry) -> list[Path]:
        pattern = Path(entry.files)
        # A pattern must not list files outside the folder either.
        if ".." in pattern.parts or pattern.is_absolute():
            self.inside(entry.files, self._entry_text(entry))
        if any("**" in part and part != "**" for part in pattern.parts):  # Python 3.13 changes its meaning
            raise RecordingError(
                f'{self._entry_text(entry)}: found files = "{entry.files}", expected ** to stand alone'
            )
        try:
            paths = sorted(path for path in self.folder.glob(entry.files) if path.is_file())
        except (ValueError, NotImplementedError) as error:
            raise RecordingError(f'{self._entry_text(entry)}: found files = "{entry.files}": {error}') from None
        return [self.inside(path.relative_to(self.folder), self._entry_text(entry)) for path in paths]

    def _paths(self, entry: RecordingEntry) -> list[tuple[str, Path]]:
        if entry.file is None and entry.files is None:
            ((stream, file),) = entry.streams.items()
            return [(entry.name, self._require_file(entry, file, f"the stream {stream}"))]
        if entry.file is not None:
            path = self.inside(entry.file, self._entry_text(entry))
            if not path.is_file():
                raise RecordingError(
                    f'{path}: no such file, expected by [[recordings]] "{entry.name}"{_folder_contents(path.parent)}'
                )
            return [(entry.name, path)]
        paths = self._matching(entry)
        if not paths:
            raise RecordingError(
                f'{self.folder / STUDY_FILE}: [[recordings]] "{entry.name}": no file matches "{entry.files}"'
                f"{_folder_contents((self.folder / entry.files).parent)}"
            )
        if len(paths) == 1:
            return [(entry.name, paths[0])]
        return [(f"{entry.name}.{_name_from_stem(path.stem)}", path) for path in paths]

    def _load(self, entry, name, path, files) -> Recording:
        if name in self._loaded:
            return self._loaded[name]
        if entry.file is None and entry.files is None:
            return self._load_stream_alone(entry, name, files)
        columns, digest = self._read_once(path, files)
        specs = self._present_specs(entry, columns)
        channels, garbage_cut = _without_garbage(_make_channels(columns, specs, entry.window))
        channels, repeats = _without_repeats(channels)
        channels |= _integrated_positions(channels) if regressed_joints(self.config) else {}
        payload = Payload(entry.payload.mass, entry.payload.distance) if entry.payload else None
        recording = Recording(
            name=name,
            path=path,
            checksum=digest,
            use=entry.use,
            channels=channels,
            protocol=entry.protocol,
            participant=entry.participant,
            condition=entry.condition,
            payload=payload,
            start=entry.start,
            optical=self._load_optical(entry, files),
            slider=entry.slider,
            streams={stream: self._load_stream(entry, name, stream, files) for stream in entry.streams},
            amplitude=entry.amplitude,
            repetition=entry.repetition,
            period=entry.period,
            cuts=(
                *_excluded_cuts(entry, path, channels["time"].samples),
                *_truncation_cut(path, channels["time"].samples, entry.window),
                *garbage_cut,
            ),
            repeats=repeats,
            uncut=self._uncut_emg(entry, name, path, columns=columns, digest=digest),
        )
        recording = _correct_delays(
            self._without_defects(recording, specs, entry.processing or self.config.processing), specs
        )
        recording = within_streams(self._without_empty_ends(recording))
        self._apart[name] = recording
        self._loaded[name] = self._joined(recording, entry, {})
        return self._loaded[name]

    def _load_stream_alone(self, entry, name, files) -> Recording:
        """Return a maximal contraction of which the stream with EMG alone was recorded."""
        (stream,) = entry.streams
        recording = replace(self._load_stream(entry, name, stream, files), name=name)
        self._apart[name] = self._loaded[name] = recording
        return recording

    def _present_specs(self, entry: RecordingEntry, columns: Columns) -> dict[str, ChannelSpec]:
        """Return the entries of a recording's channels; of a maximal contraction, only time, EMG and those in its
        file."""
        specs = self.config.channels_of(entry)
        if entry.protocol != MAXIMAL_PROTOCOL:
            return specs
        return {
            name: spec
            for name, spec in specs.items()
            if name == "time" or name.startswith("emg.") or spec.value is not None or spec.column in columns
        }

    def _without_empty_ends(self, recording: Recording, stream: str = "") -> Recording:
        """Return a recording without the rows at its ends that lack EMG, or what it is compared with.

        Recordings whose joints are identified are cut into pieces instead.
        """
        tables = [t for t in self.config.procedures.values() if not t.bridges]
        if regressed_joints(self.config) or not tables:
            return recording
        return trim_missing_ends(recording, [n for n in recording.channels if any(t.reads(n, stream) for t in tables)])

    def _uncut_emg(self, entry, name, path, *, columns, digest) -> Recording | None:
        """Return time and EMG of the whole file if a recording is a window of it; None without a window or EMG."""
        specs = {n: s for n, s in self.config.channels_of(entry).items() if n == "time" or n.startswith("emg.")}
        if entry.window is None or len(specs) < 2:
            return None
        channels, _ = _without_repeats(_make_channels(columns, specs, None))
        return _correct_delays(
            Recording(name, path, digest, entry.use, channels, entry.protocol, entry.participant), specs
        )

    def apart(self, name: str) -> Recording:
        """Return a recording as it was before streams were joined."""
        return self._apart[name]

    def rejoined(self, name: str, clocks: Mapping[str, tuple[float, float]]) -> Recording:
        """Return a recording with its streams joined by the offsets [s] and drifts of their `clocks`."""
        entry = self.config.entry_of(name)
        return self._joined(self._apart[name], entry, clocks)

    def _joined(self, recording: Recording, entry: RecordingEntry, clocks: Mapping[str, tuple[float, float]]):
        for stream in entry.streams:
            table, other = self.config.streams[stream], recording.streams[stream]
            if not table.join:
                continue
            offset, drift = entry.offsets.get(stream, table.offset), table.drift
            first = initial_offset(recording, other) if offset == "auto" else offset
            found = clocks.get(stream, (first, 0.0 if drift == "auto" else drift))
            recording = join_stream(recording, other, *found)
        return recording

    def _read_once(self, path: Path, files: dict[Path, Columns]) -> tuple[Columns, str]:
        from ..files.kept_columns import kept_columns

        digest = self.digest(path)
        if path not in files:
            files[path] = kept_columns(self.place("kept"), path, digest)
        return files[path], digest

    def digest(self, path: Path) -> str:
        """Return the SHA-256 of a file, computed once."""
        if path not in self._digests:
            try:
                self._digests[path] = checksum(path) if path.is_file() else ""
            except OSError:  # reading the file will report the error
                self._digests[path] = ""
        return self._digests[path]

    def specs_of(self, recording: Recording) -> dict[str, ChannelSpec]:
        """Return the entries of study.toml for a recording's channels."""
        entry = self.config.entry_of(recording.name)
        if entry is None:
            return self.config.channels
        streams = {n: c for stream in entry.streams for n, c in self.config.joined_channels(stream).items()}
        return {**streams, **self.config.channels_of(entry)}

    def processing_of(self, recording: Recording) -> Processing:
        """Return the processing of a recording's samples before a regression."""
        return self.config.processing_of(recording.name)

    def _load_stream(self, entry, name, stream, files) -> Recording:
        path = self._require_file(entry, entry.streams[stream], f"the stream {stream}")
        columns, digest = self._read_once(path, files)
        specs = self.config.streams[stream].channels
        channels, repeats = _without_repeats(_make_channels(columns, specs, None))
        other = Recording(f"{name}.{stream}", path, digest, entry.use, channels, entry.protocol, entry.participant)
        other = replace(other, cuts=_truncation_cut(path, other.time), repeats=repeats)
        processing = entry.processing or self.config.processing
        other = _correct_delays(self._without_defects(other, specs, processing, stream), specs)
        return self._without_empty_ends(other, stream)

    def _without_defects(
        self, recording: Recording, specs: Mapping[str, ChannelSpec], processing: Processing, stream: str = ""
    ) -> Recording:
        """Return the recording, or one of its streams, with its defects cut out, and what is done to its stamps."""
        found = find_cuts(recording, self.config, specs, processing, stream=stream)
        cuts = tuple(sorted((*recording.cuts, *found), key=lambda cut: cut.first))
        return replace(recording, cuts=cuts, smooth_stamps=processing.stamp_smoothing)

    def _require_file(self, entry, file, what) -> Path:
        path = self.inside(file, self._entry_text(entry))
        if not path.is_file():
            raise RecordingError(
                f'{path}: no such file, expected by {what} of [[recordings]] "{entry.name}"'
                f"{_folder_contents(path.parent)}"
            )
        return path

    def _load_optical(self, entry, files) -> OpticalRecording | None:
        if entry.optical is None:
            return None
        columns, digest = self._read_once(self._require_file(entry, entry.optical, "optical"), files)
        rail, spec = self.config.rail, self.config.optical
        time = _to_si(columns.column(spec.time.column, "time"), spec.time)
        return read_optical(columns, digest, time, spec, carriage=rail.marker if rail is not None else None)


def open_folder(
    folder: str | os.PathLike,
    model: type[StudyFile] | None = None,
    *,
    out: str | os.PathLike | None = None,
    allow_outside: bool = False,
) -> Study:
    """Open a study's folder. Recordings are read only when they are used."""
    from .study_file import StudyFile, parse_study_file

    folder = Path(folder)
    require_folder(folder, f"a study: the folder with a {STUDY_FILE} in it", StudyError)
    if out is not None:
        require_folder(Path(out), "a folder to write to")
    path = require_inside(folder / STUDY_FILE, folder, allow_outside, str(folder))
    config = parse_study_file(path, model or StudyFile)
    if out is not None:
        _require_own_results(Path(out), folder, config.name)
    return Study(folder, config, out=None if out is None else Path(out), allow_outside=allow_outside)


def _require_own_results(out: Path, folder: Path, name: str) -> None:
    """Refuse a folder for results that belongs to another study or has its results: their cards have equal names."""
    if out.resolve() == folder.resolve():
        return
    if (out / STUDY_FILE).exists():
        raise StudyError(f"{out}: found a study of its own, expected a folder for what is found of {folder}")
    others = {row.id.partition(".")[0] for row in _rows_in(out / RESULTS_FILE)} - {name}
    if others:
        raise StudyError(
            f"{out}: found results of {', '.join(sorted(others)[:5])}, expected those of {name} or none; name another "
            "folder to write to"
        )


def _rows_in(path: Path) -> list[ResultRow]:
    """Return the rows of a results.json; none if the file is missing or cannot be read."""
    try:
        return read_rows(path) if path.is_file() else []
    except RecordingError:
        return []


def _correct_delays(recording: Recording, specs: Mapping[str, ChannelSpec]) -> Recording:
    """Return a recording without the lags and delays that study.toml states for its channels."""
    recording = undo_lags(recording, {n: spec.lag for n, spec in specs.items() if spec.lag is not None})
    return shift_channels(recording, {n: spec.delay for n, spec in specs.items() if isinstance(spec.delay, float)})


def _make_channels(columns: Columns, specs: dict[str, ChannelSpec], window) -> dict[str, Channel]:
    _require_file_units(columns, specs)
    for name, spec in specs.items():
        if columns.angle_unit not in (None, spec.unit) and spec.unit in ("deg", "rad"):
            raise RecordingError(
                f"{columns.path.name}: channel {name}: study.toml says {spec.unit}, the file's header says "
                f"{columns.angle_unit}"
            )
    values = {n: _read_samples(columns, n, spec) for n, spec in specs.items() if spec.rate is None}
    rate = specs["time"].rate
    if rate is not None:
        values = _without_empty_ends(values)
        values["time"] = np.arange(max((len(samples) for samples in values.values()), default=0)) / rate
    time = values["time"]
    n = len(time)
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
                f"found times from {np.nanmin(time):g} s to {np.nanmax(time):g} s"
            )
        values = {name: samples[inside] for name, samples in values.items()}
    for samples in values.values():
        samples.flags.writeable = False  # so that the channel does not copy them
    return {name: Channel(name, values[name], spec.si_unit, spec.column) for name, spec in specs.items()}


def _without_repeats(channels: dict[str, Channel]) -> tuple[dict[str, Channel], int]:
    """Return the channels without the rows of packets delivered twice, and the number of those rows."""
    samples = {name: channel.samples for name, channel in channels.items() if name != "time"}
    first = first_deliveries(channels["time"].samples, samples)
    repeats = int(np.sum(~first))
    if not repeats:
        return channels, 0
    return {name: replace(channel, samples=channel.samples[first]) for name, channel in channels.items()}, repeats


def _integrated_positions(channels: Mapping[str, Channel]) -> dict[str, Channel]:
    """Return the integral of each velocity whose joint has no position, from 0 on.

    Its zero is arbitrary; a joint's weight has a sine and a cosine, so that the fit finds it.
    """
    time, made = channels["time"].samples, {}
    for name, velocity in channels.items():
        head, _, joint = name.partition(".")
        ending = f".{joint}" if joint else ""
        if head != "velocity" or velocity.unit not in ("rad/s", "m/s"):
            continue
        if any(f"{place}{ending}" in channels for place in ("position", "motor_position")):
            continue
        steps = np.diff(time, prepend=time[0]) * 0.5 * (velocity.samples + np.roll(velocity.samples, 1))
        place = np.cumsum(np.where(np.isfinite(steps), steps, 0.0))
        place[~np.isfinite(velocity.samples)] = np.nan
        made[f"position{ending}"] = Channel(
            f"position{ending}", place, velocity.unit.removesuffix("/s"), velocity.column
        )
    return made


def _without_garbage(channels: dict[str, Channel]) -> tuple[dict[str, Channel], tuple[Cut, ...]]:
    """Return the channels without rows of garbage at either end, and one cut that says so; none without any."""
    time = channels["time"].samples
    found = find_garbage(time, {name: channel.samples for name, channel in channels.items() if name != "time"})
    if found is None or len(time) - found.head - found.tail < 2:
        return channels, ()
    kept = slice(found.head, len(time) - found.tail)
    sane = {name: replace(channel, samples=channel.samples[kept]) for name, channel in channels.items()}
    text = f"{found.where} of {len(time)} rows of garbage: {found.cause}"
    start = float(sane["time"].samples[0 if found.head else -1])
    first = 0 if found.head else len(time) - found.head - found.tail
    return sane, (Cut(GARBAGE_KIND, "time", start, start, first, first - 1, text),)


def _read_samples(columns: Columns, name: str, spec: ChannelSpec) -> np.ndarray:
    less = columns.column(spec.minus.column, name) if spec.minus is not None else None
    stored = _listed(columns, name, spec) if spec.value is None else np.array([spec.value])
    if less is not None and len(less) != len(stored) and min(len(less), len(stored)) != 1:
        raise RecordingError(
            f"{columns.path.name}: channel {name}: column {spec.column!r} has {len(stored)} samples, column "
            f"{spec.minus.column!r}, which is taken off it, {len(less)}; expected as many"
        )
    if spec.wrap_bits is not None and np.isfinite(stored).any():
        known = stored[np.isfinite(stored)][:: max(1, len(stored) // 200_000)]
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


def _excluded_cuts(entry: RecordingEntry, path: Path, time: np.ndarray) -> tuple[Cut, ...]:
    """Return the cuts that study.toml asks for in a recording with samples at `time`, shape (n,) [s]."""
    cuts = []
    for start, stop in entry.exclude:
        inside = np.flatnonzero((time >= start) & (time < stop))
        if inside.size:
            first, last = int(inside[0]), int(inside[-1])
            found = "what study.toml excludes"
            cuts.append(Cut("excluded", "time", float(time[first]), stop, first, last, found, by="hand"))
        elif entry.file is not None:
            # A pattern may match files of different lengths. In a single file, a missing stretch is a mistake.
            raise RecordingError(
                f"{path.name} (recording {entry.name}): exclude {start:g} s to {stop:g} s holds no sample, found times "
                f"from {np.nanmin(time):g} s to {np.nanmax(time):g} s"
            )
    return tuple(cuts)


def _truncation_cut(path: Path, time: np.ndarray, window: tuple[float, float] | None = None) -> tuple[Cut, ...]:
    """Return a cut for the missing end of a truncated file, if its `window` [s] reaches the end; else none.

    The complete samples were taken at `time`, shape (n,) [s].
    """
    from ..files.readers.read import find_lost_end

    lost = find_lost_end(path)
    if not lost or (window is not None and window[1] <= time[-1]):
        return ()
    found = f"{lost}, where the file is truncated"
    return (Cut("truncated", "time", float(time[-1]), float(time[-1]), len(time), len(time) - 1, found),)


def _require_file_units(columns: Columns, specs: dict[str, ChannelSpec]) -> None:
    for name, spec in specs.items():
        used = (spec.column,) if spec.minus is None else (spec.column, spec.minus.column)
        # A scale says that the stored numbers are counts, or in another unit than the one that follows from them.
        stated = [] if spec.scale != 1.0 else [columns.units[c] for c in used if c in columns.units]
        file_unit = next((unit for unit in stated if contradicts_unit(unit, spec.unit)), None)
        if file_unit is not None:
            raise RecordingError(
                f'{columns.path.name}: channel {name}: study.toml says {spec.unit}, the file itself "{file_unit}"'
            )


def _to_si(stored: np.ndarray, spec: ChannelSpec, less: np.ndarray | None = None) -> np.ndarray:
    """Convert stored numbers, minus those of the column `less`, to SI, in the order that `ChannelSpec` states."""
    values = _decode_counts(stored, spec)
    # Each pass over a recording of hours takes long, so steps without an effect are skipped.
    if spec.sign * spec.scale != 1.0:
        values *= spec.sign * spec.scale
    if less is not None:
        values = values - spec.sign * (spec.minus.scale or spec.scale) * _decode_counts(less, spec)
    if spec.offset:
        values += spec.offset
    if spec.si_factor != 1.0:
        values *= spec.si_factor
    if spec.si_offset:
        values += spec.si_offset
    if spec.wrap is not None:
        _unwrap(values, spec.wrap)
    return values


def _decode_counts(stored: np.ndarray, spec: ChannelSpec) -> np.ndarray:
    """Return stored numbers with their sign, without jumps of a rolling count, and with missing samples as NaN."""
    values = np.array(stored, dtype=np.float64)
    if isinstance(spec.missing, float):
        values[values == spec.missing] = np.nan
    if spec.signed_bits is not None:
        values = np.where(values >= 2.0 ** (spec.signed_bits - 1), values - 2.0**spec.signed_bits, values)
    if spec.wrap_bits is not None:
        _unwrap(values, 2.0**spec.wrap_bits)
    return values


def _unwrap(values: np.ndarray, period: float) -> None:
    """Remove jumps of whole periods in place, across gaps too; missing samples stay missing."""
    known = np.isfinite(values)
    values[known] = np.unwrap(values[known], period=period)


def _name_from_stem(stem: str) -> str:
    """Return a file's stem as part of a recording's name, without characters that pages or formulas interpret."""
    return re.sub(r"[^\w .()+,=-]", "_", stem)


def _folder_contents(folder: Path) -> str:
    names = sorted(p.name for p in folder.iterdir()) if folder.is_dir() else None
    if names is None:
        return f"; there is no folder {folder.name}"
    return f"; {folder.name} holds {', '.join(names[:DISPLAYED_FILE_COUNT]) or 'nothing'}"


def drive_channel(recording: Recording, study: Study) -> str | None:
    """Return the name of the channel with the drive's command; None if the recording has none."""
    drive = study.rig.drive
    return command_channel(recording, drive.kind) if drive else None
