"""Read LabVIEW measurement files (.lvm): a header for the file, one for each segment, and the segment's samples.

The layout is National Instruments' "Specification for the LabVIEW Measurement File". Segments follow each other in
time. Channels that share their times share the column ``X_Value``; others have NAME.time. Without a column of times,
they follow from ``X0`` and ``Delta_X``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..._errors import RecordingError
from ..personal_fields import find_personal_lines
from ..stated_units import unit_from_text
from ._caps import require_few_columns, require_narrow_lines, require_unpacked_size
from ._columns import Columns
from ._number_blocks import text_of

ENDINGS = (".lvm", ".txt", ".csv", ".dat")

MAGIC = b"LabVIEW Measurement"
"""Every such file begins with these words."""

END_OF_HEADER = "***End_of_Header***"
"""Line that ends a header."""

TIME_NAME = "X_Value"
"""Name of the column of times."""

T = TypeVar("T")


@dataclass
class _Segment:
    """A segment: its settings by channel, its channels, and its rows."""

    settings: dict[str, list[str]]
    names: list[str]
    rows: list[list[str]]


def recognises(path: Path) -> bool:
    """Whether a file begins as a LabVIEW measurement file does."""
    with path.open("rb") as file:
        return file.read(64).lstrip(b"\xef\xbb\xbf").startswith(MAGIC)


def read(path: Path) -> Columns:
    """Return columns by channel, each shape (n,) float64, in the file's own units."""
    lines = text_of(path.read_bytes()).splitlines()
    if not lines or not lines[0].startswith(MAGIC.decode()):
        raise RecordingError(
            f'{path.name}: not readable as a LabVIEW measurement file: found no line "{MAGIC.decode()}"'
        )
    heads = [i for i, line in enumerate(lines) if line.startswith(END_OF_HEADER)]
    if not heads:
        raise RecordingError(f"{path.name}: found no line {END_OF_HEADER}, the file is truncated")
    file_lines = [line.rstrip() for line in lines[1 : heads[0]] if line.strip()]
    delimiter = "," if any(line.lower().startswith("separator,") for line in file_lines) else "\t"
    pairs = dict(line.split(delimiter, 1) for line in file_lines if delimiter in line)
    head = {key.strip(): value.strip() for key, value in pairs.items()}
    segments = _segments(path, lines, heads, delimiter)
    decimal = head.get("Decimal_Separator", ".")
    columns_of_time = head.get("X_Columns", "One").casefold()
    values: dict[str, list[np.ndarray]] = {}
    units: dict[str | int, str] = {}
    for segment in segments:
        for name, x, unit in _columns_of(path, segment, columns_of_time, decimal):
            values.setdefault(name, []).append(x)
            if unit:
                units[name] = unit_from_text(unit) or unit
        require_few_columns(path, len(values))
    joined = {name: np.concatenate(parts) for name, parts in values.items()}
    if not joined:
        raise RecordingError(f"{path.name}: found no segment with samples, expected one")
    personal = find_personal_lines(file_lines)
    hidden = {field.label for field in personal} | {"Operator"}
    facts = {key: value for key, value in head.items() if value and key not in hidden}
    return Columns(path, joined, units=units, facts=facts, personal=tuple(personal))


def _segments(path: Path, lines: list[str], heads: list[int], delimiter: str) -> list[_Segment]:
    """Return the segments of a file; without headers of segments, the lines after the file's header are one."""
    ends = heads[1:] or heads
    segments: list[_Segment] = []
    for k, end in enumerate(ends):
        begin = heads[0] + 1 if k == 0 else ends[k - 1] + 1
        settings: dict[str, list[str]] = {}
        if len(heads) > 1:
            at = next((i for i in range(end - 1, begin - 1, -1) if lines[i].startswith("Channels")), begin)
            for line in lines[at:end]:
                fields = [text.strip() for text in line.split(delimiter)]
                settings[fields[0]] = fields[1:]
        stop = ends[k + 1] if k + 1 < len(ends) else len(lines)
        named = next((i for i in range(end + 1, stop) if lines[i].strip()), stop)
        require_narrow_lines(path, lines[named : named + 2])
        names = [text.strip() for text in lines[named].split(delimiter)] if named < stop else []
        rows = []
        for line in lines[named + 1 : stop]:
            if line.startswith("Channels" + delimiter):
                break  # the next segment's header
            if line.strip():
                rows.append([text.strip() for text in line.split(delimiter)])
        require_unpacked_size(path, float(len(rows)) * len(names))
        segments.append(_Segment(settings, names, rows))
    return segments


def _columns_of(path: Path, segment: _Segment, columns_of_time: str, decimal: str) -> list[tuple[str, np.ndarray, str]]:
    """Return name, samples and unit of each column of a segment."""
    names = [name for name in segment.names if name and name.casefold() != "comment"]
    table = np.full((len(segment.rows), len(names)), np.nan)
    for i, row in enumerate(segment.rows):
        for j, text in enumerate(row[: len(names)]):
            try:
                table[i, j] = float(text.replace(decimal, ".")) if text else np.nan
            except ValueError:
                raise RecordingError(
                    f'{path.name}: segment of {names[0]}, row {i + 1}: found the text "{text[:40]}", expected a number'
                ) from None
    places = [j for j, name in enumerate(names) if not name.startswith(TIME_NAME)]
    first = _numbers(segment.settings, "X0")
    step = _numbers(segment.settings, "Delta_X")
    y_units, x_units = segment.settings.get("Y_Unit_Label", []), segment.settings.get("X_Unit_Label", [])
    clocks = [
        table[:, j - 1] if columns_of_time == "multi" and j > 0 else
        table[:, 0] if columns_of_time == "one" and names[0].startswith(TIME_NAME) else
        _entry(first, k, 0.0) + _entry(step, k, np.nan) * np.arange(len(table))
        for k, j in enumerate(places)
    ]  # fmt: skip
    made: list[tuple[str, np.ndarray, str]] = []
    is_shared = all(np.array_equal(clock, clocks[0], equal_nan=True) for clock in clocks[1:])
    dimension = segment.settings.get("X_Dimension", ["Time"])
    clock_unit = _entry(x_units, 0, "") or ("s" if _entry(dimension, 0, "Time") in ("Time", "") else "")
    if clocks and is_shared and np.isfinite(clocks[0]).any():
        made.append((TIME_NAME, clocks[0], clock_unit))
    for k, j in enumerate(places):
        n = len(table)
        filled = np.flatnonzero(np.isfinite(table[:, j]))
        if not is_shared:
            # A slower channel ends in empty cells.
            n = int(filled[-1]) + 1 if filled.size else 0
            made.append((f"{names[j]}.time", clocks[k][:n], clock_unit))
        made.append((names[j], table[:n, j].copy(), _entry(y_units, k, "")))
    return made


def _numbers(settings: Mapping[str, list[str]], key: str) -> list[float]:
    found = []
    for text in settings.get(key, []):
        try:
            found.append(float(text.replace(",", ".")))
        except ValueError:
            break
    return found


def _entry(entries: list[T], place: int, default: T) -> T:
    return entries[place] if place < len(entries) else default
