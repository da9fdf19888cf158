"""A study: a folder with study.toml, the recordings it names, and what was made of them."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._errors import IdentificationError, RecordingError, StudyError
from .._given import require_folder, require_inside
from .clock import first_deliveries
from .cut import Cut
from .defects.find import find_cuts
from .delay import led, moved
from .joined_stream import initial_offset, join_stream
from .optical import OpticalRecording, read_optical
from .recording import Channel, Payload, Recording
from .results import ResultRow, read_rows

if TYPE_CHECKING:
    from .readers import Columns
    from .study_fields import Table
    from .study_file import ChannelSpec, JointTable, Model, Processing, RecordingEntry, SeveralJoints, StudyFile

STUDY_FILE = "study.toml"
RESULTS_FILE = "results.json"


@dataclass(frozen=True, eq=False)
class Study:
    """A study's folder, and what its study.toml says.

    Attributes
    ----------
    folder : Path
        The study.
    config : StudyFile
        study.toml, in SI.
    out : Path or None
        Folder that everything is written to instead of the study's own, which may be read-only.
    allow_outside : bool
        Whether files outside the study's folder are read where study.toml names them, or a link leads there.
    accept_stale : bool
        Whether a model card is used that was made from something else than the study as it is now.
    """

    folder: Path
    config: StudyFile = field(repr=False)
    _loaded: dict = field(default_factory=dict, repr=False)
    _digests: dict[Path, str] = field(default_factory=dict, repr=False)
    _apart: dict[str, Recording] = field(default_factory=dict, repr=False)  # Before streams were joined
    found: dict = field(default_factory=dict, repr=False)  # What a procedure found of the recordings, not to ask twice
    _left_out: frozenset[str] = field(default=frozenset(), repr=False)
    out: Path | None = None
    allow_outside: bool = False
    accept_stale: bool = False

    @property
    def name(self) -> str:
        """First part of every figure's id."""
        return self.config.name

    @property
    def rig(self) -> JointTable | SeveralJoints:
        """The machine: its joint, or several of them in `joints`."""
        return self.config.rig

    @property
    def processing(self) -> Processing:
        """What is done to samples before a regression."""
        return self.config.processing

    @property
    def model(self) -> Model:
        """What is identified."""
        return self.config.model

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
        """Remarks the report repeats."""
        return self.config.notes

    @property
    def models_dir(self) -> Path:
        """Where model cards are written."""
        return self.place("models")

    @property
    def results_path(self) -> Path:
        """Every figure the commands printed."""
        return self.made / RESULTS_FILE

    @property
    def report_dir(self) -> Path:
        """Where the report is."""
        return self.place("report")

    def kept_path(self, procedure: str) -> Path:
        """Where what a procedure found is kept, to be drawn again."""
        return self.place("kept") / f"{procedure}.npz"

    @property
    def made(self) -> Path:
        """Folder of everything that is made of the study."""
        return self.folder if self.out is None else self.out

    def place(self, name: str) -> Path:
        """Folder below `made` that something is written to; a PellucidError if a link leads out of the study."""
        path = self.made / name
        return path if self.out is not None else require_inside(path, self.folder, self.allow_outside, name)

    def inside(self, file: str | Path, where: str) -> Path:
        """A file of the study by its path from the folder; a PellucidError, which says `where` it was named, if it lies
        outside."""
        return require_inside(self.folder / file, self.folder, self.allow_outside, where)

    def cards(self, pattern: str = "*.json") -> tuple[Path, ...]:
        """Model cards whose names match, in order of name; of two of one name the one in `models_dir`."""
        found = {path.name: path for path in sorted((self.folder / "models").glob(pattern))}
        found = {name: self.inside(Path("models") / name, f"model card {name}") for name in found}
        found |= {path.name: path for path in self.models_dir.glob(pattern) if self.out is not None}
        return tuple(found[name] for name in sorted(found))

    def card(self, name: str) -> Path:
        """Where the model card of that file name is, or would be."""
        where = f"model card {name}"
        if self.out is not None:
            own = require_inside(self.models_dir / name, self.out, self.allow_outside, where)
            if own.is_file():
                return own
        return self.inside(Path("models") / name, where)

    def files(self) -> tuple[Path, ...]:
        """Every file that study.toml names among the recordings, once."""
        found = []
        for entry in self.config.recordings:
            found += [path for _, path in self._paths(entry)]
            beside = [file for file in (entry.optical, *entry.streams.values()) if file is not None]
            found += [self.inside(file, self._named_by(entry)) for file in beside]
        return tuple(dict.fromkeys(found))

    def fingerprint(self, more: Iterable[Path] = ()) -> str:
        """SHA-256 of study.toml, of every recording's file, of `more` files, and of Pellucid's own code."""
        from .kept import code_fingerprint

        digests = {}
        for path in (self.folder / STUDY_FILE, *self.files()):
            digests[path] = self.digest(path)
        # Cards are written anew while a study is open; its recordings are read once.
        digests |= {path: checksum(path) if path.is_file() else "" for path in more}
        parts = [code_fingerprint()]
        # A file may lie outside the study's folder.
        parts += [f"{os.path.relpath(path, self.folder)} {digest}" for path, digest in digests.items()]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()

    def recordings(self, use: str | None = None) -> tuple[Recording, ...]:
        """Recordings in the order study.toml names them; each file is read once.

        Parameters
        ----------
        use : str or None
            ``"fit"`` or ``"validate"``; None for all.

        Raises
        ------
        RecordingError
            If a file is missing or unreadable, or lacks a column; names file, channel, found and expected.
        """
        if use not in (None, "fit", "validate"):
            raise RecordingError(f'use: found {use!r}, expected "fit", "validate" or None')
        files: dict[Path, Columns] = {}
        found = [
            self._load(entry, name, path, files)
            for entry in self.config.recordings
            if use is None or entry.use == use
            for name, path in self._paths(entry)
            if name not in self._left_out
        ]
        return tuple(found)

    def without(self, names: Iterable[str]) -> Study:
        """The same study without some of its recordings."""
        return replace(self, _left_out=self._left_out | frozenset(names))

    def recording(self, name: str) -> Recording:
        """One recording by its name.

        Raises
        ------
        RecordingError
            If study.toml names no such recording, or it cannot be read.
        """
        names = []
        for entry in self.config.recordings:
            # A pattern's recordings are known only once their files are listed.
            if entry.file is not None and entry.name != name:
                names.append(entry.name)
                continue
            for each, path in self._paths(entry):
                names.append(each)
                if each == name:
                    return self._load(entry, each, path, {})
        raise RecordingError(f'{self.folder / STUDY_FILE}: no recording "{name}", found {", ".join(names) or "none"}')

    def _named_by(self, entry: RecordingEntry) -> str:
        return f'{self.folder / STUDY_FILE}: [[recordings]] "{entry.name}"'

    def _matching(self, entry: RecordingEntry) -> list[Path]:
        pattern = Path(entry.files)
        # Whoever may not read outside may not look there either.
        if ".." in pattern.parts or pattern.is_absolute():
            self.inside(entry.files, self._named_by(entry))
        if any("**" in part and part != "**" for part in pattern.parts):  # another meaning from Python 3.13 on
            raise RecordingError(f'{self._named_by(entry)}: found files = "{entry.files}", expected ** to stand alone')
        try:
            paths = sorted(path for path in self.folder.glob(entry.files) if path.is_file())
        except (ValueError, NotImplementedError) as error:
            raise RecordingError(f'{self._named_by(entry)}: found files = "{entry.files}": {error}') from None
        return [self.inside(path.relative_to(self.folder), self._named_by(entry)) for path in paths]

    def _paths(self, entry: RecordingEntry) -> list[tuple[str, Path]]:
        if entry.file is not None:
            path = self.inside(entry.file, self._named_by(entry))
            if not path.is_file():
                raise RecordingError(
                    f'{path}: no such file, expected by [[recordings]] "{entry.name}"{_present(path.parent)}'
                )
            return [(entry.name, path)]
        paths = self._matching(entry)
        if not paths:
            raise RecordingError(
                f'{self.folder / STUDY_FILE}: [[recordings]] "{entry.name}": no file matches "{entry.files}"'
                f"{_present((self.folder / entry.files).parent)}"
            )
        if len(paths) == 1:
            return [(entry.name, paths[0])]
        return [(f"{entry.name}.{_as_name(path.stem)}", path) for path in paths]

    def _load(self, entry, name, path, files) -> Recording:
        if name in self._loaded:
            return self._loaded[name]
        columns, digest = self._read_once(path, files)
        channels, repeats = _delivered_once(_channels(columns, self.config.channels_of(entry), entry.window))
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
                *_excluded(entry, path, channels["time"].samples),
                *_cut_row(path, channels["time"].samples, entry.window),
            ),
            repeats=repeats,
            uncut=self._uncut_emg(entry, name, path, columns, digest),
        )
        specs = self.config.channels_of(entry)
        recording = _in_time(self._without_defects(recording, specs, entry.processing or self.config.processing), specs)
        self._apart[name] = recording
        self._loaded[name] = self._joined(recording, entry, {})
        return self._loaded[name]

    def _uncut_emg(self, entry, name, path, columns, digest) -> Recording | None:
        """Time and EMG of the whole file, where a recording is a window of it; None without either."""
        specs = {n: s for n, s in self.config.channels_of(entry).items() if n == "time" or n.startswith("emg.")}
        if entry.window is None or len(specs) < 2:
            return None
        channels, _ = _delivered_once(_channels(columns, specs, None))
        return _in_time(Recording(name, path, digest, entry.use, channels, entry.protocol, entry.participant), specs)

    def apart(self, name: str) -> Recording:
        """A recording before streams were joined."""
        return self._apart[name]

    def rejoined(self, name: str, clocks: Mapping[str, tuple[float, float]]) -> Recording:
        """A recording with its streams joined by offsets [s] and drifts that were found of their `clocks`."""
        entry = self.config.entry_of(name)
        return self._joined(self._apart[name], entry, clocks)

    def _joined(self, recording: Recording, entry: RecordingEntry, clocks: Mapping[str, tuple[float, float]]):
        for stream in entry.streams:
            table, beside = self.config.streams[stream], recording.streams[stream]
            if not table.join:
                continue
            offset, drift = entry.offsets.get(stream, table.offset), table.drift
            first = initial_offset(recording, beside) if offset == "auto" else offset
            found = clocks.get(stream, (first, 0.0 if drift == "auto" else drift))
            recording = join_stream(recording, beside, *found)
        return recording

    def _read_once(self, path: Path, files: dict[Path, Columns]) -> tuple[Columns, str]:
        from .kept_columns import kept_columns

        digest = self.digest(path)
        if path not in files:
            files[path] = kept_columns(self.place("kept"), path, digest)
        return files[path], digest

    def digest(self, path: Path) -> str:
        """SHA-256 of a file, taken once."""
        if path not in self._digests:
            try:
                self._digests[path] = checksum(path) if path.is_file() else ""
            except OSError:  # whoever reads it says so
                self._digests[path] = ""
        return self._digests[path]

    def specs_of(self, recording: Recording) -> dict[str, ChannelSpec]:
        """What study.toml says of a recording's channels."""
        entry = self.config.entry_of(recording.name)
        if entry is None:
            return self.config.channels
        streams = {n: c for stream in entry.streams for n, c in self.config.joined_channels(stream).items()}
        return {**streams, **self.config.channels_of(entry)}

    def processing_of(self, recording: Recording) -> Processing:
        """What is done to the samples of a recording before a regression."""
        return self.config.processing_of(recording.name)

    def _load_stream(self, entry, name, stream, files) -> Recording:
        path = self._beside(entry, entry.streams[stream], f"the stream {stream}")
        columns, digest = self._read_once(path, files)
        specs = self.config.streams[stream].channels
        channels, repeats = _delivered_once(_channels(columns, specs, None))
        made = Recording(f"{name}.{stream}", path, digest, entry.use, channels, entry.protocol, entry.participant)
        made = replace(made, cuts=_cut_row(path, made.time), repeats=repeats)
        return _in_time(self._without_defects(made, specs, entry.processing or self.config.processing, stream), specs)

    def _without_defects(
        self, recording: Recording, specs: Mapping[str, ChannelSpec], processing: Processing, stream: str = ""
    ) -> Recording:
        """The recording, or one of its streams, with what is bad in it cut out."""
        found = find_cuts(recording, self.config, specs, processing, stream)
        return replace(recording, cuts=tuple(sorted((*recording.cuts, *found), key=lambda cut: cut.first)))

    def _beside(self, entry, file, what) -> Path:
        path = self.inside(file, self._named_by(entry))
        if not path.is_file():
            raise RecordingError(
                f'{path}: no such file, expected by {what} of [[recordings]] "{entry.name}"{_present(path.parent)}'
            )
        return path

    def _load_optical(self, entry, files) -> OpticalRecording | None:
        if entry.optical is None:
            return None
        columns, digest = self._read_once(self._beside(entry, entry.optical, "optical"), files)
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
    """Open a study's folder; recordings are read when they are asked for."""
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
    """Refuse a folder to write to that is another study's, or holds its results: cards of both have the same names."""
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
    """Rows of a results.json; none where there is no such file, or none that can be read."""
    try:
        return read_rows(path) if path.is_file() else []
    except RecordingError:
        return []


