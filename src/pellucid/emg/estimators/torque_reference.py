"""Torque that a wearer applies to an orthosis, from the orthosis's own torque and the inertia and weight of both.

With limb and orthosis moving as one, the strap's torque cancels between them:

    tau_k = (I_e + I_k) q'' + (b_e + b_k) q' + G_e sin(q - z_e) + G_k sin(q - z_k) - tau_e

with z the angles at which they hang. Dry friction is left out, because in a hold it can take any value up to its level.
The wearer counteracts: when holding still at q = 0, tau_k = -tau_e.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...files.recording import Recording
from ...numerics.filters import central_difference, zero_phase_lowpass


@dataclass(frozen=True)
class MovedBody:
    """A body that moves about the joint: limb and orthosis together, or one of them."""

    gravity: float  # Torque of its weight at 90 deg from the angle at which it hangs [N m]
    inertia: float = 0.0  # Moment of inertia [kg m²]
    viscous: float = 0.0  # Viscous friction [N m s/rad]
    zero: float = 0.0  # Angle at which it hangs [rad]
    offset: float = 0.0  # Torque that the spring shows without load [N m]

    def __add__(self, other: MovedBody) -> MovedBody:
        # The sum of two sines of the same angle is one sine.
        pull = self.gravity * np.exp(1j * self.zero) + other.gravity * np.exp(1j * other.zero)
        return MovedBody(
            float(np.abs(pull)),
            self.inertia + other.inertia,
            self.viscous + other.viscous,
            float(np.angle(pull)),
            self.offset + other.offset,
        )

    @property
    def words(self) -> str:
        """How the body is modelled, as a sentence."""
        return (
            "limb and orthosis are taken for one body, since no card of the strap is there: a strap that yields adds "
            "what the limb weighs at another angle."
        )

    def wearer_torque(self, recording: Recording, lowpass: float) -> np.ndarray:
        """Return the wearer's torque about the joint, shape (n,) [N m], low-passed at `lowpass` [Hz]."""
        return human_torque(recording["position"], recording["torque"], self, lowpass=lowpass, fs=recording.fs)


def human_torque(
    position: np.ndarray, orthosis_torque: np.ndarray, body: MovedBody, *, lowpass: float, fs: float
) -> np.ndarray:
    """Return the wearer's torque about the joint, shape (n,) [N m], positive along `position`.

    `position` [rad] is 0 where the limb hangs. `orthosis_torque` is the torque of the spring on the orthosis [N m].
    `body` is limb and orthosis together. Both signals, shape (n,) at `fs` [Hz], pass a zero-phase low-pass of order 4
    at `lowpass` [Hz].
    """
    q = zero_phase_lowpass(np.asarray(position, float), lowpass, 4, fs)
    v = central_difference(q, fs)
    own = zero_phase_lowpass(np.asarray(orthosis_torque, float), lowpass, 4, fs)
    return (
        body.inertia * central_difference(v, fs)
        + body.viscous * v
        + body.gravity * np.sin(q - body.zero)
        - own
        + body.offset
    )
