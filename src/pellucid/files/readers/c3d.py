"""Read C3D files of motion captures: markers, analog channels and force plates, with their times.

A marker C becomes the columns C_x, C_y and C_z, at the times of the column ``point.time``. An analog channel keeps its
name, at the times of ``analog.time``. A force plate, numbered from 1, becomes ``plate1.force_x``, ``plate1.moment_x``,
``plate1.centre_x``, ... in the laboratory's axes, at the times of ``analog.time``: the force of the person on the
plate, the moment about the plate's own origin, and the centre of pressure. All start at the file's first frame, which
is time 0. One file may therefore hold both the motion capture and the EMG of a recording.
"""

from __future__ import annotations

import contextlib
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError, missing_compiled_package
from ..stated_units import unit_from_text
from ._columns import Columns
from ._signals import unique_names

ENDINGS = (".c3d",)
APART = ("ezc3d",)

POINT_TIME = "point.time"
"""Column with the times of the markers."""

ANALOG_TIME = "analog.time"
"""Column with the times of the analog channels."""

GROUPS_WITH_UNITS = ("ANGLE", "FORCE", "MOMENT", "POWER", "SCALAR")
"""Beginnings of the names of parameters that list what a model computed, and of their units."""

COMPUTED_NAME = re.compile(r"(?:angle|moment|torque|power|force|grf|velocity|acceleration)s?\d*$", re.IGNORECASE)
"""Names of what a model computed, such as RKneeAngles; it stands among the markers."""

AXES = ("x", "y", "z")
"""Endings of a marker's columns, after an underscore."""

PLATE_QUANTITIES = {
    "force": ("force", "unit_force"),
    "moment": ("moment", "unit_moment"),
    "centre": ("center_of_pressure", "unit_position"),
}
"""Names of a plate's columns, and where the library has their numbers and their unit."""

BLOCK_BYTES = 512
"""The format counts positions in the file in blocks of this size."""

SECOND_BYTE = 0x50
"""Every C3D file has this value in its second byte."""

DEC_PROCESSOR = 85
"""Code of a DEC processor in the parameters' fourth byte; Intel's is 84."""

MIPS_PROCESSOR = 86
"""Code of a MIPS processor in the parameters' fourth byte."""

