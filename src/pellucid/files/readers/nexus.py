"""Read text that Vicon Nexus exports: blocks of devices, model outputs and trajectories, each with a rate of its own.

A block has a line with its kind, one with its rate, and a table with groups, names and units above it. A coordinate of
a marker or a model output is NAME_x, as in C3D files; a channel of a device is DEVICE.CHANNEL. The times of a block,
which follow from its frames and its rate, are the column KIND.time.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..._errors import RecordingError
from ._caps import require_few_columns
from ._columns import Columns
from ._number_blocks import text_of
from ._table_header import AXIS_NAMES
from .csv import read_table

ENDINGS = (".csv", ".txt")

_NUMBER_LINE = re.compile(r"[\s\"]*(\d+(?:\.\d+)?)[\s\",;]*")
_KIND_LINE = re.compile(r"[\s\"]*([A-Za-z][A-Za-z ]{2,40}?)[\s\",;]*")
_FRAME_LINE = re.compile(r"[\s\"]*Frame\b", re.IGNORECASE)
_AXIS = re.compile(r"(.+)\.([XYZ]'{0,2})")

_SUB_FRAME = "Sub Frame"


def recognises(path: Path) -> bool:
    """Whether a file begins with a block: its kind, its rate, and below them a line that begins with ``Frame``."""
    with path.open("rb") as file:
        lines = text_of(file.read(1 << 16)).splitlines()[:5]
    return _is_block(lines)


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) with the n of its block."""
    lines = text_of(path.read_bytes()).splitlines()
    values: dict[str, np.ndarray | str] = {}
    units: dict[str | int, str] = {}
    blocks = list(_blocks(lines))
    for kind, rate, rows in blocks:
        table = read_table(path, io.BytesIO("\n".join(rows).encode()), delimiter=_delimiter(rows))
        frames = table.values.get("Frame")
        if frames is None or isinstance(frames, str):
            continue
        sub = table.values.get(_SUB_FRAME)
        inner = sub if isinstance(sub, np.ndarray) else np.zeros(len(frames))
        times = ((frames - 1.0) * (np.nanmax(inner, initial=0.0) + 1.0) + inner) / rate
        values[f"{kind}.time"], units[f"{kind}.time"] = times, "s"
        for name, x in table.values.items():
            if name in ("Frame", _SUB_FRAME):
                continue
            own = _named(name)
            own = own if own not in values else f"{kind}.{own}"
            values[own] = x
            if name in table.units:
                units[own] = table.units[name]
        require_few_columns(path, len(values))
    if not values:
        raise RecordingError(f"{path.name}: found no block with frames, expected one")
    facts = {"sampling rate": f"{blocks[0][1]:g} Hz"} if len(blocks) == 1 else {}
    return Columns(path, values, units=units, facts=facts)


def _named(name: str) -> str:
    """Return a column's name; a coordinate's ends as in C3D files."""
    match = _AXIS.fullmatch(name)
    if match is None:
        return name
    axis = match[2][0].lower()
    return f"{match[1]}_{axis}{match[2][1:]}" if axis in AXIS_NAMES else name


def _is_block(lines: list[str]) -> bool:
    return (
        len(lines) >= 5
        and _KIND_LINE.fullmatch(lines[0]) is not None
        and _NUMBER_LINE.fullmatch(lines[1]) is not None
        and any(_FRAME_LINE.match(line) for line in lines[2:5])
    )


def _blocks(lines: list[str]) -> Iterator[tuple[str, float, list[str]]]:
    """Yield the kind, the rate [Hz] and the lines of each block of samples; events are none."""
    starts = [i for i, line in enumerate(lines) if line[:1].isalpha() or line[:1] == '"']
    begins = [i for i in starts if _is_block(lines[i : i + 5])]
    kinds = [
        i
        for i in starts
        if i not in begins and _KIND_LINE.fullmatch(lines[i]) and i > 0 and not lines[i - 1].strip(" ,;\t")
    ]
    for i in begins:
        kind, rate = _KIND_LINE.fullmatch(lines[i]), _NUMBER_LINE.fullmatch(lines[i + 1])
        if kind is None or rate is None or float(rate[1]) <= 0.0:
            continue
        end = min((j for j in (*begins, *kinds) if j > i), default=len(lines))
        yield kind[1].strip(), float(rate[1]), [line for line in lines[i + 2 : end] if line.strip(" ,;\t")]


def _delimiter(rows: list[str]) -> str:
    return max("\t;,", key=lambda mark: sum(mark in row for row in rows[:20]))
