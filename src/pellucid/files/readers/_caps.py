"""Caps on what one file may hold. A larger file is refused, so that no file fills the memory or takes a day to read."""

from __future__ import annotations

import gzip
import io
import os
from collections.abc import Iterable
from pathlib import Path

from ..._errors import RecordingError

DEFAULT_MAX_COLUMNS = 5000
"""A file has at most this many columns, unless PELLUCID_MOST_COLUMNS states another number."""

MAX_NAME_LENGTH = 300
"""A column's name has at most this many characters; dotted names of nested structures have less than half."""

DEFAULT_MAX_FILE_BYTES = 4e9
"""A file has at most this many bytes, unless PELLUCID_MOST_FILE_BYTES states another number."""

DEFAULT_MAX_UNPACKED_BYTES = 128e6
"""A file's numbers take at most this many bytes as float64, or `MAX_UNPACKED_SIZE_RATIO` times the file's size if that
is more. PELLUCID_MOST_BYTES states another number of bytes."""

MAX_UNPACKED_SIZE_RATIO = 100.0
"""A file's numbers take at most this many times the file's own size as float64, or `DEFAULT_MAX_UNPACKED_BYTES` if that
is more."""

BASE_READING_TIME_S = 4.0
"""A separate process may read a file for this long [s], plus the file's size divided by `MIN_READING_SPEED`.
PELLUCID_MOST_SECONDS states another number of seconds."""

MIN_READING_SPEED = 2e6
"""Reading speed that a file's time limit allows for [B/s]."""


def stated_cap(name: str, default: float) -> float:
    """Return the cap that the environment variable PELLUCID_MOST_`name` states, else the `default`."""
    said = os.environ.get(f"PELLUCID_MOST_{name}")
    try:
        return default if said is None else float(said)
    except ValueError:
        raise RecordingError(f'PELLUCID_MOST_{name}: found "{said}", expected a number') from None


def max_columns() -> float:
    """Return how many columns a file may have."""
    return stated_cap("COLUMNS", DEFAULT_MAX_COLUMNS)


def max_unpacked_bytes(path: Path) -> float:
    """Return how many bytes a file's numbers may take as float64."""
    return stated_cap("BYTES", max(DEFAULT_MAX_UNPACKED_BYTES, MAX_UNPACKED_SIZE_RATIO * path.stat().st_size))


def max_reading_time(path: Path) -> float:
    """Return how long a separate process may read a file [s]."""
    return stated_cap("SECONDS", BASE_READING_TIME_S + path.stat().st_size / MIN_READING_SPEED)


def require_few_columns(path: Path, columns: int) -> None:
    """Raise a RecordingError if a file has too many columns."""
    if columns > max_columns():
        raise RecordingError(
            f"{path.name}: found {columns} columns or more, expected at most {max_columns():g}; to read it all the "
            "same: PELLUCID_MOST_COLUMNS=NUMBER"
        )


def require_short_names(path: Path, names: Iterable[str]) -> None:
    """Raise a RecordingError if a column's name is too long: what names say is searched in time that grows faster."""
    longest = max(names, key=len, default="")
    if len(longest) > MAX_NAME_LENGTH:
        raise RecordingError(
            f'{path.name}: found a column with a name of {len(longest)} characters, "{longest[:40]}...", expected at '
            f"most {MAX_NAME_LENGTH}"
        )


def require_narrow_lines(path: Path, lines: Iterable[str]) -> None:
    """Raise a RecordingError if a line would be split into too many columns, before any line is split completely."""
    limit = int(max_columns())
    for line in lines:
        for delimiter in ("\t", ";", ",", None) if len(line) > 2 * limit else ():
            require_few_columns(path, len(line.split(delimiter, limit + 1)))


def require_unpacked_size(path: Path, numbers: float) -> None:
    """Raise a RecordingError if a file holds too many numbers for its size."""
    if 8.0 * numbers > max_unpacked_bytes(path):
        raise RecordingError(
            f"{path.name}: found {numbers:.3g} numbers in {path.stat().st_size} bytes, which unpacked take "
            f"{8e-6 * numbers:.3g} MB, expected at most {1e-6 * max_unpacked_bytes(path):.3g} MB; to read it all the "
            "same: PELLUCID_MOST_BYTES=NUMBER"
        )


def unpacked_gzip(path: Path, content: bytes) -> bytes:
    """Return what a file's `content`, packed by gzip, holds; raise a RecordingError if it is too much for its size."""
    limit = int(max_unpacked_bytes(path))
    with gzip.open(io.BytesIO(content)) as packed:
        made = packed.read(limit + 1)
    if len(made) > limit:
        raise RecordingError(
            f"{path.name}: found {path.stat().st_size} bytes that unpack to more, expected at most "
            f"{1e-6 * limit:.3g} MB unpacked; to read it all the same: PELLUCID_MOST_BYTES=NUMBER"
        )
    return made


def require_file_size(path: Path) -> None:
    """Raise a RecordingError if a file is empty, or larger than any recording."""
    size = path.stat().st_size
    if size == 0:
        raise RecordingError(f"{path.name}: the file is empty (0 bytes), expected recorded samples")
    limit = stated_cap("FILE_BYTES", DEFAULT_MAX_FILE_BYTES)
    if size > limit:
        raise RecordingError(
            f"{path.name}: found {size} bytes, expected at most {limit:g}; to read it all "
            "the same: PELLUCID_MOST_FILE_BYTES=NUMBER"
        )
