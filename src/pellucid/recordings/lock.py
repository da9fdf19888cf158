"""A study's results belong to one command at a time: of two that write at once neither loses what the other found."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .._errors import PellucidError

PATIENCE = 60.0
"""How long a command waits for another one that writes the same results [s]."""


@contextmanager
def locked(path: str | os.PathLike, patience: float | None = None) -> Iterator[None]:
    """Nobody else writes `path` meanwhile; PellucidError after `patience` [s]. A process that dies gives it back."""
    from filelock import FileLock, Timeout  # only where something is written

    path, patience = Path(path), PATIENCE if patience is None else patience
    path.parent.mkdir(parents=True, exist_ok=True)
    place = path.with_name(f".{path.name}.lock")
    # A lock is opened for writing: through a link, the file that it leads to would be emptied.
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
