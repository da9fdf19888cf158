"""C3D files of motion captures: markers and analog channels, each with its own times.

A marker C becomes the columns C_x, C_y and C_z, at the times of the column ``point.time``; an analog channel keeps its
name, at the times of ``analog.time``. Both start at the file's first frame, which is time 0. One file may so be a
recording's motion capture and its EMG at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError

POINT_TIME, ANALOG_TIME = "point.time", "analog.time"
AXES = ("x", "y", "z")


def read(path: Path) -> dict[str, np.ndarray]:
    """Columns by name, in the file's own units: marker coordinates shape (n,), analog channels shape (m,).

    Coordinates of a marker that was lost are NaN.

    Raises
    ------
    RecordingError
        If the file is truncated or is no C3D file, has no rate, or two of its channels have one name.
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
    return into


def units(path: Path) -> dict[str, str]:
    """Unit of every column of which the file says one.

    Raises
    ------
    RecordingError
        If the file cannot be read.
    """
    content = _content(path)
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

    try:
        return ezc3d.c3d(str(path))
    except Exception as error:  # the library raises whatever its C++ does
        raise RecordingError(f"{path.name}: not readable as a C3D file, truncated or damaged: {error}") from error


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
