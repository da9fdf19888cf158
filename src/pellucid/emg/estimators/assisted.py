r"""EMG-assisted muscles: activations near the recorded ones that reproduce a measured torque.

At every sample, with F_m(a) the force of a calibrated muscle at the length and speed that it has, r its moment arms, E
the muscles with EMG and U those without,

.. math::
   \min_{0 \le a \le 1} \; \sum_j \frac{(\tau_j - \tau^0_j - \sum_m r_{jm} F_m(a_m))^2}{s_j^2}
   + \kappa \sum_{m \in E} (a_m - a^{emg}_m)^2 + \varepsilon \sum_{m \in U} a_m^2

with :math:`\tau^0` the joint's own tissue and s the standard deviation of the torque that was fitted. :math:`\kappa` is
the trust in EMG. Infinite trust makes the method EMG-driven; with no trust and every muscle in U it is static
optimisation [1]_; between them it is EMG-assisted [2]_. The activations are found from the measured torque. That they
reproduce this torque is therefore no evidence for them.

A muscle's force is linear in its activation, except that its optimal length moves. The problem is therefore linearised
a few times, and each linear problem is solved exactly. Its dual has one unknown for each joint, :math:`\lambda_j`, with
:math:`a_m = \mathrm{clip}(c_m + \sum_j G_{jm}\lambda_j/w_m, 0, 1)`. The dual is convex, and Newton's method solves it.

.. [1] R. D. Crowninshield, R. A. Brand, "A physiologically based criterion of muscle force prediction in locomotion",
   J. Biomechanics 14, 1981.
.. [2] C. Pizzolato et al., "CEINMS: a toolbox to investigate the influence of different neural control solutions on the
   prediction of muscle excitation and joint moments during dynamic motor tasks", J. Biomechanics 48, 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ... import _core
from ..fit.muscle_calibration import MuscleSamples
from ..models.hill import MUSCLE_QUANTITIES, HillMuscle

LINEARISATION_COUNT = 4
"""Number of times that forces are linearised about the activations found so far.

Chosen by judgement; no measurement is recorded.
"""

MAX_NEWTON_STEPS = 60
"""Largest number of Newton steps on the dual problem. Chosen by judgement; no measurement is recorded."""

ACTIVATION_STEP = 1e-4
"""Difference of activations by which the slope of a muscle's force is computed [1].

