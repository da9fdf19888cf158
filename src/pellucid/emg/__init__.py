"""Electromyography: signals, muscles, estimators of torque, study."""
