"""Read Parquet and Feather files, as pandas, Polars and Arrow write them.

A column keeps its name; a struct's fields are named by their dotted path, and a column of lists of one length is
numbered. Times become seconds since 1970, durations seconds. A missing value is NaN.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ._caps import require_few_columns, require_unpacked_size
from ._columns import Columns

ENDINGS = (".parquet", ".feather")
APART = ("pyarrow.parquet", "pyarrow.feather")

UNIT_KEYS = (b"unit", b"units")
"""Keys of a field's metadata that may state its unit."""

TICKS_PER_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""Ticks of a second in Arrow's units of time."""


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) float64."""
    try:
        table = _load(path)
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # the library's C++ code may raise anything
        raise RecordingError(f"{path.name}: not readable, truncated or damaged: {error}") from error
    values: dict[str, np.ndarray | str] = {}
    units: dict[str | int, str] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        field = table.schema.field(len(values)) if len(values) < len(table.schema) else None
        _add_column(path, name, column, values, units)
        said = next((field.metadata[key] for key in UNIT_KEYS if key in (field.metadata or {})),
            None) if field else None
        if said is not None:
            units[name] = said.decode("utf-8", "replace").strip()
    return Columns(path, values, units=units)


def _load(path: Path) -> Any:
    if path.suffix.lower() == ".feather":
        from pyarrow import feather

        table = feather.read_table(path)
    else:
        from pyarrow import parquet

        with parquet.ParquetFile(path) as file:
            require_few_columns(path, file.metadata.num_columns)
            require_unpacked_size(path, float(file.metadata.num_rows) * file.metadata.num_columns)
            table = file.read()
    require_unpacked_size(path, float(table.num_rows) * table.num_columns)
    # A struct becomes a column of each field, named by its dotted path.
    while any(str(field.type).startswith("struct") for field in table.schema):
        table = table.flatten()
        require_few_columns(path, table.num_columns)
    return table


def _add_column(path: Path, name: str, column: Any, values: dict, units: dict[str | int, str]) -> None:
    import pyarrow

    kind = column.type
    if pyarrow.types.is_fixed_size_list(kind):
        items = column.combine_chunks().flatten()
        for i in range(kind.list_size):
            _add_column(path, f"{name}.{i}", items.take(pyarrow.array(range(i, len(items), kind.list_size))), values,
                        units)  # fmt: skip
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
    samples = column.to_numpy(zero_copy_only=False) if not hasattr(column, "combine_chunks") else column.to_numpy()
    whole = samples.dtype.kind in "iu" and ticks > 1.0
    seconds = samples // int(ticks) + (samples % int(ticks)) / ticks if whole else np.asarray(samples, float) / ticks
    values[name] = np.ascontiguousarray(seconds, dtype=np.float64)
