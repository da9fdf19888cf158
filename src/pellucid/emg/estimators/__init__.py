"""From EMG and joint angles to joint torque: features, estimators, cross-validation without leaks, calibration."""
