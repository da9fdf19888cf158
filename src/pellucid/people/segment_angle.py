"""Angle of a body segment between two markers of an optical recording."""

from __future__ import annotations

import numpy as np

from .._errors import RecordingError
from ..files.optical import OpticalRecording
from .movements import NoAngle

MIN_HORIZONTAL_SHARE = 0.1
"""Smallest mean horizontal share of the segment's direction; below it the sign of the angle is undefined."""


def segment_angle(optical: OpticalRecording, proximal: str, distal: str) -> np.ndarray:
    """Angle of the line from one marker to another, in the vertical plane in which it points on average.

    With u the segment's direction, g that of gravity and f the horizontal direction of the mean of u, q = atan2(u.f,
    u.g): 0 where the segment hangs, a quarter turn where it points forward. Motion out of the plane does not enter.

    Gives (n,) [rad].
    """
    for name in (proximal, distal):
        if name not in optical.markers:
            raise RecordingError(
                f"{optical.path.name}: marker {name}: found {', '.join(optical.markers)}, expected it among them"
            )
    line = optical.markers[distal] - optical.markers[proximal]
    length = np.linalg.norm(line, axis=1)
    seen = np.isfinite(length)
    where = f"{optical.path.name}: markers {proximal} and {distal}"
    if not seen.any():
        raise NoAngle(f"{where}: found no frame that saw both, expected most")
    if np.median(length[seen]) < 1e-3:
        raise RecordingError(f"{where}: found them {1e3 * np.median(length[seen]):.2g} mm apart, expected a segment")
    direction = line / length[:, None]
    mean = direction[seen].mean(axis=0)
    level = mean - (mean @ optical.down) * optical.down
    share = float(np.linalg.norm(level))
    if share < MIN_HORIZONTAL_SHARE:
        raise RecordingError(
            f"{where}: found a segment that points {100 * share:.2g} % to a side on average, expected at least "
            f"{100 * MIN_HORIZONTAL_SHARE:.0f} %: without a side its angle has no sign"
        )
    angle = np.full(len(length), np.nan)
    angle[seen] = np.unwrap(np.arctan2(direction[seen] @ (level / share), direction[seen] @ optical.down))
    return angle
