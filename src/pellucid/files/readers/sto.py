"""Read OpenSim's storage (.sto) and motion (.mot) files: a header up to ``endheader``, then columns of numbers.

A column keeps its label, and an orientation is NAME.w, NAME.x, NAME.y and NAME.z. The header states whether angles are
in degrees.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..._errors import RecordingError
from ._caps import require_narrow_lines
from ._columns import Columns

ENDINGS = (".sto", ".mot", ".dat")

_PARTS_BY_TYPE = {"quaternion": tuple("wxyz"), "vec3": tuple("xyz"), "spatialvec": ("rx", "ry", "rz", "x", "y", "z")}
"""Parts of a cell by the type that the header states, in the order in which OpenSim writes them."""

WRITERS_THAT_MISCOUNT_ROWS = ("rtosim output",)
"""First lines of real-time writers whose ``nRows`` counts one row too many, or one too few, of a file that is whole."""


def recognises(path: Path) -> bool:
    """Whether a file, whatever its ending, is one of OpenSim's: it has a line ``endheader``."""
    with path.open(encoding="utf-8-sig", errors="replace") as lines:
        return any(line.strip().lower() == "endheader" for _, line in zip(range(1000), lines, strict=False))


def read(path: Path) -> Columns:
    """Return columns by label, each shape (n,) float64, in the file's own units; the header may state angles' unit."""
    header, body, first = _split_header(path)
    if not body:
        raise RecordingError(f"{path.name}: found nothing after endheader, expected labels and rows")
    require_narrow_lines(path, body[:1])
    labels = body[0].split()
    parts = _PARTS_BY_TYPE.get(header.get("datatype", ""), ())
    rows = [line.split() for line in body[1:]]
    columns = len(labels)
    if parts and rows:
        # OpenSense writes an orientation as one cell, "w,x,y,z".
        labels = [labels[0], *(f"{label}.{part}" for label in labels[1:] for part in parts)]
        rows = [[number for cell in fields for number in cell.split(",")] for fields in rows]
    for number, fields in enumerate(rows, first + 1):
        if len(fields) != len(labels):
            last = number - first == len(rows)
            raise RecordingError(
                f"{path.name}: line {number} has {len(fields)} fields, expected {len(labels)}"
                + ("; it is the last line, so the file is truncated" if last else "")
            )
    try:
        table = np.array(rows, dtype=np.float64).reshape(len(rows), len(labels))
    except ValueError as error:
        raise RecordingError(f"{path.name}: found text where numbers are expected: {error}") from None
    miscounts = header["title"].startswith(WRITERS_THAT_MISCOUNT_ROWS)
    for key, found in (("nrows", len(rows)), ("ncolumns", columns)):
        accepted = (found - 1, found, found + 1) if key == "nrows" and miscounts else (found,)
        if key in header and header[key] not in map(str, accepted):
            raise RecordingError(
                f"{path.name}: the header says {key[0]}{key[1].upper()}{key[2:]}={header[key][:40]}, found {found}; "
                "the file is truncated or was edited"
            )
    values = {label: np.ascontiguousarray(table[:, i]) for i, label in enumerate(labels)}
    facts = {"DataRate": f"{header['datarate']} Hz"} if "datarate" in header else {}
    return Columns(path, values, {"yes": "deg", "no": "rad"}.get(header.get("indegrees", "")), facts=facts)


def _split_header(path: Path) -> tuple[dict[str, str], list[str], int]:
    """Return the header as keys in lower case, the lines after it, and the number of the line with the labels.

    The header's first line has the key ``title``.
    """
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    end = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    if end is None:
        raise RecordingError(f"{path.name}: found no line endheader, expected an OpenSim storage file")
    pairs = [[part.strip().lower() for part in line.split("=", 1)] for line in lines[:end] if "=" in line]
    header = {"title": lines[0].strip().lower(), **dict(pairs)}
    body = [(i, line) for i, line in enumerate(lines[end + 1 :], end + 2) if line.strip()]
    return header, [line for _, line in body], body[0][0] if body else end + 1
