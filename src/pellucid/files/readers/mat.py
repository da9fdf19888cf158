"""Read MATLAB files: version 5 and older with SciPy, version 7.3 with h5py, and those with objects with mat-io.

A struct's fields are named by their dotted path, ``log.q``, and so are a table's variables; the times of a timetable
are ``log.Time``, in seconds. `_signals` reads logs of Simulink, captures of dSPACE ControlDesk and matrices with names
of their columns.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError, install_command, missing_package
from ._acquisition_structs import plain_signals
from ._columns import Columns
from ._hdf5 import is_matlab_object
from ._signals import MAX_DEPTH, Signals

ENDINGS = (".mat",)
APART = ("scipy.io", "h5py")

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""An HDF5 file has these bytes at its beginning, or after MATLAB's own header."""

HDF5_OFFSET = 512
"""Bytes of MATLAB's own header in a file of version 7.3."""

OBJECTS_COLUMN = "MATLAB objects"
"""Name of the column that says that a file holds tables, timeseries or other objects, which only mat-io reads."""


LOGGING_CLASSES = ("timeseries", "tsdata.", "tscollection", "Simulink.SimulationData.", "Simulink.SimulationOutput",
                   "Simulink.Timeseries", "Simulink.ModelDataLogs", "Simulink.TsArray")  # fmt: skip
"""Beginnings of the names of classes whose objects hold recordings; objects of other programs hold their settings."""


def extra_libraries(path: Path) -> tuple[str, ...]:
    """Return the libraries that this file needs in addition to those in `APART`: mat-io brings pandas, which loads
    slowly.
    """
    has_objects = _has_objects_in_hdf5(path) if _is_hdf5(path) else _has_subsystem(path)
    return ("matio",) if has_objects else ()


def read(path: Path) -> Columns:
    """Return numeric variables and struct fields by dotted path, each shape (n,) float64; cells are numbered."""
    if _is_hdf5(path):
        has_objects = _has_objects_in_hdf5(path)
        if has_objects and (columns := _read_objects(path)) is not None:
            return columns
        return _with_remark(_columns(path, _read_hdf5(path)), has_objects)
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
    has_objects = _holds(content, MatlabOpaque)
    if has_objects and (columns := _read_objects(path)) is not None:
        return columns
    return _with_remark(_columns(path, content), has_objects)


def _columns(path: Path, content: Mapping[Any, Any]) -> Columns:
    """Return the columns of a file's variables."""
    signals = Signals(path)
    variables = {
        name: _with_plain_structs(value)
        for name, value in content.items()
        if isinstance(name, str) and not name.startswith("__")
    }
    signals.add_file(plain_signals(variables) or variables)
    return signals.columns()


def _is_hdf5(path: Path) -> bool:
    """Whether a file is of version 7.3."""
    with path.open("rb") as file:
        head = file.read(HDF5_OFFSET + len(HDF5_SIGNATURE))
    return b"MATLAB 7.3" in head[:128] or head.startswith(HDF5_SIGNATURE) or head.endswith(HDF5_SIGNATURE)


def _has_subsystem(path: Path) -> bool:
    """Whether the header of a file of version 5 says where the contents of objects and functions are."""
    with path.open("rb") as file:
        head = file.read(124)
    return head.startswith(b"MATLAB 5") and head[116:124] not in (bytes(8), b" " * 8)


def _holds(value: Any, kind: type, depth: int = 0) -> bool:
    """Whether a value is of a class, or holds one that is."""
    if isinstance(value, kind):
        return True
    if isinstance(value, Mapping):
        value = list(value.values())
    elif isinstance(value, np.ndarray) and value.dtype == object:
        value = value.ravel().tolist()
    return isinstance(value, list) and depth < MAX_DEPTH and any(_holds(item, kind, depth + 1) for item in value)


def _with_remark(columns: Columns, has_objects: bool) -> Columns:
    """Return the columns, with one that says what a file's tables need if mat-io is not installed.

    A RecordingError says so if the file holds nothing else.
    """
    if not has_objects:
        return columns
    said = f"a table or another object of MATLAB, such as a timeseries, needs mat-io: {install_command('matlab')}"
    if not columns.values:
        raise RecordingError(
            f"{columns.path.name}: {said}; or save it in MATLAB as a struct of vectors: "
            "table2struct(T, ToScalar=true), or struct(time=ts.Time, q=ts.Data) of a timeseries"
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
    return _columns(path, {name: _without_objects(value, 0) for name, value in content.items()})


def _read_hdf5(path: Path) -> dict[str, Any]:
    """Return the variables of a file of version 7.3, without objects."""
    try:
        import h5py  # noqa: F401
    except ImportError:
        raise RecordingError(str(missing_package(f"{path.name}: a file in HDF5", "h5py", "files"))) from None
    from ._matlab_hdf5 import read_variables

    try:
        return read_variables(path)
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # the library raises a dozen types for damaged files
        raise RecordingError(f"{path.name}: not readable as a MAT file, truncated or damaged: {error}") from error


def _without_objects(value: Any, depth: int) -> Any:
    """Return a value of mat-io's as mappings, lists and arrays: tables by their variables, times in seconds, logs
    by their properties."""
    if depth > MAX_DEPTH:
        return None  # an object that refers to its owner
    if hasattr(value, "columns") and hasattr(value, "index"):
        table = {str(name): value[name].to_numpy() for name in value.columns}
        if value.index.dtype.kind in "mM":
            table = {str(value.index.name or "Time"): value.index.to_numpy(), **table}
        return {name: _without_objects(column, depth + 1) for name, column in table.items()}
    properties = getattr(value, "properties", None)
    if isinstance(properties, dict):
        if not str(getattr(value, "classname", "")).startswith(LOGGING_CLASSES):
            return None
        value = properties
    if isinstance(value, Mapping):
        return {key: _without_objects(item, depth + 1) for key, item in value.items()}
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype.kind in "mM":
        missing = np.isnat(value)
        since = value - np.datetime64(0, "s") if value.dtype.kind == "M" else value
        return np.where(missing, np.nan, since / np.timedelta64(1, "s"))
    if value.dtype.kind in "US":
        return str(value.item()) if value.size == 1 else [str(text) for text in value.ravel()]
    if value.dtype.names:
        structs = [
            {name: _without_objects(item[name], depth + 1) for name in value.dtype.names} for item in value.ravel()
        ]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype == object:
        items = [_without_objects(item, depth + 1) for item in value.ravel("F")]
        return items[0] if len(items) == 1 else items
    return value


def _with_plain_structs(value: Any) -> Any:
    # SciPy returns a struct array as an object array of dicts, and cells as an object array of anything.
    if isinstance(value, np.ndarray) and value.dtype.names:
        return None  # an object whose contents are elsewhere
    if isinstance(value, np.ndarray) and value.dtype == object:
        if value.size > 1 and all(isinstance(item, (int, float, np.number)) for item in value.ravel()):
            return value.astype(np.float64)  # a cell for each number
        if value.ndim > 1 and any(_is_nested(item) for item in value.ravel()):
            return [_with_plain_structs(row) for row in value]
        return [_with_plain_structs(item) for item in value.ravel()]
    if isinstance(value, Mapping):
        return {key: _with_plain_structs(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_with_plain_structs(item) for item in value]
    return value


def _is_nested(item: Any) -> bool:
    """Whether a cell's content is itself cells or a matrix."""
    return isinstance(item, list) or (isinstance(item, np.ndarray) and (item.dtype == object or item.ndim > 1))
