"""Torque of joints from EMG: trials, calibration, judgement, report."""

from ..command import Command

PROCEDURE_ORDER = 80
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("calibrate", "Torque from EMG by several methods, judged held out.", reads_cards=True)
"""Command that runs this procedure alone."""
