"""How well a virtual robot's drive measures its own effort, and the readings that a supervisor must live with."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from .. import _core
from ..control.supervised import DRIVE_GAIN_ERROR, DRIVE_OFFSET_SHARE

NOISE_COUNT = 50_021
"""Periods of noise that are drawn before they repeat: a prime, so that they meet every phase of a repeated motion."""

LAGS_S = (0.3e-3, 2.0e-3)
"""Lags of current measurements [s]: a servo amplifier's filter, and a slow field bus."""

NOISE_SHARE = 0.01
"""Standard deviation of the noise of a reading within the stated accuracy, as a share of the limit of effort."""

QUANTUM_SHARE = 0.002
"""Quantum of such a reading, as a share of the limit of effort: 10 bits from one limit to the other."""


@dataclass(frozen=True)
class DriveReading:
    """The measurement of a drive's effort; by default it is exact."""

    gain: float = 1.0  # Reading per effort [1]
    offset: float = 0.0  # [N m or N]
    lag: float = 0.0  # Time constant [s]
    noise: float = 0.0  # Standard deviation, white [N m or N]
    quantum: float = 0.0  # [N m or N]; 0: none

    @property
    def numbers(self) -> np.ndarray:
        """Gain, offset, lag and quantum, shape (4,), in the order of the core."""
        return np.array([getattr(self, name) for name in _core.DRIVE_READING_NAMES])

    def draw_noise(self, seed: int) -> np.ndarray:
        """Noise of as many periods as are drawn before it repeats, shape (n,) [N m or N]."""
        return self.noise * np.random.default_rng([seed, 10]).standard_normal(NOISE_COUNT)


EXACT_READING = DriveReading()
"""A reading that is the effort itself."""


def stated_readings(effort_limit: float) -> tuple[DriveReading, ...]:
    """Return the eight worst readings within the stated accuracy: gain, offset and lag at either end of their range.

    All have noise and a quantum. The accuracy is what `Instruments` states by default, for a law that may give
    `effort_limit` [N m or N].
    """
    return tuple(
        DriveReading(
            1.0 + gain * DRIVE_GAIN_ERROR,
            offset * DRIVE_OFFSET_SHARE * effort_limit,
            lag,
            NOISE_SHARE * effort_limit,
            QUANTUM_SHARE * effort_limit,
        )
        for gain, offset, lag in product((-1.0, 1.0), (-1.0, 1.0), LAGS_S)
    )
