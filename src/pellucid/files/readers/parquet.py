"""Read Parquet and Feather files, as pandas, Polars and Arrow write them.

A column keeps its name; a struct's fields are named by their dotted path, and a column of lists of one length is
numbered. Times become seconds since 1970, durations seconds. A missing value is NaN.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError, missing_package
from ._caps import require_few_columns, require_unpacked_size
from ._columns import Columns

ENDINGS = (".parquet", ".feather")
APART = ("pyarrow.parquet", "pyarrow.ipc")

UNIT_KEYS = (b"unit", b"units")
"""Keys of a field's metadata that may state its unit."""

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
    for field, column in zip(table.schema, table.columns, strict=True):
        name = field.name
        if name in values:
            raise RecordingError(f'{path.name}: found two columns named "{name}", expected each once')
        _add_column(path, name, column, values, units)
        said = next((field.metadata[key] for key in UNIT_KEYS if key in (field.metadata or {})), None)
        if said is not None and said.strip():
            units[name] = said.decode("utf-8", "replace").strip()
    return Columns(path, values, units=units)


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


def _add_column(path: Path, name: str, column: Any, values: dict, units: dict[str | int, str]) -> None:
    import pyarrow

    kind = column.type
    if pyarrow.types.is_fixed_size_list(kind) and not column.null_count:
        items: dict[str, np.ndarray | str] = {}
        _add_column(path, name, column.combine_chunks().flatten(), items, units)
        found = items[name]
        if isinstance(found, str):
            values[name] = found
        else:
            numbered = found.reshape(-1, kind.list_size)
            values.update({f"{name}.{i}": np.ascontiguousarray(numbered[:, i]) for i in range(kind.list_size)})
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


def _numbers(column: Any) -> np.ndarray:
    """Return a column's numbers, 0 for each that is missing."""
    return (column.fill_null(0) if column.null_count else column).to_numpy(zero_copy_only=False)
