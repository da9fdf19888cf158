"""Write XDF files append-only, so that a file stays readable whenever its writer is killed.

Each chunk goes to the file in one write. A file that was not ended has no footers, and perhaps half a chunk at its end:
`seal_xdf` removes the half and adds the footers, and `chunks` walks over whatever is whole.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import numpy as np

from .._atomic import atomically
from .._errors import PellucidError

COPIED_BLOCK_BYTES = 1 << 20
"""A file is copied in blocks of this size."""

FIRST_BYTES = b"XDF:"
"""Every XDF file begins with these bytes."""

FILE_HEADER_TAG = 1
"""Tag of the chunk with the file's header."""

STREAM_HEADER_TAG = 2
"""Tag of the chunk with a stream's header."""

SAMPLES_TAG = 3
"""Tag of a chunk of samples."""

CLOCK_OFFSET_TAG = 4
"""Tag of the chunk with a measured offset of a stream's clock."""

FOOTER_TAG = 6
"""Tag of the chunk with a stream's footer."""

FILE_MODE = 0o600
"""Mode of a new file: a recording of a person, which no other user of this computer may read."""

FORMATS = {"double64": "<f8", "float32": "<f4", "int64": "<i8", "int32": "<i4", "string": None}
"""Formats of a stream's values, and their type in NumPy."""


@dataclass
class XdfStream:
    """What is known of one stream of a file that is written."""

    identity: int
    format: str
    channels: int
    count: int = 0
    first: float = float("nan")  # first time stamp [s]
    last: float = float("nan")  # last time stamp [s]

    def footer(self) -> str:
        """Return the text of the stream's footer."""
        return (
            "<?xml version='1.0'?><info>"
            f"<first_timestamp>{self.first!r}</first_timestamp><last_timestamp>{self.last!r}</last_timestamp>"
            f"<sample_count>{self.count}</sample_count></info>"
        )

    def footer_content(self) -> bytes:
        """Return the content of the stream's footer."""
        return struct.pack("<I", self.identity) + self.footer().encode()

    def note(self, count: int, first: float, last: float) -> None:
        """Count samples that were written."""
        self.first = first if self.count == 0 else self.first
        self.count, self.last = self.count + count, last


class XdfWriter:
    """A file that is only ever appended to.

    Parameters
    ----------
    path : Path
        A new file; one that exists is an error. `resume` goes on with one.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._file = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, FILE_MODE)
        self.streams: dict[int, XdfStream] = {}
        self._append(FIRST_BYTES)
        self._write(FILE_HEADER_TAG, b"<?xml version='1.0'?><info><version>1.0</version></info>")

    @classmethod
    def resume(cls, path: Path, end: int, streams: Mapping[int, XdfStream]) -> XdfWriter:
        """Continue a file whose first `end` bytes hold these streams; later bytes are removed."""
        writer = cls.__new__(cls)
        writer.path, writer.streams = Path(path), dict(streams)
        os.truncate(path, end)
        writer._file = os.open(path, os.O_WRONLY | os.O_APPEND)
        return writer

    def _write(self, tag: int, content: bytes) -> None:
        self._append(_chunk_bytes(tag, content))

    def _append(self, data: bytes) -> None:
        """Append bytes; a disk that takes a part says why at the rest, which is then missing from the file."""
        try:
            written = os.write(self._file, data)
            while written < len(data):
                written += os.write(self._file, data[written:])
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def add_stream(
        self,
        identity: int,
        name: str,
        type: str,
        channels: Sequence[tuple[str, str]],
        *,
        rate: float = 0.0,
        format: str = "double64",
        source: str = "",
        description: Mapping[str, str] | None = None,
    ) -> None:
        """Add a stream with channels of (label, unit); `description` adds elements of text after the channels."""
        made = "".join(
            f"<channel><label>{escape(label)}</label><unit>{escape(unit)}</unit></channel>" for label, unit in channels
        )
        more = "".join(f"<{key}>{escape(text)}</{key}>" for key, text in (description or {}).items())
        text = (
            f"<?xml version='1.0'?><info><name>{escape(name)}</name><type>{escape(type)}</type>"
            f"<channel_count>{len(channels)}</channel_count><nominal_srate>{rate!r}</nominal_srate>"
            f"<channel_format>{format}</channel_format><source_id>{escape(source)}</source_id>"
            f"<desc><channels>{made}</channels>{more}</desc></info>"
        )
        self.streams[identity] = XdfStream(identity, format, len(channels))
        self._write(STREAM_HEADER_TAG, struct.pack("<I", identity) + text.encode())

    def write_samples(self, identity: int, time: np.ndarray, values: np.ndarray) -> None:
        """Append numeric samples: times shape (n,) [s], values shape (n, channels)."""
        stream, n = self.streams[identity], len(time)
        if n == 0:
            return
        block = np.empty(n, [("size", "u1"), ("time", "<f8"), ("value", FORMATS[stream.format], (stream.channels,))])
        block["size"], block["time"], block["value"] = 8, time, values
        self._write(SAMPLES_TAG, struct.pack("<IBI", identity, 4, n) + block.tobytes())
        stream.note(n, float(time[0]), float(time[-1]))

    def write_texts(self, identity: int, time: Sequence[float], texts: Sequence[str]) -> None:
        """Append texts to a stream of one channel of strings, at times [s]."""
        if not texts:
            return
        content = struct.pack("<IBI", identity, 4, len(texts))
        for moment, text in zip(time, texts, strict=True):
            data = text.encode()
            content += struct.pack("<BdBI", 8, moment, 4, len(data)) + data
        self._write(SAMPLES_TAG, content)
        self.streams[identity].note(len(texts), float(time[0]), float(time[-1]))

    def write_clock_offset(self, identity: int, time: float, offset: float) -> None:
        """Append a measurement of a stream's clock: `offset` is to be added to its time stamps [s]."""
        self._write(CLOCK_OFFSET_TAG, struct.pack("<Idd", identity, time, offset))

    def seal(self) -> None:
        """Append every stream's footer, flush the file to the disk, and close it."""
        for stream in self.streams.values():
            self._write(FOOTER_TAG, stream.footer_content())
        os.fsync(self._file)
        self.close()

    def close(self) -> None:
        """Close the file as it is."""
        if self._file >= 0:
            os.close(self._file)
        self._file = -1


