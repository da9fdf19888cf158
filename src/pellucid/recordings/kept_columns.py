"""Columns of long files, kept beside a study as numbers: text is parsed once.

A kept file is named after the checksum of the file it came from and of the readers; it is its keeper's seal, a line of
JSON (names, what the file says of units, lengths, checksums) and the columns after each other, little-endian float64.
Only columns that are asked for are read. One without this user's seal is somebody else's, and written anew. Nothing is
kept where the folder cannot be written, and no more than `MOST` of all.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from hashlib import blake2b, sha256
from pathlib import Path

import numpy as np

from .._atomic import atomically
from .keepers_mark import SEAL_LENGTH, is_sealed, seal, sealed_size
from .readers import Columns, read_columns

FROM = 4_000_000  # bytes of a file that is worth keeping
MOST = 4_000_000_000  # bytes kept of one study's files; those read last stay
ENDING = ".columns"
STORED = np.dtype("<f8")


class KeptColumns(Mapping):
    """Columns by name, each read from a kept file when it is asked for, or where that is damaged from its `source`;
    those of text as they were."""

    def __init__(self, path: Path, start: int, entries: dict, source: Path):
        self._path, self._start, self._entries, self._source = path, start, entries, source

    def __getitem__(self, name: str) -> np.ndarray | str:
        entry = self._entries[name]
        if isinstance(entry, str):
            return entry
        at, n, checksum = entry
        try:
            column = np.memmap(self._path, STORED, "r", self._start + at, (n,)) if n else np.empty(0, STORED)
            if _checksum(column) == checksum:
                return np.asarray(column).astype(float, copy=False)
        except (OSError, ValueError):
            pass  # it is gone, or shorter than it was
        return read_columns(self._source).values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


def kept_columns(folder: Path, source: Path, digest: str) -> Columns:
    """Columns of the file `source` with the SHA-256 `digest`: those kept in `folder`, or read now and, if it is long,
    kept."""
    if source.stat().st_size < FROM:
        return read_columns(source)
    path = folder / f"{digest[:32]}-{_readers()[:8]}{ENDING}"
    return _kept(path, source) or _keep(path, read_columns(source))


def _kept(path: Path, source: Path) -> Columns | None:
    try:
        with path.open("rb") as file:
            found = file.read(SEAL_LENGTH)
            size = sealed_size(found, path.name.encode())
            line = b"" if size is None else file.read(size)
        if size is None or not is_sealed(line, found):
            return None
        head, start = json.loads(line), SEAL_LENGTH + len(line)
        for entry in head["columns"].values():
            # Of a file that was cut, less than there was.
            if not isinstance(entry, str) and start + entry[0] + entry[1] * STORED.itemsize > path.stat().st_size:
                return None
        found = KeptColumns(path, start, dict(head["columns"]), source), head["angle_unit"], head["units"]
    except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError):
        return None
    with suppress(OSError):
        os.utime(path)  # what was used last is forgotten last
    return Columns(source, *found)


def _keep(path: Path, columns: Columns) -> Columns:
    """The same columns, from where they are kept now if they can be."""
    if not all(isinstance(x, str) or (x.ndim == 1 and x.dtype == float) for x in columns.values.values()):
        return columns
    entries, at = {}, 0
    for name, x in columns.values.items():
        entries[name] = x if isinstance(x, str) else (at, len(x), _checksum(np.ascontiguousarray(x, STORED)))
        at += 0 if isinstance(x, str) else x.nbytes
    if at > MOST or any(isinstance(name, int) for name in columns.units):
        return columns
    head = {"columns": entries, "angle_unit": columns.angle_unit, "units": dict(columns.units)}
    text = json.dumps(head).encode()
    line = text + b" " * (-(len(text) + 1) % STORED.itemsize) + b"\n"  # numbers lie where a processor wants them
    try:
        with atomically(path) as file:
            file.write(seal(line, path.name.encode()) + line)
            for x in columns.values.values():
                if not isinstance(x, str):
                    file.write(np.ascontiguousarray(x, STORED))
        _forget(path)
    except OSError:
        return columns  # the folder cannot be written, or is full
    kept = KeptColumns(path, SEAL_LENGTH + len(line), entries, columns.path)
    return Columns(columns.path, kept, columns.angle_unit, columns.units)


def _checksum(column: np.ndarray) -> str:
    return blake2b(column, digest_size=16).hexdigest()


def _forget(but: Path) -> None:
    """Remove what other readers kept of the same file, then what was used longest ago until no more than `MOST` is
    left."""
    others = [path for path in but.parent.glob(f"*{ENDING}") if path != but]
    for path in [path for path in others if path.name[:32] == but.name[:32]]:
        path.unlink(missing_ok=True)
        others.remove(path)
    total = 0
    for path in [but, *sorted(others, key=lambda path: path.stat().st_mtime, reverse=True)]:
        total += path.stat().st_size
        if total > MOST:
            path.unlink(missing_ok=True)


@cache
def _readers() -> str:
    """SHA-256 of the readers' sources: others may read a file otherwise."""
    digest = sha256()
    for source in sorted((Path(__file__).parent / "readers").glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()
