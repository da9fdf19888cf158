"""C3D files of motion captures: markers and analog channels, each with its own times.

A marker C becomes the columns C_x, C_y and C_z, at the times of the column ``point.time``; an analog channel keeps its
name, at the times of ``analog.time``. Both start at the file's first frame, which is time 0. One file may so be a
recording's motion capture and its EMG at once.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ._columns import Columns

ENDINGS = (".c3d",)
APART = ("ezc3d",)

POINT_TIME, ANALOG_TIME = "point.time", "analog.time"
AXES = ("x", "y", "z")

BLOCK, MAGIC = 512, 0x50
"""Bytes of a block, and the second byte of every C3D file."""
DEC, MIPS = 85, 86
"""Processors, as the parameters' fourth byte names them; Intel's is 84."""
LONGEST = 65535
"""Last frame of a file that is too long for its header to say."""


def read(path: Path) -> Columns:
    """Columns by name, in the file's own units: marker coordinates shape (n,), analog channels shape (m,).

    Coordinates of a marker that was lost are NaN.
    """
    content = _content(path)
    points, analogs = content["data"]["points"], content["data"]["analogs"][0]
    into: dict[str, np.ndarray] = {}

    def add(name: str, samples: np.ndarray) -> None:
        if name in into:
            raise RecordingError(f'{path.name}: found two channels named "{name}", expected each once')
        into[name] = np.ascontiguousarray(samples, dtype=np.float64)

    labels = _labels(content, "POINT", points.shape[1])
    if labels:
        add(POINT_TIME, np.arange(points.shape[2]) / _rate(path, content, "POINT"))
        residuals = content["data"]["meta_points"]["residuals"][0]
        for i, label in enumerate(labels):
            track = points[:3, i].copy()
            # A residual below 0 says lost; older files put a lost marker into the origin.
            track[:, (residuals[i] < 0.0) | ~track.any(axis=0)] = np.nan
            for axis, samples in zip(AXES, track, strict=True):
                add(f"{label}_{axis}", samples)
    labels = _labels(content, "ANALOG", analogs.shape[0])
    if labels:
        add(ANALOG_TIME, np.arange(analogs.shape[1]) / _rate(path, content, "ANALOG"))
        for label, samples in zip(labels, analogs, strict=True):
            add(label, samples)
    return Columns(path, into, units=_units(content))


def _units(content: Any) -> dict[str, str]:
    """Unit of every column of which the file says one."""
    found = {}
    length = _texts(content, "POINT", "UNITS")
    for label in _labels(content, "POINT", content["data"]["points"].shape[1]):
        found |= {f"{label}_{axis}": length[0].strip() for axis in AXES if length and length[0].strip()}
    analogs = _labels(content, "ANALOG", content["data"]["analogs"].shape[1])
    for label, unit in zip(analogs, _texts(content, "ANALOG", "UNITS"), strict=False):
        if unit.strip():
            found[label] = unit.strip().replace("Nmm", "N*mm").replace("Nm", "N*m")
    return found


def _content(path: Path) -> Any:
    import ezc3d

    _require_whole(path)
    try:
        return ezc3d.c3d(str(path))
    except Exception as error:  # the library raises whatever its C++ does
        raise RecordingError(f"{path.name}: not readable as a C3D file, truncated or damaged: {error}") from error


def _require_whole(path: Path) -> None:
    """Refuse what is no C3D file, or is shorter than its header promises: the library may crash on either."""
    with path.open("rb") as file:
        head = file.read(BLOCK)
        file.seek(BLOCK * (max(head[0], 1) - 1) if head else 0)
        section = file.read(4)
    if len(head) < BLOCK or len(section) < 4 or head[1] != MAGIC:
        raise RecordingError(f"{path.name}: not readable as a C3D file: found no header of such a file")
    # Motion captures on MIPS stored the large byte first; all others the small one.
    order = ">" if section[3] == MIPS else "<"
    points, analogs, first, last = struct.unpack(f"{order}4H", head[2:10])
    start, _ = struct.unpack(f"{order}2H", head[16:20])
    # A scale below 0 says floats; its sign is in another byte for each maker of computers.
    floats = head[{MIPS: 12, DEC: 13}.get(section[3], 15)] & 0x80
    frame = (4 * points + analogs) * (4 if floats else 2)
    frames = last - first + 1 if last < LONGEST else 1
    expected = BLOCK * (start - 1) + frames * frame
    if path.stat().st_size < expected:
        raise RecordingError(
            f"{path.name}: not readable as a C3D file: found {path.stat().st_size} bytes, expected {expected} as its "
            "header says: it is truncated"
        )


def _texts(content: Any, group: str, name: str) -> list[str]:
    parameters = content["parameters"].get(group, {})
    return list(parameters[name]["value"]) if name in parameters else []


def _labels(content: Any, group: str, count: int) -> list[str]:
    # A file with more than 255 channels continues its names in LABELS2.
    named = [*_texts(content, group, "LABELS"), *_texts(content, group, "LABELS2")]
    named = [label.strip() for label in named][:count]
    return [label or str(i) for i, label in enumerate([*named, *[""] * (count - len(named))])]


def _rate(path: Path, content: Any, group: str) -> float:
    rate = float(content["header"]["points" if group == "POINT" else "analogs"]["frame_rate"])
    if not rate > 0.0:
        raise RecordingError(f"{path.name}: found the rate {rate:g} Hz of {group}, expected one above 0")
    return rate
