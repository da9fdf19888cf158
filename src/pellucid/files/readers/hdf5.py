"""Read HDF5 files: every numeric dataset, named by its path, ``emg.biceps`` for ``/emg/biceps``.

A dataset of several columns is numbered, ``emg.0``, ``emg.1``, ...; a field of a compound dataset, as tables of pandas
have them, is named. An attribute ``unit`` or ``units`` of a dataset is the unit of its columns.
"""

from __future__ import annotations

from pathlib import Path

from ._columns import Columns
from ._hdf5 import read_datasets

ENDINGS = (".h5", ".hdf5", ".hdf")
APART = ("h5py",)


def read(path: Path) -> Columns:
    """Return columns by dotted path, in the file's own units, each shape (n,) float64.

    A matrix's samples run along its longer side."""
    return read_datasets(path, kind="HDF5", columns_first=False)