Chosen by judgement; no measurement is recorded.
"""

INSTANT_ACTIVATION_DYNAMICS = {"delay": 0.0, "time_constant_1": 1e-9, "time_constant_2": 1e-9, "shape": 0.0}
"""Activation dynamics of a muscle whose activation equals its excitation."""


@dataclass(frozen=True, eq=False)
class AssistedMuscles:
    """Calibrated muscles over one recording, and the torque of the joints' own tissue there."""

    muscles: tuple[HillMuscle, ...]
    samples: MuscleSamples = field(repr=False)
    tissue: np.ndarray = field(repr=False)  # Torque of the joints' own tissue, shape (j, n) [N m]
    scale: np.ndarray  # Standard deviation of each joint's fitted torque, shape (j,) [N m]

    @property
    def arms(self) -> np.ndarray:
        """Moment arms, shape (j, m, n) [m]."""
        return self.samples.data.moment_arm.reshape(-1, len(self.muscles), self.tissue.shape[1])

    @property
    def recorded(self) -> np.ndarray:
        """Activation of each muscle by its own EMG, shape (m, n)."""
        table = np.array([muscle.vector() for muscle in self.muscles])
        data = self.samples.data
        return _core.hill_states(table, *data.arrays[:3], period=data.period, starts=data.starts)[0]

    def force(self, activation: np.ndarray) -> np.ndarray:
        """Return the force of each muscle at activations of shape (m, n), same shape [N]."""
        table = np.array([muscle.vector() for muscle in self.muscles])
        for quantity, value in INSTANT_ACTIVATION_DYNAMICS.items():
            table[:, MUSCLE_QUANTITIES.index(quantity)] = value
        data = self.samples.data
        held = np.ascontiguousarray(activation)
        return _core.hill_states(table, held, data.length, data.rate, period=data.period, starts=data.starts)[1]

    def torque(self, activation: np.ndarray) -> np.ndarray:
        """Return the torque of each joint at activations of shape (m, n), shape (j, n) [N m]."""
        return self.tissue + np.einsum("jmn,mn->jn", self.arms, self.force(activation))

    def find_activations(self, unrecorded: Sequence[int] = (), *, trust: float, effort: float) -> np.ndarray:
        """Return activations that reproduce the measured torque, shape (m, n).

        The EMG of muscles in `unrecorded` is ignored. `trust` weighs deviations from EMG, `effort` the activity of
        muscles without EMG.
        """
        own = np.ones(len(self.muscles), bool)
        own[list(unrecorded)] = False
        centre = np.where(own[:, None], self.recorded, 0.0)
        weight = np.where(own, trust, effort)
        wanted = self.samples.torque.reshape(self.tissue.shape)
        a = centre
        for _ in range(LINEARISATION_COUNT):
            here = np.clip(a, 0.0, 1.0 - ACTIVATION_STEP)
            force = self.force(here)
            slope = (self.force(here + ACTIVATION_STEP) - force) / ACTIVATION_STEP
            gain = self.arms * slope
            rest = self.tissue + np.einsum("jmn,mn->jn", self.arms, force - slope * here)
            a = minimise_bounded_quadratic(gain, wanted - rest, centre, weight, self.scale)
        return a


def minimise_bounded_quadratic(
    gain: np.ndarray, wanted: np.ndarray, centre: np.ndarray, weight: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """Return the minimiser a of a bounded quadratic cost, for every sample at once, shape (m, n).

    The cost is sum_j ((wanted - gain a)_j / scale_j)^2 + sum_m weight_m (a_m - centre_m)^2 with 0 <= a <= 1. Shapes:
    `gain` (j, m, n), `wanted` (j, n), `centre` (m, n), `weight` (m,) above 0, `scale` (j,).
    """
    g = gain * (1.0 / scale)[:, None, None]
    y = wanted / scale[:, None]
    w = weight[:, None]
    joints, count = y.shape

    def activation(dual: np.ndarray) -> np.ndarray:
        return np.clip(centre + np.einsum("jmn,jn->mn", g, dual) / w, 0.0, 1.0)

    def cost(dual: np.ndarray, a: np.ndarray) -> np.ndarray:
        pulled = np.sum(a * np.einsum("jmn,jn->mn", g, dual) - 0.5 * w * (a - centre) ** 2, axis=0)
        return 0.5 * np.sum(dual**2, axis=0) - np.sum(dual * y, axis=0) + pulled

    dual = np.zeros((joints, count))
    a = activation(dual)
    for _ in range(MAX_NEWTON_STEPS):
        slope = dual - y + np.einsum("jmn,mn->jn", g, a)
        if np.max(np.abs(slope), initial=0.0) < 1e-10:
            break
        free = ((a > 0.0) & (a < 1.0)) / w
        curve = np.eye(joints)[:, :, None] + np.einsum("jmn,mn,kmn->jkn", g, free, g)
        step = -np.linalg.solve(curve.transpose(2, 0, 1), slope.T[:, :, None])[:, :, 0].T
        now, falls = cost(dual, a), np.sum(slope * step, axis=0)
        size = np.ones(count)
        for _ in range(40):
            tried = activation(dual + size * step)
            worse = cost(dual + size * step, tried) > now + 1e-4 * size * falls + 1e-14 * (1.0 + np.abs(now))
            if not worse.any():
                break
            size = np.where(worse, 0.5 * size, size)
        dual = dual + size * step
        a = activation(dual)
    return a
