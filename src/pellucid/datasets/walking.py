"""How a knee moves in walking: a public recording on a treadmill, which virtual wearers follow."""

from __future__ import annotations

import numpy as np

from ..recordings.readers.read import read_columns
from .fetch import path

WALKING, FILE, KNEE, RATE = "lower_limb_walking", "ik.sto", "knee_angle_r", 100.0
"""The data set, its file, the knee's column there [deg], which flexion makes negative, and samples per second [Hz]."""


def recorded_walking() -> tuple[float, np.ndarray]:
    """Rate [Hz] and flexion of a knee, shape (n,) [rad]; a DatasetError where the recording is not on this machine."""
    return RATE, -np.deg2rad(read_columns(path(WALKING) / FILE)[KNEE])