UNKNOWN_LAST_FRAME = 65535
"""A header with this last frame does not state the file's length, because the file is too long for it."""


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units: marker coordinates shape (n,), analog channels shape (m,).

    Coordinates of a lost marker are NaN.
    """
    content = _load(path)
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
            # A negative residual marks a lost marker; older files place a lost marker at the origin.
            track[:, (residuals[i] < 0.0) | ~track.any(axis=0)] = np.nan
            for axis, samples in zip(AXES, track, strict=True):
                add(f"{label}_{axis}", samples)
    labels = _labels(content, "ANALOG", analogs.shape[0])
    if labels:
        add(ANALOG_TIME, np.arange(analogs.shape[1]) / _rate(path, content, "ANALOG"))
        for label, samples in zip(labels, analogs, strict=True):
            add(label, samples)
    units = _units(content)
    for number, plate in enumerate(content["data"].get("platform", ()), 1):
        for quantity, (key, unit) in PLATE_QUANTITIES.items():
            for axis, samples in zip(AXES, plate[key], strict=True):
                if len(samples) == analogs.shape[1]:
                    add(f"plate{number}.{quantity}_{axis}", samples)
                    if plate[unit].strip():
                        units[f"plate{number}.{quantity}_{axis}"] = _study_unit(plate[unit])
    return Columns(path, into, units=units)


def _units(content: Any) -> dict[str | int, str]:
    """Return the unit of every column for which the file states one.

    Angles, forces, moments and powers that a model computed stand among the markers. The file lists them in groups,
    each with a unit of its own.
    """
    found: dict[str | int, str] = {}
    length = _texts(content, "POINT", "UNITS")
    by_label = _units_of_groups(content)
    for label in _labels(content, "POINT", content["data"]["points"].shape[1]):
        # Without groups, the unit of lengths is not that of what a model computed.
        unit = by_label.get(label, "" if COMPUTED_NAME.search(label) or not length else length[0].strip())
        if unit:
            found |= dict.fromkeys((f"{label}_{axis}" for axis in AXES), _study_unit(unit))
    analogs = _labels(content, "ANALOG", content["data"]["analogs"].shape[1])
    stated = [*_texts(content, "ANALOG", "UNITS"), *_texts(content, "ANALOG", "UNITS2")]
    for label, unit in zip(analogs, stated, strict=False):
        if unit.strip():
            found[label] = _study_unit(unit)
    return found


def _units_of_groups(content: Any) -> dict[str, str]:
    """Return the unit of each label that a group lists: POINT:ANGLES in POINT:ANGLE_UNITS; "" if it states none."""
    groups = {f"{name}S": f"{name}_UNITS" for name in GROUPS_WITH_UNITS}
    pairs = _texts(content, "POINT", "TYPE_GROUPS")
    groups |= dict(zip(pairs[::2], pairs[1::2], strict=False))
    found: dict[str, str] = {}
    for group, units in groups.items():
        unit = next((text.strip() for text in _texts(content, "POINT", units.strip())), "")
        for label in (*_texts(content, "POINT", group.strip()), *_texts(content, "POINT", f"{group.strip()}2")):
            found[label.strip()] = unit
    return found


def _study_unit(unit: str) -> str:
    """Return a unit of the file as study.toml says it, if it is known."""
    return unit_from_text(unit) or unit.strip()


def _load(path: Path) -> Any:
    try:
        import ezc3d
    except ImportError:
        raise RecordingError(str(missing_compiled_package(f"{path.name}: a C3D file", "ezc3d"))) from None
    _require_whole(path)
    # Plates of a kind that the library cannot compute do not spoil the rest of the file.
    with contextlib.suppress(Exception):
        return ezc3d.c3d(str(path), extract_forceplat_data=True)
    try:
        return ezc3d.c3d(str(path))
    except Exception as error:  # the library's C++ code may raise anything
        raise RecordingError(f"{path.name}: not readable as a C3D file, truncated or damaged: {error}") from error


def _require_whole(path: Path) -> None:
    """Refuse a file that is no C3D file or is shorter than its header states: the library may crash on either."""
    with path.open("rb") as file:
        head = file.read(BLOCK_BYTES)
        file.seek(BLOCK_BYTES * (max(head[0], 1) - 1) if head else 0)
        section = file.read(4)
    if len(head) < BLOCK_BYTES or len(section) < 4 or head[1] != SECOND_BYTE:
        raise RecordingError(f"{path.name}: not readable as a C3D file: found no header of such a file")
    # Motion captures with a MIPS processor stored the most significant byte first, all others last.
    order = ">" if section[3] == MIPS_PROCESSOR else "<"
    points, analogs, first, last = struct.unpack(f"{order}4H", head[2:10])
    start, _ = struct.unpack(f"{order}2H", head[16:20])
    # A negative scale means that samples are floats. The position of its sign bit depends on the processor.
    floats = head[{MIPS_PROCESSOR: 12, DEC_PROCESSOR: 13}.get(section[3], 15)] & 0x80
    frame = (4 * points + analogs) * (4 if floats else 2)
    head_bytes = BLOCK_BYTES * (start - 1)
    frames = last - first + 1 if last < UNKNOWN_LAST_FRAME else _long_frame_count(path, order, head_bytes)
    expected = head_bytes + frames * frame
    if path.stat().st_size < expected:
        raise RecordingError(
            f"{path.name}: not readable as a C3D file: found {path.stat().st_size} bytes, expected {expected} as its "
            "header says: it is truncated"
        )


def _long_frame_count(path: Path, order: str, length: int) -> int:
    """Return how many frames the parameters of a long file state, in its first `length` bytes; 1 if they do not.

    TRIAL:ACTUAL_START_FIELD and ACTUAL_END_FIELD are two words each, the low one first; some programs write the words
    as floats.
    """
    with path.open("rb") as file:
        parameters = file.read(length)
    fields = []
    for name in (b"ACTUAL_START_FIELD", b"ACTUAL_END_FIELD"):
        at = parameters.find(name) + len(name) + 2  # behind the name and the position of the next parameter
        kind = {b"\x02\x01\x02": "2H", b"\x04\x01\x02": "2f"}.get(parameters[at : at + 3])
        if name not in parameters or kind is None or len(parameters) < at + 11:
            return 1
        low, high = struct.unpack_from(f"{order}{kind}", parameters, at + 3)
        if not (0 <= low < 65536 and 0 <= high < 65536):
            return 1
        fields.append(int(low) + 65536 * int(high))
    return max(fields[1] - fields[0] + 1, 1)


def _texts(content: Any, group: str, name: str) -> list[str]:
    parameters = content["parameters"].get(group, {})
    # A parameter may hold numbers where texts are expected.
    return [str(text) for text in parameters[name]["value"]] if name in parameters else []


def _labels(content: Any, group: str, count: int) -> list[str]:
    # A file with more than 255 channels continues its names in LABELS2.
    named = [*_texts(content, group, "LABELS"), *_texts(content, group, "LABELS2")]
    named = [label.strip() for label in named][:count]
    return unique_names(label or str(i) for i, label in enumerate([*named, *[""] * (count - len(named))]))


def _rate(path: Path, content: Any, group: str) -> float:
    rate = float(content["header"]["points" if group == "POINT" else "analogs"]["frame_rate"])
    if not rate > 0.0:
        raise RecordingError(f"{path.name}: found the rate {rate:g} Hz of {group}, expected one above 0")
    return rate
