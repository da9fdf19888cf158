"""Angles and hinges from inertial sensors."""
