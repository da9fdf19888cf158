"""Collect the signals of nested values, including layouts in which programs store names and units apart from numbers.

The layouts are Simulink's "Structure With Time", timeseries and Dataset, captures of dSPACE ControlDesk, and matrices
with a list of names of their columns. Everything else is named by its dotted path, as `flatten` does.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ..stated_units import split_unit, unit_from_text
from ._caps import max_columns, require_few_columns, require_unpacked_size
from ._columns import Columns
from ._flatten import flatten, with_samples_down

MAX_DEPTH = 40
"""Values are nested at most so deep; an object that refers to its owner would be nested without end."""

MIN_TRIAL_ROWS = 8
"""A list of structs holds vectors, not samples, if its entries hold vectors of at least so many numbers."""

LEFT_OUT_COLUMN = "further recordings"
"""Name of the column that says how many recordings of a file exceed the cap on columns."""

LABEL_KEYS = frozenset({
    "colheaders", "columnlabels", "columnnames", "columns", "labels", "label", "channels", "channelnames",
    "channellabels", "channelname", "names", "name", "varnames", "variablenames", "variables", "signalnames",
    "description", "jointnames", "joints", "dofnames", "musclenames", "muscles", "headers", "header", "fields",
    "fieldnames", "features", "markernames", "sensornames", "motornames",
})  # fmt: skip
"""Keys, folded, of lists that may name the columns of a matrix in the same struct."""

LABEL_SUFFIXES = ("names", "labels", "columns", "channels", "joints")
"""Ends of the keys, folded, of lists that name the columns of one matrix: ``q_names`` those of ``q``."""

UNIT_KEYS = frozenset({"unit", "units", "channelunits", "columnunits", "physicalunits", "dimension", "dimensions"})
"""Keys, folded, of a unit, or of a list with the unit of each column."""

RATE_KEYS = frozenset({
    "fs", "rate", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "sfreq", "srate", "fps",
    "frequency", "framerate", "samplingfreq", "samplefreq", "sampleratehz", "samplingratehz", "fshz", "ratehz",
    "controlfreq",
})  # fmt: skip
"""Keys, folded, of a sampling rate [Hz]."""

TIME_KEYS = frozenset({"time", "t", "times", "timestamp", "timestamps", "stamp", "tout"})
"""Keys, folded, of the times of signals in the same struct."""

_RECORDING_LIST = re.compile(
    r"(?:.*[_\s-])?(?:trial|demo|episode|recording|run|rep|repetition|take|session|sweep|experiment|measurement|test)s?[_\s-]?\d*",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Stated:
    """Numbers with what the file states of them."""

    samples: np.ndarray
    labels: tuple[str, ...] = ()  # name of each column
    units: tuple[str, ...] = ()  # unit of each column, or of all


def folded(key: object) -> str:
    """Return a key without case, and without the signs between and behind its words."""
    return re.sub(r"[\s_.-]+", "", str(key)).casefold()


def text_of(value: Any) -> str:
    """Return a value that is one text, stripped; "" for any other value."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "US" and value.size == 1:
        value = value.item()
    if isinstance(value, (list, tuple)) and len(value) == 1:
        value = value[0]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return re.sub(r"\s+", " ", value).strip() if isinstance(value, str) else ""


def texts_of(value: Any) -> tuple[str, ...]:
    """Return a value that is a list of texts, stripped; () for any other value. A single text is a list of one."""
    if isinstance(value, np.ndarray):
        value = value.ravel().tolist() if value.dtype.kind in "USO" else ()
    if isinstance(value, (str, bytes)):
        value = [value]
    if not isinstance(value, (list, tuple)) or not value:
        return ()
    found = tuple(text_of(item) for item in value)
    return found if all(isinstance(item, (str, bytes)) or text_of(item) for item in value) else ()


def left_out_text(count: int) -> str:
    """Return the message that the limit on columns excludes so many recordings."""
    return (
        f"{count} recordings at the file's end are excluded, because the file has more than {max_columns():g} "
        "columns; to read all of them, set PELLUCID_MOST_COLUMNS=NUMBER"
    )


