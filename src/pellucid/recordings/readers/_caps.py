"""How much one file may hold: what is more is refused by name, so that a small file fills neither memory nor a day."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from ..._errors import RecordingError

COLUMNS = 5000
"""Most columns of a file; PELLUCID_MOST_COLUMNS says another number."""

FILE_BYTES = 4e9
"""Most bytes of a file; PELLUCID_MOST_FILE_BYTES says another number."""

NUMBER_BYTES, SWELLS = 128e6, 100.0
"""Most bytes of a file's numbers as float64, or how many times its own size, if that is more; PELLUCID_MOST_BYTES says
another number."""

SECONDS, SPEED = 4.0, 2e6
"""For which a file may be read by a process of its own [s], and beside them its size over this [B/s];
PELLUCID_MOST_SECONDS says another number."""


def most(name: str, usual: float) -> float:
    """A cap as the environment's variable PELLUCID_MOST_`name` has it, or the usual one."""
    said = os.environ.get(f"PELLUCID_MOST_{name}")
    try:
        return usual if said is None else float(said)
    except ValueError:
        raise RecordingError(f'PELLUCID_MOST_{name}: found "{said}", expected a number') from None


def most_columns() -> float:
    """Of a file."""
    return most("COLUMNS", COLUMNS)


def most_bytes(path: Path) -> float:
    """Of a file's numbers as float64."""
    return most("BYTES", max(NUMBER_BYTES, SWELLS * path.stat().st_size))


def most_seconds(path: Path) -> float:
    """For which a process of its own may read a file [s]."""
    return most("SECONDS", SECONDS + path.stat().st_size / SPEED)


def require_few(path: Path, columns: int) -> None:
    """RecordingError if a file has too many columns."""
    if columns > most_columns():
        raise RecordingError(
            f"{path.name}: found {columns} columns or more, expected at most {most_columns():g}; to read it all the "
            "same: PELLUCID_MOST_COLUMNS=NUMBER"
        )


def require_narrow(path: Path, lines: Iterable[str]) -> None:
    """RecordingError if one of some lines of text is divided into too many columns, before any is."""
    most = int(most_columns())
    for line in lines:
        for delimiter in ("\t", ";", ",", None) if len(line) > 2 * most else ():
            require_few(path, len(line.split(delimiter, most + 1)))


def require_small(path: Path, numbers: float) -> None:
    """RecordingError if a file holds too many numbers for its size."""
    if 8.0 * numbers > most_bytes(path):
        raise RecordingError(
            f"{path.name}: found {numbers:.3g} numbers in {path.stat().st_size} bytes, which unpacked take "
            f"{8e-6 * numbers:.3g} MB, expected at most {1e-6 * most_bytes(path):.3g} MB; to read it all the same: "
            "PELLUCID_MOST_BYTES=NUMBER"
        )


def require_size(path: Path) -> None:
    """RecordingError if a file is empty, or larger than any recording."""
    size = path.stat().st_size
    if size == 0:
        raise RecordingError(f"{path.name}: the file is empty (0 bytes), expected recorded samples")
    if size > most("FILE_BYTES", FILE_BYTES):
        raise RecordingError(
            f"{path.name}: found {size} bytes, expected at most {most('FILE_BYTES', FILE_BYTES):g}; to read it all "
            "the same: PELLUCID_MOST_FILE_BYTES=NUMBER"
        )
