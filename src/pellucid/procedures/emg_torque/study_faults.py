"""What is to be known of a study's EMG before it is calibrated: of each file, and of sessions against each other."""

from __future__ import annotations

from ...recordings.fault import Fault
from ...recordings.study import Study
from .emg_faults import emg_faults
from .sessions import session_faults


def study_faults(study: Study) -> list[Fault]:
    """What is wrong with files first; where nothing is, channels that are not what they were. `study` [emg_torque]."""
    found = emg_faults(study)
    return found if any(fault.severity == "refuse" for fault in found) else found + session_faults(study)
