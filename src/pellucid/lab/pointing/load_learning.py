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

LOADS = ("inertia", "viscous", "coulomb", "gravity_sine", "gravity_cosine")
"""What is expected, in the order of every array: kg*m^2, N*m*s/rad, N*m, N*m, N*m."""


def felt(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, width: float) -> np.ndarray:
    """Torque of a load per unit of each of `LOADS`.

    Parameters
    ----------
    position, velocity, acceleration : ndarray, shape (n,)
        Of the arm [rad], [rad/s], [rad/s^2].
    width : float
        Over which friction changes its sign [rad/s].

    Returns
    -------
    ndarray, shape (n, 5)
    """
    return np.column_stack(
        [acceleration, velocity, np.tanh(velocity / width), np.sin(position), np.cos(position)],
    )


def learnt(expected: np.ndarray, columns: np.ndarray, torque: np.ndarray, learning: Mapping) -> np.ndarray:
    """What is expected after a movement.

    Parameters
    ----------
    expected : ndarray, shape (5,)
        Before it, in the order of `LOADS`.
    columns : ndarray, shape (n, 5)
        From `felt`.
    torque : ndarray, shape (n,)
        That the load took [N*m].
    learning : mapping
        rate [1], trust, shape (5,), in the units of `LOADS`, and felt_noise [N*m].

    Returns
    -------
    ndarray, shape (5,)
    """
    noise, trust = learning["felt_noise"], np.asarray(learning["trust"], float)
    surprise = torque - columns @ expected
    information = columns.T @ columns / noise**2 + np.diag(1.0 / trust**2)
    shown = np.linalg.solve(information, columns.T @ surprise / noise**2)
    return expected + learning["rate"] * shown
