"""Read NumPy's files: named arrays (.npz) and single arrays (.npy).

An array of several columns is numbered, ``q.0``, ``q.1``, ..., or named by a list of as many texts in the same file,
such as ``joint_names``; a field of a structured array is named. Objects, which could run a program, are not loaded.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as array_format

from ..._errors import RecordingError
from ._caps import require_unpacked_size
from ._columns import Columns
from ._signals import Signals

ENDINGS = (".npz", ".npy")

OBJECTS_TEXT = "contains Python objects, which could run a program, expected numbers; save each as a separate array"
"""Message for a column of objects."""


def read(path: Path) -> Columns:
    """Return columns by the arrays' names, each shape (n,) float64.

    A matrix's samples run along its longer side."""
    content: dict[str, Any] = {}
    objects: dict[str, np.ndarray | str] = {}
    try:
        if path.suffix.lower() == ".npy":
            with path.open("rb") as file:
                number_count, has_objects = _contents(file)
            require_unpacked_size(path, number_count)
            if has_objects:
                raise RecordingError(f"{path.name}: not readable as NumPy's arrays: it {OBJECTS_TEXT}")
            content[path.stem] = _with_fields(np.load(path, allow_pickle=False))
        else:
            total = 0.0
            with zipfile.ZipFile(path) as archive:
                for member in archive.namelist():
                    if not member.endswith(".npy"):
                        continue
                    name = member.removesuffix(".npy").replace("/", ".")
                    # The size is in the array's first bytes, which are unpacked alone.
                    with archive.open(member) as file:
                        number_count, has_objects = _contents(file)
                    if has_objects:
                        objects[name] = OBJECTS_TEXT
                        continue
                    total += number_count
                    require_unpacked_size(path, total)
                    with archive.open(member) as file:
                        content[name] = _with_fields(array_format.read_array(file, allow_pickle=False))
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # parsing unexpected bytes may raise anything
        raise RecordingError(f"{path.name}: not readable as NumPy's arrays, truncated or damaged: {error}") from error
    signals = Signals(path)
    signals.add(content, "")
    signals.values |= objects
    return signals.columns()


def _contents(file: IO[bytes]) -> tuple[float, bool]:
    """Return how many numbers an array holds, and whether it holds objects instead."""
    version = array_format.read_magic(file)
    read_header = array_format.read_array_header_1_0 if version == (1, 0) else array_format.read_array_header_2_0
    shape, _, dtype = read_header(file)
    return math.prod(shape) * max(dtype.itemsize / 8.0, 1.0), dtype.hasobject


def _with_fields(array: np.ndarray) -> Any:
    """Return a structured array as a mapping of its fields."""
    return {field: array[field] for field in array.dtype.fields} if array.dtype.fields else array
