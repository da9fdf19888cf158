"""A study's results belong to one command at a time: of two that write at once neither loses what the other found."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .._errors import PellucidError

PATIENCE = 60.0
"""How long a command waits for another one that writes the same results [s]."""


@contextmanager
def locked(path: str | os.PathLike, patience: float | None = None) -> Iterator[None]:
    """Nobody else writes `path` meanwhile; PellucidError after `patience` [s]. A process that dies gives it back."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # The lock's file stays: who removed it would take it from whoever waits for it.
    handle = os.open(path.with_name(f".{path.name}.lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        _wait(handle, path, PATIENCE if patience is None else patience)
        yield
    finally:
        os.close(handle)


def _wait(handle: int, path: Path, patience: float) -> None:
    until = time.monotonic() + patience
    while True:
        try:
            return fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= until:
                raise PellucidError(
                    f"{path}: found it being written by another command for {patience:g} s, expected to have it by "
                    "then; wait for that command, or stop it, and run this one again"
                ) from None
            time.sleep(0.02)
