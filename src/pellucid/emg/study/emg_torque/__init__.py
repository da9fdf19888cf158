"""Torque of joints from EMG: trials, calibration, judgement, report."""

from ....study.procedures.command import Command

PROCEDURE_ORDER = 80
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("calibrate", "Estimate torque from EMG, and judge it held out.", reads_cards=True)
"""Command that runs this procedure alone."""
