"""From what a drive reports (current, voltage, duty, torque) to the effort at the joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._errors import RecordingError
from ..files.recording import Recording
from .drive_channel import DRIVE_CHANNELS
from .study_file import Drive, JointTable


@dataclass(frozen=True)
class DriveModel:
    """tau = gain * command - back_emf * velocity."""

    gain: float  # Effort per unit of the command channel (1 where the constant is unknown)
    back_emf: float  # Effort per velocity that a voltage drive loses to its own motion [N*m*s/rad or N*s/m]
    effort_unit: str  # "N*m", "N", or the command's own unit "A" or "V" where the constant is unknown


def drive_model(rig: JointTable) -> DriveModel:
    """The drive's effort per command, from the rig's constants.

    A voltage drive with resistance R and joint-side constant K = gear ratio x torque constant gives
    tau = K/R u - K^2/R v; without R the constant is effort per volt (an amplifier that controls current).
    """
    drive: Drive = rig.drive
    si = {"rotary": "N*m", "prismatic": "N"}[rig.motion]
    if drive.kind == "torque":
        return DriveModel(1.0, 0.0, si)
    if drive.constant is None:
        return DriveModel(1.0, 0.0, {"current": "A", "voltage": "V"}[drive.kind])
    constant = drive.constant * drive.gear_ratio
    if drive.kind == "voltage" and drive.resistance is not None:
        return DriveModel(constant / drive.resistance, constant**2 / drive.resistance, si)
    return DriveModel(constant, 0.0, si)


def command_of(recording: Recording, rig: JointTable) -> np.ndarray:
    """The drive's command as recorded: torque, current, or voltage (duty times supply where only duty is recorded).
    Gives (n,) [N*m], [N], [A], [V]."""
    drive = rig.drive
    for name in DRIVE_CHANNELS[drive.kind]:
        if name in recording and name != "duty":
            return recording[name]
    if drive.kind == "voltage" and "duty" in recording:
        supply = recording["supply"] if "supply" in recording.channels else drive.supply
        if supply is None:
            raise RecordingError(
                f"{recording.path}: channel 'duty' needs a supply voltage; found neither [rig.drive] supply "
                "nor a channel 'supply'"
            )
        return recording["duty"] * supply
    raise RecordingError(
        f"{recording.path}: a {drive.kind} drive needs one of the channels "
        f"{', '.join(DRIVE_CHANNELS[drive.kind])}; found {', '.join(recording.channels)}"
    )
