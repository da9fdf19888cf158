"""Read files and texts from strangers safely, before they reach names, pages and terminals."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from ._errors import ArgumentError, PellucidError, StudyError

MAX_FILE_BYTES = 50_000_000
"""A file that is read as one text has at most this size, such as a card, a rig or a model of muscles [B]."""

MAX_KEY_PARTS = 40
"""A dotted key in TOML has at most this many parts. Python's reader takes memory and time that grow with the square of
their number: 40 kB of parts take 2.4 GB."""

NAME_PATTERN = r"^\w[\w .-]{0,99}$"
"""Pattern of a name that may be part of a file's name, a figure's id or a column's name: letters and digits of any
language, blanks . - _"""

STEM_PATTERN = r"^[\w(+=][\w .()+,=-]{0,199}$"
"""Pattern of the stem of a file's name."""

_INVISIBLE_CHARACTERS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def require_path(path: Any, where: str) -> Path:
    """Return a path that was given as a text or a path; raise an ArgumentError for anything else."""
    if not isinstance(path, (str, os.PathLike)):
        raise ArgumentError(f"{where}: found a value of type {type(path).__name__}, expected a path")
    return Path(path)


def read_given(path: Path, most: int = MAX_FILE_BYTES) -> bytes:
    """Return the content of a regular file of at most `most` bytes; raise a FileNotFoundError if there is none."""
    path = Path(path)
    # Reading a pipe or a device may wait for ever or never end.
    if path.exists() and not path.is_file():
        raise PellucidError(f"{path}: found no regular file, expected one")
    if path.stat().st_size > most:
        raise PellucidError(f"{path}: found {path.stat().st_size} bytes, expected at most {most}")
    return path.read_bytes()


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the tables of a text in TOML, in time and memory proportional to its length; `where` begins a message."""
    import tomllib

    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") >= MAX_KEY_PARTS and _dotted_parts(line) > MAX_KEY_PARTS:
            raise StudyError(
                f"{where}, line {number}: found a dotted key of more than {MAX_KEY_PARTS} parts, expected fewer"
            )
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{where}: not valid TOML: {error}") from error


_KEY_TOKEN = re.compile(r"[A-Za-z0-9_-]+|[ \t]+|\.|.", re.DOTALL)


def _dotted_parts(line: str) -> int:
    """Return how many parts a dotted key in a line has at most: bare parts in one run, and all quoted parts.

    Whether a part stands in a string is not looked at, because a line alone does not tell that.
    """
    longest = run = quoted = 0
    last, dotted = "", False
    for match in _KEY_TOKEN.finditer(line):
        token = match[0]
        if token.isspace():
            continue
        if token == ".":
            quoted += last[:1] in ("'", '"') and bool(last)
            dotted = True
        elif token[0].isalnum() or token[0] in "_-":
            run = run + 1 if dotted else 1
            longest, dotted = max(longest, run), False
        elif token in "'\"":
            dotted = False
        else:
            run, dotted = 0, False
        last = token
    return max(longest, quoted) + min(longest, quoted)


def require_inside(path: Path, folder: Path, allowed: bool, where: str) -> Path:
    """Return `path` if it lies in `folder` after all links are followed, or if files outside are `allowed`."""
    try:
        inside = allowed or path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # the path is a link to itself, or no file can have its name
        inside = False
    if not inside:
        raise PellucidError(
            f"{where}: found {visible_text(str(path))} outside the study's folder, expected a file in it; "
            "--allow-outside (allow_outside=True) takes it all the same"
        )
    return path


def require_folder(path: Path, expected: str, error: type[PellucidError] = PellucidError) -> Path:
    """Return `path` if it is a folder or could become one; otherwise raise an `error` that says what was `expected`."""
    for place in (path, *path.absolute().parents):
        if place.is_dir():
            break
        if place.exists():
            raise error(f"{visible_text(str(place))}: found a file, expected {expected}")
    return path


def require_empty_folder(folder: Path, error: type[PellucidError] = StudyError) -> None:
    """Raise an `error` if `folder` is a file, or a folder with something in it."""
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        found = "a file" if folder.is_file() else f"a folder that holds {', '.join(sorted(os.listdir(folder))[:5])}"
        raise error(f"{folder}: found {found}, expected a new or empty folder")


def visible_text(text: str) -> str:
    """Return a text in which replacement characters stand for invisible and control characters."""
    return _INVISIBLE_CHARACTERS.sub("\N{REPLACEMENT CHARACTER}", text)


_NUMBER_CELL = re.compile(r"[-+]?[\d.][\d.,;:%() eE–-]*(?:to [-+\d.,;:%() eE–]*)?")


def csv_cell(cell: str) -> str:
    """Return a cell of a table, with a quote before it if a spreadsheet would read it as a formula."""
    return f"'{cell}" if cell[:1] in "=+-@\t\r" and cell and _NUMBER_CELL.fullmatch(cell) is None else cell
