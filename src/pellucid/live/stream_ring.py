"""A stream that was taken in, in shared memory: one process writes, and recorder and session read."""

from __future__ import annotations

import json
import mmap
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._errors import PellucidError
from .clock_tracker import ClockState
from .shared_memory import make_memory_file

RING_MAGIC = b"PELLRING"
"""First eight bytes of the file."""

RING_VERSION = 1
"""Version of the layout."""

HEAD_BYTES = 8192
"""Size of the head, with the text that describes the stream [B]."""

TEXT_OFFSET = 512
"""Place of that text [B]."""

RING_SECONDS = 64.0
"""How much of a stream its ring keeps."""

MIN_CAPACITY = 1024
"""Smallest number of samples that a ring keeps."""

PROCESS_NICENESS = -15
"""Niceness that the processes ask for which take streams in and record: before pages, after the engine."""

HEAD_TYPE = np.dtype(
    [
        ("magic", "S8"),
        ("version", "<u4"),
        ("channels", "<u4"),
        ("capacity", "<u8"),
        ("count", "<u8"),
        ("offset", "<f8"),
        ("drift", "<f8"),
        ("jumps", "<u8"),
        ("batches", "<u8"),
        ("lost", "<u8"),
        ("rate", "<f8"),
        ("heard", "<i8"),
        ("text_bytes", "<u8"),
    ]
)
"""Head of a ring."""


def ask_for_niceness() -> None:
    """Ask that this process runs before ordinary ones; where the system does not permit it, nothing changes."""
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, PROCESS_NICENESS)


def _sample_type(channels: int) -> np.dtype:
    return np.dtype(
        [
            ("number", "<u8"),
            ("time", "<f8"),
            ("device_time", "<f8"),
            ("value", "<f8", (channels,)),
            ("number_again", "<u8"),
        ]
    )


@dataclass(frozen=True)
class StreamSamples:
    """Samples of a stream since a cursor."""

    cursor: int  # cursor from which to go on
    lost: int  # samples that were overwritten before they were read
    time: np.ndarray  # shape (n,), on the host's monotonic clock [s]
    device_time: np.ndarray  # shape (n,), as the stream stamped them [s]
    values: np.ndarray  # shape (n, channels)


class StreamRing:
    """The mapped file of one stream."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        with self.path.open("r+b") as file:
            # All of it at once where the system can: what is written later then needs no memory that may be missing.
            flags = mmap.MAP_SHARED | getattr(mmap, "MAP_POPULATE", 0)
            self._memory = mmap.mmap(file.fileno(), 0, flags=flags)
        self._head = np.frombuffer(self._memory, HEAD_TYPE, 1)
        if self._head["magic"][0] != RING_MAGIC or int(self._head["version"][0]) != RING_VERSION:
            raise PellucidError(f"{path}: found no ring of a stream, expected the file of a running session")
        size = int(self._head["text_bytes"][0])
        said = json.loads(self._memory[TEXT_OFFSET : TEXT_OFFSET + size])
        self.name: str = said["name"]
        self.type: str = said["type"]
        self.source: str = said["source"]
        self.nominal_rate: float = said["rate"]
        self.labels: list[str] = said["labels"]
        self.units: list[str] = said["units"]
        self.capacity = int(self._head["capacity"][0])
        self._samples = np.frombuffer(self._memory, _sample_type(len(self.labels)), self.capacity, HEAD_BYTES)

    @classmethod
    def create(
        cls, region: Path, index: int, *, name: str, type: str, source: str, rate: float,
        labels: Sequence[str], units: Sequence[str],
    ) -> StreamRing:  # fmt: skip
        """Create and return the ring of the stream with this index, in the folder of a region."""
        path = region.with_name(f"{region.name}.{index}.stream")
        said = {
            "name": name,
            "type": type,
            "source": source,
            "rate": rate,
            "labels": list(labels),
            "units": list(units),
        }
        text = json.dumps(said).encode()
        if len(text) > HEAD_BYTES - TEXT_OFFSET:
            raise PellucidError(
                f'stream "{name}": found {len(text)} bytes of description, expected at most {HEAD_BYTES}'
            )
        capacity = max(MIN_CAPACITY, round(RING_SECONDS * rate))
        head = np.zeros(1, HEAD_TYPE)
        head["magic"], head["version"], head["channels"] = RING_MAGIC, RING_VERSION, len(labels)
        head["capacity"], head["text_bytes"], head["rate"] = capacity, len(text), np.nan
        making = path.with_suffix(".making")
        size = HEAD_BYTES + capacity * _sample_type(len(labels)).itemsize
        make_memory_file(making, size, head.tobytes().ljust(TEXT_OFFSET, b"\0") + text)
        making.rename(path)
        return cls(path)

    @staticmethod
    def all_of(region: Path) -> list[StreamRing]:
        """Return the rings in the folder of a region, in the order in which their streams were found."""
        return [StreamRing(path) for path in sorted(region.parent.glob(f"{region.name}.*.stream"))]

    @property
    def count(self) -> int:
        """Number of samples so far."""
        return int(self._head["count"][0])

    @property
    def heard_ns(self) -> int:
        """When something arrived last, on the monotonic clock [ns]."""
        return int(self._head["heard"][0])

    @property
    def clock(self) -> ClockState:
        """What is known of the stream's clock."""
        h = self._head[0]
        return ClockState(
            float(h["offset"]), float(h["drift"]), int(h["jumps"]), int(h["batches"]), int(h["lost"]), float(h["rate"])
        )

    def append(self, time: np.ndarray, device_time: np.ndarray, values: np.ndarray) -> None:
        """Add samples: times shape (n,) [s], values shape (n, channels). Only the intake does."""
        first = self.count
        numbers = np.arange(first, first + len(time))
        block = np.zeros(len(time), self._samples.dtype)
        block["number"] = block["number_again"] = numbers + 1
        block["time"], block["device_time"], block["value"] = time, device_time, values
        self._samples[numbers % self.capacity] = block
        self._head["count"] = first + len(time)

    def tell(self, clock: ClockState, heard_ns: int) -> None:
        """Say what is known of the clock, and when something arrived last."""
        for name in ("offset", "drift", "jumps", "batches", "lost", "rate"):
            self._head[name] = getattr(clock, name)
        self._head["heard"] = heard_ns

    def read_since(self, cursor: int, limit: int | None = None) -> StreamSamples:
        """Return the samples after a `cursor`; 0 is before the first."""
        head = self.count
        first = min(max(cursor, head - self.capacity * 15 // 16, 0), head)
        last = head if limit is None else min(head, first + limit)
        numbers = np.arange(first, last)
        found = self._samples[numbers % self.capacity]
        whole = (found["number"] == numbers + 1) & (found["number_again"] == numbers + 1)
        lost = first - min(cursor, first) + int(np.count_nonzero(~whole))
        found = found[whole]
        return StreamSamples(last, lost, found["time"], found["device_time"], found["value"])