def is_recording_name(name: str) -> bool:
    """Whether a name, such as ``demo_0`` or ``trials``, says that what it holds are recordings."""
    return _RECORDING_LIST.fullmatch(name.rpartition(".")[2]) is not None


class Signals:
    """The signals of one file, as they are found."""

    def __init__(self, path: Path):
        self._path = path
        self.values: dict[str, np.ndarray | str] = {}
        self.units: dict[str | int, str] = {}
        self.facts: dict[str, str] = {}
        self.recordings: list[str] = []
        self._series: dict[str, list[_Series]] = {}
        self._rates: dict[str, float] = {}

    def add_file(self, content: Mapping[str, Any]) -> None:
        """Add a file's variables. The name of a single struct adds nothing if it is the file's, or that of a capture:
        another recording has another."""
        if len(content) == 1:
            ((name, value),) = content.items()
            is_named_so = folded(name) == folded(self._path.stem)
            if isinstance(value, Mapping) and (is_named_so or _capture(_fields(value)) is not None):
                content = value
        self.add(content, "")

    def add(self, value: Any, name: str, depth: int = 0) -> None:
        """Add the numbers of a value by their dotted paths; known layouts are read by their own names."""
        if depth > MAX_DEPTH:
            raise RecordingError(
                f'{self._path.name}: "{name[:60]}" is nested more deeply than expected: at most {MAX_DEPTH} levels'
            )
        if isinstance(value, Mapping):
            self._add_mapping(value, name, depth)
        elif isinstance(value, Stated):
            self._add_matrix(value.samples, name, value.labels, value.units)
        elif isinstance(value, (list, tuple)) and value and all(isinstance(item, Mapping) for item in value):
            self._add_structs(value, name, depth)
        elif isinstance(value, (list, tuple)) and any(_is_nested(item) for item in value):
            for i, item in enumerate(value):
                self.add(item, f"{name}.{i}", depth + 1)
        else:
            self._add_plain(value, name)

    def state_rate(self, place: str, rate: float) -> None:
        """State the sampling rate of a column, or of all below a path [Hz]."""
        self._rates[place] = rate

    def columns(self) -> Columns:
        """Return everything that was added."""
        self._add_series()
        self._add_rates()
        numeric = {name: x for name, x in self.values.items() if not isinstance(x, str)}
        require_unpacked_size(self._path, sum(map(len, numeric.values())))
        # A setting in a struct is told by its last word, if no other one is called so.
        scalars = [(name.rpartition(".")[2], x) for name, x in numeric.items() if len(x) == 1 and "." in name]
        leaves = [leaf for leaf, _ in scalars]
        facts = {
            leaf: f"{x[0]:.12g}"
            for leaf, x in scalars
            if leaves.count(leaf) == 1 and leaf not in numeric and folded(leaf) not in RATE_KEYS
        }
        return Columns(
            self._path, self.values, units=self.units, facts=facts | self.facts, recordings=tuple(self.recordings)
        )

    def _add_mapping(self, value: Mapping[str, Any], name: str, depth: int) -> None:
        fields = _fields(value)
        capture = _capture(fields)
        if capture is not None:
            self._add_capture(capture, name)
        elif _is_structure_with_time(fields):
            self._add_structure_with_time(fields, name, depth)
        elif (series := _timeseries(fields, name)) is not None:
            self._series.setdefault(name.rpartition(".")[0], []).append(series)
        elif (elements := _elements(fields)) is not None:
            for i, element in enumerate(elements):
                self._add_element(element, name, i, depth)
        else:
            self._add_labelled(value, name, depth)

    def _add_structs(self, value: Sequence[Mapping[str, Any]], name: str, depth: int) -> None:
        """Add a list of structs: samples, each with a number a field, or trials and joints, each with vectors."""
        if any(_holds_vectors(item) for item in value):
            parts = {f"{name}.{i}": item for i, item in enumerate(value)}
            self._add_alike(parts, depth, is_recording_name(name) or len(set(map(_longest, value))) > 1)
        else:
            flatten(value, name, self.values, self._path)  # type: ignore[arg-type]

    def _add_alike(self, parts: Mapping[str, Any], depth: int, are_recordings: bool) -> None:
        """Add structs of the same form by their paths, and note the innermost ones that are recordings."""
        width = 0
        for i, (path, part) in enumerate(parts.items()):
            if are_recordings and len(self.values) + width > max_columns():
                self.values[LEFT_OUT_COLUMN] = left_out_text(len(parts) - i)
                return
            columns, recordings = len(self.values), len(self.recordings)
            self.add(part, path, depth + 1)
            width = max(width, len(self.values) - columns)
            if are_recordings and len(parts) > 1 and len(self.recordings) == recordings:
                self.recordings.append(path)

    def _add_labelled(self, value: Mapping[str, Any], name: str, depth: int) -> None:
        """Add a struct's fields; a list names the columns of a matrix in the same struct if their numbers are equal."""
        keys = {key: folded(key) for key in value}
        lists = {keys[key]: found for key, item in value.items() if len(found := texts_of(item)) > 1}
        shared = next((found for key, found in lists.items() if key in LABEL_KEYS), ())
        units = next((found for key in value if keys[key] in UNIT_KEYS and (found := texts_of(value[key]))), ())
        by_name: Mapping[str, Any] = next(
            (value[key] for key in value if keys[key] in UNIT_KEYS and isinstance(value[key], Mapping)), {}
        )
        vectors = [key for key, item in value.items() if isinstance(item, np.ndarray) and item.size > 1]
        alike = _alike_structs(value)
        rate = next(
            (rate for key in value if keys[key] in RATE_KEYS and (rate := _rate_of(value[key])) is not None), None
        )
        # Beside times, a frequency may be that of the motion.
        if rate is not None and not any(keys[key] in TIME_KEYS for key in vectors):
            self.state_rate(name, rate)
        for key, item in value.items():
            path = f"{name}.{key}" if name else str(key)
            if key in alike:
                group = alike[key]
                if key == group[0]:
                    paths = {f"{name}.{other}" if name else str(other): value[other] for other in group}
                    self._add_alike(paths, depth, are_recordings=True)
                continue
            own = (lists.get(f"{keys[key]}{word}") for word in LABEL_SUFFIXES)
            labels = next((found for found in own if found), lists.get(keys[key].replace("values", "items"), shared))
            parts = list(enumerate(item)) if isinstance(item, list) else [(None, item)]
            if labels and all(_fits(part, labels) for _, part in parts):
                for i, part in parts:
                    stated = part.units if isinstance(part, Stated) and part.units else units
                    matrix = part.samples if isinstance(part, Stated) else part
                    self._add_matrix(matrix, path if i is None else f"{path}.{i}", labels, stated)
                continue
            self.add(item, path, depth + 1)
            said = text_of(by_name.get(key))
            if not said and len(units) == 1 and vectors == [key]:
                said = units[0]
            if said and path in self.values:
                self.units[path] = unit_from_text(said) or said

    def _add_matrix(self, samples: np.ndarray, name: str, labels: Sequence[str], units: Sequence[str]) -> None:
        """Add a matrix, with a name for each column where there are as many names as columns."""
        matrix = np.asarray(samples)
        if not _fits(matrix, labels):
            before = set(self.values)
            self._add_plain(matrix, name)
            added = [column for column in self.values if column not in before]
            stated = list(units) if len(units) == len(added) else list(units[:1]) * len(added)
            for column, unit in zip(added, stated, strict=False):
                if unit:
                    self.units[column] = unit_from_text(unit) or unit
            return
        # Where both sides are as long as the list, the samples run down.
        side = matrix.ndim - 1 - matrix.shape[::-1].index(len(labels))
        labelled = np.moveaxis(matrix, side, 0)
        names = unique_names([label or str(i) for i, label in enumerate(labels)])
        stated = list(units) if len(units) == len(labels) else [units[0] if len(units) == 1 else ""] * len(labels)
        for i, (label, unit) in enumerate(zip(names, stated, strict=True)):
            path = f"{name}.{label}" if name else label
            if matrix.ndim == 2:
                self._add_column(path, labelled[i], unit)
            else:
                self._add_plain(labelled[i], path)

    def _add_plain(self, value: Any, name: str) -> None:
        """Add numbers by `flatten`, the samples of a matrix along its longer side."""
        if isinstance(value, np.ndarray):
            value = with_samples_down(np.squeeze(value))
        flatten(value, name, self.values, self._path)  # type: ignore[arg-type]

    def _add_column(self, name: str, samples: np.ndarray, unit: str = "") -> None:
        require_few_columns(self._path, len(self.values))
        self.values[name] = np.ascontiguousarray(samples, dtype=np.float64)
        if unit:
            self.units[name] = unit_from_text(unit) or unit

    def _add_components(self, name: str, samples: np.ndarray, unit: str) -> None:
        """Add a signal of shape (n, k); its components are numbered, and a unit in its name is that of each."""
        bare, named = split_unit(name)
        if samples.shape[1] == 1:
            self._add_column(name, samples[:, 0], unit)
            return
        for i in range(samples.shape[1]):
            self._add_column(f"{bare or name}.{i}", samples[:, i], unit or named or "")

    def _add_capture(self, rasters: list[_Raster], name: str) -> None:
        """Add a capture of ControlDesk: signals by their names, of several rasters below the raster's name."""
        for raster, place in zip(rasters, unique_names([r.name for r in rasters]), strict=True):
            prefix = ".".join(part for part in (name, place if len(rasters) > 1 else "") if part)
            within = f"{prefix}." if prefix else ""
            self._add_column(f"{within}time", raster.times, "s")
            for label, signal in zip(_captured_names(raster.signals), raster.signals, strict=True):
                self._add_column(f"{within}{label}", signal.samples, signal.unit)

    def _add_structure_with_time(self, fields: Mapping[str, Any], name: str, depth: int) -> None:
        """Add Simulink's "Structure With Time", or its "Structure", whose time is empty."""
        times = np.atleast_1d(np.squeeze(np.asarray(fields.get("time", ()))))
        within = f"{name}." if name else ""
        if times.size > 1 and times.dtype.kind in "fiu":
            self._add_column(f"{within}time", times, "s")
        signals = _list_of_structs(fields["signals"])
        labels = unique_names([_name_of_signal(_fields(s), i) for i, s in enumerate(signals)])
        for label, signal in zip(labels, map(_fields, signals), strict=True):
            values = signal["values"]
            n = times.size if times.size > 1 else 0
            samples = _samples_first(values, n) if isinstance(values, np.ndarray) else None
            if samples is None:
                self.add(values, f"{within}{label}", depth + 1)
                continue
            parts = texts_of(signal.get("label"))
            if 1 < len(parts) == samples.shape[1]:
                self._add_matrix(samples, f"{within}{label}", parts, ())
            else:
                self._add_components(f"{within}{label}", samples, text_of(signal.get("unit")))

    def _add_element(self, element: Any, name: str, i: int, depth: int) -> None:
        """Add an element of a Dataset: a Signal with values, or the values themselves."""
        if not isinstance(element, Mapping):
            return
        fields = _fields(element)
        values = fields.get("values", element)
        inner = _fields(values) if isinstance(values, Mapping) else {}
        named = (text_of(part.get(key)) for part in (fields, inner) for key in ("name", "propagatedname"))
        block = _last_of_block_path(fields.get("blockpath"))
        label = next((text for text in named if text and text != "unnamed"), block) or str(i)
        path = f"{name}.{label}" if name else label
        if (series := _timeseries(inner, "")) is not None:
            alone = _Series(label, series.samples, series.unit, series.times, series.time_unit)
            self._series.setdefault(name, []).append(alone)
        else:
            self.add(values, path, depth + 1)

    def _add_rates(self) -> None:
        """Add one sampling rate as a fact, and several as the times of what each was stated for."""
        if len(set(self._rates.values())) == 1:
            self.facts["fs"] = f"{next(iter(self._rates.values())):.12g}"
            return
        below: dict[str, list[str]] = {place: [] for place in self._rates}
        for name, x in self.values.items():
            parts = name.split(".")
            places = (".".join(parts[:i]) for i in range(len(parts), -1, -1))
            place = next((place for place in places if place in below), None)
            if place is not None and not isinstance(x, str) and len(x) > 1:
                below[place].append(name)
        for place, names in below.items():
            has_times = any(folded(name.rpartition(".")[2]) in TIME_KEYS for name in names)
            if names and not has_times:
                n = max(len(self.values[name]) for name in names)
                self._add_column(f"{place}.time" if place else "time", np.arange(n) / self._rates[place], "s")

    def _add_series(self) -> None:
        """Add timeseries; those in the same struct with the same times have one column ``time``."""
        for prefix, group in self._series.items():
            within = f"{prefix}." if prefix else ""
            first = group[0]
            shared = all(np.array_equal(s.times, first.times) and s.time_unit == first.time_unit for s in group)
            shared = shared and f"{within}time" not in self.values
            if shared:
                self._add_column(f"{within}time", first.times, first.time_unit)
            for series, label in zip(group, unique_names([s.name for s in group]), strict=True):
                if not shared:
                    self._add_column(f"{within}{label}.time", series.times, series.time_unit)
                self._add_components(f"{within}{label}", series.samples, series.unit)
        self._series.clear()


