"""The region of shared memory as Python sees it: records and events are read, commands and events are written."""

from __future__ import annotations

import json
import mmap
import os
import threading
import time
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import PellucidError
from . import layout
from .shared_memory import hold, make_memory_file


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
            raise PellucidError(f"{path}: found no region of version {layout.REGION_VERSION} of a live session")

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
