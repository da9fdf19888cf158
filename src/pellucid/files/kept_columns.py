"""Keep the columns of long files beside a study as numbers, so that text is parsed only once.

A kept file is named after the checksums of its source file and of the readers. It consists of the user's seal, a line
of JSON (names, units, lengths, checksums) and the columns one after another, as little-endian float64. Only columns
that are asked for are read. A file without this user's seal is written anew. Nothing is kept in a folder that cannot be
written, and no more than `MAX_KEPT_BYTES` altogether.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path

import numpy as np

from .._atomic import atomically
from .log import SEAL_LENGTH, is_sealed, seal, sealed_size
from .readers import Columns, read_columns
from .readers.read import needs_process

MIN_FILE_BYTES = 4_000_000
"""Only the columns of files from this size on are kept; smaller files are read fast enough, unless they need a process
of their own."""

MAX_KEPT_BYTES = 4_000_000_000
"""At most this many bytes are kept for one study. The files that were read last stay."""

FILE_ENDING = ".columns"
"""Ending of the names of kept files."""

STORED_DTYPE = np.dtype("<f8")
"""Type of the stored numbers."""

_VERIFIED_COLUMNS: dict[tuple[str, int, int], set[str]] = {}
"""Columns whose checksums this process has verified, by what `_state_of` says of their file."""


class KeptColumns(Mapping):
    """Columns by name, each read from a kept file when it is asked for, or from its `source` if that file is damaged.

    A column of text is its description, as in `Columns`. A column whose checksum is `verified` is not summed up again.
    """

    def __init__(self, path: Path, start: int, entries: dict, source: Path, verified: set[str]):
        self._path, self._start, self._entries, self._source = path, start, entries, source
        self._verified = verified

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __getitem__(self, name: str) -> np.ndarray | str:
        entry = self._entries[name]
        if isinstance(entry, str):
            return entry
        at, n, checksum = entry
        try:
            column = (
                np.memmap(self._path, STORED_DTYPE, "r", self._start + at, (n,)) if n else np.empty(0, STORED_DTYPE)
            )
            if name in self._verified or _checksum(column) == checksum:
                self._verified.add(name)
                return np.asarray(column).astype(float, copy=False)
        except (OSError, ValueError):
            pass  # the kept file is gone, or shorter than before
        return read_columns(self._source).values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


def kept_columns(folder: Path, source: Path, digest: str) -> Columns:
    """Return the columns of the file `source` with the SHA-256 `digest`, from `folder` if they are kept there.

    Otherwise the file is read, and its columns are kept if it is long, or needs a process of its own.
    """
    if source.stat().st_size < MIN_FILE_BYTES and not needs_process(source):
        return read_columns(source)
    path = folder / f"{digest[:32]}-{_readers_checksum()[:8]}{FILE_ENDING}"
    return _read_kept(path, source) or _keep(path, read_columns(source))


def _read_kept(path: Path, source: Path) -> Columns | None:
    try:
        with path.open("rb") as file:
            found_seal = file.read(SEAL_LENGTH)
            size = sealed_size(found_seal, path.name.encode())
            line = b"" if size is None else file.read(size)
        if size is None or not is_sealed(line, found_seal):
            return None
        head, start = json.loads(line), SEAL_LENGTH + len(line)
        for entry in head["columns"].values():
            # A truncated file holds less than its header states.
            if not isinstance(entry, str) and start + entry[0] + entry[1] * STORED_DTYPE.itemsize > path.stat().st_size:
                return None
        verified = _VERIFIED_COLUMNS.pop(_state_of(path), set())
        columns = Columns(
            source, KeptColumns(path, start, dict(head["columns"]), source, verified), head["angle_unit"], head["units"]
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError):
        return None
    with suppress(OSError):
        os.utime(path)  # the files that were used last are removed last
        _VERIFIED_COLUMNS[_state_of(path)] = verified
    return columns


def _keep(path: Path, columns: Columns) -> Columns:
    """Store columns and return them as read from the stored file; return the given ones if they cannot be stored."""
    if not all(isinstance(x, str) or (x.ndim == 1 and x.dtype == float) for x in columns.values.values()):
        return columns
    entries, at = {}, 0
    for name, x in columns.values.items():
        entries[name] = x if isinstance(x, str) else (at, len(x), _checksum(np.ascontiguousarray(x, STORED_DTYPE)))
        at += 0 if isinstance(x, str) else x.nbytes
    if at > MAX_KEPT_BYTES or any(isinstance(name, int) for name in columns.units):
        return columns
    head = {"columns": entries, "angle_unit": columns.angle_unit, "units": dict(columns.units)}
    text = json.dumps(head).encode()
    line = (
        text + b" " * (-(len(text) + 1) % STORED_DTYPE.itemsize) + b"\n"
    )  # the padding aligns the numbers for the processor
    try:
        with atomically(path) as file:
            file.write(seal(line, path.name.encode()) + line)
            for x in columns.values.values():
                if not isinstance(x, str):
                    file.write(np.ascontiguousarray(x, STORED_DTYPE).data)
        _remove_old_files(path)
    except OSError:
        return columns  # the folder cannot be written, or is full
    kept = KeptColumns(path, SEAL_LENGTH + len(line), entries, columns.path, set(entries))
    return Columns(columns.path, kept, columns.angle_unit, columns.units)


def _state_of(path: Path) -> tuple[str, int, int]:
    """Return the path of a file, the time of its last change [ns] and its size."""
    found = path.stat()
    return str(path), found.st_mtime_ns, found.st_size


def _checksum(column: np.ndarray) -> str:
    return sha256(column.data).hexdigest()


def _remove_old_files(but: Path) -> None:
    """Remove files that other readers kept of the same source, then the oldest files beyond `MAX_KEPT_BYTES`."""
    others = [path for path in but.parent.glob(f"*{FILE_ENDING}") if path != but]
    for path in [path for path in others if path.name[:32] == but.name[:32]]:
        path.unlink(missing_ok=True)
        others.remove(path)
    total = 0
    for path in [but, *sorted(others, key=lambda path: path.stat().st_mtime, reverse=True)]:
        total += path.stat().st_size
        if total > MAX_KEPT_BYTES:
            path.unlink(missing_ok=True)


@cache
def _readers_checksum() -> str:
    """Return the SHA-256 of the readers' sources, because other readers may read a file differently."""
    digest = sha256()
    for source in sorted((Path(__file__).parent / "readers").glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()
