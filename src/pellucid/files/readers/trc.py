"""Read TRC files of motion captures, with the markers' names and times that C3D files have here.

A marker C becomes the columns C_x, C_y and C_z, at the times of the column ``point.time``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..._errors import RecordingError
from ._caps import require_few_columns, require_narrow_lines
from ._columns import Columns
from .c3d import AXES, POINT_TIME

ENDINGS = (".trc",)

HEADER_LINES = 5
"""Two lines of the file's kind and keys, one of their values, one of the markers and one of their axes."""


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,); coordinates of a lost marker are NaN."""
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    if len(lines) < HEADER_LINES or not lines[0].lower().startswith("pathfiletype"):
        raise RecordingError(f"{path.name}: not readable as a TRC file: found no line PathFileType, expected it first")
    require_narrow_lines(path, lines[:HEADER_LINES])
    stated = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    markers = [name.strip() for name in lines[3].split("\t")[2:] if name.strip()]
    require_few_columns(path, len(AXES) * len(markers))
    if len(set(markers)) != len(markers):
        twice = next(name for name in markers if markers.count(name) > 1)
        raise RecordingError(f'{path.name}: found two markers named "{twice}", expected each once')
    width = 2 + len(AXES) * len(markers)
    rows = [_numbers(path, number, line, width) for number, line in enumerate(lines, 1)
            if number > HEADER_LINES and line.strip()]  # fmt: skip
    frames = stated.get("NumFrames", "")
    if frames.isdigit() and int(frames) != len(rows):
        raise RecordingError(
            f"{path.name}: the header says NumFrames={frames}, found {len(rows)}; the file is truncated or was edited"
        )
    table = np.array(rows).reshape(len(rows), width)
    values: dict[str, np.ndarray | str] = {POINT_TIME: np.ascontiguousarray(table[:, 1])}
    units: dict[str | int, str] = {POINT_TIME: "s"}
    for i, name in enumerate(markers):
        for j, axis in enumerate(AXES):
            values[f"{name}_{axis}"] = np.ascontiguousarray(table[:, 2 + len(AXES) * i + j])
            if stated.get("Units"):
                units[f"{name}_{axis}"] = stated["Units"]
    return Columns(path, values, units=units)


def _numbers(path: Path, number: int, line: str, width: int) -> list[float]:
    """Return the numbers of a line; an empty cell, as a lost marker leaves it, is NaN."""
    fields = line.rstrip("\r\n").split("\t")
    # Lost markers at the end of a line may leave no cells at all, and a line may end with a delimiter.
    while len(fields) > width and not fields[-1].strip():
        fields.pop()
    fields += [""] * (width - len(fields)) if len(fields) > 2 else []
    if len(fields) != width:
        raise RecordingError(f"{path.name}: line {number} has {len(fields)} fields, expected {width}")
    try:
        return [float(field) if field.strip() else np.nan for field in fields]
    except ValueError as error:
        raise RecordingError(f"{path.name}: line {number}: found text, expected numbers: {error}") from None