@dataclass(frozen=True)
class _Series:
    """A signal with times of its own."""

    name: str
    samples: np.ndarray  # shape (n, k)
    unit: str
    times: np.ndarray  # shape (n,), in `time_unit`
    time_unit: str


@dataclass(frozen=True, eq=False)
class _Captured:
    """A signal of a capture."""

    name: str
    block: str  # last part of its path in the model
    samples: np.ndarray
    unit: str


@dataclass(frozen=True, eq=False)
class _Raster:
    """Signals of a capture that were sampled together."""

    name: str
    times: np.ndarray
    signals: list[_Captured] = field(default_factory=list)


def _captured_names(signals: Sequence[_Captured]) -> list[str]:
    """Return the names of signals; those that several blocks call the same have their block before it."""
    names = [signal.name for signal in signals]
    told = [f"{s.block}.{s.name}" if names.count(s.name) > 1 and s.block else s.name for s in signals]
    return unique_names(told)


def unique_names(names: Iterable[str]) -> list[str]:
    """Return names of which each that stands there before has a number, from 2."""
    found: dict[str, int] = {}
    made: list[str] = []
    for name in names:
        found[name] = found.get(name, 0) + 1
        made.append(name if found[name] == 1 else f"{name}_{found[name]}")
    return made


def _alike_structs(value: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the fields that are recordings, such as ``demo_0`` and ``demo_1``, each with all of its kind.

    Their names differ in numbers alone. Those of other names, such as joints, are recordings if they have the same
    fields and differ in length.
    """
    structs = [
        key
        for key, item in value.items()
        if isinstance(item, Mapping) and _holds_vectors(item) and not _is_known_layout(_fields(item))
    ]
    kinds: dict[str | frozenset[str], list[str]] = {}
    for key in structs:
        kinds.setdefault(re.sub(r"\d+", "#", str(key)), []).append(key)
        kinds.setdefault(frozenset(map(str, value[key])), []).append(key)
    found: dict[str, list[str]] = {}
    for kind, keys in kinds.items():
        if len(keys) < 2 or not found.keys().isdisjoint(keys):
            continue
        if isinstance(kind, str):
            are_recordings = "#" in kind and all(is_recording_name(str(key)) for key in keys)
        else:
            are_recordings = len(kind) > 1 and len({_longest(value[key]) for key in keys}) > 1
        if are_recordings:
            ordered = sorted(keys, key=lambda key: [int(number) for number in re.findall(r"\d+", str(key))])
            found |= dict.fromkeys(keys, ordered)
    return found


def _is_known_layout(fields: Mapping[str, Any]) -> bool:
    """Whether a struct is a log of Simulink or dSPACE, whose fields are alike whatever it holds."""
    return (
        _is_structure_with_time(fields)
        or _elements(fields) is not None
        or _timeseries(fields, "") is not None
        or _capture(fields) is not None
    )


def _fields(value: Mapping[str, Any]) -> dict[str, Any]:
    """Return a struct's fields by their names without case; a private property of an object ends in "_"."""
    return {str(key).rstrip("_").casefold(): item for key, item in value.items()}


def _list_of_structs(value: Any) -> list[Mapping[str, Any]]:
    """Return a struct or a list of structs as a list; [] for anything else."""
    items = [value] if isinstance(value, Mapping) else value
    return list(items) if isinstance(items, (list, tuple)) and all(isinstance(i, Mapping) for i in items) else []


def _vector(value: Any) -> np.ndarray | None:
    """Return the numbers of a vector, shape (n,); None for anything else."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        return None
    squeezed = np.atleast_1d(np.squeeze(value))
    return squeezed if squeezed.ndim == 1 and squeezed.size else None


def _capture(fields: Mapping[str, Any]) -> list[_Raster] | None:
    """Return the rasters of a capture of dSPACE ControlDesk; None if the struct is none.

    X are the times of each raster; each Y has a name, a unit, its samples, and the number or the name of its X.
    """
    clocks = [_fields(x) for x in _list_of_structs(fields.get("x"))]
    signals = [_fields(y) for y in _list_of_structs(fields.get("y"))]
    if not clocks or not signals or not all("name" in y and "data" in y for y in signals):
        return None
    rasters = [
        _Raster(text_of(x.get("raster")) or text_of(x.get("name")) or f"raster_{i}", times)
        for i, x in enumerate(clocks, 1)
        if (times := _vector(x.get("data"))) is not None
    ]
    for y in signals:
        samples = _vector(y["data"])
        if samples is None:
            continue
        fitting = [raster for raster in rasters if len(raster.times) == len(samples)]
        number = _vector(np.asarray(y.get("xindex", 0)))
        by_number = rasters[int(number[0]) - 1 :][:1] if number is not None and number[0] >= 1 else []
        by_name = [raster for raster in fitting if raster.name == text_of(y.get("raster"))]
        raster = next((r for r in (*by_number, *by_name, *fitting) if r in fitting), None)
        if raster is not None:
            name = text_of(y["name"]).strip('" ') or "signal"
            block = _last_of_block_path(y.get("path"))
            raster.signals.append(_Captured(name, block, samples, text_of(y.get("unit"))))
    return [raster for raster in rasters if raster.signals] or None


def _is_structure_with_time(fields: Mapping[str, Any]) -> bool:
    signals = _list_of_structs(fields.get("signals"))
    return "time" in fields and bool(signals) and all("values" in _fields(signal) for signal in signals)


def _name_of_signal(signal: Mapping[str, Any], i: int) -> str:
    """Return the name of a signal of a "Structure With Time": its label, else its block's."""
    label = text_of(signal.get("label")) or text_of(signal.get("title"))
    return label or _last_of_block_path(signal.get("blockname")) or str(i)


def _last_of_block_path(path: Any) -> str:
    """Return the last part of a block's path, ``model/plant/Gain`` or an object that holds one; "" if there is none."""
    if isinstance(path, Mapping):
        path = _fields(path).get("path")
    texts = texts_of(path)
    return re.split(r"(?<!/)/(?!/)", texts[-1])[-1].strip(' "') if texts else ""


def _timeseries(fields: Mapping[str, Any], path: str) -> _Series | None:
    """Return the signal of an object, or a struct of an object, of the class timeseries; None if it is none.

    Even times are stated by start, increment and length alone. MATLAB keeps others in the object or its TimeInfo.
    """
    about, of_times = fields.get("datainfo"), fields.get("timeinfo")
    data = fields.get("data")
    if not isinstance(data, np.ndarray) or data.dtype.kind not in "fiub" or (about is None and of_times is None):
        return None
    info = _fields(of_times) if isinstance(of_times, Mapping) else {}
    times = next((t for t in (_vector(fields.get("time")), _vector(info.get("time"))) if t is not None), None)
    if times is None:
        start, increment = (_vector(np.asarray(info.get(key, np.nan))) for key in ("start", "increment"))
        length = _vector(np.asarray(info.get("length", max(data.shape, default=0))))
        if start is None or increment is None or length is None or not np.isfinite(increment[0]):
            return None
        times = start[0] + increment[0] * np.arange(min(int(length[0]), data.size))
    samples = _samples_first(data, len(times))
    if samples is None:
        return None
    label, named = path.rpartition(".")[2], text_of(fields.get("name"))
    if named and named != "unnamed" and folded(named) != folded(label):
        label = f"{label}.{named}" if label else named
    units = _fields(about).get("units") if isinstance(about, Mapping) else None
    unit = text_of(_fields(units).get("name") if isinstance(units, Mapping) else units)
    time_unit = unit_from_text(text_of(info.get("units"))) or "s"
    return _Series(label or "signal", samples, unit, np.asarray(times, np.float64), time_unit)


def _elements(fields: Mapping[str, Any]) -> list[Any] | None:
    """Return the elements of a Dataset of Simulink; None if the struct is none."""
    storage = fields.get("storage")
    found = _fields(storage).get("elements") if isinstance(storage, Mapping) else None
    if isinstance(found, Mapping):
        return [found]
    return list(found) if isinstance(found, (list, tuple)) else None


def _samples_first(values: np.ndarray, n: int) -> np.ndarray | None:
    """Return an array as (n, k): samples run along the first side of a matrix, and the last side of more dimensions.

    None if no side has n samples; n is 0 if it is not known.
    """
    if values.dtype.kind not in "fiub" or values.size == 0:
        return None
    array = values.reshape(-1, 1) if values.ndim < 2 else values
    if n == 0:
        n = max(array.shape)
    order = range(array.ndim) if array.ndim == 2 else reversed(range(array.ndim))
    side = next((axis for axis in order if array.shape[axis] == n), None)
    return None if side is None else np.moveaxis(array, side, 0).reshape(n, -1)


def _fits(value: Any, labels: Sequence[str]) -> bool:
    """Whether a value is a matrix of which a side has as many columns as there are names.

    A list of markers may name the shorter sides of an array of more dimensions.
    """
    array = value.samples if isinstance(value, Stated) else value
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiub" or not labels or array.ndim < 2:
        return False
    return len(labels) in array.shape if array.ndim == 2 else (
        array.ndim == 3 and array.shape.count(len(labels)) == 1 and max(array.shape) > len(labels)
    )  # fmt: skip


def _rate_of(value: Any) -> float | None:
    """Return a sampling rate [Hz] that is a number; None if it is none."""
    if not isinstance(value, (int, float, np.number, np.ndarray)) or np.size(value) != 1:
        return None
    rate = float(np.asarray(value).item())
    return rate if 0.0 < rate < math.inf else None


def _is_nested(item: Any) -> bool:
    """Whether an entry of a list is itself a list, a struct or more than a number."""
    return isinstance(item, (list, tuple, Mapping, Stated)) or (
        isinstance(item, np.ndarray) and (item.dtype == object or item.ndim > 1 or item.size >= MIN_TRIAL_ROWS)
    )


def _holds_vectors(value: Any, depth: int = 0) -> bool:
    """Whether a struct holds a vector of several samples."""
    if isinstance(value, Mapping):
        return depth < MAX_DEPTH and any(_holds_vectors(item, depth + 1) for item in value.values())
    if isinstance(value, Stated):
        value = value.samples
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "fiub" and value.size >= MIN_TRIAL_ROWS
    if isinstance(value, (list, tuple)):
        return len(value) >= MIN_TRIAL_ROWS or any(_holds_vectors(item, depth + 1) for item in value[:MIN_TRIAL_ROWS])
    return False


def _longest(value: Any) -> int:
    """Return how many samples a struct's longest field has."""
    if isinstance(value, Mapping):
        return max((_longest(item) for item in value.values()), default=0)
    if isinstance(value, Stated):
        value = value.samples
    return max(value.shape, default=0) if isinstance(value, np.ndarray) else 0
