r"""How long a person takes for a movement, where nobody says: the duration of largest utility.

.. math::
   U(T) &= \frac{\alpha - E(T)}{1 + \gamma T} \\
   E(T) &= e_0 T + \frac{1}{\eta}\int_0^T \max(\tau\dot q, 0)\,dt + c_r\int_0^T \dot\tau^2\,dt

with the torque that the motion needs, :math:`\tau = J\ddot q + b\dot q + C\tanh(\dot q/w)`, of the arm and of what the
person expects to be strapped to it; gravity, which is the same at every pace, is left out. Reward that is discounted
by time goes back to Shadmehr, Huang and Ahmed [1]_. The effort is work and torque rate: one that is quadratic in
torque would let a constant resistance shorten movements, since it grows with their duration.

.. [1] R. Shadmehr, H. J. Huang, A. A. Ahmed, "A representation of effort in decision-making and motor control",
   Current Biology 26(14), 2016.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

DURATION_GRID_SIZE, MOVEMENT_SAMPLE_COUNT = 96, 49


def _minimum_jerk_shape() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    s = np.linspace(0.0, 1.0, MOVEMENT_SAMPLE_COUNT)
    return 30.0 * s**2 * (1.0 - s) ** 2, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s), 60.0 * (1.0 - 6.0 * s + 6.0 * s**2)


UNIT_VELOCITY, UNIT_ACCELERATION, UNIT_JERK = _minimum_jerk_shape()


def utility(
    durations: np.ndarray,
    amplitude: float,
    dynamics: tuple[float, float, float],
    reward: float,
    choice: Mapping,
    width: float,
) -> np.ndarray:
    """Utility of movements [J] of several durations [s], each shape (n,), over an amplitude [rad]; dynamics are
    inertia [kg*m^2], viscous [N*m*s/rad] and Coulomb friction [N*m] of arm and load together, which changes its
    sign over a width."""
    took = effort(durations, amplitude, dynamics, choice, width)
    return (reward - took) / (1.0 + choice["discount"] * np.asarray(durations, float))


def effort(
    durations: np.ndarray, amplitude: float, dynamics: tuple[float, float, float], choice: Mapping, width: float
) -> np.ndarray:
    """What the same movements take [J], shape (n,)."""
    inertia, viscous, coulomb = dynamics
    t = np.asarray(durations, float)[:, None]
    size = abs(amplitude)
    v, a = size / t * UNIT_VELOCITY, size / t**2 * UNIT_ACCELERATION
    torque = inertia * a + viscous * v + coulomb * np.tanh(v / width)
    # Of Coulomb friction the change of sign is left out of the rate: it is a step of any steepness.
    rate = inertia * size / t**3 * UNIT_JERK + viscous * a
    power = np.maximum(torque * v, 0.0)
    t = t[:, 0]
    made = choice["resting_power"] * t
    return made + t * _mean(power) / choice["efficiency"] + choice["torque_rate_cost"] * t * _mean(rate**2)


def _mean(values: np.ndarray) -> np.ndarray:
    """Mean over evenly spaced columns, by the trapezoidal rule."""
    return (values.sum(axis=1) - 0.5 * (values[:, 0] + values[:, -1])) / (values.shape[1] - 1)


def preferred_duration(
    amplitude: float, dynamics: tuple[float, float, float], reward: float, choice: Mapping, width: float
) -> float:
    """The duration of largest utility [s]."""
    grid = duration_grid(choice["shortest"], choice["longest"])
    return best_duration(grid, utility(grid, amplitude, dynamics, reward, choice, width))


def best_duration(grid: np.ndarray, value: np.ndarray) -> float:
    """Where values of the durations of a grid, each shape (n,), are largest, between its points too [s]."""
    best = int(np.argmax(value))
    if best in (0, len(grid) - 1):
        return float(grid[best])
    low, middle, high = value[best - 1 : best + 2]
    step = 0.5 * (low - high) / (low - 2.0 * middle + high)
    return float(grid[best] * (grid[1] / grid[0]) ** step)


@cache
def duration_grid(shortest: float, longest: float) -> np.ndarray:
    """A grid of durations, shape (n,) [s]."""
    grid = np.geomspace(shortest, longest, DURATION_GRID_SIZE)
    grid.flags.writeable = False
    return grid
