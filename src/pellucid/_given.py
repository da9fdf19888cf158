"""What others gave: files that may be a stranger's, and their words, which go into names, pages and terminals."""

from __future__ import annotations

import re
from pathlib import Path

from ._errors import PellucidError

MOST_BYTES = 50_000_000
"""Of a file that is read whole as text: a card, a rig, a model of muscles [B]."""

NAME = r"^\w[\w .-]{0,99}$"
"""What may be part of a file's name, a figure's id and a column's: letters and digits of any language, blanks . - _"""

STEM = r"^[\w(+=][\w .()+,=-]{0,199}$"
"""What the stem of a file's name may be."""

_UNSEEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def read_given(path: Path, most: int = MOST_BYTES) -> bytes:
    """The content of a regular file of at most so many bytes; FileNotFoundError if there is none."""
    path = Path(path)
    # A pipe or a device would be waited for, or read without end.
    if path.exists() and not path.is_file():
        raise PellucidError(f"{path}: found no regular file, expected one")
    if path.stat().st_size > most:
        raise PellucidError(f"{path}: found {path.stat().st_size} bytes, expected at most {most}")
    return path.read_bytes()


def require_inside(path: Path, folder: Path, allowed: bool, where: str) -> Path:
    """`path` again, if it lies in `folder` wherever links lead, or what lies outside is `allowed`."""
    try:
        inside = allowed or path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a link to itself, a name that no file can have
        inside = False
    if not inside:
        raise PellucidError(
            f"{where}: found {seen(str(path))} outside the study's folder, expected a file in it; --allow-outside "
            "(allow_outside=True) takes it all the same"
        )
    return path


def require_folder(path: Path, expected: str, error: type[PellucidError] = PellucidError) -> Path:
    """Return `path` again, if it is a folder or could be made one; where it is a file, or lies in one, an `error` says
    what was `expected`."""
    for place in (path, *path.absolute().parents):
        if place.is_dir():
            break
        if place.exists():
            raise error(f"{seen(str(place))}: found a file, expected {expected}")
    return path


def seen(text: str) -> str:
    """A text with what cannot be seen, or turns a terminal or a line around, in the open."""
    return _UNSEEN.sub("\N{REPLACEMENT CHARACTER}", text)


_NUMBERS = re.compile(r"[-+]?[\d.][\d.,;:%() eE–-]*(?:to [-+\d.,;:%() eE–]*)?")


def words_in_csv(cell: str) -> str:
    """A cell of a table that a spreadsheet may open: as it is, unless it were taken for a formula."""
    return f"'{cell}" if cell[:1] in "=+-@\t\r" and cell and _NUMBERS.fullmatch(cell) is None else cell
