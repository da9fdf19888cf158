"""Read NumPy's files: named arrays (.npz) and single arrays (.npy).

An array of several columns is numbered, ``emg.0``, ``emg.1``, ...; a field of a structured array is named. Objects,
which could run a program, are refused.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO

import numpy as np
from numpy.lib import format as array_format

from ..._errors import RecordingError
from ._caps import require_unpacked_size
from ._columns import Columns
from ._flatten import flatten, with_samples_down

ENDINGS = (".npz", ".npy")


def read(path: Path) -> Columns:
    """Return columns by the arrays' names, each shape (n,) float64.

    A matrix's samples run along its longer side."""
    into: dict[str, np.ndarray] = {}
    try:
        if path.suffix.lower() == ".npy":
            with path.open("rb") as file:
                _require_size(path, file, 0.0)
            _flatten_array(path, path.stem, np.load(path, allow_pickle=False), into)
        else:
            number_count = 0.0
            with zipfile.ZipFile(path) as archive:
                for member in archive.namelist():
                    if not member.endswith(".npy"):
                        continue
                    # The size is in the array's first bytes, which are unpacked alone.
                    with archive.open(member) as file:
                        number_count = _require_size(path, file, number_count)
                    with archive.open(member) as file:
                        array = array_format.read_array(file, allow_pickle=False)
                    _flatten_array(path, member.removesuffix(".npy").replace("/", "."), array, into)
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # parsing unexpected bytes may raise anything
        raise RecordingError(f"{path.name}: not readable as NumPy's arrays, truncated or damaged: {error}") from error
    return Columns(path, into)


def _require_size(path: Path, file: IO[bytes], before: float) -> float:
    """Return how many numbers an array and those before it hold; a RecordingError says that they are too many."""
    version = array_format.read_magic(file)
    read_header = array_format.read_array_header_1_0 if version == (1, 0) else array_format.read_array_header_2_0
    shape, _, dtype = read_header(file)
    number_count = before + math.prod(shape) * max(dtype.itemsize / 8.0, 1.0)
    require_unpacked_size(path, number_count)
    return number_count


def _flatten_array(path: Path, name: str, array: np.ndarray, into: dict[str, np.ndarray]) -> None:
    fields = array.dtype.fields
    whole = {field: array[field] for field in fields} if fields else with_samples_down(array)
    flatten(whole, name, into, path)
