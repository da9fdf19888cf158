"""Markers in a file's columns, as ``[optical]`` of study.toml says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._errors import RecordingError
from ..files.optical import AXES, OpticalRecording

if TYPE_CHECKING:
    from ..files.readers import Columns
    from .study_file import Optical


def read_optical(
    columns: Columns, digest: str, time: np.ndarray, spec: Optical, *, carriage: str | None
) -> OpticalRecording:
    """Return the markers in a file's columns, in metres. `time` has shape (n,) [s]."""
    markers = {}
    for marker in spec.markers:
        stored = [columns.column(spec.column(marker, axis), f"of marker {marker}") for axis in AXES]
        file_unit = columns.units.get(spec.column(marker, AXES[0]), spec.unit)
        if file_unit != spec.unit:
            raise RecordingError(
                f'{columns.path.name}: marker {marker}: study.toml says {spec.unit}, the file itself "{file_unit}"'
            )
        for axis, samples in zip(AXES, stored, strict=True):
            if len(samples) != len(time):
                raise RecordingError(
                    f"{columns.path.name}: marker {marker} (column {spec.column(marker, axis)!r}) has {len(samples)} "
                    f"samples, expected {len(time)} as in time"
                )
        markers[marker] = spec.si_factor * np.column_stack(stored)
    return OpticalRecording(columns.path, digest, time, markers, np.array(spec.down), carriage)
