"""Find out whether somebody wears the joint of a study: then no delay is estimated, and every result is doubtful."""

from __future__ import annotations

from ...files.defects import echoed, worn
from ...files.fault import Fault
from ...files.quantity import quantity_of
from ...files.recording import Recording
from ...study.study import Study, drive_channel

WORN_ADVICE = (
    "Record the robot alone, or with the limb's torque known ([coupling]). Weight at rest and friction at known speeds "
    "may still be read from stretches in which the wearer is passive"
)
"""What to do about a joint that somebody wears."""


def wearer_faults(study: Study) -> list[Fault]:
    """Return a warning for each recording that somebody seems to wear, and for each measurement that echoes a command.

    A command that the drive's channel echoes is another channel with its unit whose name says that it was asked for.
    """
    if "wearer" not in study.found:
        study.found["wearer"] = [fault for recording in study.recordings() for fault in _faults_of(recording, study)]
    return list(study.found["wearer"])


def is_worn(study: Study) -> bool:
    """Whether a fitted recording shows that somebody wears the joint; held-out recordings decide nothing."""
    fitted = {recording.path.name for recording in study.recordings("fit")}
    return any(fault.kind == worn.KIND and fault.file in fitted for fault in wearer_faults(study))


def _faults_of(recording: Recording, study: Study) -> list[Fault]:
    drive = drive_channel(recording, study)
    if drive is None or drive not in recording or "position" not in recording:
        return []
    faults = []
    unit, where = recording.channels[drive].unit, f"{recording.path.name} (recording {recording.name})"
    kept = recording.enabled & recording.sound
    for name, channel in recording.channels.items():
        asked = name != drive and channel.unit == unit and quantity_of(name).role == "command"
        echo = echoed.find_echo(recording[drive][kept], channel.samples[kept]) if asked else None
        if echo is not None:
            late = f"{1e3 * echo.delay / recording.fs:.3g} ms late (r = {echo.correlation:.4f})"
            found, wanted = f"the samples of {name}, {late}", "a measurement: it is its own command"
            message = f"{where}, channel {drive}: found {found}, expected {wanted}"
            faults.append(Fault("warn", echoed.KIND, recording.path.name, drive, found, wanted, message))
    seen = worn.find_worn(recording.time[kept], recording["position"][kept], recording[drive][kept])
    if seen is not None:
        found, wanted = "; ".join(seen.reasons), f"a machine alone: somebody seems to wear it. {WORN_ADVICE}"
        message = f"{where}, channel {drive}: found that {found}, expected {wanted}"
        faults.insert(0, Fault("warn", worn.KIND, recording.path.name, drive, found, wanted, message))
    return faults
