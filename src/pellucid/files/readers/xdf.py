"""Read XDF files of the lab streaming layer: every stream of a recording, on one clock.

A channel C of a stream S becomes the column S.C, at the times of the column S.time. Channels without names are
numbered from 1. As in the layer's own reader, measured offsets bring the clocks of other computers onto the recorder's,
and the times of evenly sampled streams are smoothed. Time 0 is the first sample of the file. A file whose recorder was
killed is read to its last complete chunk.
"""

from __future__ import annotations

import io
import logging
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ..stated_units import unit_from_text
from ._columns import Columns
from ._xml import parse_small_xml

ENDINGS = (".xdf",)
APART = ("pyxdf",)

FIRST_BYTES = b"XDF:"
"""Every XDF file begins with these bytes."""

STREAM_HEADER_TAG = 2
"""Tag of the chunk that begins a stream."""

FOOTER_TAG = 6
"""Tag of the chunk that ends a stream."""

MAX_CHUNK_HEAD_BYTES = 15
"""Bytes before a chunk's content: the width of its length, its length, its tag and the identity of its stream."""

MAX_STREAM_HEADER_BYTES = 4_000_000
"""A stream's description has at most this many bytes; that of 5,000 channels with all their fields has 2 MB."""

MIN_MEAN_CHUNK_BYTES = 12
"""Chunks of a file have at least this mean size; the smallest one with content, a boundary, has 20 bytes."""


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) with the n of its stream."""
    into: dict[str, np.ndarray | str] = {}
    whole = _walk(path)
    streams = [stream for stream in _load_streams(path, whole) if len(stream["time_stamps"])]
    if not streams:
        cut = f" before byte {whole.end} of {whole.size}, where the file is truncated" if whole.end < whole.size else ""
        raise RecordingError(f"{path.name}: found no stream with samples{cut}")
    for stream in streams:
        _require_all_samples(path, stream)
    start = min(float(stream["time_stamps"][0]) for stream in streams)
    for stream in streams:
        name, labels = _name(stream), _labels(stream)
        if f"{name}.time" in into:
            raise RecordingError(f'{path.name}: found two streams named "{name}", expected each once')
        into[f"{name}.time"] = np.asarray(stream["time_stamps"], np.float64) - start
        series = stream["time_series"]
        for i, label in enumerate(labels):
            if isinstance(series, np.ndarray):
                into[f"{name}.{label}"] = np.ascontiguousarray(series[:, i], dtype=np.float64)
            else:
                into[f"{name}.{label}"] = f'the stream "{name}" holds text, expected numbers'
    return Columns(path, into, units=_units(streams))


def _units(streams: list[Any]) -> dict[str | int, str]:
    """Return the unit of every column for which the file states one."""
    found: dict[str | int, str] = {}
    for stream in streams:
        for label, channel in zip(_labels(stream), _channels(stream), strict=False):
            said = _text(channel, "unit")
            if said:
                found[f"{_name(stream)}.{label}"] = unit_from_text(said) or said
    return found


@dataclass
class WholeChunks:
    """The whole chunks at the beginning of a file."""

    size: int  # size of the file [B]
    end: int = len(FIRST_BYTES)  # position after the last whole chunk [B]
    streams: dict[int, str] = field(default_factory=dict)  # names by identity
    ended: set[int] = field(default_factory=set)  # identities of streams with a footer


def lost_end(path: Path) -> str:
    """Return what a file lacks whose recorder was killed, or whose disk was full; "" for a whole file."""
    whole = _walk(path)
    lost = [f"{whole.size - whole.end} bytes of an incomplete chunk"] if whole.end < whole.size else []
    endless = [f'"{name}"' for identity, name in whole.streams.items() if identity not in whole.ended]
    if endless:
        named = ", ".join(endless[:5]) + (f" and {len(endless) - 5} more" if len(endless) > 5 else "")
        lost.append(f"no end of the stream{'s' if len(endless) > 1 else ''} {named}")
    return " and ".join(lost)


def _walk(path: Path) -> WholeChunks:
    """Find the whole chunks of a file by their heads."""
    whole, count = WholeChunks(path.stat().st_size), 0
    with path.open("rb") as file:
        if file.read(len(FIRST_BYTES)) != FIRST_BYTES:
            raise RecordingError(f"{path.name}: not readable as an XDF file: found no header of such a file")
        while True:
            file.seek(whole.end)
            head = file.read(MAX_CHUNK_HEAD_BYTES)
            width = head[0] if head else 0
            length = int.from_bytes(head[1 : 1 + width], "little")
            begin = whole.end + 1 + width
            if width not in (1, 4, 8) or length < 2 or begin + length > whole.size:
                return whole
            tag, identity = (
                int.from_bytes(head[1 + width + at : 1 + width + to], "little") for at, to in ((0, 2), (2, 6))
            )
            if tag == STREAM_HEADER_TAG:
                if length > MAX_STREAM_HEADER_BYTES:
                    raise RecordingError(
                        f"{path.name}: found a stream's description of {length} bytes, expected at most "
                        f"{MAX_STREAM_HEADER_BYTES}"
                    )
                file.seek(begin + 6)
                root = parse_small_xml(path, file.read(length - 6))
                whole.streams[identity] = (root.findtext("name") or "").strip() or str(identity)
            elif tag == FOOTER_TAG:
                whole.ended.add(identity)
            whole.end, count = begin + length, count + 1
            if whole.end < MIN_MEAN_CHUNK_BYTES * count - 1000:
                raise RecordingError(
                    f"{path.name}: found {count} chunks in {whole.end} bytes, expected larger ones: the file is damaged"
                )


def _load_streams(path: Path, whole: WholeChunks) -> list[Any]:
    import pyxdf

    # The library continues behind an incomplete chunk, with whatever it finds there.
    source: Any = str(path)
    if whole.end < whole.size:
        with path.open("rb") as file:
            source = io.BytesIO(file.read(whole.end))
    # The library reports a damaged file in its log, and continues with the part that it can read.
    logger, damage = logging.getLogger("pyxdf.pyxdf"), _FirstError()
    before, logger.propagate = logger.propagate, False
    logger.addHandler(damage)
    try:
        streams, _ = pyxdf.load_xdf(source)
    except MemoryError:
        raise
    except Exception as error:  # parsing unexpected bytes may raise anything
        raise RecordingError(f"{path.name}: not readable as an XDF file, truncated or damaged: {error}") from error
    finally:
        logger.removeHandler(damage)
        logger.propagate = before
    if damage.said:
        raise RecordingError(f"{path.name}: not readable as an XDF file, damaged: {damage.said}")
    return streams


class _FirstError(logging.Handler):
    """Keep the first error that a library reports."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.said = ""

    def emit(self, record: logging.LogRecord) -> None:
        """Keep an error's text."""
        self.said = self.said or record.getMessage()[:200]


