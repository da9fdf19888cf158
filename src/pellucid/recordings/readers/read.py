"""Which reader opens which file."""

from __future__ import annotations

import importlib
from pathlib import Path

from ..._errors import RecordingError
from ._columns import Columns

FORMATS = {
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".dat": "csv",
    ".mat": "mat",
    ".json": "json",
    ".sto": "sto",
    ".mot": "sto",
    ".c3d": "c3d",
    ".xdf": "xdf",
    ".edf": "edf",
    ".bdf": "edf",
}
"""File ending -> module of this package that reads it."""


def read_columns(path: Path) -> Columns:
    """Read every numeric column of a file.

    Parameters
    ----------
    path : Path
        File whose ending says its format.

    Returns
    -------
    Columns

    Raises
    ------
    RecordingError
        If the file is missing, empty, truncated, of an unknown format, or holds no numbers.
    """
    path = Path(path)
    if not path.is_file():
        raise RecordingError(f"{path}: no such file")
    if path.stat().st_size == 0:
        raise RecordingError(f"{path.name}: the file is empty (0 bytes), expected recorded samples")
    module = FORMATS.get(path.suffix.lower())
    if module is None:
        raise RecordingError(
            f'{path.name}: found the ending "{path.suffix}", expected one of {", ".join(sorted(FORMATS))}'
        )
    try:
        if path.suffix.lower() == ".dat" and _is_storage(path):
            module = "sto"
        columns = importlib.import_module(f".{module}", __package__).read(path)
    except OSError as error:
        raise RecordingError(f"{path}: not readable: {error}") from error
    if all(isinstance(value, str) for value in columns.values.values()):
        raise RecordingError(f"{path.name}: found no numeric column")
    return columns


def _is_storage(path: Path) -> bool:
    """Whether a line ``endheader`` makes a .dat file one of OpenSim's."""
    with path.open(encoding="utf-8-sig", errors="replace") as lines:
        return any(line.strip().lower() == "endheader" for _, line in zip(range(1000), lines, strict=False))
