"""Read HDF5 files: every numeric dataset, named by its path, ``emg.biceps`` for ``/emg/biceps``.

A dataset of several columns is numbered, ``emg.0``, ``emg.1``, ..., or named if an attribute or a list in its group has
a name for each column; so is a field of a compound dataset. Attributes may state the unit and the sampling rate. Groups
that differ in a number alone, such as demonstrations of a robot, are recordings. Pictures are excluded.
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
    return read_datasets(path)
