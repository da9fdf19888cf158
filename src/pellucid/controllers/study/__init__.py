"""Instruments of a study's rig, and incidents of a controller."""
