r"""The duration that a person prefers for a movement: the one of largest utility.

.. math::
   U(T) &= \frac{\alpha - E(T)}{1 + \gamma T} \\
   E(T) &= e_0 T + \frac{1}{\eta}\int_0^T \max(\tau\dot q, 0)\,dt + c_r\int_0^T \dot\tau^2\,dt

Here :math:`\alpha` is the reward of arriving [J], :math:`\gamma` the discount rate [1/s], :math:`e_0` the power at rest
[W], :math:`\eta` the efficiency of positive work [1] and :math:`c_r` the price of torque rate. The torque :math:`\tau =
J\ddot q + b\dot q + C\tanh(\dot q/w)` is that of the arm and of the load which the person expects on it. Gravity is
neglected, because it is the same at every pace.

The reward discounted by time is that of Shadmehr, Huang and Ahmed [1]_. The effort :math:`E` is work and torque rate.
An effort quadratic in torque grows with duration under a constant resistance, so that resistance would shorten
movements.

.. [1] R. Shadmehr, H. J. Huang, A. A. Ahmed, "A representation of effort in decision-making and motor control",
   Current Biology 26(14), 2016.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

DURATION_GRID_SIZE = 96
"""Number of durations at which the utility is evaluated; its maximum is interpolated between them."""

MOVEMENT_SAMPLE_COUNT = 49
"""Number of samples of a movement over which the effort is integrated."""


def _minimum_jerk_shape() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return velocity, acceleration and jerk of the minimum-jerk movement of unit amplitude and duration, (n,) each."""
    s = np.linspace(0.0, 1.0, MOVEMENT_SAMPLE_COUNT)
    return 30.0 * s**2 * (1.0 - s) ** 2, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s), 60.0 * (1.0 - 6.0 * s + 6.0 * s**2)


UNIT_VELOCITY, UNIT_ACCELERATION, UNIT_JERK = _minimum_jerk_shape()
"""Velocity, acceleration and jerk of the minimum-jerk movement of unit amplitude and duration, shape (n,) each."""


def utility(
    durations: np.ndarray,
    amplitude: float,
    dynamics: tuple[float, float, float],
    reward: float,
    choice: Mapping,
    width: float,
) -> np.ndarray:
    """Return the utility of movements of several durations, shape (n,) [J].

    Parameters
    ----------
    durations : ndarray
        Shape (n,) [s].
    amplitude : float
        [rad].
    dynamics : tuple of float
        Inertia [kg*m^2], viscous [N*m*s/rad] and Coulomb friction [N*m] of arm and expected load together.
    reward : float
        Value of arriving [J].
    choice : mapping
        Table ``[choice]`` of a rig's file.
    width : float
        Velocity over which the sign of Coulomb friction changes [rad/s].
    """
    cost = effort(durations, amplitude, dynamics, choice, width)
    return (reward - cost) / (1.0 + choice["discount"] * np.asarray(durations, float))


def effort(
    durations: np.ndarray, amplitude: float, dynamics: tuple[float, float, float], choice: Mapping, width: float
) -> np.ndarray:
    """Return the effort of movements of several durations, shape (n,) [J]; arguments as in `utility`."""
    inertia, viscous, coulomb = dynamics
    t = np.asarray(durations, float)[:, None]
    size = abs(amplitude)
    v, a = size / t * UNIT_VELOCITY, size / t**2 * UNIT_ACCELERATION
    torque = inertia * a + viscous * v + coulomb * np.tanh(v / width)
    # The torque rate leaves out Coulomb friction, whose change of sign is a step of arbitrary steepness.
    rate = inertia * size / t**3 * UNIT_JERK + viscous * a
    power = np.maximum(torque * v, 0.0)
    t = t[:, 0]
    resting = choice["resting_power"] * t
    return resting + t * _mean(power) / choice["efficiency"] + choice["torque_rate_cost"] * t * _mean(rate**2)


def _mean(values: np.ndarray) -> np.ndarray:
    """Return the mean of each row over its evenly spaced columns, by the trapezoidal rule."""
    return (values.sum(axis=1) - 0.5 * (values[:, 0] + values[:, -1])) / (values.shape[1] - 1)


def preferred_duration(
    amplitude: float, dynamics: tuple[float, float, float], reward: float, choice: Mapping, width: float
) -> float:
    """Return the duration of largest utility [s]; arguments as in `utility`."""
    grid = duration_grid(choice["shortest"], choice["longest"])
    return best_duration(grid, utility(grid, amplitude, dynamics, reward, choice, width))


def best_duration(grid: np.ndarray, value: np.ndarray) -> float:
    """Return the duration at which `value` is largest [s], by a parabola through the best points of the `grid`.

    Both arrays have shape (n,); the grid is geometric.
    """
    best = int(np.argmax(value))
    if best in (0, len(grid) - 1):
        return float(grid[best])
    low, middle, high = value[best - 1 : best + 2]
    step = 0.5 * (low - high) / (low - 2.0 * middle + high)
    return float(grid[best] * (grid[1] / grid[0]) ** step)


@cache
def duration_grid(shortest: float, longest: float) -> np.ndarray:
    """Return a geometric grid of durations, shape (n,) [s], which must not be written to."""
    grid = np.geomspace(shortest, longest, DURATION_GRID_SIZE)
    grid.flags.writeable = False
    return grid
