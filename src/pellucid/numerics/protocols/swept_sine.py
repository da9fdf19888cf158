r"""A swept sine of constant amplitude, with its exact velocity and acceleration.

The pulsation is to grow as :math:`\omega(t) = \omega_0 + c\,t/T`. Two signals go by that description:

.. math::
   \text{integrated:}\quad \phi &= \int_0^t \omega = \omega_0 t + \tfrac{c}{2T} t^2, & \dot\phi &= \omega(t) \\
   \text{literal:}\quad \phi &= \omega(t)\,t = \omega_0 t + \tfrac{c}{T} t^2, & \dot\phi &= \omega_0 + 2 c\,t/T

The literal one sweeps twice as far as the law says. It is here because papers print it [1]_ and some labs ran it; a
protocol of one's own wants the integrated one.

.. [1] D. Verdel et al., "An identification-based method improving the transparency of a robotic upper limb
   exoskeleton", Robotica, 2021, eq. 5: T = 25 s, start 1 rad/s, growth 3 rad/s.
"""

from __future__ import annotations

import numpy as np

from ..._errors import PellucidError


def swept_sine(
    duration: float, fs: float, *, amplitude: float, start: float, growth: float, literal: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position A sin(phi), velocity and acceleration, (n,) each, [rad or m] and per second.

    `duration` [s]; `fs` [Hz]; `amplitude` [rad or m]; `start`, `growth` [rad/s]. The derivatives are analytic.
    """
    if not duration > 0.0 or not fs > 0.0:
        raise PellucidError(f"swept sine: duration {duration} s at {fs} Hz; both must be positive")
    time = np.arange(round(duration * fs)) / fs
    bend = (1.0 if literal else 0.5) * growth / duration  # rad/s^2; half the pulsation's slope
    phase = (start + bend * time) * time
    pulsation = start + 2.0 * bend * time
    sine, cosine = np.sin(phase), np.cos(phase)
    return (
        amplitude * sine,
        amplitude * pulsation * cosine,
        amplitude * (2.0 * bend * cosine - pulsation**2 * sine),
    )
