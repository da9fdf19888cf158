r"""The torque that a wearer gives against an orthosis through straps, which yield.

Against 10 N m a strap turns by tens of degrees, and the limb's weight acts at the limb's own angle. The orthosis's
balance tells the strap's torque, the strap tells how far the limb is ahead, and the limb's balance gives the torque:

.. math::
    \theta_k = \theta_e + D(\tau_c), \qquad
    \tau_k = I_k\ddot\theta_k + b_k\dot\theta_k + m_{sh} g l_{sh}\sin\theta_k + \tau_c
"""

from __future__ import annotations

import numpy as np

from ..fit.strap.coupled_impedance import mismatch
from ..fit.strap.strap_torque import Limb, Orthosis, StrappedSwing, from_orthosis
from ..signals.filters import central_difference, zero_phase_lowpass


def strapped_torque(
    time: np.ndarray,
    position: np.ndarray,
    torque: np.ndarray,
    *,
    orthosis: Orthosis,
    limb: Limb,
    stiffness: float,
    damping: float,
    lowpass: float,
) -> np.ndarray:
    """Torque of the wearer about the joint. `time`, `position`, `torque` (n,) [s], [rad], [N m]; `stiffness`,
    `damping` [N m/rad], [N m s/rad]; `lowpass` [Hz]; gives (n,) [N m]."""
    nowhere = np.zeros(0)
    trial = StrappedSwing("", "fitted", time, position, torque, nowhere, nowhere)
    strap = from_orthosis(trial, orthosis).torque
    ahead = mismatch(strap, trial.fs, stiffness=stiffness, damping=damping)
    angle, through = zero_phase_lowpass(np.column_stack([position + ahead, strap]), lowpass, 4, trial.fs).T
    velocity = central_difference(angle, trial.fs)
    own = limb.inertia * central_difference(velocity, trial.fs) + limb.viscous * velocity
    return own + limb.gravity * np.sin(angle - limb.zero) + through
