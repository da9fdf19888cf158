"""Results kept beside a study: one file of numbers, which bears its keeper's mark and is believed by nobody else.

A result is a tree of the package's own frozen dataclasses, mappings, tuples and arrays. Arrays are stored once each,
the tree as JSON; what is read back may only be such dataclasses, whatever the file says. A seal follows the archive,
which NumPy reads all the same. The seal is read first: it tells how large the keeper's archive is.
"""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from hashlib import blake2b, sha256
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires, version
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import write_bytes_atomically
from .keepers_mark import SEAL_LENGTH, is_sealed, seal, sealed_size

PACKAGE = __name__.partition(".")[0]
TREE, FRESH = "tree", "made_from"


class _Unknown(TypeError):
    pass


def keep(path: Path, made_from: str, result: Any) -> Path | None:
    """Write a result, whole or not at all; None where it holds what cannot be kept."""
    arrays = _Arrays()
    try:
        tree = json.dumps({FRESH: made_from, TREE: arrays.plain(result)}, separators=(",", ":"))
    except _Unknown:
        path.unlink(missing_ok=True)
        return None
    stored = {f"a{i}": x for i, x in enumerate(arrays.found)}
    stored[TREE] = np.frombuffer(tree.encode(), np.uint8)
    content = BytesIO()
    np.savez(content, **stored)
    content.write(seal(content.getbuffer()))
    return write_bytes_atomically(path, content.getbuffer())


def read_kept(path: Path, made_from: str) -> Any:
    """A result, if this user kept it and it was made from just this; None otherwise, also where the file is damaged."""
    if not path.is_file():
        return None
    try:
        content = _sealed_content(path)
        if content is None:
            return None
        with np.load(BytesIO(content), allow_pickle=False) as stored:
            tree = json.loads(stored[TREE].tobytes().decode())
            if tree[FRESH] != made_from:
                return None
            return _object(tree[TREE], stored)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, ImportError, EOFError, MemoryError,
            RecursionError, ArithmeticError, NotImplementedError, zipfile.BadZipFile):  # fmt: skip
        return None  # another version's, or somebody's own


def _sealed_content(path: Path) -> bytes | None:
    """Return the archive of a kept file; None, before it is read, if this user did not keep one of its size."""
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


@cache
def code_fingerprint() -> str:
    """Return the SHA-256 of everything that computes: the package's sources, its compiled core, and the versions of the
    libraries that it requires. Another of them may find something else."""
    root = Path(import_module(PACKAGE).__file__).parent
    digest = sha256(version(PACKAGE).encode())
    core = Path(import_module(f"{PACKAGE}._core").__file__)
    for source in (*sorted(root.rglob("*.py")), core):
        digest.update(source.read_bytes())
    digest.update(json.dumps(library_versions()).encode())
    return digest.hexdigest()


def library_versions() -> dict[str, str]:
    """Return the versions of the libraries that the package computes with, by name; those of its optional extras where
    they are installed."""
    found = {}
    for requirement in requires(PACKAGE) or ():
        name = re.match(r"[\w.-]+", requirement)[0]
        if name != PACKAGE and not re.search(r"extra == ['\"](test|benchmark)['\"]", requirement):
            with suppress(PackageNotFoundError):
                found[name] = version(name)
    return found


class _Arrays:
    """Turns a tree into JSON, and takes its arrays out, equal ones once."""

    def __init__(self) -> None:
        self.found: list[np.ndarray] = []
        self._places: dict[tuple, int] = {}

    def plain(self, x: Any) -> Any:
        if x is None or isinstance(x, (bool, str)):
            return x
        if isinstance(x, (int, float)) and not isinstance(x, np.generic):
            return x
        if is_dataclass(x) and type(x).__module__.partition(".")[0] == PACKAGE:
            kind = f"{type(x).__module__}:{type(x).__qualname__}"
            return {"d": kind, "v": {f.name: self.plain(getattr(x, f.name)) for f in fields(x)}}
        if isinstance(x, np.ndarray):
            return {"a": self._place(x)}
        if isinstance(x, np.generic):
            return {"a": self._place(np.asarray(x)), "scalar": True}
        if isinstance(x, list):
            return [self.plain(y) for y in x]
        if isinstance(x, tuple):
            return {"t": [self.plain(y) for y in x]}
        if isinstance(x, (set, frozenset)):
            return {"f": [self.plain(y) for y in sorted(x)]}
        if isinstance(x, Mapping):
            return {"m": [[self.plain(key), self.plain(value)] for key, value in x.items()]}
        if isinstance(x, Path):
            return {"p": str(x)}
        if isinstance(x, slice):
            return {"s": [self.plain(part) for part in (x.start, x.stop, x.step)]}
        raise _Unknown(f"{type(x).__module__}.{type(x).__qualname__} cannot be kept")

    def _place(self, x: np.ndarray) -> int:
        if x.dtype == object:
            raise _Unknown("an array of objects cannot be kept")
        x = np.ascontiguousarray(x) if x.ndim else x
        key = (x.shape, x.dtype.str, blake2b(x.tobytes(), digest_size=16).digest())
        if key not in self._places:
            self._places[key] = len(self.found)
            self.found.append(x)
        return self._places[key]


def _object(x: Any, stored: Mapping[str, np.ndarray]) -> Any:
    if isinstance(x, list):
        return [_object(y, stored) for y in x]
    if not isinstance(x, dict):
        return x
    if "a" in x:
        array = stored[f"a{int(x['a'])}"]
        return array[()] if x.get("scalar") else array
    if "t" in x:
        return tuple(_object(y, stored) for y in x["t"])
    if "f" in x:
        return frozenset(_object(y, stored) for y in x["f"])
    if "m" in x:
        return {_object(key, stored): _object(value, stored) for key, value in x["m"]}
    if "p" in x:
        return Path(x["p"])
    if "s" in x:
        return slice(*(_object(part, stored) for part in x["s"]))
    return _dataclass(x["d"], {name: _object(value, stored) for name, value in x["v"].items()})


def _dataclass(kind: str, values: dict[str, Any]) -> Any:
    module, _, name = kind.partition(":")
    if module.partition(".")[0] != PACKAGE:
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