def _require_all_samples(path: Path, stream: Any) -> None:
    """Raise a RecordingError if a stream's footer counts more samples than were found: a chunk is damaged."""
    footer = stream.get("footer")
    said = (
        _text(footer["info"], "sample_count") if isinstance(footer, dict) and isinstance(footer["info"], dict) else ""
    )
    found = len(stream["time_stamps"])
    if said.isdigit() and int(said) > found:
        raise RecordingError(
            f'{path.name}: the stream "{_name(stream)}" has {found} samples, and its footer counts {said}: the file is '
            "damaged"
        )


def _name(stream: Any) -> str:
    return _text(stream["info"], "name") or str(stream["info"]["stream_id"])


def _labels(stream: Any) -> list[str]:
    count = int(_text(stream["info"], "channel_count"))
    named = [_text(channel, "label") for channel in _channels(stream)][:count]
    named += [""] * (count - len(named))
    return [label or str(i) for i, label in enumerate(named, 1)]


def _channels(stream: Any) -> list[Any]:
    description = (stream["info"].get("desc") or [None])[0] or {}
    table = (description.get("channels") or [None])[0] or {}
    return [channel or {} for channel in table.get("channel", [])]


def _text(node: Any, key: str) -> str:
    found = (node.get(key) or [""])[0]
    return found.strip() if isinstance(found, str) else ""
