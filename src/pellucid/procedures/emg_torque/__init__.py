"""Torque of joints from EMG: trials, calibration, judgement, report."""

from ..command import Command

PROCEDURE_ORDER = 80
PROCEDURE_COMMAND = Command("calibrate", "Torque from EMG by several methods, judged held out.", reads_cards=True)
