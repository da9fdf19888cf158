"""Read XDF files of the lab streaming layer: every stream of a recording, on one clock.

A channel C of a stream S becomes the column S.C, at the times of the column S.time. Channels without names are
numbered from 1. As in the layer's own reader, measured offsets bring the clocks of other computers onto the recorder's,
and the times of evenly sampled streams are smoothed. Time 0 is the first sample of the file.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ._columns import Columns

ENDINGS = (".xdf",)
APART = ("pyxdf",)

FIRST_BYTES = b"XDF:"
"""Every XDF file begins with these bytes."""

UNIT_SYMBOLS = {
    "microvolts": "uV", "millivolts": "mV", "volts": "V", "degrees": "deg", "radians": "rad", "seconds": "s",
    "meters": "m", "millimeters": "mm", "newtons": "N", "newtonmeters": "N*m", "amperes": "A", "celsius": "degC",
}  # fmt: skip
"""Symbol in study.toml of each unit that streams spell out."""


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) with the n of its stream."""
    into: dict[str, np.ndarray | str] = {}
    streams = [stream for stream in _load_streams(path) if len(stream["time_stamps"])]
    if not streams:
        raise RecordingError(f"{path.name}: found no stream with samples")
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
                found[f"{_name(stream)}.{label}"] = UNIT_SYMBOLS.get(said.lower(), said)
    return found


def _load_streams(path: Path) -> list[Any]:
    import pyxdf

    with path.open("rb") as file:
        if file.read(len(FIRST_BYTES)) != FIRST_BYTES:
            raise RecordingError(f"{path.name}: not readable as an XDF file: found no header of such a file")
    # The library reports a damaged file in its log, and continues with the part that it can read.
    logger = logging.getLogger("pyxdf.pyxdf")
    before, logger.disabled = logger.disabled, True
    try:
        streams, _ = pyxdf.load_xdf(str(path))
    except MemoryError:
        raise
    except Exception as error:  # parsing unexpected bytes may raise anything
        raise RecordingError(f"{path.name}: not readable as an XDF file, truncated or damaged: {error}") from error
    finally:
        logger.disabled = before
    for stream in streams:
        if not stream.get("footer"):
            raise RecordingError(f'{path.name}: the stream "{_name(stream)}" has no end: the file is truncated')
    return streams


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
