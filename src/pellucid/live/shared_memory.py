"""Files of shared memory: private to their user, with their memory reserved, and removed once their session is dead.

A session's region and the rings of its streams are files in the system's folder for shared memory, which outlive their
processes. Every Python process of a session therefore holds a shared lock on the region's file. The system releases the
lock however the process dies, so that the next session finds the files of dead ones and removes them.

The region of shared memory as Python sees it: records and events are read, commands and events are written.
"""

from __future__ import annotations

import errno
import json
import mmap
import os
import tempfile
import threading
import time
import weakref
from collections import defaultdict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import PellucidError
from . import layout

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


@dataclass(frozen=True)
class Event:
    """One event of a session."""

    time: float  # host's monotonic clock [s]
    kind: str
    data: Mapping[str, Any]


class Region:
    """The mapped file; one process writes commands and events, and any number read.

    Parameters
    ----------
    path : Path
        The file. It must exist; `create` makes it.

    Raises
    ------
    PellucidError
        If the file is missing, or is no region of a known version.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        try:
            handle = os.open(self.path, os.O_RDWR | os.O_CLOEXEC)
            weakref.finalize(self, os.close, handle)
            hold(handle)
            size = os.fstat(handle).st_size
            if size != layout.REGION_BYTES:
                raise PellucidError(f"{path}: found {size} bytes, expected {layout.REGION_BYTES} of a live session")
            self._memory = mmap.mmap(handle, size)
        except OSError as error:
            raise PellucidError(f"{path}: {error.strerror or error}") from None
        block = self._block
        self._header = block(layout.HEADER_TYPE, 0)
        self._status = block(layout.STATUS_TYPE, layout.STATUS_OFFSET)
        self._command = block(layout.COMMAND_TYPE, layout.COMMAND_OFFSET)
        self._recorder = block(layout.RECORDER_TYPE, layout.RECORDER_OFFSET)
        self._events = block(layout.EVENT_TYPE, layout.EVENT_OFFSET, layout.EVENT_CAPACITY)
        self._records = block(layout.RECORD_TYPE, layout.RECORD_OFFSET, layout.RECORD_CAPACITY)
        self._lock = threading.Lock()
        head = self._header[0]
        if head["magic"] != layout.REGION_MAGIC or int(head["version"]) != layout.REGION_VERSION:
            raise PellucidError(
                f"{path}: found no region of version {layout.REGION_VERSION} of a live session, expected the file of a "
                "running one"
            )

    def _block(self, dtype: np.dtype, offset: int, count: int = 1) -> np.ndarray:
        return np.frombuffer(self._memory, dtype, count, offset)

    @classmethod
    def create(cls, path: Path, period_ns: int) -> Region:
        """Make a region for an engine with a control period [ns], and return it."""
        head = np.zeros(1, layout.HEADER_TYPE)
        head["magic"], head["version"], head["value_count"] = layout.REGION_MAGIC, layout.REGION_VERSION, 6
        head["record_bytes"], head["record_capacity"] = layout.RECORD_TYPE.itemsize, layout.RECORD_CAPACITY
        head["event_bytes"], head["event_capacity"] = layout.EVENT_TYPE.itemsize, layout.EVENT_CAPACITY
        head["epoch"], head["period"] = time.monotonic_ns(), period_ns
        make_memory_file(Path(path), layout.REGION_BYTES, head.tobytes())
        region = cls(path)
        region.command(torque_estimate=np.nan, torque_half_width=np.nan)
        return region

    @property
    def epoch_ns(self) -> int:
        """Deadline of cycle 0 on the monotonic clock [ns]."""
        return int(self._header["epoch"][0])

    @property
    def period_ns(self) -> int:
        """Control period [ns]."""
        return int(self._header["period"][0])

    @property
    def record_count(self) -> int:
        """Number of complete records so far."""
        return int(self._header["records"][0])

    @property
    def event_count(self) -> int:
        """Number of complete events so far."""
        return int(self._header["events"][0])

    def status(self) -> np.void:
        """Return a copy of the engine's status, of `layout.STATUS_TYPE`."""
        return self._status.copy()[0]

    def recorder(self) -> np.void:
        """Return a copy of the recorder's status, of `layout.RECORDER_TYPE`."""
        return self._recorder.copy()[0]

    def tell_recorder(self, **values: int) -> None:
        """Write some of the recorder's status; only the recorder does."""
        for name, value in values.items():
            self._recorder[name] = value

    def command(self, **values: Any) -> int:
        """Change some fields of the command, say that the session is alive, and return the command's number."""
        with self._lock:
            block = self._command.copy()
            for name, value in values.items():
                block[name] = value
            block["sequence"] += 1
            block["heartbeat"] = time.monotonic_ns()
            block["checksum"] = layout.checksum(block.view("<u8")[:-1])
            self._command[:] = block
            return int(block["sequence"][0])

    def last_command(self) -> np.void:
        """Return a copy of the command, of `layout.COMMAND_TYPE`."""
        return self._command.copy()[0]

    def records_since(self, cursor: int, limit: int | None = None) -> tuple[int, np.ndarray, int]:
        """Return the next cursor, the records after a `cursor`, and how many were overwritten before they were read.

        Cursors count records; 0 is before the first. `limit` is the largest number of records.
        """
        head = self.record_count
        # A sixteenth is left alone: the engine may be writing there while this reads.
        oldest = max(head - layout.RECORD_CAPACITY * 15 // 16, 0)
        first = min(max(cursor, oldest), head)
        last = head if limit is None else min(head, first + limit)
        numbers = np.arange(first, last)
        records = self._records[numbers % layout.RECORD_CAPACITY]
        whole = (records["number"] == numbers + 1) & (records["number_again"] == numbers + 1)
        lost = first - min(cursor, first) + int(np.count_nonzero(~whole))
        return last, records[whole], lost

    def write_event(self, kind: str, data: Mapping[str, Any] | None = None, time_s: float | None = None) -> None:
        """Add an event with a kind and data that JSON can hold, now or at a `time_s` of the monotonic clock.

        Raises
        ------
        PellucidError
            If the text is longer than an event.
        """
        text = json.dumps({"kind": kind, **(data or {})}, ensure_ascii=False, allow_nan=False).encode()
        if len(text) > layout.TEXT_BYTES:
            raise PellucidError(
                f'event "{kind}": found {len(text)} bytes of JSON, expected at most {layout.TEXT_BYTES}'
            )
        with self._lock:
            number = self.event_count + 1
            slot = self._events[(number - 1) % layout.EVENT_CAPACITY : (number - 1) % layout.EVENT_CAPACITY + 1]
            slot["number_again"] = 0
            slot["number"], slot["length"] = number, len(text)
            slot["time"] = time.monotonic_ns() if time_s is None else round(1e9 * time_s)
            slot["text"] = text.ljust(layout.TEXT_BYTES, b" ")
            slot["number_again"] = number
            self._header["events"] = number

    def events_since(self, cursor: int) -> tuple[int, list[Event]]:
        """Return the next cursor and the events after a `cursor`; 0 is before the first."""
        head = self.event_count
        first = min(max(cursor, head - layout.EVENT_CAPACITY + 1, 0), head)
        found = []
        for number in range(first + 1, head + 1):
            slot = self._events[(number - 1) % layout.EVENT_CAPACITY].copy()
            if int(slot["number"]) == int(slot["number_again"]) == number:
                data = json.loads(slot["text"].tobytes()[: int(slot["length"])])
                found.append(Event(1e-9 * int(slot["time"]), data.pop("kind"), data))
        return head, found
