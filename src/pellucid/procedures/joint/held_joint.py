"""Tell whether a study's recordings are postures, in which its joint is only held, or of a locked spring."""

from __future__ import annotations

import numpy as np

from ...recordings.recording import Recording
from ...studies.study import Study

MAX_POSTURE_RANGE_RAD = np.radians(0.5)
"""A joint whose angle stays within this range in a recording is held there [rad]."""

LOCKED_SPRING_NAME = "locked_spring"
"""The protocol of a recording in which one end of a spring is locked and the other is driven."""


def is_locked_spring(study: Study) -> bool:
    """Whether every recording that a study fits is said to be of a locked spring."""
    fitted = [entry.protocol for entry in study.config.recordings if entry.use == "fit"]
    return bool(fitted) and all(protocol == LOCKED_SPRING_NAME for protocol in fitted)


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
