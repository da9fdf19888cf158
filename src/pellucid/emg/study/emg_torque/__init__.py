"""Torque of joints from EMG: trials, calibration, judgement, report."""
