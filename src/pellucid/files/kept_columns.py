"""Keep the columns of long files in a study's folder as numbers, so that text is parsed only once.

A kept file is named after the checksums of its source file and of the readers. It consists of the user's seal, a line
of JSON (names, units, lengths, checksums) and the columns one after another, as little-endian numbers of the shortest
type that holds them exactly. Only requested columns are read. A file without this user's seal is written anew. Nothing
is kept in a folder that cannot be written, and no more than `MAX_KEPT_BYTES` altogether.

A seal shows that this user wrote a file: it holds the content's size, its checksum, and a mark that requires the key in
the user's folder of settings.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from hashlib import blake2b, sha256
from hmac import compare_digest
from pathlib import Path
from secrets import token_bytes

import numpy as np

from .._atomic import atomically, write_bytes_atomically
from .readers import Columns, read_columns
from .readers.read import needs_process

MIN_FILE_BYTES = 4_000_000
"""Only the columns of files from this size on are kept; smaller files are read fast enough, unless they need a process
of their own."""

MAX_KEPT_BYTES = 4_000_000_000
"""At most this many bytes are kept for one study. The files that were read last stay."""

FILE_ENDING = ".columns"
"""Ending of the names of kept files."""

STORED_DTYPES = {name: np.dtype(name) for name in ("<i2", "<i4", "<f8")}
"""Types of the stored numbers by name, the shortest first."""

ALIGNMENT_BYTES = 8
"""Each column begins at a multiple of this many bytes, as the processor reads numbers best."""

USUAL_EVIDENCE_COUNT = 100
"""Whether a shorter type holds a column mostly shows in this many numbers."""

_VERIFIED_COLUMNS: dict[tuple[str, int, int], set[str]] = {}
"""Columns whose checksums this process has verified, by what `_state_of` says of their file."""


MARK_BYTES = 32
"""Length of a mark, and of the key."""

SETTINGS_VARIABLE = "PELLUCID_SETTINGS"
"""Environment variable that names another folder of settings."""


def mark(content: bytes | memoryview) -> bytes:
    """Return the mark of a content, `MARK_BYTES` bytes, which nobody can make without the key."""
    return blake2b(content, key=_key(settings_folder()), digest_size=MARK_BYTES).digest()


SEAL_LENGTH = 8 + 2 * MARK_BYTES
"""Length of a seal in bytes: a content's size, its checksum, and the mark of both."""


def seal(content: bytes | memoryview, context: bytes = b"") -> bytes:
    """Return the seal of a content, `SEAL_LENGTH` bytes; its mark includes a `context`, such as a file's name.

    A seal can be checked before the content is read, so that a reader never reads more bytes than were stored.
    """
    note = len(content).to_bytes(8, "little") + blake2b(content, digest_size=MARK_BYTES).digest()
    return note + mark(context + note)


def sealed_size(found: bytes, context: bytes = b"") -> int | None:
    """Return the size of the content that a `found` seal belongs to [bytes]; None if it is not this user's seal."""
    note, marked = found[:-MARK_BYTES], found[-MARK_BYTES:]
    own = len(found) == SEAL_LENGTH and is_own_mark(context + note, marked)
    return int.from_bytes(note[:8], "little") if own else None


def is_sealed(content: bytes | memoryview, found: bytes) -> bool:
    """Return whether a content is the one of a `found` seal, which `sealed_size` has accepted."""
    return found[8:-MARK_BYTES] == blake2b(content, digest_size=MARK_BYTES).digest()


def is_own_mark(content: bytes | memoryview, found: bytes) -> bool:
    """Return whether a `found` mark is this user's mark of the content."""
    return compare_digest(mark(content), found)


def settings_folder() -> Path:
    """Return the user's own folder of settings."""
    named = os.environ.get(SETTINGS_VARIABLE)
    if named:
        return Path(named)
    parent = os.environ.get("APPDATA") if os.name == "nt" else os.environ.get("XDG_CONFIG_HOME")
    return (Path(parent) if parent else Path.home() / ".config") / "pellucid"


@cache
def _key(folder: Path) -> bytes:
    """Return the key; draw it if the folder has none. If the folder cannot be written, the key is this process's
    own."""
    path = folder / "kept.key"
    try:
        if not path.is_file() or path.stat().st_size != MARK_BYTES:
            write_bytes_atomically(path, token_bytes(MARK_BYTES), private=True)
        return path.read_bytes()  # if two processes drew a key at once, both use the later one
    except OSError:
        return token_bytes(MARK_BYTES)


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
        at, n, checksum, dtype = entry
        stored = STORED_DTYPES[dtype]
        try:
            column = np.memmap(self._path, stored, "r", self._start + at, (n,)) if n else np.empty(0, stored)
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
            if isinstance(entry, str):
                continue
            at, n, _, dtype = entry
            if start + at + n * STORED_DTYPES[dtype].itemsize > path.stat().st_size:
                return None
        verified = _VERIFIED_COLUMNS.pop(_state_of(path), set())
        columns = Columns(
            source,
            KeptColumns(path, start, dict(head["columns"]), source, verified),
            head["angle_unit"],
            head["units"],
            damaged=head["damaged"],
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
    entries: dict[str, tuple[int, int, str, str] | str] = {}
    parts, at = [], 0
    for name, x in columns.values.items():
        if isinstance(x, str):
            entries[name] = x
            continue
        part = _shortest(x)
        entries[name] = at, len(x), _checksum(part), part.dtype.str
        parts.append(part)
        at += part.nbytes + -part.nbytes % ALIGNMENT_BYTES
    if at > MAX_KEPT_BYTES or any(isinstance(name, int) for name in columns.units):
        return columns
    head = {
        "columns": entries,
        "angle_unit": columns.angle_unit,
        "units": dict(columns.units),
        "damaged": columns.damaged,
    }
    text = json.dumps(head).encode()
    line = (
        text + b" " * (-(len(text) + 1) % ALIGNMENT_BYTES) + b"\n"
    )
    try:
        with atomically(path) as file:
            file.write(seal(line, path.name.encode()) + line)
            for part in parts:
                file.write(part.data)
                file.write(bytes(-part.nbytes % ALIGNMENT_BYTES))
        _remove_old_files(path)
    except OSError:
        return columns  # the folder cannot be written, or is full
    kept = KeptColumns(path, SEAL_LENGTH + len(line), entries, columns.path, set(entries))
    return Columns(columns.path, kept, columns.angle_unit, columns.units)


def _shortest(column: np.ndarray) -> np.ndarray:
    """Return the same numbers, (n,), in the shortest of `STORED_DTYPES` that holds the bits of each."""
    *short, widest = STORED_DTYPES.values()
    column = np.ascontiguousarray(column)
    with np.errstate(invalid="ignore"):
        for dtype in short:
            for part in (column[:USUAL_EVIDENCE_COUNT], column):
                made = part.astype(dtype)
                if not np.array_equal(made.astype(float).view(np.int64), part.view(np.int64)):
                    break
            else:
                return made
    return column.astype(widest, copy=False)


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
