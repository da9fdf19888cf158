"""Read the numeric datasets of an HDF5 file, whatever program wrote it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError, missing_package
from ._caps import require_unpacked_size
from ._columns import Columns
from ._flatten import flatten, with_samples_down

UNIT_ATTRIBUTES = ("unit", "units", "Unit", "Units")
"""Attributes of a dataset that may state its unit."""


def read_datasets(path: Path, *, kind: str, columns_first: bool) -> Columns:
    """Return the numeric datasets of an HDF5 file, named by their dotted paths.

    Samples run along the longer side of a matrix, or along its last axis where the writer stores `columns_first`, as
    MATLAB does. A field of a compound dataset is a column of its own. `kind` says in messages what the file is.
    """
    try:
        import h5py
    except ImportError:
        raise RecordingError(str(missing_package(f"{path.name}: a file in HDF5", "h5py", "files"))) from None
    into: dict[str, np.ndarray] = {}
    units: dict[str | int, str] = {}
    number_count = 0.0

    def visit(place: str, item: Any) -> None:
        nonlocal number_count
        if not isinstance(item, h5py.Dataset) or place.startswith("#") or not _is_numeric(item.dtype):
            return
        if is_matlab_object(item):
            return
        _require_inside(path, place, item)
        # A field of a compound dataset may hold several numbers.
        number_count += item.size * max(item.dtype.itemsize / 8.0, 1.0) if item.dtype.fields else item.size
        # A dataset in chunks is unpacked chunk by chunk, and a chunk may be larger than the dataset.
        require_unpacked_size(path, max(number_count, math.prod(item.chunks or ()) * item.dtype.itemsize / 8.0))
        name, before = place.replace("/", "."), set(into)
        array = np.asarray(item[()])
        if array.dtype.fields:
            flatten({field: array[field] for field in array.dtype.fields}, name, into, path)
        else:
            flatten(array.T if columns_first else with_samples_down(array), name, into, path)
        unit = next((item.attrs[key] for key in UNIT_ATTRIBUTES if key in item.attrs), None)
        unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
        if isinstance(unit, str) and unit.strip():
            units.update(dict.fromkeys(into.keys() - before, unit.strip()))

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # the library raises a dozen types for damaged files
        raise RecordingError(f"{path.name}: not readable as {kind}, truncated or damaged: {error}") from error
    return Columns(path, into, units=units)


def is_matlab_object(item: Any) -> bool:
    """Whether MATLAB stores a table or another object here, of which the numbers are only a reference."""
    return "MATLAB_object_decode" in item.attrs


def _is_numeric(dtype: np.dtype) -> bool:
    """Whether a dataset of this type holds numbers, in fields or not."""
    return dtype.kind in "fiub" or dtype.fields is not None


def _require_inside(path: Path, name: str, item: Any) -> None:
    """Refuse data that is stored in another file, because that may be any file of this computer."""
    if item.external or item.is_virtual:
        raise RecordingError(f"{path.name}: found that {name} is stored in another file, expected it in this one")
