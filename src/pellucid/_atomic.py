"""Write files completely or not at all, so that a killed command leaves no half-written result."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

MIN_LEFTOVER_AGE_S = 60.0
"""An unfinished file of a process that no longer runs is removed after this time [s]. The process may run on another
machine that shares the folder."""


def write_text_atomically(path: str | os.PathLike, text: str) -> Path:
    """Write `text` as UTF-8 to a temporary file in the folder of `path`, then rename it to `path`."""
    return write_bytes_atomically(path, text.encode("utf-8"))


def write_bytes_atomically(path: str | os.PathLike, content: bytes | memoryview, *, private: bool = False) -> Path:
    """Write bytes to a temporary file in the folder of `path`, then rename it; others cannot read a `private` file."""
    with atomically(path, private=private) as file:
        file.write(content)
    return Path(path)


@contextmanager
def atomically(path: str | os.PathLike, *, private: bool = False) -> Iterator[BinaryIO]:
    """Open a file for writing, and rename it into place at the end; other users cannot read a `private` file."""
    import tempfile

    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.{os.getpid()}-", suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes private files, but the whole laboratory should be able to read a result.
        os.chmod(temporary, (0o600 if private else 0o666) & ~_umask())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def remove_leftovers(*folders: Path) -> None:
    """Remove the unfinished files of commands that were killed; those of running commands stay."""
    for folder in folders:
        for path in folder.glob(".*-*.tmp") if folder.is_dir() else ():
            written_by = re.fullmatch(r"\..*\.(\d+)-[^.]+\.tmp", path.name)
            with suppress(OSError):
                old = time.time() - path.stat().st_mtime > MIN_LEFTOVER_AGE_S
                if written_by and old and not _is_running(int(written_by[1])):
                    path.unlink()


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
