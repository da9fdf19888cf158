r"""How smooth is a movement? Spectral arc length of its speed, and log dimensionless jerk.

The spectral arc length (SPARC) [1]_ [2]_ is minus the length of the normalised magnitude spectrum of the speed,

.. math::
   -\int_0^{\omega_c} \sqrt{ \frac{1}{\omega_c^2} + \Big(\frac{d\hat V}{d\omega}\Big)^2 } \, d\omega,
   \qquad \hat V(\omega) = |V(\omega)| / |V(0)|,

up to the highest frequency below 10 Hz at which the spectrum is still above 5 %. The speed is the norm of the velocity:
the spectrum of a signed velocity is another curve once a movement corrects an overshoot. The log dimensionless jerk
(LDLJ) [2]_ is

.. math::  -\ln \frac{T^3}{v_{peak}^2} \int_0^T \Big|\frac{d^2 v}{dt^2}\Big|^2 dt

with the jerk of the velocity v and the peak of its norm: the speed has a kink where the velocity changes sign, and its
second derivative has no meaning there. Both are higher the smoother a movement is. One of minimum jerk has
LDLJ = -ln(1024/5) = -5.32 and, whatever its size and duration, one SPARC, -1.40. Jerk is the third derivative of an
angle: the LDLJ of a filtered record says much about its filter. A constant speed is no movement, and is refused.

.. [1] S. Balasubramanian, A. Melendez-Calderon, E. Burdet, "A robust and sensitive metric for quantifying movement
   smoothness", IEEE Trans. Biomed. Eng. 59, 2012.
.. [2] S. Balasubramanian, A. Melendez-Calderon, A. Roby-Brami, E. Burdet, "On the analysis of movement smoothness",
   J. NeuroEng. Rehabil. 12, 2015.
"""

from __future__ import annotations

import numpy as np

from .._errors import RecordingError
from ..numerics.speed import tangential_speed
from .movements import Kinematics, Movement

SPECTRUM_OVERSAMPLING_POWER = 4
"""The spectrum is sampled 2 to this power times finer than the movement's own length gives (zero padding)."""

MIN_SPEED_VARIATION = 1e-9
"""A speed that varies by less than this share of its largest is constant: rounding reaches 1e-13 of it."""


def smoothness(motion: Kinematics, movement: Movement) -> dict[str, float]:
    """Return SPARC and LDLJ of a movement, as ``sparc`` and ``ldlj``."""
    velocity = motion.velocity[movement.first : movement.last + 1]
    return {
        "sparc": spectral_arc_length(velocity, motion.fs),
        "ldlj": log_dimensionless_jerk(velocity, motion.fs),
    }


def spectral_arc_length(velocity: np.ndarray, fs: float, *, highest: float = 10.0, least: float = 0.05) -> float:
    """Return the SPARC of the speed of one movement.

    `velocity` (n,), or (n, d) of a point; `fs` [Hz]; `highest` frequency [Hz]; `least` spectrum [1].
    """
    _, speed = _checked(velocity)
    n = 2 ** (int(np.ceil(np.log2(len(speed)))) + SPECTRUM_OVERSAMPLING_POWER)
    spectrum = np.abs(np.fft.rfft(speed, n))
    frequency = np.fft.rfftfreq(n, 1.0 / fs)
    spectrum = (spectrum / spectrum[0])[frequency <= highest]
    last = np.flatnonzero(spectrum >= least)[-1]
    spectrum, width = spectrum[: last + 1], max(int(last), 1)
    return -float(np.sum(np.hypot(1.0 / width, np.diff(spectrum))))


def log_dimensionless_jerk(velocity: np.ndarray, fs: float) -> float:
    """Return the LDLJ of one movement. `velocity` (n,), or (n, d) of a point; `fs` [Hz]."""
    velocity, speed = _checked(velocity)
    duration = (len(speed) - 1) / fs
    jerk = np.diff(velocity, 2, axis=0) * fs**2
    # The integral covers the samples that have a second difference: one sample at either end is missing.
    power = float(np.sum(jerk**2)) / fs
    if power == 0.0:
        raise RecordingError("smoothness: found a velocity without jerk, expected a movement")
    return -float(np.log(duration**3 / np.max(speed) ** 2 * power))


def _checked(velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a movement's velocity and speed; refuse what is no movement."""
    velocity = np.asarray(velocity, float)
    if velocity.ndim not in (1, 2) or len(velocity) < 4 or not np.isfinite(velocity).all() or not velocity.any():
        raise RecordingError(
            f"smoothness: found a velocity of shape {velocity.shape}, expected at least 4 numbers, not all of them 0"
        )
    speed = tangential_speed(velocity)
    if np.ptp(speed) <= MIN_SPEED_VARIATION * np.max(speed):
        raise RecordingError(
            f"smoothness: found a constant speed of {np.max(speed):.3g}, expected one that rises and falls"
        )
    return velocity, speed
