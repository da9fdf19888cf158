"""A robot's instruments and their accuracy: the one table that lab, supervisor and exported controller read."""

from __future__ import annotations

import math
from dataclasses import dataclass

DRIVE_GAIN_ERROR = 0.05
"""Default of `Instruments.drive_gain_error`: the accuracy of uncalibrated current sensors and torque constants [1]."""

DRIVE_OFFSET_SHARE = 0.01
"""Default of `Instruments.drive_offset_share`, as a share of the law's limit of effort [1]."""


@dataclass(frozen=True)
class Instruments:
    """A robot's instruments and their accuracy."""

    encoder_resolution: float = 4e-4  # error of one encoder reading [rad or m]
    joint_encoder: bool = False  # whether there is a second encoder, behind the transmission
    joint_tolerance: float = 0.05  # largest difference of both encoders without a fault: twist and backlash [rad or m]
    drive: bool = False  # whether the drive measures its current or torque
    drive_limit: float = math.inf  # largest effort of the drive [N m or N]
    force_range: float = math.inf  # range of the force sensor [N m or N]
    emg_range: float = 40.0  # largest torque in the EMG calibration [N m]
    drive_gain_error: float = DRIVE_GAIN_ERROR  # relative error of the drive's measurement [1]
    drive_offset_share: float = DRIVE_OFFSET_SHARE  # offset of that measurement, as a share of the effort limit [1]
    start_up_answer: float | None = None  # work of the start-up test's wave at commissioning; None if not known [J]
    probe: bool = False  # whether a small wave of effort may test encoder and drive while the law runs
