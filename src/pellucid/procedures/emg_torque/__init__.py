"""Torque of joints from EMG: trials, calibration, judgement, report."""

from ..command import Command

ORDER = 80
COMMAND = Command("calibrate", "Torque from EMG by several methods, judged held out.", reads_cards=True)
