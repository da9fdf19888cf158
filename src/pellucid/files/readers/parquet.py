"""Read Parquet and Feather files, as pandas, Polars and Arrow write them.

A column keeps its name; a struct's fields are named by their dotted path. A column of lists of one length is numbered,
or named by the key ``names`` of its metadata or by the ``meta/info.json`` of a LeRobot data set. A column such as
``episode_index`` tells recordings apart: ``episode_0.action.0``. Times become seconds since 1970, durations seconds. A
missing value is NaN.
"""

from __future__ import annotations

import contextlib
import json
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError, missing_package
from ._caps import max_columns, require_few_columns, require_unpacked_size
from ._columns import Columns
from ._signals import LEFT_OUT_COLUMN, RATE_KEYS, folded, left_out_text, unique_names

ENDINGS = (".parquet", ".feather")
APART = ("pyarrow.parquet", "pyarrow.ipc")

UNIT_KEYS = (b"unit", b"units")
"""Keys of a field's metadata that may state its unit."""

NAME_KEYS = (b"names", b"labels", b"channels", b"columns")
"""Keys of a field's metadata that may name the entries of its lists."""

DATA_SET_INFO = Path("meta", "info.json")
"""File of LeRobot next to its folders of data, with the names of each column's entries, and the rate."""

MAX_INFO_BYTES = 1_000_000
"""A data set's information has at most so many bytes; the longest, of hundreds of features, have a tenth."""

MIN_RECORDING_ROWS = 8
"""Rows tell recordings apart only if each recording has at least so many."""

_RECORDING_INDEX = re.compile(
    r"(episode|trial|demo|demonstration|run|recording|trajectory)(?:_?(?:index|idx|id|number))?"
)

TICKS_PER_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""Ticks of a second in Arrow's units of time."""


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) float64."""
    try:
        with _without_pandas():
            return _columns(path, _load(path))
    except (RecordingError, MemoryError):
        raise
    except ImportError:
        raise RecordingError(
            str(missing_package(f"{path.name}: a file of Arrow, Parquet or Feather", "pyarrow", "files"))
        ) from None
    except Exception as error:  # the library's C++ code may raise anything
        raise RecordingError(f"{path.name}: not readable, truncated or damaged: {error}") from error


class _NoPandas:
    """A finder of modules that finds no pandas."""

    def find_spec(self, name: str, *_: Any) -> None:
        if name == "pandas":
            raise ModuleNotFoundError("No module named 'pandas'", name=name)


@contextlib.contextmanager
def _without_pandas() -> Iterator[None]:
    """Import no pandas, which takes seconds: the library imports it wherever it is installed, and needs it nowhere."""
    finder = _NoPandas()
    sys.meta_path.insert(0, finder)  # type: ignore[arg-type]
    try:
        yield
    finally:
        sys.meta_path.remove(finder)  # type: ignore[arg-type]


def _columns(path: Path, table: Any) -> Columns:
    """Return the columns of an Arrow table."""
    values: dict[str, np.ndarray | str] = {}
    units: dict[str | int, str] = {}
    info = _data_set_info(path)
    rates = {key.decode("utf-8", "replace"): text.decode("utf-8", "replace")
             for key, text in (table.schema.metadata or {}).items()}  # fmt: skip
    facts = {key: text for key, text in {**rates, "fps": str(info.get("fps", ""))}.items()
             if folded(key) in RATE_KEYS and text and len(text) < 40}  # fmt: skip
    features = info.get("features", {})
    for field, column in zip(table.schema, table.columns, strict=True):
        name = field.name
        if name in values:
            raise RecordingError(f'{path.name}: found two columns named "{name}", expected each once')
        feature = features.get(name, {}) if isinstance(features, dict) else {}
        labels = _listed(field, NAME_KEYS) or _flat_names(feature.get("names") if isinstance(feature, dict) else None)
        before = len(values)
        _add_column(path, name, column, values, units, labels)
        require_few_columns(path, len(values))
        added = list(values)[before:]
        stated = _listed(field, UNIT_KEYS)
        for one, unit in zip(added, stated if len(stated) == len(added) else stated[:1] * len(added), strict=False):
            if unit:
                units[one] = unit
    return _split(Columns(path, values, units=units, facts=facts))


def _listed(field: Any, keys: tuple[bytes, ...]) -> list[str]:
    """Return the texts of a field's metadata under one of some keys: a JSON list, or texts with commas between."""
    said = next((field.metadata[key] for key in keys if key in (field.metadata or {})), b"").decode("utf-8", "replace")
    try:
        found = json.loads(said)
    except (ValueError, RecursionError):
        found = None
    return _flat_names(found) or [part.strip() for part in said.split(",") if said.strip()]


def _flat_names(names: Any) -> list[str]:
    """Return a list of names; LeRobot may have it below a key, such as ``motors``."""
    if isinstance(names, dict) and len(names) == 1:
        names = next(iter(names.values()))
    return [str(name) for name in names] if isinstance(names, list) else []


def _data_set_info(path: Path) -> dict[str, Any]:
    """Return what the data set around a file says of it; {} if there is none."""
    for folder in path.absolute().parents[:3]:
        about = folder / DATA_SET_INFO
        if about.is_file() and about.stat().st_size < MAX_INFO_BYTES:
            try:
                found = json.loads(about.read_text(encoding="utf-8"))
            except (ValueError, RecursionError, OSError):
                return {}
            return found if isinstance(found, dict) else {}
    return {}


