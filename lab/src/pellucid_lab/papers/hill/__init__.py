"""The three-step calibration of a Hill model from EMG."""
