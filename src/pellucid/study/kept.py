"""Keep results of a study, each in one file of numbers that carries the user's own mark.

Files of other users are ignored.

A result is a tree of the package's own frozen dataclasses, mappings, tuples and arrays. Each array is stored once, and
the tree as JSON. Whatever the file says, only such dataclasses are restored from it. A seal follows the archive, which
NumPy can read in spite of it. The seal is read first, because it states the size of the archive.

`hold_lock` lets one command at a time write a study's results.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from hashlib import blake2b
from importlib import import_module
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import write_bytes_atomically
from .._errors import PellucidError
from ..files.kept_columns import SEAL_LENGTH, is_sealed, seal, sealed_size
from .code_fingerprint import PACKAGE_NAME

MAX_WAIT_S = 60.0
"""A command waits at most this long for another one that writes the same results [s]."""


@contextmanager
def hold_lock(path: str | os.PathLike, patience: float | None = None) -> Iterator[None]:
    """Hold the lock of `path`; raise a PellucidError after `patience` [s]. The lock of a dead process is released."""
    from filelock import FileLock, Timeout  # imported here, since most commands do not write

    path, patience = Path(path), MAX_WAIT_S if patience is None else patience
    path.parent.mkdir(parents=True, exist_ok=True)
    place = path.with_name(f".{path.name}.lock")
    # The lock file is opened for writing. Through a symbolic link this would empty the link's target.
    if place.is_symlink() or (place.exists() and not place.is_file()):
        found = "a symbolic link" if place.is_symlink() else "no regular file"
        raise PellucidError(f"{place}: found {found}, expected the lock file of {path.name} or nothing; remove it")
    lock = FileLock(place, patience, poll_interval=0.02)
    try:
        lock.acquire()
    except Timeout:
        raise PellucidError(
            f"{path}: found it being written by another command for {patience:g} s, expected to have it by "
            "then; wait for that command, or stop it, and run this one again"
        ) from None
    try:
        yield
    finally:
        lock.release()


TREE_KEY = "tree"
"""Key of the result in the stored JSON, and name of the JSON in the archive."""

ORIGIN_KEY = "made_from"
"""Key of the text that identifies the inputs of the result."""


class _UnsupportedTypeError(TypeError):
    """A result contains an object that cannot be stored."""


def keep_result(path: Path, made_from: str, result: Any) -> Path | None:
    """Write a result, completely or not at all; return None if it contains an object that cannot be stored."""
    encoder = _TreeEncoder()
    try:
        tree = json.dumps({ORIGIN_KEY: made_from, TREE_KEY: encoder.encode(result)}, separators=(",", ":"))
    except _UnsupportedTypeError:
        path.unlink(missing_ok=True)
        return None
    stored = {f"a{i}": x for i, x in enumerate(encoder.arrays)}
    stored[TREE_KEY] = np.frombuffer(tree.encode(), np.uint8)
    content = BytesIO()
    np.savez(content, **stored)
    with content.getbuffer() as written:
        signature = seal(written)
    content.write(signature)
    return write_bytes_atomically(path, content.getbuffer())


def read_kept(path: Path, made_from: str) -> Any:
    """Return a kept result; None if this user did not keep it, it was made from something else, or it is damaged."""
    if not path.is_file():
        return None
    try:
        content = _sealed_content(path)
        if content is None:
            return None
        with np.load(BytesIO(content), allow_pickle=False) as stored:
            tree = json.loads(stored[TREE_KEY].tobytes().decode())
            if tree[ORIGIN_KEY] != made_from:
                return None
            return _decode(tree[TREE_KEY], stored)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, ImportError, EOFError, MemoryError,
            RecursionError, ArithmeticError, NotImplementedError, zipfile.BadZipFile):  # fmt: skip
        return None  # another version or another program wrote the file


def _sealed_content(path: Path) -> bytes | None:
    """Return the archive of a kept file; None, before it is read, if its seal is not this user's or states another
    size."""
    with path.open("rb") as file:
        size = file.seek(0, SEEK_END) - SEAL_LENGTH
        if size < 0:
            return None
        file.seek(size)
        found = file.read(SEAL_LENGTH)
        if sealed_size(found) != size:
            return None
        file.seek(0)
        content = file.read(size)
    return content if is_sealed(content, found) else None


class _TreeEncoder:
    """Encoder that turns a tree into JSON and collects its arrays, equal arrays once."""

    def __init__(self) -> None:
        self.arrays: list[np.ndarray] = []
        self._places: dict[tuple, int] = {}

    def encode(self, x: Any) -> Any:
        """Return `x` as plain lists, dicts, texts and numbers; arrays are replaced by their index in `arrays`."""
        if x is None or isinstance(x, (bool, str)):
            return x
        if isinstance(x, (int, float)) and not isinstance(x, np.generic):
            return x
        if is_dataclass(x) and type(x).__module__.partition(".")[0] == PACKAGE_NAME:  # no others are stored
            kind = f"{type(x).__module__}:{type(x).__qualname__}"
            return {"d": kind, "v": {f.name: self.encode(getattr(x, f.name)) for f in fields(x)}}
        if isinstance(x, np.ndarray):
            return {"a": self._array_index(x)}
        if isinstance(x, np.generic):
            return {"a": self._array_index(np.asarray(x)), "scalar": True}
        if isinstance(x, list):
            return [self.encode(y) for y in x]
        if isinstance(x, tuple):
            return {"t": [self.encode(y) for y in x]}
        if isinstance(x, (set, frozenset)):
            return {"f": [self.encode(y) for y in sorted(x)]}
        if isinstance(x, Mapping):
            return {"m": [[self.encode(key), self.encode(value)] for key, value in x.items()]}
        if isinstance(x, Path):
            return {"p": str(x)}
        if isinstance(x, slice):
            return {"s": [self.encode(part) for part in (x.start, x.stop, x.step)]}
        raise _UnsupportedTypeError(f"{type(x).__module__}.{type(x).__qualname__} cannot be kept")

    def _array_index(self, x: np.ndarray) -> int:
        if x.dtype == object:
            raise _UnsupportedTypeError("an array of objects cannot be kept")
        x = np.ascontiguousarray(x) if x.ndim else x
        key = (x.shape, x.dtype.str, blake2b(x.tobytes(), digest_size=16).digest())
        if key not in self._places:
            self._places[key] = len(self.arrays)
            self.arrays.append(x)
        return self._places[key]


def _decode(x: Any, stored: Mapping[str, np.ndarray]) -> Any:
    if isinstance(x, list):
        return [_decode(y, stored) for y in x]
    if not isinstance(x, dict):
        return x
    if "a" in x:
        array = stored[f"a{int(x['a'])}"]
        return array[()] if x.get("scalar") else array
    if "t" in x:
        return tuple(_decode(y, stored) for y in x["t"])
    if "f" in x:
        return frozenset(_decode(y, stored) for y in x["f"])
    if "m" in x:
        return {_decode(key, stored): _decode(value, stored) for key, value in x["m"]}
    if "p" in x:
        return Path(x["p"])
    if "s" in x:
        return slice(*(_decode(part, stored) for part in x["s"]))
    return _decode_dataclass(x["d"], {name: _decode(value, stored) for name, value in x["v"].items()})


def _decode_dataclass(kind: str, values: dict[str, Any]) -> Any:
    module, _, name = kind.partition(":")
    if module.partition(".")[0] != PACKAGE_NAME:
        raise ValueError(kind)
    found = getattr(import_module(module), name)
    if not (isinstance(found, type) and is_dataclass(found)):
        raise ValueError(kind)
    if {f.name for f in fields(found)} != set(values):
        raise ValueError(kind)
    made = object.__new__(found)
    for key, value in values.items():
        object.__setattr__(made, key, value)
    return made