def _chunk_bytes(tag: int, content: bytes) -> bytes:
    return b"\x08" + struct.pack("<QH", len(content) + 2, tag) + content


@dataclass(frozen=True)
class Chunk:
    """One whole chunk of a file."""

    tag: int
    content: bytes
    end: int  # position after it [B]


def chunks(data: bytes) -> Iterator[Chunk]:
    """Yield the complete chunks of an XDF file's bytes, without an incomplete one at the end.

    Raises
    ------
    PellucidError
        If the bytes are no XDF file.
    """
    if data[:4] != FIRST_BYTES:
        raise PellucidError(
            f"found the first bytes {data[:4]!r}, expected an XDF file, which begins with {FIRST_BYTES!r}"
        )
    at = 4
    while at < len(data):
        width = data[at]
        if width not in (1, 4, 8) or at + 1 + width > len(data):
            return
        length = int.from_bytes(data[at + 1 : at + 1 + width], "little")
        begin, end = at + 1 + width, at + 1 + width + length
        if length < 2 or end > len(data):
            return
        yield Chunk(int.from_bytes(data[begin : begin + 2], "little"), data[begin + 2 : end], end)
        at = end


def sample_block(content: bytes, stream: XdfStream) -> np.ndarray | None:
    """Return the samples of a chunk that `XdfWriter.write_samples` wrote, by time and value; None for texts."""
    if stream.format == "string":
        return None
    n = struct.unpack_from("<I", content, 5)[0]
    kind = [("size", "u1"), ("time", "<f8"), ("value", FORMATS[stream.format], (stream.channels,))]
    return np.frombuffer(content, kind, n, 9)


def text_samples(content: bytes) -> list[tuple[float, str]]:
    """Return times [s] and texts of a chunk that `XdfWriter.write_texts` wrote."""
    found, at = [], 9
    for _ in range(struct.unpack_from("<I", content, 5)[0]):
        _, moment, _, size = struct.unpack_from("<BdBI", content, at)
        at += struct.calcsize("<BdBI")
        found.append((moment, content[at : at + size].decode()))
        at += size
    return found


@dataclass
class WrittenXdf:
    """What a file of `XdfWriter` holds, footers or not."""

    streams: dict[int, XdfStream]
    headers: dict[int, ElementTree.Element]
    footers: set[int]
    end: int  # position after the last whole chunk [B]

    def name(self, identity: int) -> str:
        """Return the name of a stream."""
        return self.headers[identity].findtext("name") or ""


def scan_xdf(path: Path, *, until: int | None = None) -> WrittenXdf:
    """Return what a file that `XdfWriter` wrote holds, up to a position [B] or its last whole chunk."""
    data = Path(path).read_bytes()[:until]
    found = WrittenXdf({}, {}, set(), len(FIRST_BYTES))
    for chunk in chunks(data):
        found.end = chunk.end
        if chunk.tag in (STREAM_HEADER_TAG, SAMPLES_TAG, FOOTER_TAG):
            identity = struct.unpack_from("<I", chunk.content)[0]
        if chunk.tag == STREAM_HEADER_TAG:
            head = ElementTree.fromstring(chunk.content[4:].decode())
            found.headers[identity] = head
            channels = int(head.findtext("channel_count") or 0)
            found.streams[identity] = XdfStream(identity, head.findtext("channel_format") or "double64", channels)
        elif chunk.tag == FOOTER_TAG:
            found.footers.add(identity)
        elif chunk.tag == SAMPLES_TAG and identity in found.streams:
            stream = found.streams[identity]
            block = sample_block(chunk.content, stream)
            times = [t for t, _ in text_samples(chunk.content)] if block is None else block["time"]
            stream.note(len(times), float(times[0]), float(times[-1]))
    return found


def seal_xdf(path: str | Path) -> int:
    """Make a file of a killed recorder whole: remove half a chunk at its end, and add the footers that are missing.

    The file is replaced at once by the whole one; if that cannot be written, it stays as it is.

    Parameters
    ----------
    path : path
        File that `XdfWriter` wrote.

    Returns
    -------
    int
        Number of bytes that were removed; 0 for a file that ended with a whole chunk.

    Raises
    ------
    PellucidError
        If it is no XDF file.
    """
    path = Path(path)
    size = path.stat().st_size
    try:
        found = scan_xdf(path)
    except PellucidError as error:
        raise PellucidError(f"{path}: {error}") from None
    missing = [stream for identity, stream in found.streams.items() if identity not in found.footers]
    if not missing and found.end == size:
        return 0
    with path.open("rb") as source, atomically(path) as file:
        left = found.end
        while left > 0:
            block = source.read(min(left, COPIED_BLOCK_BYTES))
            file.write(block)
            left -= len(block)
        for stream in missing:
            file.write(_chunk_bytes(FOOTER_TAG, stream.footer_content()))
    return size - found.end
