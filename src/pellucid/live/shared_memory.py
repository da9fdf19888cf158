"""Files of shared memory: private to their user, with their memory reserved, and removed once their session is dead.

A session's region and the rings of its streams are files in the system's folder for shared memory, which outlive their
processes. Every Python process of a session therefore holds a shared lock on the region's file. The system releases the
lock however the process dies, so that the next session finds the files of dead ones and removes them.
"""

from __future__ import annotations

import errno
import os
import tempfile
import time
from collections import defaultdict
from contextlib import suppress
from pathlib import Path

from .._errors import PellucidError

SHARED_MEMORY_FOLDER = Path("/dev/shm")
"""Folder for the region where the system has it: its pages are never written to a disk."""

REGION_PREFIX = "pellucid-"
"""Names of regions begin with this."""

REGION_SUFFIX = ".live"
"""Names of regions end with this; the files of their streams' rings begin with the whole name and a dot."""

PRIVATE_MODE = 0o600
"""Mode of the files of a session: they hold what a participant did, which no other user of this computer may read."""

PRIVATE_UMASK = 0o077
"""Mask of the files that a session's processes make: no rights for other users."""

MAX_NEWBORN_AGE_S = 60.0
"""An empty file without a lock may be a region that is just being made, until it is this old [s]."""


def make_region_file(folder: Path) -> tuple[Path, int]:
    """Make an empty file for a region in shared memory, or in a folder where the system has none.

    Returns
    -------
    path : Path
    handle : int
        Open file that holds the lock; the caller closes it.
    """
    place = SHARED_MEMORY_FOLDER if os.access(SHARED_MEMORY_FOLDER, os.W_OK) else folder
    handle, name = tempfile.mkstemp(prefix=REGION_PREFIX, suffix=REGION_SUFFIX, dir=place)
    hold(handle)
    return Path(name), handle


def make_memory_file(path: Path, size: int, content: bytes) -> None:
    """Make a private file of a size [B] that begins with a content, with all of its memory reserved.

    Memory that is missing is found here, and not by a process that is killed when it writes there.

    Raises
    ------
    PellucidError
        If there is not enough memory.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, PRIVATE_MODE)
    try:
        os.fchmod(handle, PRIVATE_MODE)
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(handle, 0, size)
        else:
            os.ftruncate(handle, size)
        os.pwrite(handle, content, 0)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise PellucidError(
            f"{path}: found no room for {size / 1e6:.0f} MB of shared memory ({error.strerror}), expected it in "
            f"{path.parent}; remove other files there, or make it larger"
        ) from None
    finally:
        os.close(handle)


def hold(handle: int) -> None:
    """Hold a shared lock on an open file until it is closed; a file system without locks has none."""
    with suppress(ImportError, OSError):
        import fcntl  # imported here, since Windows has none and no engine

        fcntl.flock(handle, fcntl.LOCK_SH)


def remove_region(path: Path) -> None:
    """Remove the files of a session's shared memory: the region, and the rings of its streams."""
    for each in [path, *path.parent.glob(f"{path.name}.*")]:
        each.unlink(missing_ok=True)


def remove_dead_regions(*folders: Path) -> list[Path]:
    """Remove this user's regions in folders whose processes are all dead, with their rings; return them."""
    found: dict[Path, list[Path]] = defaultdict(list)
    for path in (path for folder in folders for path in folder.glob(f"{REGION_PREFIX}*{REGION_SUFFIX}*")):
        found[path.with_name(path.name.split(REGION_SUFFIX)[0] + REGION_SUFFIX)].append(path)
    dead = [region for region in found if _is_dead(region)]
    for region in dead:
        for path in found[region]:
            with suppress(OSError):  # another user owns it, or another start has removed it
                path.unlink()
    return dead


def _is_dead(region: Path) -> bool:
    """Return whether no process holds a region's lock; one without a file has none that could."""
    import fcntl

    try:
        handle = os.open(region, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        return error.errno == errno.ENOENT
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        seen = os.fstat(handle)
        return seen.st_size > 0 or time.time() - seen.st_mtime > MAX_NEWBORN_AGE_S
    except OSError:
        return False
    finally:
        os.close(handle)
