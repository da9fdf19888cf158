"""What robot and person do to each other during a movement: torque between them, and the work it costs.

Laws that hardly change how people move still differ in how hard they have to work for it: people spend effort to keep
their movements as they are, so torque, work and EMG show what durations hide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._errors import RecordingError


@dataclass(frozen=True)
class Interaction:
    """Torque and work between robot and person over one movement."""

    rms: float  # RMS of the torque [N m]
    peak: float  # largest absolute torque [N m]
    resisted: float  # work of the person against the robot [J]
    assisted: float  # work of the robot on the person [J]


def interaction(torque: np.ndarray, velocity: np.ndarray, fs: float) -> Interaction:
    """Return the interaction over one movement. `torque` (n,) [N m]; `velocity` (n,) [rad/s]; `fs` [Hz]."""
    torque, velocity = np.asarray(torque, float), np.asarray(velocity, float)
    if torque.shape != velocity.shape or torque.ndim != 1 or not len(torque) or not np.isfinite(torque).all():
        raise RecordingError(
            f"interaction: found torque {torque.shape} and velocity {velocity.shape}, expected as many numbers of both"
        )
    power = torque * velocity
    return Interaction(
        rms=float(np.sqrt(np.mean(torque**2))),
        peak=float(np.max(np.abs(torque))),
        resisted=float(-np.sum(np.minimum(power, 0.0)) / fs),
        assisted=float(np.sum(np.maximum(power, 0.0)) / fs),
    )
