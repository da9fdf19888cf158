"""The motion capture of a trial: markers in the laboratory's axes, on the motion capture's own clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from .._errors import RecordingError

AXES = ("x", "y", "z")
"""Values of ``{axis}`` in the name of a coordinate's column."""


@dataclass(frozen=True, eq=False)
class OpticalRecording:
    """Marker trajectories of one trial."""

    path: Path  # file of the motion capture
    checksum: str  # SHA-256 of the file, hexadecimal
    time: np.ndarray = field(repr=False)  # times on the motion capture's own clock, shape (n,) [s], read-only
    # Coordinates of each marker along the laboratory's axes, shape (n, 3) [m], read-only; all three are NaN in frames
    # that lost the marker
    markers: Mapping[str, np.ndarray] = field(repr=False)
    down: np.ndarray  # direction of gravity along the laboratory's axes, of length 1, shape (3,)
    carriage: str | None = None  # marker on the slider's carriage, if study.toml names one

    def __post_init__(self):
        n = len(self.time)
        markers = {}
        for name, given in self.markers.items():
            samples = np.array(given, dtype=np.float64)
            if samples.shape != (n, 3):
                raise RecordingError(
                    f"{self.path.name}: marker {name}: found shape {samples.shape}, expected ({n}, 3) as in time"
                )
            # A point with a missing coordinate counts as lost.
            samples[~np.isfinite(samples).all(axis=1)] = np.nan
            markers[name] = _frozen(samples)
        if self.carriage is not None and self.carriage not in markers:
            raise RecordingError(
                f"{self.path.name}: found the markers {', '.join(markers) or 'none'}, expected {self.carriage}, the "
                "carriage's, among them"
            )
        down = np.array(self.down, dtype=np.float64)
        object.__setattr__(self, "time", _frozen(np.array(self.time, dtype=np.float64)))
        object.__setattr__(self, "markers", MappingProxyType(markers))
        object.__setattr__(self, "down", _frozen(down / np.linalg.norm(down)))

    def __len__(self) -> int:
        return len(self.time)

    def seen(self, marker: str) -> np.ndarray:
        """Return a mask of the frames in which a marker was seen, shape (n,) bool."""
        return np.isfinite(self.markers[marker][:, 0])


def _frozen(samples: np.ndarray) -> np.ndarray:
    samples.flags.writeable = False
    return samples
