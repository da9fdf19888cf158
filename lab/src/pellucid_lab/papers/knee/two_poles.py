r"""A joint as a transfer function with two poles and no zeros, 1 / (I s² + b s + k), and what its numbers imply.

A pendulum is not such a joint. In a swing of amplitude A, a linear fit to its gravity torque m g l sin q gives a
spring:

.. math::
    k(A) = m g l\,\frac{2 J_1(A)}{A} \quad\text{(a sine of amplitude A)}, \qquad
    k(A) = m g l\,\frac{\sin A}{A} \quad\text{(its end point)}
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import j1

from pellucid._errors import PellucidError


@dataclass(frozen=True)
class TwoPoles:
    """Inertia [kg m^2], damping [N m s/rad] and stiffness [N m/rad], all positive."""

    inertia: float
    damping: float
    stiffness: float

    def __post_init__(self) -> None:
        if min(self.inertia, self.damping, self.stiffness) <= 0.0:
            raise PellucidError(
                f"two poles: found inertia {self.inertia}, damping {self.damping}, stiffness {self.stiffness}; "
                "expected all positive"
            )

    @property
    def natural_frequency(self) -> float:
        """[Hz]"""
        return math.sqrt(self.stiffness / self.inertia) / (2.0 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """1 where it just does not oscillate."""
        return self.damping / (2.0 * math.sqrt(self.stiffness * self.inertia))

    @property
    def time_constant(self) -> float:
        """Time in which an oscillation falls to 1/e [s]."""
        return 2.0 * self.inertia / self.damping

    def left_after(self, seconds: float) -> float:
        """Return the share of an oscillation's amplitude that is left after `seconds` [s]."""
        return math.exp(-seconds / self.time_constant)


def sine_stiffness(gravity: float, amplitude: float) -> float:
    """Return the stiffness of a pendulum by least squares over a sine.

    gravity [N m], amplitude [rad]; gives [N m/rad].
    """
    return float(gravity * 2.0 * j1(amplitude) / amplitude)


def chord_stiffness(gravity: float, amplitude: float) -> float:
    """The spring through the pendulum's torque at one angle; gravity [N m], amplitude [rad]; gives [N m/rad]."""
    return gravity * math.sin(amplitude) / amplitude


def r_squared(fit: float) -> float:
    """Return R² for a fit in percent, 100 (1 - |y - ŷ| / |y - mean y|)."""
    return 1.0 - (1.0 - fit / 100.0) ** 2


def output_sd(rmse: float, fit: float) -> float:
    """Return the output's standard deviation, from the error's size and the fit in percent; in the error's unit."""
    return rmse / (1.0 - fit / 100.0)


def lowpass_delay(order: int, cutoff: float) -> float:
    """Return the delay [s] of a causal Butterworth low-pass for slow signals; cutoff [Hz]."""
    if order < 1 or cutoff <= 0.0:
        raise PellucidError(f"low-pass: found order {order}, cutoff {cutoff} Hz; expected both positive")
    angles = (math.pi * (2 * i + 1) / (2 * order) for i in range(order))
    return sum(math.sin(a) for a in angles) / (2.0 * math.pi * cutoff)