def _in_time(recording: Recording, specs: Mapping[str, ChannelSpec]) -> Recording:
    """A recording whose channels lie where study.toml says that they belong."""
    recording = led(recording, {n: spec.lag for n, spec in specs.items() if spec.lag is not None})
    return moved(recording, {n: spec.delay for n, spec in specs.items() if isinstance(spec.delay, float)})


def checksum(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _channels(columns: Columns, specs: dict[str, ChannelSpec], window) -> dict[str, Channel]:
    _require_the_files_units(columns, specs)
    for name, spec in specs.items():
        if columns.angle_unit not in (None, spec.unit) and spec.unit in ("deg", "rad"):
            raise RecordingError(
                f"{columns.path.name}: channel {name}: study.toml says {spec.unit}, the file's header says "
                f"{columns.angle_unit}"
            )
    # One column after another: of hours each takes much memory.
    values = {n: _of_columns(columns, n, spec) for n, spec in specs.items() if spec.rate is None}
    rate = specs["time"].rate
    if rate is not None:
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
        samples.flags.writeable = False  # nobody else has them: a channel needs no copy
    return {name: Channel(name, values[name], spec.si_unit, spec.column) for name, spec in specs.items()}


def _delivered_once(channels: dict[str, Channel]) -> tuple[dict[str, Channel], int]:
    """The channels without rows that are a packet's second delivery, and how many rows those were."""
    samples = {name: channel.samples for name, channel in channels.items() if name != "time"}
    first = first_deliveries(channels["time"].samples, samples)
    repeats = int(np.sum(~first))
    if not repeats:
        return channels, 0
    return {name: replace(channel, samples=channel.samples[first]) for name, channel in channels.items()}, repeats


def _of_columns(columns: Columns, name: str, spec: ChannelSpec) -> np.ndarray:
    less = columns.column(spec.minus.column, name) if spec.minus is not None else None
    stored = columns.column(spec.column, name) if spec.value is None else np.array([spec.value])
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


def _excluded(entry: RecordingEntry, path: Path, time: np.ndarray) -> tuple[Cut, ...]:
    """What study.toml leaves out of a recording whose samples were taken at `time`, shape (n,) [s]."""
    cuts = []
    for start, stop in entry.exclude:
        inside = np.flatnonzero((time >= start) & (time < stop))
        if inside.size:
            first, last = int(inside[0]), int(inside[-1])
            found = "what study.toml excludes"
            cuts.append(Cut("excluded", "time", float(time[first]), stop, first, last, found, by="hand"))
        elif entry.file is not None:
            # Of many files some are shorter than others; of one, a stretch that is not there is a mistake.
            raise RecordingError(
                f"{path.name} (recording {entry.name}): exclude {start:g} s to {stop:g} s holds no sample, found times "
                f"from {np.nanmin(time):g} s to {np.nanmax(time):g} s"
            )
    return tuple(cuts)


def _cut_row(path: Path, time: np.ndarray, window: tuple[float, float] | None = None) -> tuple[Cut, ...]:
    """The last row of a text file in which its writer was cut off, after samples at `time`, shape (n,) [s], of a
    `window` [s]."""
    from .readers.csv import ENDINGS, cut_row

    cut = cut_row(path) if path.suffix.lower() in ENDINGS else None
    if cut is None or (window is not None and window[1] <= time[-1]):
        return ()
    text = cut.text if len(cut.text) <= 40 else f"{cut.text[:37]}..."
    found = f'an incomplete last row, "{text}", where the file is truncated'
    return (Cut("truncated", "time", float(time[-1]), float(time[-1]), len(time), len(time) - 1, found),)


def _require_the_files_units(columns: Columns, specs: dict[str, ChannelSpec]) -> None:
    for name, spec in specs.items():
        of = (spec.column,) if spec.minus is None else (spec.column, spec.minus.column)
        said = next((columns.units[c] for c in of if columns.units.get(c) not in (None, spec.unit)), None)
        if said is not None:
            raise RecordingError(
                f'{columns.path.name}: channel {name}: study.toml says {spec.unit}, the file itself "{said}"'
            )


def _to_si(stored: np.ndarray, spec: ChannelSpec, less: np.ndarray | None = None) -> np.ndarray:
    """Stored numbers, and those of the column taken off them, to SI, in the order `ChannelSpec` states."""
    values = _counts(stored, spec)
    # Of hours each pass takes long: what changes nothing is left out.
    if spec.sign * spec.scale != 1.0:
        values *= spec.sign * spec.scale
    if less is not None:
        values = values - spec.sign * (spec.minus.scale or spec.scale) * _counts(less, spec)
    if spec.offset:
        values += spec.offset
    if spec.si_factor != 1.0:
        values *= spec.si_factor
    if spec.si_offset:
        values += spec.si_offset
    if spec.wrap is not None:
        _unwrap(values, spec.wrap)
    return values


def _counts(stored: np.ndarray, spec: ChannelSpec) -> np.ndarray:
    """What is stored, as the numbers that were meant."""
    values = np.array(stored, dtype=np.float64)
    if isinstance(spec.missing, float):
        values[values == spec.missing] = np.nan
    if spec.signed_bits is not None:
        values = np.where(values >= 2.0 ** (spec.signed_bits - 1), values - 2.0**spec.signed_bits, values)
    if spec.wrap_bits is not None:
        _unwrap(values, 2.0**spec.wrap_bits)
    return values


def _unwrap(values: np.ndarray, period: float) -> None:
    """Undo jumps of whole periods in place; a gap is stepped over, and missing samples stay missing."""
    known = np.isfinite(values)
    values[known] = np.unwrap(values[known], period=period)


def _as_name(stem: str) -> str:
    """A file's name as part of a recording's: what could mean something on a page or in a formula is left out."""
    return re.sub(r"[^\w .()+,=-]", "_", stem)


def _present(folder: Path) -> str:
    names = sorted(p.name for p in folder.iterdir()) if folder.is_dir() else None
    if names is None:
        return f"; there is no folder {folder.name}"
    return f"; {folder.name} holds {', '.join(names[:20]) or 'nothing'}"
