"""Files that are either whole or as they were: a killed command leaves no half-written result."""

from __future__ import annotations

import os
import re
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

LEFT_OVER = 60.0
"""After which an unfinished file of nobody who lives is taken away [s]; a folder may be shared with other machines."""


def write_text_atomically(path: str | os.PathLike, text: str) -> Path:
    """Write `text` as UTF-8 beside `path`, then rename it into place."""
    return write_bytes_atomically(path, text.encode("utf-8"))


def write_bytes_atomically(path: str | os.PathLike, content: bytes | memoryview, *, private: bool = False) -> Path:
    """`write_text_atomically` of bytes; `private` ones nobody else may read."""
    with atomically(path, private=private) as file:
        file.write(content)
    return Path(path)


@contextmanager
def atomically(path: str | os.PathLike, *, private: bool = False) -> Iterator[BinaryIO]:
    """A file to be written in parts, renamed into place when all are there; nobody else may read a `private` one."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.{os.getpid()}-", suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        # mkstemp makes private files; a result is meant to be read by the whole lab.
        os.chmod(temporary, (0o600 if private else 0o666) & ~_umask())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def remove_leftovers(*folders: Path) -> None:
    """Take away what commands that were killed had not finished writing; whoever still lives keeps theirs."""
    for folder in folders:
        for path in folder.glob(".*-*.tmp") if folder.is_dir() else ():
            written_by = re.fullmatch(r"\..*\.(\d+)-[^.]+\.tmp", path.name)
            with suppress(OSError):
                old = time.time() - path.stat().st_mtime > LEFT_OVER
                if written_by and old and not _alive(int(written_by[1])):
                    path.unlink()


def _alive(process: int) -> bool:
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
