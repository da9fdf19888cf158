"""Errors with which a virtual robot's drive measures its own effort, and the worst that a supervisor must tolerate.

The drive filters its effort by a first-order lag, reports ``gain * effort + offset`` with white noise, and rounds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from pellucid import _core
from pellucid.controllers.instruments import DRIVE_GAIN_ERROR, DRIVE_OFFSET_SHARE

NOISE_COUNT = 50_021
"""Number of control periods of noise that are drawn before the noise repeats.

It is a prime, so that the noise falls on every phase of a repeated motion."""

LAGS_S = (0.3e-3, 2.0e-3)
"""Shortest and longest lag of a current measurement [s]: a servo amplifier's filter, and a slow field bus.

Chosen by judgement; no measurement is recorded."""

NOISE_SHARE = 0.01
"""Standard deviation of a reading's noise, as a share of the effort limit.

Chosen by judgement; no measurement is recorded."""

QUANTUM_SHARE = 0.002
"""Quantum of a reading, as a share of the effort limit: a converter of 10 bits from the lower limit to the upper."""


@dataclass(frozen=True)
class DriveReading:
    """Errors of one drive's measurement of its own effort; the default has none."""

    gain: float = 1.0  # reading per effort [1]
    offset: float = 0.0  # reading at no effort [N m or N]
    lag: float = 0.0  # time constant of the first-order lag [s]
    noise: float = 0.0  # standard deviation of the white noise [N m or N]
    quantum: float = 0.0  # rounding step [N m or N]; 0 for no rounding

    @property
    def numbers(self) -> np.ndarray:
        """Return gain, offset, lag and quantum, shape (4,), in the order of the core's `DRIVE_READING_NAMES`."""
        return np.array([getattr(self, name) for name in _core.DRIVE_READING_NAMES])

    def draw_noise(self, seed: int) -> np.ndarray:
        """Draw the noise of `NOISE_COUNT` control periods, shape (n,) [N m or N]."""
        return self.noise * np.random.default_rng([seed, 10]).standard_normal(NOISE_COUNT)


EXACT_READING = DriveReading()
"""The reading of a drive that measures its effort without error."""


def stated_readings(effort_limit: float) -> tuple[DriveReading, ...]:
    """Return the eight worst readings within the stated accuracy: gain, offset and lag at either end of their range.

    Each also has noise and a quantum. The accuracy is the default of `control.instruments.Instruments`; it scales with
    the `effort_limit` of the law [N m or N].
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
