"""Read MATLAB files: version 5 and older with SciPy, version 7.3 with h5py if it is installed."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np

from ..._errors import RecordingError
from ._caps import require_unpacked_size
from ._columns import Columns
from ._flatten import flatten

ENDINGS = (".mat",)
APART = ("scipy.io", "h5py")


def read(path: Path) -> Columns:
    """Return numeric variables and struct fields by dotted path, each shape (n,) float64; cells are numbered."""
    with path.open("rb") as file:
        head = file.read(128)
    if b"MATLAB 7.3" in head or head[:8] == b"\x89HDF\r\n\x1a\n":
        return _read_hdf5(path)
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings():
            # Function workspaces repeat an unnamed variable; the warning does not concern the recording.
            warnings.simplefilter("ignore")
            content = loadmat(path, simplify_cells=True)
    except MemoryError:
        raise
    except Exception as error:  # SciPy raises a dozen types for damaged files
        raise RecordingError(f"{path.name}: not readable as a MAT file, truncated or damaged: {error}") from error
    into: dict[str, np.ndarray] = {}
    for name, value in content.items():
        if isinstance(name, str) and not name.startswith("__"):
            _flatten_cells(_with_plain_structs(value), name, into, path)
    return Columns(path, into)


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


def _read_hdf5(path: Path) -> Columns:
    try:
        import h5py
    except ImportError:
        raise RecordingError(
            f"{path.name}: a MAT file of version 7.3, which needs h5py: pip install h5py, "
            "or save it in MATLAB with save(..., '-v7')"
        ) from None
    into: dict[str, np.ndarray] = {}
    number_count = 0.0

    def visit(name, item):
        nonlocal number_count
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" and not name.startswith("#"):
            _require_inside(path, name, item)
            number_count += item.size
            # A dataset in chunks is unpacked chunk by chunk, and a chunk may be larger than the dataset.
            require_unpacked_size(path, max(number_count, math.prod(item.chunks or ()) * item.dtype.itemsize / 8.0))
            # MATLAB stores columns first, HDF5 rows first.
            flatten(np.asarray(item[()]).T, name.replace("/", "."), into, path)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # the library raises a dozen types for damaged files
        raise RecordingError(f"{path.name}: not readable as a MAT file, truncated or damaged: {error}") from error
    return Columns(path, into)


def _require_inside(path: Path, name: str, item) -> None:
    """Refuse data that is stored in another file, because that may be any file of this computer."""
    if item.external or item.is_virtual:
        raise RecordingError(f"{path.name}: found that {name} is stored in another file, expected it in this one")
