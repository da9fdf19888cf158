"""Read XDF files of the lab streaming layer: every stream of a recording, on one clock.

A channel C of a stream S becomes the column S.C, at the times of the column S.time. Channels without names are
numbered from 1. As in the layer's own reader, measured offsets bring the clocks of other computers onto the recorder's.
The times of evenly sampled streams are smoothed between gaps. A stream that was lost and found again is one, with the
gap. Streams of one name that differ in type, source or computer are called so: ``Trigno_EMG`` and ``Trigno_ACC``. Time
0 is the first sample of the file. A file whose recorder was killed is read to its last complete chunk.
"""

from __future__ import annotations

import io
import logging
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError, listed_names
from ..file_facts import NOMINAL_RATE_FACT
from ..stated_units import unit_from_text
from ._columns import Columns
from ._even_stamps import smoothed_stamps
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

TELLING_KEYS = ("type", "source_id", "hostname")
"""What tells streams of one name apart."""

MAX_OVERLAP_S = 1.0
"""A stream that was lost and found again may begin so long before its first part ends [s], and a tenth of that part."""

MIN_MEAN_CHUNK_BYTES = 12
"""Chunks of a file have at least this mean size; the smallest one with content, a boundary, has 20 bytes."""


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) with the n of its stream."""
    into: dict[str, np.ndarray | str] = {}
    whole = _walk(path)
    streams = [stream for stream in _load_streams(path, whole) if len(stream["time_stamps"])]
    if not streams:
        cut = f" before byte {whole.end} of {whole.size}, where the file is truncated" if whole.end < whole.size else ""
        raise RecordingError(f"{path.name}: found no stream with samples{cut}, expected one or more")
    for stream in streams:
        _require_all_samples(path, stream)
    joined = [_joined(path, name, parts) for name, parts in _by_name(streams).items()]
    start = min(float(stream.stamps.min()) for stream in joined)
    units: dict[str | int, str] = {}
    facts: dict[str, str] = {}
    for stream in joined:
        into[f"{stream.name}.time"] = stream.stamps - start
        if stream.rate > 0.0:
            facts[f"{stream.name}.{NOMINAL_RATE_FACT}"] = f"{stream.rate:.12g}"
        for i, (label, unit) in enumerate(zip(stream.labels, stream.units, strict=True)):
            name = f"{stream.name}.{label}"
            if stream.series is None:
                into[name] = f'the stream "{stream.name}" holds text, expected numbers'
            else:
                into[name] = np.ascontiguousarray(stream.series[:, i], dtype=np.float64)
            if unit:
                units[name] = unit
    return Columns(path, into, units=units, facts=facts)


@dataclass(frozen=True, eq=False)
class _Stream:
    """A stream, joined where it was lost and found again."""

    name: str
    stamps: np.ndarray  # shape (n,), on the recorder's clock [s]
    series: np.ndarray | None  # shape (n, channels); None for text
    labels: list[str]
    units: list[str]
    rate: float  # nominal rate [Hz], 0 for samples at any time


def _by_name(streams: list[Any]) -> dict[str, list[Any]]:
    """Return the streams by name; those of one name by what else tells them apart."""
    by_name: dict[str, list[Any]] = {}
    for stream in streams:
        by_name.setdefault(_name(stream), []).append(stream)
    found: dict[str, list[Any]] = {}
    for name, group in by_name.items():
        if all(_form(stream) == _form(group[0]) for stream in group) and not _overlap(group):
            found[name] = group
            continue
        key = next((key for key in TELLING_KEYS if len({_text(s["info"], key) for s in group}) > 1), None)
        for stream in group:
            told = f"{name}_{_text(stream['info'], key)}" if key else name
            found.setdefault(told.rstrip("_"), []).append(stream)
    return found


def _form(stream: Any) -> tuple[object, ...]:
    """Return what the parts of one stream share."""
    info = stream["info"]
    keys = ("type", "channel_count", "channel_format", "nominal_srate", "source_id")
    return (*(_text(info, key) for key in keys), *_labels(stream))


def _overlap(streams: list[Any]) -> bool:
    """Whether two streams have samples at the same times."""
    spans = sorted((float(s["time_stamps"][0]), float(s["time_stamps"][-1])) for s in streams)
    return any(b < end - min(MAX_OVERLAP_S, 0.1 * (end - a)) for (a, end), (b, _) in pairwise(spans))


def _joined(path: Path, name: str, parts: list[Any]) -> _Stream:
    """Return the parts of a stream as one, in the order of their times."""
    if not all(_form(part) == _form(parts[0]) for part in parts) or _overlap(parts):
        raise RecordingError(f'{path.name}: found two streams named "{name}" at the same time, expected each once')
    parts = sorted(parts, key=lambda part: float(part["time_stamps"][0]))
    stamps = np.concatenate([np.asarray(part["time_stamps"], np.float64) for part in parts])
    is_text = not all(isinstance(part["time_series"], np.ndarray) for part in parts)
    series = None if is_text else np.concatenate([part["time_series"] for part in parts])
    rate = _nominal_rate(parts[0])
    if rate > 0.0 and not _has_own_times(parts[0]):
        joints = np.cumsum([len(part["time_stamps"]) for part in parts])[:-1].tolist()
        stamps, _ = smoothed_stamps(stamps, rate, joints)
    labels = _labels(parts[0])
    said = [_text(channel, "unit") for channel in _channels(parts[0])][: len(labels)]
    units = [unit_from_text(text) or text for text in said + [""] * (len(labels) - len(said))]
    return _Stream(name, stamps, series, labels, units, rate)


def _nominal_rate(stream: Any) -> float:
    """Return the rate that a stream states [Hz]; 0 for samples at any time."""
    try:
        rate = float(_text(stream["info"], "nominal_srate"))
    except ValueError:
        return 0.0
    return rate if 0.0 < rate < float("inf") else 0.0


def _has_own_times(stream: Any) -> bool:
    """Whether a stream, such as a camera's, says that it may drop samples: its stamps are then those of its samples."""
    description = (stream["info"].get("desc") or [None])[0] or {}
    about = (description.get("synchronization") or [None])[0] or {}
    return isinstance(about, dict) and _text(about, "can_drop_samples").lower() == "true"


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
        lost.append(f"no end of the stream{'s' if len(endless) > 1 else ''} {listed_names(endless, 5)}")
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
        # The library's own smoothing draws one line through lost samples of up to a second.
        streams, _ = pyxdf.load_xdf(source, dejitter_timestamps=False)
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
