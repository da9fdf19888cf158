"""The torque that a wearer gives against an orthosis, from the orthosis's own torque and what both weigh.

With limb and orthosis moving as one, the strap's torque cancels between them:

    tau_k = (I_e + I_k) q'' + (b_e + b_k) q' + (G_e + G_k) sin q - tau_e

The wearer counteracts: holding still at q = 0, tau_k = -tau_e.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..signals.filters import central_difference, zero_phase_lowpass


@dataclass(frozen=True)
class MovedBody:
    """What is moved: limb and orthosis together, or one of them.

    Parameters
    ----------
    gravity : float
        Torque at 90 deg [N m].
    inertia : float
        [kg m²]
    viscous : float
        [N m s/rad]
    """

    gravity: float
    inertia: float = 0.0
    viscous: float = 0.0

    def __add__(self, other: MovedBody) -> MovedBody:
        return MovedBody(self.gravity + other.gravity, self.inertia + other.inertia, self.viscous + other.viscous)


def human_torque(
    position: np.ndarray, orthosis_torque: np.ndarray, body: MovedBody, *, lowpass: float, fs: float
) -> np.ndarray:
    """Torque of the wearer about the joint.

    Parameters
    ----------
    position : ndarray, shape (n,)
        Joint angle [rad]; 0 hangs along gravity.
    orthosis_torque : ndarray, shape (n,)
        Of its spring, on the orthosis, positive along the angle [N m].
    body : MovedBody
        Limb and orthosis together.
    lowpass, fs : float
        Cut-off of the zero-phase low-pass that both pass (order 4), and their rate [Hz].

    Returns
    -------
    ndarray, shape (n,)
        [N m], positive along the angle.
    """
    q = zero_phase_lowpass(np.asarray(position, float), lowpass, 4, fs)
    v = central_difference(q, fs)
    own = zero_phase_lowpass(np.asarray(orthosis_torque, float), lowpass, 4, fs)
    return body.inertia * central_difference(v, fs) + body.viscous * v + body.gravity * np.sin(q) - own
