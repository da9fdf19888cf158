r"""How quick and how precise a person is: one weight, the price of an error that is left, decides both.

A primary movement of duration :math:`T` over an amplitude :math:`A` ends with an error whose standard deviation is that
of its mean speed [1]_, :math:`\sigma = kA/T`. Who sees an error :math:`e` may leave it or correct it, which takes a
look and a movement, :math:`C = t_v + t_c`, and leaves what cannot be resolved, :math:`r`, a share :math:`s` of the
error, and the noise of the correction itself, :math:`r'^2 = r^2 + (s^2 + k^2/t_c^2)\,e^2`. With a reward for arriving
of 1, a squared error's price :math:`w` and discounting by time, both are decided by the same utility [2]_:

.. math::
   z^2 &= r^2 + \left(\frac1w - r^2\right)\frac{\gamma C}{1 + \gamma (T + C)} \\
   U(T) &= \frac{1 - E(T)/\alpha - w L}{1 + \gamma\,(T + nC)}, \qquad n = \frac{p_1}{1 - p_2}

with the chances :math:`p_1`, :math:`p_2` to miss the dead zone :math:`z` after the primary movement and after a
correction, and the mean square :math:`L` of what is left.

An error inside the dead zone costs less than the time of a correction; the primary movement's duration is
that of largest utility. Where precision has no price this is `movement_choice`; where it is dear, movements are slow,
and corrected as finely as can be seen: the trade-off of Fitts's task without a target's width [3]_.

.. [1] R. A. Schmidt, H. Zelaznik, B. Hawkins, J. S. Frank, J. T. Quinn, "Motor-output variability", Psychological
   Review 86, 1979.
.. [2] R. Shadmehr, H. J. Huang, A. A. Ahmed, "A representation of effort in decision-making and motor control",
   Current Biology 26(14), 2016.
.. [3] D. E. Meyer et al., "Optimality in human motor performance: ideal control of rapid aimed movements",
   Psychological Review 95, 1988.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from .movement_choice import best_duration, duration_grid, effort


@dataclass(frozen=True)
class Accuracy:
    """What a person's precision has to do with, whatever it is worth."""

    noise: float  # k: standard deviation of a primary movement's end over its mean speed [s]
    resolution: float  # r: error that is not seen, standard deviation [rad]
    correction: float  # t_c: a correction's duration [s]
    visual_delay: float  # t_v [s]
    shortfall: float = 0.0  # Of an error, that a correction leaves [1]

    @property
    def correcting(self) -> float:
        """From an error to the end of its correction [s]."""
        return self.visual_delay + self.correction

    @property
    def relative(self) -> float:
        """What a correction leaves of an error: what it falls short, and its own noise [1]."""
        return float(np.hypot(self.shortfall, self.noise / self.correction))


@dataclass(frozen=True)
class Aim:
    """What is decided before a movement."""

    duration: float  # Of the primary movement [s]
    spread: float  # Of where it ends, standard deviation [rad]
    dead_zone: float  # Error that is left as it is [rad]


def dead_zone(primary: np.ndarray | float, accuracy: Accuracy, price: float, discount: float) -> np.ndarray:
    """Largest errors that are left after primary movements [s] of shape (n,) or (): shape as theirs [rad]; price is w
    [1/rad^2], discount [1/s]."""
    r, more = accuracy.resolution, accuracy.correcting
    gained = max(1.0 / price - r**2, 0.0)
    return np.sqrt(r**2 + gained * discount * more / (1.0 + discount * (primary + more)))


def choose_aim(
    amplitude: float,
    dynamics: tuple[float, float, float],
    reward: float,
    accuracy: Accuracy,
    price: float,
    choice: Mapping,
    width: float,
) -> Aim:
    """Duration, spread and dead zone over an amplitude [rad] of a person to whom arriving is worth a reward [J] and a
    squared error a price, of that [1/rad^2]; dynamics, choice and width as `movement_choice.utility` takes them."""
    grid = duration_grid(choice["shortest"], choice["longest"])
    took = effort(grid, amplitude, dynamics, choice, width)
    spread = accuracy.noise * abs(amplitude) / grid
    zone = dead_zone(grid, accuracy, price, choice["discount"])
    missed, inside = _normal(zone, spread)
    # What a correction leaves of the errors that were beyond the zone, and how many more that asks for.
    left = np.sqrt(accuracy.resolution**2 + accuracy.relative**2 * (spread**2 - inside) / np.maximum(missed, 1e-12))
    again, within = _normal(zone, left)
    corrections = missed / np.maximum(1.0 - again, 0.1)
    loss = inside + missed * within / np.maximum(1.0 - again, 0.1)
    value = (1.0 - took / reward - price * loss) / (
        1.0 + choice["discount"] * (grid + corrections * accuracy.correcting)
    )
    best = best_duration(grid, value)
    return Aim(
        best,
        accuracy.noise * abs(amplitude) / best,
        float(dead_zone(best, accuracy, price, choice["discount"])),
    )


def _normal(zone: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of errors with a standard deviation, the share beyond a zone and the mean square of those within, counted over
    all; each shape (n,)."""
    u = zone / spread
    within = erf(u / np.sqrt(2.0))
    return 1.0 - within, spread**2 * (within - 2.0 * u * np.exp(-0.5 * u**2) / np.sqrt(2.0 * np.pi))
