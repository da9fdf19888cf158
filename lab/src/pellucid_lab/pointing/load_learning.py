r"""How a person's expectation of a load on the arm adapts from movement to movement.

The person feels the load as the torque beyond what the arm itself needs. The model of the load is

.. math::
   \tau_c \approx J a + b v + C \tanh(v / w) + g_s \sin q + g_c \cos q,

Its five parameters are estimated from a movement with the previous expectation as prior, and a share of the change is
adopted: trial-by-trial adaptation of an internal model [1]_. Without a load the expectation does not change.

.. [1] R. Shadmehr, M. A. Smith, J. W. Krakauer, "Error correction, sensory prediction, and adaptation in motor
   control", Annual Review of Neuroscience 33, 2010.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def load_regressor(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, width: float) -> np.ndarray:
    """Return the torque of a load per unit of each of its parameters along a motion, shape (n, 5).

    They are inertia [kg m^2], viscous friction [N m s/rad], Coulomb friction, and gravity's sine and cosine [N m].
    Position [rad], velocity [rad/s] and acceleration [rad/s^2] have shape (n,). The sign of friction changes smoothly
    over the velocity `width` [rad/s].
    """
    return np.column_stack(
        [acceleration, velocity, np.tanh(velocity / width), np.sin(position), np.cos(position)],
    )


def update_expected_load(
    expected: np.ndarray, regressor: np.ndarray, torque: np.ndarray, learning: Mapping
) -> np.ndarray:
    """Return the load that a person expects after a movement, shape (5,) in the order of `load_regressor`.

    Parameters
    ----------
    expected : ndarray
        Load that was expected before the movement, shape (5,).
    regressor : ndarray
        `load_regressor` of the movement, shape (n, 5).
    torque : ndarray
        Torque that the load took during the movement, shape (n,) [N*m].
    learning : mapping
        Table ``[learning]`` of a rig's file: ``felt_noise`` [N*m], ``trust``, the standard deviations of the prior, and
        ``rate``, the share of the change that is adopted.
    """
    noise, prior_sd = learning["felt_noise"], np.asarray(learning["trust"], float)
    residual = torque - regressor @ expected
    information = regressor.T @ regressor / noise**2 + np.diag(1.0 / prior_sd**2)
    change = np.linalg.solve(information, regressor.T @ residual / noise**2)
    return expected + learning["rate"] * change
