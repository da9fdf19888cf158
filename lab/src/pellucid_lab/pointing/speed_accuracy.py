r"""The speed-accuracy trade-off of pointing: one weight, the price of a remaining error, sets both speed and precision.

A primary movement of duration :math:`T` over an amplitude :math:`A` ends with an error whose standard deviation is that
proportional to its mean speed [1]_, :math:`\sigma = kA/T`. A person who sees an error :math:`e` may leave it or correct
it. A correction takes the visual delay and a movement, :math:`C = t_v + t_c`. Three errors remain after it: the
resolution of the eye, :math:`r`; a share :math:`s` of the error; and the noise of the correction itself. Together they
are :math:`r'^2 = r^2 + (s^2 + k^2/t_c^2)\,e^2`. With a reward of 1 for arriving, the price :math:`w` of a squared error
and the discount rate :math:`\gamma`, dead zone and duration follow from the same utility [2]_:

.. math::
   z^2 &= r^2 + \left(\frac1w - r^2\right)\frac{\gamma C}{1 + \gamma (T + C)} \\
   U(T) &= \frac{1 - E(T)/\alpha - w L}{1 + \gamma\,(T + nC)}, \qquad n = \frac{p_1}{1 - p_2}

Here :math:`p_1` and :math:`p_2` are the probabilities to miss the dead zone :math:`z` after the primary movement and
after a correction, :math:`n` is the expected number of corrections, :math:`L` the mean square of the remaining error,
:math:`E` the effort and :math:`\alpha` the reward [J].

An error inside the dead zone costs less than the time of its correction. The duration of the primary movement is the
one of largest utility. With a price of zero this is the model of `movement_choice`. With a high price movements are
slow and corrected as finely as the eye resolves: the trade-off of Fitts's task without a target's width [3]_.

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
    """The limits of a person's precision, which do not depend on the price of an error."""

    noise: float  # k: standard deviation of a primary movement's end over its mean speed [s]
    resolution: float  # r: standard deviation of the error that the eye does not resolve [rad]
    correction: float  # t_c: duration of a correction [s]
    visual_delay: float  # t_v: time from an error to the start of its correction [s]
    shortfall: float = 0.0  # s: share of an error that a correction leaves [1]

    @property
    def correction_time(self) -> float:
        """Return C, the time from an error to the end of its correction [s]."""
        return self.visual_delay + self.correction

    @property
    def remaining_share(self) -> float:
        """Return the remaining error of a correction over the error before it, from shortfall and noise [1]."""
        return float(np.hypot(self.shortfall, self.noise / self.correction))


@dataclass(frozen=True)
class Aim:
    """The decisions that a person makes before a movement, and the scatter that follows from them."""

    duration: float  # duration of the primary movement [s]
    spread: float  # standard deviation of the place where the primary movement ends [rad]
    dead_zone: float  # z: largest error that is not corrected [rad]


def dead_zone(primary: np.ndarray | float, accuracy: Accuracy, price: float, discount: float) -> np.ndarray:
    """Return the largest error that is not worth a correction, z, after primary movements of duration `primary` [rad].

    `primary` has shape (n,) or () [s], as the result has; `price` is w [1/rad^2], `discount` is gamma [1/s].
    """
    resolution, correction_time = accuracy.resolution, accuracy.correction_time
    gain = max(1.0 / price - resolution**2, 0.0)
    return np.sqrt(resolution**2 + gain * discount * correction_time / (1.0 + discount * (primary + correction_time)))


def choose_aim(
    amplitude: float,
    dynamics: tuple[float, float, float],
    reward: float,
    accuracy: Accuracy,
    price: float,
    choice: Mapping,
    width: float,
) -> Aim:
    """Return the aim of largest utility over an amplitude [rad].

    `reward` is the value of arriving [J], and `price` that of a squared error over the reward [1/rad^2]; `dynamics`,
    `choice` and `width` are as in `movement_choice.utility`.
    """
    grid = duration_grid(choice["shortest"], choice["longest"])
    cost = effort(grid, amplitude, dynamics, choice, width)
    spread = accuracy.noise * abs(amplitude) / grid
    zone = dead_zone(grid, accuracy, price, choice["discount"])
    missed, inside = _split_normal_errors(zone, spread)
    # Standard deviation of errors after one correction, and the share of these that needs another one.
    remaining = np.sqrt(
        accuracy.resolution**2 + accuracy.remaining_share**2 * (spread**2 - inside) / np.maximum(missed, 1e-12)
    )
    missed_again, inside_again = _split_normal_errors(zone, remaining)
    corrections = missed / np.maximum(1.0 - missed_again, 0.1)
    loss = inside + missed * inside_again / np.maximum(1.0 - missed_again, 0.1)
    value = (1.0 - cost / reward - price * loss) / (
        1.0 + choice["discount"] * (grid + corrections * accuracy.correction_time)
    )
    best = best_duration(grid, value)
    return Aim(
        best,
        accuracy.noise * abs(amplitude) / best,
        float(dead_zone(best, accuracy, price, choice["discount"])),
    )


def _split_normal_errors(zone: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split normal errors at a dead zone: return the share beyond it, and the mean square that those inside contribute.

    `spread` is the standard deviation of the errors; the mean is over all errors, so that those beyond count as zero.
    All arrays have shape (n,).
    """
    u = zone / spread
    within = erf(u / np.sqrt(2.0))
    return 1.0 - within, spread**2 * (within - 2.0 * u * np.exp(-0.5 * u**2) / np.sqrt(2.0 * np.pi))
