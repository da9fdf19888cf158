r"""What a person comes to expect of a load that is strapped on, movement by movement.

The load is felt as the torque that the arm does not need for itself. What a movement shows of it,

.. math::
   \tau_c \approx J a + b v + C \tanh(v / w) + g_s \sin q + g_c \cos q,

is weighed against what was expected before, and a share of the difference is taken over: trial-by-trial adaptation of
an internal model [1]_. Without a load there is nothing to feel, and nothing is learnt.

.. [1] R. Shadmehr, M. A. Smith, J. W. Krakauer, "Error correction, sensory prediction, and adaptation in motor
   control", Annual Review of Neuroscience 33, 2010.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

LOAD_NAMES = ("inertia", "viscous", "coulomb", "gravity_sine", "gravity_cosine")
"""What is expected, in the order of every array: kg*m^2, N*m*s/rad, N*m, N*m, N*m."""


def load_regressor(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, width: float) -> np.ndarray:
    """Torque of a load per unit of each of `LOAD_NAMES`, shape (n, 5), of an arm that moves, each shape (n,) [rad],
    [rad/s], [rad/s^2]; friction changes its sign over a width [rad/s]."""
    return np.column_stack(
        [acceleration, velocity, np.tanh(velocity / width), np.sin(position), np.cos(position)],
    )


def update_expected_load(
    expected: np.ndarray, columns: np.ndarray, torque: np.ndarray, learning: Mapping
) -> np.ndarray:
    """What is expected after a movement, shape (5,) in the order of `LOAD_NAMES`, from what was before it, columns of
    `load_regressor`, and the torque that the load took, shape (n,) [N*m]."""
    noise, trust = learning["felt_noise"], np.asarray(learning["trust"], float)
    surprise = torque - columns @ expected
    information = columns.T @ columns / noise**2 + np.diag(1.0 / trust**2)
    shown = np.linalg.solve(information, columns.T @ surprise / noise**2)
    return expected + learning["rate"] * shown
