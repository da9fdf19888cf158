"""Take columns from data frames, mappings and structured arrays as readers take them from files, and write them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import write_bytes_atomically, write_text_atomically
from .._errors import PellucidError
from .._given import visible_text
from ..files.readers import Columns

MAX_NAME_LENGTH = 200
"""A column's name has at most so many characters."""


def is_table(data: object) -> bool:
    """Return whether an object has columns by name."""
    if isinstance(data, np.ndarray):
        return data.dtype.names is not None
    return isinstance(data, Mapping) or hasattr(data, "column_names") or hasattr(data, "columns")


def columns_of_arrays(data: Any, name: str, caller: str) -> Columns:
    """Return the columns of a table as a reader returns those of a file, whose path is made of `name`.

    Masked, missing and NaN samples are NaN. Stamps of datetime64 are seconds since the first one.

    Raises
    ------
    PellucidError
        If a column is neither numbers nor text, or two columns have one name; the message names the argument `data` of
        the function `caller`, and the column.
    """
    values: dict[str, np.ndarray | str] = {}
    units: dict[str | int, str] = {}
    for label, column in _named(data):
        where = f'{caller}: data: column "{visible_text(label)}"'
        if label in values:
            raise PellucidError(f"{where}: found two columns of this name, expected one")
        if not label.strip() or visible_text(label) != label or "\n" in label or len(label) > MAX_NAME_LENGTH:
            raise PellucidError(f"{where}: found a name of such characters or length, expected a plain one")
        found, unit = _numbers(column, where)
        if isinstance(found, np.ndarray) and found.ndim == 2:
            values |= {f"{label}.{k}": part for k, part in enumerate(found.T)}
            continue
        values[label] = found
        if unit:
            units[label] = unit
    lengths = {len(x) for x in values.values() if not isinstance(x, str)}
    ending = "csv" if len(lengths) == 1 else "npz"
    return Columns(Path(f"{name}.{ending}"), values, units=units)


def _named(data: Any) -> Iterator[tuple[str, Any]]:
    """Yield the columns of a table by name; the index of a data frame first if it is time or has a name."""
    if isinstance(data, np.ndarray):
        for field in data.dtype.names or ():
            yield str(field), data[field]
    elif isinstance(data, Mapping):
        for key, column in data.items():
            yield _joined(key), column
    elif hasattr(data, "column_names"):  # PyArrow
        for key in data.column_names:
            yield str(key), data.column(key).to_numpy()
    else:
        index = getattr(data, "index", None)
        kind, label = getattr(getattr(index, "dtype", None), "kind", ""), getattr(index, "name", None)
        if kind in ("m", "M") or (kind and label is not None):
            yield str(label or "time"), index
        columns = list(data.columns)
        for place, key in enumerate(columns):
            # The place tells columns of one name apart, which the message then names.
            yield _joined(key), data.iloc[:, place] if hasattr(data, "iloc") else data[key]


def _joined(key: object) -> str:
    """Return a column's key as its name; the parts of a key of several levels are joined by dots."""
    return ".".join(str(part) for part in key if str(part)) if isinstance(key, tuple) else str(key)


def _numbers(column: Any, where: str) -> tuple[np.ndarray | str, str]:
    """Return the numbers of a column, shape (n,) or (n, k), and the unit of a column of stamps; text as its kind."""
    mask = np.ma.getmaskarray(column) if isinstance(column, np.ma.MaskedArray) else None
    try:
        x = np.asarray(column if mask is None else column.data)
    except (TypeError, ValueError) as error:
        raise PellucidError(f"{where}: found {type(column).__name__}: {error}, expected an array of numbers") from None
    if x.dtype.kind == "O":
        x = _of_objects(x)
    if x.dtype.kind in "US":
        first = str(x.flat[0]) if x.size else ""
        return f'found text, such as "{visible_text(first)[:40]}", expected numbers', ""
    unit = ""
    if x.dtype.kind in "mM":
        x, unit = _seconds(x), "s"
    if x.dtype.kind not in "fiub":
        raise PellucidError(f"{where}: found {x.dtype}, expected real numbers")
    if x.ndim == 0:
        x = x[None]
        mask = None if mask is None else mask[None]
    if x.ndim > 2:
        raise PellucidError(f"{where}: found an array of shape {x.shape}, expected (n,) or (n, k)")
    numbers = x.astype(float)
    if mask is not None:
        numbers[mask] = np.nan
    if numbers.ndim == 2 and 1 in numbers.shape:
        numbers = numbers.ravel()
    return numbers, unit


def _of_objects(x: np.ndarray) -> np.ndarray:
    """Return numbers among which samples are missing as floats, stamps as datetime64, anything else as text."""
    missing = np.array([value is None or value is not value or str(value) in ("<NA>", "NaT") for value in x.ravel()])
    kinds = {type(value) for value, lost in zip(x.ravel(), missing, strict=True) if not lost}
    if kinds and all(hasattr(kind, "timestamp") for kind in kinds):
        # Whole microseconds: a float of seconds since 1970 has few digits more.
        whole = [0 if lost else round(1e6 * v.timestamp()) for v, lost in zip(x.ravel(), missing, strict=True)]
        times = np.array(whole, np.int64).astype("datetime64[us]")
        times[missing] = np.datetime64("NaT")
        return times.reshape(x.shape)
    if any(issubclass(kind, (str, bytes)) for kind in kinds):
        return x.astype(str)
    try:
        return np.array([np.nan if lost else float(v) for v, lost in zip(x.ravel(), missing, strict=True)]).reshape(
            x.shape
        )
    except (TypeError, ValueError):
        return x.astype(str)


def _seconds(x: np.ndarray) -> np.ndarray:
    """Return stamps as seconds since the first one, or durations as seconds; missing ones are NaN."""
    known = x[~np.isnat(x)]
    since = x - known.flat[0] if x.dtype.kind == "M" and known.size else x
    if x.dtype.kind == "M" and not known.size:
        return np.full(x.shape, np.nan)
    lost = np.isnat(since)
    seconds = since.astype("timedelta64[ns]").astype(np.int64) * 1e-9
    seconds[lost] = np.nan
    return seconds


def write_columns(path: Path, columns: Columns) -> Path:
    """Write columns to a file that the readers restore exactly: CSV, or an .npz where they differ in length."""
    numeric = {name: x for name, x in columns.values.items() if not isinstance(x, str)}
    if path.suffix == ".npz":
        packed = io.BytesIO()
        np.savez_compressed(packed, allow_pickle=False, **numeric)
        return write_bytes_atomically(path, packed.getbuffer())
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(numeric)
    # repr gives the shortest text that is read back as the same float.
    rows = zip(*(map(repr, x.tolist()) for x in numeric.values()), strict=True)
    text.writelines(f"{','.join(row)}\n" for row in rows)
    return write_text_atomically(path, text.getvalue())
