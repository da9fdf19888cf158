"""Lock a study's results, so that two commands that write at the same time do not lose each other's rows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .._errors import PellucidError

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
