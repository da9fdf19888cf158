"""Speed of a movement, and the samples from its onset to its end.

Onset, peak and end of a movement are decided by its speed, the norm of its tangential velocity. A velocity along one
direction is no substitute: an overshoot and its correction backwards would not count.
"""

from __future__ import annotations

import numpy as np


def tangential_speed(velocity: np.ndarray) -> np.ndarray:
    """Return the norm of a `velocity`, shape (n,) of one coordinate or (n, d) of a point; shape (n,), same unit."""
    velocity = np.asarray(velocity, float)
    return np.abs(velocity) if velocity.ndim == 1 else np.linalg.norm(velocity, axis=1)


def moving_samples(speed: np.ndarray, threshold: float) -> tuple[int, int]:
    """Return the first and the last sample of a `speed` (n,), not all 0, above the share `threshold` of its largest."""
    above = np.flatnonzero(speed > threshold * np.max(speed))
    return int(above[0]), int(above[-1])
