"""Read MATLAB files: version 5 and older with SciPy, version 7.3 with h5py, and those with tables with mat-io.

A table's variables are named by their dotted path, as a struct's fields are: ``log.q`` for the variable q of the table
log. The times of a timetable are ``log.Time``, in seconds.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError, install_command
from ._caps import require_unpacked_size
from ._columns import Columns
from ._flatten import flatten
from ._hdf5 import is_matlab_object, read_datasets

ENDINGS = (".mat",)
APART = ("scipy.io", "h5py")

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""An HDF5 file has these bytes at its beginning, or after MATLAB's own header."""

HDF5_OFFSET = 512
"""Bytes of MATLAB's own header in a file of version 7.3."""

OBJECTS_COLUMN = "MATLAB objects"
"""Name of the column that says that a file holds tables or other objects, which only mat-io reads."""


def extra_libraries(path: Path) -> tuple[str, ...]:
    """Return the libraries that this file needs beside those in `APART`: mat-io brings pandas, which loads slowly."""
    if _is_hdf5(path):
        return ("matio",) if _has_objects_in_hdf5(path) else ()
    from scipy.io import whosmat

    try:
        whosmat(path)
    except TypeError:  # the library's answer to an object, which has no shape
        return ("matio",)
    return ()


def read(path: Path) -> Columns:
    """Return numeric variables and struct fields by dotted path, each shape (n,) float64; cells are numbered."""
    if _is_hdf5(path):
        if _has_objects_in_hdf5(path) and (columns := _read_objects(path)) is not None:
            return columns
        # MATLAB stores columns first, HDF5 rows first.
        return _with_remark(read_datasets(path, kind="a MAT file", columns_first=True), _has_objects_in_hdf5(path))
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabOpaque

    try:
        with warnings.catch_warnings():
            # Function workspaces repeat an unnamed variable; the warning does not concern the recording.
            warnings.simplefilter("ignore")
            content = loadmat(path, simplify_cells=True)
    except MemoryError:
        raise
    except Exception as error:  # SciPy raises a dozen types for damaged files
        raise RecordingError(f"{path.name}: not readable as a MAT file, truncated or damaged: {error}") from error
    has_objects = any(isinstance(value, MatlabOpaque) for value in content.values())
    if has_objects and (columns := _read_objects(path)) is not None:
        return columns
    into: dict[str, np.ndarray] = {}
    for name, value in content.items():
        if isinstance(value, MatlabOpaque):
            continue
        if isinstance(name, str) and not name.startswith("__"):
            _flatten_cells(_with_plain_structs(value), name, into, path)
    return _with_remark(Columns(path, into), has_objects)


def _is_hdf5(path: Path) -> bool:
    """Whether a file is of version 7.3."""
    with path.open("rb") as file:
        head = file.read(HDF5_OFFSET + len(HDF5_SIGNATURE))
    return b"MATLAB 7.3" in head[:128] or head.startswith(HDF5_SIGNATURE) or head.endswith(HDF5_SIGNATURE)


def _with_remark(columns: Columns, has_objects: bool) -> Columns:
    """Return the columns, with one that says what a file's tables need if mat-io is not installed.

    A RecordingError says so if the file holds nothing else.
    """
    if not has_objects:
        return columns
    said = f"a table or another object of MATLAB needs mat-io: in the clone of Pellucid, {install_command('matlab')}"
    if not columns.values:
        raise RecordingError(
            f"{columns.path.name}: {said}; or save it in MATLAB as a struct of vectors: table2struct(T, ToScalar=true)"
        )
    return Columns(columns.path, {**columns.values, OBJECTS_COLUMN: said}, units=columns.units)


def _has_objects_in_hdf5(path: Path) -> bool:
    """Whether a file of version 7.3 holds tables or other objects."""
    try:
        import h5py

        with h5py.File(path, "r") as file:
            found = file.visititems(lambda _, item: True if is_matlab_object(item) else None)
    except Exception:  # the reader itself says what is wrong with the file
        return False
    return bool(found)


def _read_objects(path: Path) -> Columns | None:
    """Return the columns of a file with tables; None if mat-io is not installed."""
    try:
        from matio import load_from_mat
    except ImportError:
        return None
    try:
        with warnings.catch_warnings():
            # Objects of classes that the library does not know are left out.
            warnings.simplefilter("ignore")
            content = load_from_mat(str(path))
    except MemoryError:
        raise
    except Exception as error:  # parsing unexpected bytes may raise anything
        raise RecordingError(f"{path.name}: not readable as a MAT file, truncated or damaged: {error}") from error
    into: dict[str, np.ndarray] = {}
    for name, value in content.items():
        if isinstance(name, str) and not name.startswith("__"):
            _flatten_cells(_without_objects(value), name, into, path)
    require_unpacked_size(path, sum(map(len, into.values())))
    return Columns(path, into)


def _without_objects(value: Any) -> Any:
    """Return a value of mat-io's as mappings, lists and arrays: tables by their variables, times in seconds."""
    if hasattr(value, "columns") and hasattr(value, "index"):
        table = {str(name): value[name].to_numpy() for name in value.columns}
        if value.index.dtype.kind in "mM":
            table = {str(value.index.name or "Time"): value.index.to_numpy(), **table}
        return {name: _without_objects(column) for name, column in table.items()}
    if isinstance(value, dict):
        return {key: _without_objects(item) for key, item in value.items()}
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype.kind in "mM":
        missing = np.isnat(value)
        since = value - np.datetime64(0, "s") if value.dtype.kind == "M" else value
        return np.where(missing, np.nan, since / np.timedelta64(1, "s"))
    if value.dtype.names:
        structs = [{name: _without_objects(item[name]) for name in value.dtype.names} for item in value.ravel()]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype == object:
        items = [_without_objects(item) for item in value.ravel()]
        return items[0] if len(items) == 1 else items
    return value


def _with_plain_structs(value):
    # SciPy returns a struct array as an object array of dicts, and cells as an object array of anything.
    if isinstance(value, np.ndarray) and value.dtype == object:
        if value.ndim > 1 and any(_is_nested(item) for item in value.ravel()):
            return [_with_plain_structs(row) for row in value]
        return [_with_plain_structs(item) for item in value.ravel()]
    if isinstance(value, dict):
        return {key: _with_plain_structs(item) for key, item in value.items()}
    return value


def _is_nested(item) -> bool:
    """Whether a cell's content is itself cells or a matrix."""
    return isinstance(item, list) or (isinstance(item, np.ndarray) and (item.dtype == object or item.ndim > 1))


def _flatten_cells(value, name: str, into: dict[str, np.ndarray], path: Path) -> None:
    """Add numeric leaves as `flatten` does; a cell with cells or matrices is named by its index."""
    if isinstance(value, list) and any(_is_nested(item) for item in value):
        for i, item in enumerate(value):
            # Samples run along the longer side: programs store variables in rows as often as in columns.
            wide = isinstance(item, np.ndarray) and item.ndim == 2 and item.shape[1] > item.shape[0]
            _flatten_cells(item.T if wide else item, f"{name}.{i}", into, path)
    else:
        flatten(value, name, into, path)