def _split(columns: Columns) -> Columns:
    """Return columns in which those of each recording are apart, if one tells the recordings."""
    for name, index in columns.values.items():
        match = _RECORDING_INDEX.fullmatch(name.casefold())
        if match is None or isinstance(index, str) or len(index) < 2 or np.any(index != np.round(index)):
            continue
        starts = np.concatenate(([0], np.flatnonzero(np.diff(index)) + 1, [len(index)]))
        numbers = [int(index[start]) for start in starts[:-1]]
        if len(numbers) < 2 or len(set(numbers)) < len(numbers) or np.min(np.diff(starts)) < MIN_RECORDING_ROWS:
            continue
        numeric = {key: x for key, x in columns.values.items() if not isinstance(x, str)}
        values: dict[str, np.ndarray | str] = {key: x for key, x in columns.values.items() if isinstance(x, str)}
        room = max(int(max_columns() - len(values) - 1) // len(numeric), 1)
        if len(numbers) > room:
            values[LEFT_OUT_COLUMN] = left_out_text(len(numbers) - room)
        recordings = [f"{match[1]}_{number}" for number in numbers[:room]]
        units: dict[str | int, str] = {key: unit for key, unit in columns.units.items() if key in values}
        for key, start, end in zip(recordings, starts[:-1], starts[1:], strict=False):
            values |= {f"{key}.{one}": x[start:end] for one, x in numeric.items()}
            units |= {f"{key}.{one}": unit for one, unit in columns.units.items() if one in numeric}
        return replace(columns, values=values, units=units, recordings=tuple(recordings))
    return columns


def _load(path: Path) -> Any:
    if path.suffix.lower() == ".feather":
        from pyarrow import ipc

        with ipc.open_file(str(path), options=ipc.IpcReadOptions(use_threads=False)) as file:
            require_few_columns(path, len(file.schema))
            table = file.read_all()
    else:
        from pyarrow import parquet

        with parquet.ParquetFile(path) as file:
            require_few_columns(path, file.metadata.num_columns)
            require_unpacked_size(path, float(file.metadata.num_rows) * file.metadata.num_columns)
            table = file.read(use_threads=False)
    require_unpacked_size(path, float(table.num_rows) * table.num_columns)
    # A struct becomes a column of each field, named by its dotted path.
    while any(str(field.type).startswith("struct") for field in table.schema):
        table = table.flatten()
        require_few_columns(path, table.num_columns)
    return table


def _add_column(
    path: Path, name: str, column: Any, values: dict, units: dict[str | int, str], labels: Sequence[str] = ()
) -> None:
    import pyarrow

    kind = column.type
    is_list = pyarrow.types.is_list(kind) or pyarrow.types.is_large_list(kind) or pyarrow.types.is_fixed_size_list(kind)
    if is_list:
        _add_lists(path, name, column, values, units, labels)
        return
    ticks = 1.0
    if pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind) or pyarrow.types.is_time(kind):
        ticks, units[name] = TICKS_PER_S[kind.unit], "s"
        column = column.cast(pyarrow.int32() if pyarrow.types.is_time32(kind) else pyarrow.int64())
    elif pyarrow.types.is_boolean(kind):
        column = column.cast(pyarrow.int8())
    elif pyarrow.types.is_decimal(kind):
        column = column.cast(pyarrow.float64())
    elif not (pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind)):
        values[name] = f'holds values of the type "{kind}", expected numbers'
        return
    # Whole numbers beyond 2^53, such as nanoseconds since 1970, are divided before they are rounded.
    column = column.combine_chunks() if hasattr(column, "combine_chunks") else column
    samples = _numbers(column)
    whole = samples.dtype.kind in "iu" and ticks > 1.0
    seconds = samples // int(ticks) + (samples % int(ticks)) / ticks if whole else np.asarray(samples, float) / ticks
    if column.null_count:
        seconds[_numbers(column.is_null().cast(pyarrow.int8())) == 1] = np.nan
    values[name] = np.ascontiguousarray(seconds, dtype=np.float64)


def _add_lists(
    path: Path, name: str, column: Any, values: dict, units: dict[str | int, str], labels: Sequence[str]
) -> None:
    """Add a column of lists of one length as a column for each entry; a missing list is a row of NaN."""
    from pyarrow import compute

    column = column.combine_chunks() if hasattr(column, "combine_chunks") else column
    known = column.drop_null()
    lengths = compute.min_max(compute.list_value_length(known)) if len(known) else None
    least, most = (lengths["min"].as_py(), lengths["max"].as_py()) if lengths is not None else (0, 0)
    if least != most or not most:
        values[name] = f"holds lists of {least} to {most} values, expected as many in each"
        return
    require_few_columns(path, len(values) + most)
    require_unpacked_size(path, float(len(column)) * most)
    items: dict[str, np.ndarray | str] = {}
    _add_column(path, name, known.flatten(), items, units)
    unit = units.pop(name, "")
    found = items.get(name)
    if not isinstance(found, np.ndarray):
        values[name] = found if isinstance(found, str) else "holds lists of lists, expected numbers"
        return
    table = np.full((len(column), most), np.nan)
    table[_numbers(column.is_valid().cast("int8")) == 1] = found.reshape(-1, most)
    names = unique_names(labels) if len(labels) == most else [str(i) for i in range(most)]
    for i, label in enumerate(names):
        values[f"{name}.{label}"] = np.ascontiguousarray(table[:, i])
        if unit:
            units[f"{name}.{label}"] = unit


def _numbers(column: Any) -> np.ndarray:
    """Return a column's numbers, 0 for each that is missing."""
    return (column.fill_null(0) if column.null_count else column).to_numpy(zero_copy_only=False)
