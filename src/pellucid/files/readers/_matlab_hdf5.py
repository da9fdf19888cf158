"""Read the variables of a MATLAB file of version 7.3, which is HDF5, as nested mappings, lists, arrays and texts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ._caps import require_unpacked_size
from ._hdf5 import is_matlab_object, require_inside
from ._signals import MAX_DEPTH

MAX_VALUES = 100_000
"""A file has at most so many variables, fields and cells. Each is read by a call of its own."""


def read_variables(path: Path) -> dict[str, Any]:
    """Return a file's variables by name; a struct is a mapping, a struct array or a cell array a list.

    Matrices have their rows first, as in MATLAB. Objects, such as tables, are excluded.
    """
    import h5py

    with h5py.File(path, "r") as file:
        reading = _Reading(path, file)
        return {name: value for name in _inner_names(file)
                if (value := reading.value(file[name], name, 0)) is not None}  # fmt: skip


class _Reading:
    """What was read of one file so far, to bound it."""

    def __init__(self, path: Path, file: Any):
        self._path, self._file = path, file
        self._value_count = 0
        self._number_count = 0.0

    def value(self, item: Any, name: str, depth: int) -> Any:
        """Return a variable, field or cell; None if it is an object or is empty."""
        import h5py

        self._value_count += 1
        if self._value_count > MAX_VALUES or depth > MAX_DEPTH:
            raise RecordingError(
                f"{self._path.name}: found more fields, cells or levels of nesting than expected: at most {MAX_VALUES} "
                f"values, {MAX_DEPTH} deep; save the recorded signals alone"
            )
        if isinstance(item, h5py.Group):
            return self._struct(item, name, depth)
        if not isinstance(item, h5py.Dataset) or is_matlab_object(item) or "MATLAB_empty" in item.attrs:
            return None
        require_inside(self._path, name, item)
        self._number_count += item.size
        require_unpacked_size(
            self._path, max(self._number_count, math.prod(item.chunks or ()) * item.dtype.itemsize / 8.0)
        )
        if h5py.check_ref_dtype(item.dtype) is h5py.Reference:
            return [self._referenced(cell, f"{name}.{i}", depth) for i, cell in enumerate(item[()].T.ravel("F"))]
        if item.dtype.kind not in "fiub" and item.dtype.fields is None:
            return None
        array = np.asarray(item[()]).T
        if item.attrs.get("MATLAB_class") == b"char":
            # A matrix of characters is a list of texts, a row each.
            lines = ["".join(map(chr, row)).rstrip() for row in np.atleast_2d(array)]
            return lines[0] if len(lines) == 1 else lines
        if array.dtype.fields:
            return {field: array[field] for field in array.dtype.fields}
        return np.squeeze(array)

    def _struct(self, group: Any, name: str, depth: int) -> Any:
        """Return a struct as a mapping, a struct array as a list of mappings."""
        import h5py

        found: dict[str, Any] = {}
        counts = set[int]()
        for key in _fields(group):
            item = group[key]
            # A field of a struct array holds a reference for each struct, and is no cell array.
            if isinstance(item, h5py.Dataset) and "MATLAB_class" not in item.attrs:
                counts.add(item.size if h5py.check_ref_dtype(item.dtype) is h5py.Reference else -1)
            found[key] = self.value(item, f"{name}.{key}", depth + 1)
        if len(counts) == 1 and -1 not in counts and all(isinstance(value, list) for value in found.values()):
            return [dict(zip(found, values, strict=True)) for values in zip(*found.values(), strict=True)]
        return {key: value for key, value in found.items() if value is not None}

    def _referenced(self, reference: Any, name: str, depth: int) -> Any:
        return self.value(self._file[reference], name, depth + 1) if reference else None


def _inner_names(group: Any) -> list[str]:
    """Return the names of what a group itself holds: a link into another file may lead to any file of this computer."""
    import h5py

    return [
        key
        for key in group
        if not key.startswith("#") and not isinstance(group.get(key, getlink=True), h5py.ExternalLink)
    ]


def _fields(group: Any) -> list[str]:
    """Return the names of a struct's fields, in MATLAB's order where the file states it."""
    there = _inner_names(group)
    try:
        stated = ["".join(sign.decode() for sign in name) for name in group.attrs["MATLAB_fields"]]
    except Exception:  # not stated, or in a form that only MATLAB reads
        return there
    return stated if set(stated) == set(there) else there
