r"""Energy that a torque puts into a joint over a closed cycle: what tells a compensation that drives from one that
does not.

.. math::
   W = \oint \tau\,\dot q\,dt

A joint moved slowly through a closed cycle takes in W > 0: its friction, and nothing else [1]_. A compensation that
puts in more than the joint's own W keeps the cycle going by itself; one that puts in less never does.

.. [1] J. C. Willems, "Dissipative dynamical systems, part I", Archive for Rational Mechanics and Analysis 45, 1972.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

CYCLE_SAMPLE_COUNT = 4096
"""Number of samples of one cycle. It is a multiple of four, so that the turning points are among them."""


def net_energy(torque: np.ndarray, velocity: np.ndarray, period: float) -> float:
    """Work of a torque over one period sampled evenly without its last point; the trapezoid sum of a periodic
    motion. `torque`, `velocity` (n,) [N*m], [rad/s]; `period` [s]; gives [J]."""
    return float(np.mean(np.asarray(torque, float) * np.asarray(velocity, float)) * period)


def cycle_energy(
    torque_of: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    amplitude: float,
    centre: float,
    frequency: float,
) -> float:
    """Work of a torque over one sine of position. `torque_of` (n,) [N*m]; `amplitude`, `centre` [rad]; `frequency`
    [Hz]; gives [J]."""
    w = 2.0 * np.pi * frequency
    phase = 2.0 * np.pi * np.arange(CYCLE_SAMPLE_COUNT) / CYCLE_SAMPLE_COUNT
    q = centre + amplitude * np.sin(phase)
    v, a = amplitude * w * np.cos(phase), -amplitude * w**2 * np.sin(phase)
    return net_energy(torque_of(q, v, a), v, 1.0 / frequency)
