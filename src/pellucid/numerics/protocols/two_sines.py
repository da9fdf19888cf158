r"""The swing of the paper `hill` (eq. 11): two sines, one of twice the other's frequency.

.. math::  \theta(t) - \theta_0 = C \, (\sin 2\pi f t + \sin 4\pi f t), \qquad f = 0.1\ \mathrm{Hz}
"""

from __future__ import annotations

import numpy as np

from .fourier import FourierSeries

PUBLISHED_FREQUENCY = 0.1
"""Fundamental frequency f that the paper prints [Hz]."""


def two_sines(amplitude: float, *, centre: float = 0.0, frequency: float = PUBLISHED_FREQUENCY) -> FourierSeries:
    """Return two sines of one amplitude, at a frequency and at twice that.

    `amplitude` [rad]; `centre` [rad]; `frequency` [Hz].
    """
    omega = 2.0 * np.pi * frequency
    return FourierSeries(frequency, centre, amplitude * omega * np.array([1.0, 2.0]), np.zeros(2))
