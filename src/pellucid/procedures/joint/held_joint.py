"""Tell whether a study's recordings are postures, in which its joint is only held."""

from __future__ import annotations

import numpy as np

from ...recordings.recording import Recording
from ...studies.study import Study

MAX_POSTURE_RANGE_RAD = np.radians(0.5)
"""A joint whose angle stays within this range in a recording is held there [rad]."""


def is_held_throughout(study: Study) -> bool:
    """Whether a study's recordings are postures of one rotary joint, in which nothing ever moves."""
    if study.rig.motion != "rotary":
        return False
    recordings = study.recordings()
    return len(recordings) > 0 and all(_is_posture(recording) for recording in recordings)


def _is_posture(recording: Recording) -> bool:
    if "position" not in recording:
        return False
    angle = recording["position"][recording.sound & recording.enabled]
    angle = angle[np.isfinite(angle)]
    return angle.size > 0 and float(np.ptp(angle)) <= MAX_POSTURE_RANGE_RAD
