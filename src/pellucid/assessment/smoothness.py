r"""How smooth is a movement? Spectral arc length and log dimensionless jerk, of its speed.

The spectral arc length (SPARC) [1]_ is minus the length of the speed's normalised magnitude spectrum,

.. math::
   -\int_0^{\omega_c} \sqrt{ \frac{1}{\omega_c^2} + \Big(\frac{d\hat V}{d\omega}\Big)^2 } \, d\omega,
   \qquad \hat V(\omega) = |V(\omega)| / |V(0)|,

up to the highest frequency below 10 Hz at which the spectrum is still above 5 %. The log dimensionless jerk (LDLJ)
[1]_ is

.. math::  -\ln \frac{T^3}{v_{peak}^2} \int_0^T \Big(\frac{d^2 v}{dt^2}\Big)^2 dt.

Both are higher the smoother a movement is. One of minimum jerk has LDLJ = -ln(1024/5) = -5.32 and, whatever its size
and duration, one SPARC, -1.40. Jerk is the third derivative of an angle: the LDLJ of a filtered record says much
about its filter.

.. [1] S. Balasubramanian, A. Melendez-Calderon, A. Roby-Brami, E. Burdet, "On the analysis of movement smoothness",
   J. NeuroEng. Rehabil. 12, 2015.
"""

from __future__ import annotations

import numpy as np

from .._errors import RecordingError

SPECTRUM_OVERSAMPLING_POWER = 4
"""The spectrum is sampled 2 to this power times finer than the movement's own length gives (zero padding)."""


def spectral_arc_length(speed: np.ndarray, fs: float, *, highest: float = 10.0, least: float = 0.05) -> float:
    """Return the SPARC of one movement. `speed` (n,); `fs` [Hz]; `highest` frequency [Hz]; `least` spectrum [1]."""
    speed = _checked(speed)
    n = 2 ** (int(np.ceil(np.log2(len(speed)))) + SPECTRUM_OVERSAMPLING_POWER)
    spectrum = np.abs(np.fft.rfft(speed, n))
    frequency = np.fft.rfftfreq(n, 1.0 / fs)
    spectrum = (spectrum / spectrum.max())[frequency <= highest]
    last = np.flatnonzero(spectrum >= least)[-1]
    spectrum, width = spectrum[: last + 1], max(int(last), 1)
    return -float(np.sum(np.hypot(1.0 / width, np.diff(spectrum))))


def log_dimensionless_jerk(speed: np.ndarray, fs: float) -> float:
    """Return the LDLJ of one movement. `speed` (n,); `fs` [Hz]."""
    speed = _checked(speed)
    duration = (len(speed) - 1) / fs
    jerk = np.diff(speed, 2) * fs**2
    # The integral covers the samples that have a second difference: one sample at either end is missing.
    power = float(np.sum(jerk**2)) / fs
    if power == 0.0:
        raise RecordingError("smoothness: found a speed without jerk, expected a movement")
    return -float(np.log(duration**3 / np.max(np.abs(speed)) ** 2 * power))


def _checked(speed: np.ndarray) -> np.ndarray:
    speed = np.asarray(speed, float)
    if speed.ndim != 1 or len(speed) < 4 or not np.isfinite(speed).all() or not speed.any():
        raise RecordingError(
            f"smoothness: found a speed of shape {speed.shape}, expected at least 4 numbers, not all of them 0"
        )
    return speed
