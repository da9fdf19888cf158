r"""EMG-assisted muscles: activations near the recorded ones with which the torque follows a measured one.

At every sample, with F_m(a) the force of a calibrated muscle at the length and speed that it has, r its moment arms, E
the muscles with EMG and U those without,

.. math::
   \min_{0 \le a \le 1} \; \sum_j \frac{(\tau_j - \tau^0_j - \sum_m r_{jm} F_m(a_m))^2}{s_j^2}
   + \kappa \sum_{m \in E} (a_m - a^{emg}_m)^2 + \varepsilon \sum_{m \in U} a_m^2

with :math:`\tau^0` the joint's own tissue and s the standard deviation of the torque that was fitted. :math:`\kappa` is
the trust in EMG: without end it is EMG-driven, at 0 with every muscle in U it is static optimisation [1]_, between them
EMG-assisted [2]_. What is found is told the torque: that its torque is near says nothing of it.

A muscle's force is straight in its activation but for how its optimal length moves: a few linearised problems, each
solved exactly. Their dual has one unknown a joint, :math:`\lambda_j`, with :math:`a_m = \mathrm{clip}(c_m + \sum_j
G_{jm}\lambda_j/w_m, 0, 1)`; it is convex, and Newton's steps on it end on the solution.

.. [1] R. D. Crowninshield, R. A. Brand, "A physiologically based criterion of muscle force prediction in locomotion",
   J. Biomechanics 14, 1981.
.. [2] C. Pizzolato et al., "CEINMS: a toolbox to investigate the influence of different neural control solutions on the
   prediction of muscle excitation and joint moments during dynamic motor tasks", J. Biomechanics 48, 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .. import _core
from ..fit.muscles.muscle_calibration import MuscleSamples
from ..models.hill import MUSCLE_QUANTITIES, HillMuscle

LINEARISED = 4
"""Times that forces are linearised about the activations found."""

NEWTON = 60
"""Steps of the dual, at most."""

NUDGE = 1e-4
"""Of an activation, for the slope of its force."""

AT_ONCE = {"delay": 0.0, "time_constant_1": 1e-9, "time_constant_2": 1e-9, "shape": 0.0}
"""Of a muscle whose activation is its excitation."""


@dataclass(frozen=True, eq=False)
class AssistedMuscles:
    """Calibrated muscles over one recording, and what is not theirs of its torque."""

    muscles: tuple[HillMuscle, ...]
    samples: MuscleSamples = field(repr=False)
    tissue: np.ndarray = field(repr=False)  # (j, n) Torque of the joints' own tissue [N m]
    scale: np.ndarray  # (j,) Of torques: a standard deviation of what was fitted [N m]

    @property
    def arms(self) -> np.ndarray:
        """Moment arms, (j, m, n) [m]."""
        return self.samples.data.moment_arm.reshape(-1, len(self.muscles), self.tissue.shape[1])

    @property
    def recorded(self) -> np.ndarray:
        """Activation that each muscle's EMG gives it, (m, n)."""
        table = np.array([muscle.vector() for muscle in self.muscles])
        data = self.samples.data
        return _core.hill_states(table, *data.arrays[:3], period=data.period, starts=data.starts)[0]

    def force(self, activation: np.ndarray) -> np.ndarray:
        """Force of each muscle at activations (m, n) [N]."""
        table = np.array([muscle.vector() for muscle in self.muscles])
        for quantity, value in AT_ONCE.items():
            table[:, MUSCLE_QUANTITIES.index(quantity)] = value
        data = self.samples.data
        held = np.ascontiguousarray(activation)
        return _core.hill_states(table, held, data.length, data.rate, period=data.period, starts=data.starts)[1]

    def torque(self, activation: np.ndarray) -> np.ndarray:
        """Of each joint at activations (m, n), (j, n) [N m]."""
        return self.tissue + np.einsum("jmn,mn->jn", self.arms, self.force(activation))

    def assisted(self, unrecorded: Sequence[int] = (), *, trust: float, effort: float) -> np.ndarray:
        """Activations, (m, n), with which the torque follows; of muscles `unrecorded` their EMG is not looked at."""
        own = np.ones(len(self.muscles), bool)
        own[list(unrecorded)] = False
        centre = np.where(own[:, None], self.recorded, 0.0)
        weight = np.where(own, trust, effort)
        wanted = self.samples.torque.reshape(self.tissue.shape)
        a = centre
        for _ in range(LINEARISED):
            here = np.clip(a, 0.0, 1.0 - NUDGE)
            force = self.force(here)
            slope = (self.force(here + NUDGE) - force) / NUDGE
            gain = self.arms * slope
            rest = self.tissue + np.einsum("jmn,mn->jn", self.arms, force - slope * here)
            a = bounded_quadratic(gain, wanted - rest, centre, weight, self.scale)
        return a


def bounded_quadratic(
    gain: np.ndarray, wanted: np.ndarray, centre: np.ndarray, weight: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """Of every sample min sum_j ((wanted - gain a)_j / scale_j)^2 + sum_m weight_m (a_m - centre_m)^2, 0 <= a <= 1.

    `gain` (j, m, n), `wanted` (j, n), `centre` (m, n), `weight` (m,) above 0, `scale` (j,); gives (m, n).
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
    for _ in range(NEWTON):
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
