r"""Torque of the strap between wearer and orthosis, from either body's own balance.

With theta_e the orthosis's and theta_k the limb's angle, and the strap's torque positive on the orthosis,

.. math::
    \tau_c &= I_e\ddot\theta_e + b_e\dot\theta_e + m_e g l_e\sin\theta_e + \tau_f\,\mathrm{sgn}\,\dot\theta_e - \tau_e\\
    \tau_c &= \tau_k - I_k\ddot\theta_k - b_k\dot\theta_k - m_{sh} g l_{sh}\sin\theta_k

The first needs what the actuator measures and the orthosis's own parameters; the second needs the muscles' torque and
the limb's. Each comes with its derivatives with respect to those parameters, so that their uncertainty can be carried
on. In the sum of both, the thesis's equation 2.2, the strap's torque cancels.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...signals.filters import central_difference, runs, zero_phase_lowpass

LOWPASS = 15.0
"""Zero-phase low-pass ahead of the derivatives, on every term alike [Hz]; a swing has next to nothing above 6 Hz."""
ORDER = 2
SLOW = 0.05
"""Below this [rad/s] the side on which dry friction acts is not known: the joint may stick."""


NEGLIGIBLE = 0.02
"""Dry friction smaller than this share of the strap's torque (RMS) is not worth leaving samples out for."""


@dataclass(frozen=True, eq=False)
class StrappedSwing:
    """One trial of a wearer who swings the lower leg, whoever recorded it."""

    name: str
    split: str  # ``"fitted"`` or ``"heldout"``
    # time, position, torque: (n,) Of the actuator, evenly sampled: [s], the orthosis's angle [rad], the spring's torque
    # on it [N m]
    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray
    imu_time: np.ndarray  # imu_time, imu_angle: (m,) The limb's angle by its IMU, on the IMU's own clock: [s], [rad]
    imu_angle: np.ndarray
    knee_torque: np.ndarray | None = None  # (n,) Of the muscles, as EMG tells it, at the actuator's times [N m]

    @property
    def fs(self) -> float:
        """Sampling rate of the actuator [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


@dataclass(frozen=True, eq=False)
class Orthosis:
    """What was identified of the orthosis alone."""

    inertia: float  # inertia, viscous, gravity, coulomb: [kg m^2], [N m s/rad], [N m], [N m]
    viscous: float
    gravity: float
    coulomb: float = 0.0
    # (4, 4) In this order, SI; zeros where nothing is known of it
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((4, 4)), repr=False)
    zero: float = 0.0  # zero, offset: Angle at which it hangs [rad], and what the spring shows without load [N m]
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Limb:
    """Shank and foot: inertia about the knee [kg m^2], gravity [N m], viscous damping [N m s/rad], the covariance of
    these three, shape (3, 3), and the angle at which they hang [rad]."""

    inertia: float
    gravity: float
    viscous: float = 0.0
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)), repr=False)
    zero: float = 0.0


@dataclass(frozen=True, eq=False)
class StrapTorque:
    """The strap's torque in one trial."""

    torque: np.ndarray  # (n,) On the orthosis, at the actuator's times [N m]
    sensitivity: np.ndarray  # (n, p) Its derivatives with respect to the body's parameters
    covariance: np.ndarray  # (p, p) Of these parameters
    known: np.ndarray  # (n,) False where the joint may stick, and dry friction is anything up to its level


def from_orthosis(swing: StrappedSwing, orthosis: Orthosis) -> StrapTorque:
    """The strap's torque by the orthosis's balance."""
    fs = swing.fs
    raw_velocity = central_difference(zero_phase_lowpass(swing.position, LOWPASS, ORDER, fs), fs)
    moving = np.abs(raw_velocity) > SLOW
    dry = _direction(raw_velocity, moving)
    angle, torque, dry = zero_phase_lowpass(np.column_stack([swing.position, swing.torque, dry]), LOWPASS, ORDER, fs).T
    velocity = central_difference(angle, fs)
    columns = np.column_stack(
        [central_difference(velocity, fs), velocity, np.sin(angle - orthosis.zero), dry],
    )
    values = np.array([orthosis.inertia, orthosis.viscous, orthosis.gravity, orthosis.coulomb])
    strap = columns @ values - (torque - orthosis.offset)
    matters = orthosis.coulomb > NEGLIGIBLE * float(np.std(strap))
    return StrapTorque(strap, columns, orthosis.covariance, moving if matters else np.ones(len(angle), bool))


def from_limb(swing: StrappedSwing, limb: Limb, limb_angle: np.ndarray) -> StrapTorque:
    """The strap's torque by the limb's balance. `limb_angle` (n,) [rad]."""
    if swing.knee_torque is None:
        raise ValueError(f"{swing.name}: found no knee torque, expected the muscles' for the limb's balance")
    fs = swing.fs
    angle, torque = zero_phase_lowpass(np.column_stack([limb_angle, swing.knee_torque]), LOWPASS, ORDER, fs).T
    velocity = central_difference(angle, fs)
    columns = -np.column_stack([central_difference(velocity, fs), np.sin(angle - limb.zero), velocity])
    values = np.array([limb.inertia, limb.gravity, limb.viscous])
    return StrapTorque(torque + columns @ values, columns, limb.covariance, np.ones(len(angle), bool))


def _direction(velocity: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Sign of the motion; through a reversal a straight line, because friction passes from one side to the other."""
    sign = np.sign(velocity)
    if not moving.any():
        return np.zeros_like(sign)
    at = np.arange(len(sign), dtype=float)
    filled = sign.copy()
    for run in runs(~moving):
        filled[run] = np.interp(at[run], at[moving], sign[moving])
    return filled
