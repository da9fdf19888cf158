"""Channels whose samples are in a temporary file, so that memory does not grow with the recordings of a study.

Samples are read when they are used, and released with the last array that holds them. They are not mapped into memory,
because each mapping keeps a file descriptor, of which a process has only some hundreds.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import IO, Any, Protocol
from weakref import finalize

import numpy as np

from .optical import OpticalRecording
from .recording import Channel, Recording

MAX_HELD_BYTES = 8_000_000
"""Recordings of a study are held in memory up to this size; the samples of further ones are stored."""

MIN_STORED_BYTES = 32_000
"""Shorter arrays stay in memory, because each of them takes a call to be read."""


class StoredArray:
    """An array in a store."""

    def __init__(self, store: ChannelStore, start: int, shape: tuple[int, ...]):
        self._store, self._start, self.shape = store, start, shape

    def read(self) -> np.ndarray:
        """Return the array, read-only, as the file holds it."""
        return self._store.read(self._start, self.shape)

    def read_rows(self, first: int, stop: int) -> np.ndarray:
        """Return rows of the array from `first` to before `stop`, read-only; the others are not read."""
        row = np.dtype(float).itemsize * int(np.prod(self.shape[1:]))
        return self._store.read(self._start + first * row, (stop - first, *self.shape[1:]))


    def read_each(self, rows: np.ndarray) -> np.ndarray:
        """Return some `rows` of the array, of any shape; of the others at most those next to them are read."""
        return self._store.mapped(self._start, self.shape)[rows]


class StoredArrays(Mapping):
    """Arrays by name, each read from the file when it is asked for."""

    def __init__(self, arrays: Mapping[str, StoredArray]):
        self._arrays = arrays

    def __getitem__(self, name: str) -> np.ndarray:
        return self._arrays[name].read()

    def read_each(self, name: str, rows: np.ndarray) -> np.ndarray:
        """Return some `rows` of an array."""
        return self._arrays[name].read_each(rows)

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __reduce__(self):
        return dict, ({name: np.array(samples) for name, samples in self.items()},)


def rows_of(arrays: Mapping[str, np.ndarray], name: str, rows: np.ndarray) -> np.ndarray:
    """Return some `rows` of one of `arrays`, which may be stored."""
    return arrays.read_each(name, rows) if isinstance(arrays, StoredArrays) else arrays[name][rows]


class SourceSamples(Protocol):
    """Samples that can be read again."""

    shape: tuple[int, ...]

    def read(self) -> np.ndarray:
        """Return all samples, read-only."""

    def read_rows(self, first: int, stop: int) -> np.ndarray:
        """Return samples from `first` to before `stop`, read-only."""


class SourcedChannel(Channel):
    """A channel whose samples a store need not write: they can be read again. A changed copy is a plain channel."""

    def __new__(cls, name: str, samples: np.ndarray, unit: str, column: str | int) -> Channel:  # type: ignore[misc]
        return Channel(name, samples, unit, column)

    @classmethod
    def of(cls, channel: Channel, source: SourceSamples) -> Channel:
        """Return a channel whose samples are also those of a `source`."""
        made = object.__new__(cls)
        made.__dict__.update(channel.__dict__, _array=source)
        return made

    def __reduce__(self):
        return Channel, (self.name, self.samples, self.unit, self.column)


class StoredChannel(Channel):
    """A channel that is made by `ChannelStore`; a changed copy of it is a plain channel."""

    def __new__(cls, name: str, samples: np.ndarray, unit: str, column: str | int) -> Channel:  # type: ignore[misc]
        return Channel(name, samples, unit, column)

    @property
    def samples(self) -> np.ndarray:  # type: ignore[override]
        """Samples, read from the file now."""
        return self.__dict__["_array"].read()

    def __len__(self) -> int:
        return self.__dict__["_array"].shape[0]

    def within(self, span: slice) -> Channel:
        """Return the channel with the samples of a stretch, which alone are read."""
        first, stop, step = span.indices(len(self))
        samples = self.__dict__["_array"].read_rows(first, max(first, stop))
        return Channel(self.name, samples[::step], self.unit, self.column)

    def __reduce__(self):
        # Another process has its own copy, because it does not share the temporary file.
        return Channel, (self.name, np.array(self.samples), self.unit, self.column)


class ChannelStore:
    """Recordings of a study in memory and, beyond `MAX_HELD_BYTES`, with their samples in a temporary file."""

    def __init__(self) -> None:
        self._held = 0
        self._file: IO[bytes] | None = None
        self._end = 0
        # What was stored is remembered by its id, with itself, so that the id is not given to another one.
        self._stored: dict[int, tuple[Any, Any]] = {}

    def keep(self, *versions: Recording) -> tuple[Recording, ...]:
        """Return versions of one recording, which may share channels, with their samples in memory or stored."""
        sizes = {id(x): x.nbytes for version in versions for x in _arrays(version)}
        if self._held + sum(sizes.values()) <= MAX_HELD_BYTES:
            self._held += sum(sizes.values())
            return versions
        try:
            made = {key: self._with_stored(each) for key, each in {id(each): each for each in versions}.items()}
            return tuple(made[id(each)] for each in versions)
        except OSError:  # the folder of temporary files cannot be written, or is full
            return versions
        finally:
            self._stored.clear()

    def store_all(self, arrays: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
        """Return arrays of float64 by name that are stored in the file, or the given ones if it cannot be written."""
        try:
            return StoredArrays({name: self._write(samples) for name, samples in arrays.items()})
        except OSError:
            return arrays

    def read(self, start: int, shape: tuple[int, ...]) -> np.ndarray:
        """Return an array of the file from a byte `start` on, read-only."""
        assert self._file is not None
        array = np.empty(shape)
        left = array.reshape(-1).view(np.uint8).data
        while left:
            # One call reads 2 GiB at most. It leaves the position of the file alone, which other processes share.
            got = os.preadv(self._file.fileno(), (left,), start)
            if got == 0:
                raise OSError(f"temporary file of samples: found its end at byte {start}, expected {len(left)} more")
            left, start = left[got:], start + got
        array.flags.writeable = False
        return array

    def mapped(self, start: int, shape: tuple[int, ...]) -> np.ndarray:
        """Return an array of the file from a byte `start` on, which keeps a file descriptor: release it soon."""
        assert self._file is not None
        return np.memmap(self._file, np.float64, "r", start, shape).view(np.ndarray)

    def _with_stored(self, recording: Recording) -> Recording:
        return replace(
            recording,
            channels={name: self._store(channel) for name, channel in recording.channels.items()},
            streams={name: self._with_stored(stream) for name, stream in recording.streams.items()},
            uncut=None if recording.uncut is None else self._with_stored(recording.uncut),
            optical=None if recording.optical is None else self._with_stored_markers(recording.optical),
        )

    def _with_stored_markers(self, optical: OpticalRecording) -> OpticalRecording:
        if isinstance(optical.markers, StoredArrays) or not _are_long(optical.markers.values()):
            return optical
        if id(optical) not in self._stored:
            stored = object.__new__(OpticalRecording)
            markers = StoredArrays({name: self._write(samples) for name, samples in optical.markers.items()})
            stored.__dict__.update({**optical.__dict__, "markers": markers})
            self._stored[id(optical)] = optical, stored
        return self._stored[id(optical)][1]

    def _store(self, channel: Channel) -> Channel:
        if isinstance(channel, StoredChannel) or not _are_long((channel.samples,)):
            return channel
        if id(channel) not in self._stored:
            stored = object.__new__(StoredChannel)
            array = (
                channel.__dict__["_array"] if isinstance(channel, SourcedChannel) else self._write(channel.samples)
            )
            stored.__dict__.update(name=channel.name, unit=channel.unit, column=channel.column, _array=array)
            self._stored[id(channel)] = channel, stored
        return self._stored[id(channel)][1]

    def _write(self, samples: np.ndarray) -> StoredArray:
        if not hasattr(os, "preadv"):
            raise OSError("temporary file of samples: found no os.preadv, expected reads that leave its position alone")
        if self._file is None:
            from tempfile import TemporaryFile

            self._file = TemporaryFile()  # noqa: SIM115  it is closed with the store
            finalize(self, self._file.close)
        self._file.seek(self._end)
        self._file.write(np.ascontiguousarray(samples, float).data)
        self._file.flush()
        stored = StoredArray(self, self._end, samples.shape)
        self._end += samples.nbytes
        return stored


def _are_long(arrays: Iterable[np.ndarray]) -> bool:
    return all(samples.nbytes >= MIN_STORED_BYTES for samples in arrays)


def _arrays(recording: Recording) -> Iterator[np.ndarray]:
    """Yield all arrays of a recording."""
    for channel in recording.channels.values():
        yield channel.samples
    if recording.optical is not None:
        yield from recording.optical.markers.values()
    for other in (*recording.streams.values(), recording.uncut):
        if other is not None:
            yield from _arrays(other)
