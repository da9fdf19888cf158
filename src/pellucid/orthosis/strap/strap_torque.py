r"""Torque of the strap between wearer and orthosis, from the dynamic balance of either body.

With theta_e the orthosis's angle, theta_k the limb's angle, and the strap's torque positive on the orthosis,

.. math::
    \tau_c &= I_e\ddot\theta_e + b_e\dot\theta_e + m_e g l_e\sin\theta_e + \tau_f\,\mathrm{sgn}\,\dot\theta_e - \tau_e\\
    \tau_c &= \tau_k - I_k\ddot\theta_k - b_k\dot\theta_k - m_{sh} g l_{sh}\sin\theta_k

The first balance needs the actuator's measurements and the orthosis's parameters. The second needs the muscles' torque
and the limb's parameters. Each torque comes with its derivatives with respect to those parameters, so that their
uncertainty propagates. In the sum of both balances, the thesis's equation 2.2, the strap's torque cancels.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...numerics.filters import central_difference, runs, zero_phase_lowpass

DERIVATIVE_LOWPASS_HZ = 15.0
"""Cut-off of the zero-phase low-pass before differentiation, on every term [Hz]. A swing has almost no power above 6
Hz."""

DERIVATIVE_LOWPASS_ORDER = 2
"""Order of one pass of that filter."""

MIN_FRICTION_SPEED = 0.05
"""Below this speed the joint may stick, so the sign of dry friction is unknown [rad/s]."""

MIN_FRICTION_SHARE = 0.02
"""Slow samples are excluded only if dry friction exceeds this share of the strap's torque (RMS)."""


@dataclass(frozen=True, eq=False)
class StrappedSwing:
    """One trial in which a wearer swings the lower leg, recorded or simulated."""

    name: str
    split: str  # ``"fitted"`` or ``"heldout"``
    # (n,) the actuator's evenly sampled times [s], the orthosis's angle [rad], and the spring's torque on it [N m]
    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray
    imu_time: np.ndarray  # (m,) times of the IMU, on its own clock [s]
    imu_angle: np.ndarray  # (m,) limb angle by the IMU [rad]
    knee_torque: np.ndarray | None = (
        None  # (n,) torque of the muscles estimated from EMG, at the actuator's times [N m]
    )

    @property
    def fs(self) -> float:
        """Sampling rate of the actuator [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


@dataclass(frozen=True, eq=False)
class Orthosis:
    """Parameters of the orthosis without a wearer."""

    inertia: float  # [kg m^2]
    viscous: float  # viscous friction [N m s/rad]
    gravity: float  # gravity torque at 90 degrees [N m]
    coulomb: float = 0.0  # Coulomb friction [N m]
    # (4, 4) covariance of the four parameters in this order, SI; zeros where it is unknown
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((4, 4)), repr=False)
    zero: float = 0.0  # angle at which the orthosis hangs [rad]
    offset: float = 0.0  # reading of the spring without load [N m]


@dataclass(frozen=True, eq=False)
class Limb:
    """Parameters of shank and foot."""

    inertia: float  # inertia about the knee [kg m^2]
    gravity: float  # gravity torque at 90 degrees [N m]
    viscous: float = 0.0  # viscous damping of the knee [N m s/rad]
    # (3, 3) covariance of the three parameters in this order, SI
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)), repr=False)
    zero: float = 0.0  # angle at which the limb hangs [rad]


@dataclass(frozen=True, eq=False)
class StrapTorque:
    """The strap's torque in one trial, with its uncertainty."""

    torque: np.ndarray  # (n,) torque on the orthosis, at the actuator's times [N m]
    sensitivity: np.ndarray  # (n, p) derivatives of the torque with respect to the body's parameters
    covariance: np.ndarray  # (p, p) covariance of the body's parameters
    known: np.ndarray  # (n,) False where the joint may stick, so that dry friction is unknown up to its level


def from_orthosis(swing: StrappedSwing, orthosis: Orthosis) -> StrapTorque:
    """Return the strap's torque from the balance of the orthosis."""
    fs = swing.fs
    raw_velocity = central_difference(
        zero_phase_lowpass(swing.position, DERIVATIVE_LOWPASS_HZ, DERIVATIVE_LOWPASS_ORDER, fs), fs
    )
    moving = np.abs(raw_velocity) > MIN_FRICTION_SPEED
    dry = _direction(raw_velocity, moving)
    angle, torque, dry = zero_phase_lowpass(
        np.column_stack([swing.position, swing.torque, dry]), DERIVATIVE_LOWPASS_HZ, DERIVATIVE_LOWPASS_ORDER, fs
    ).T
    velocity = central_difference(angle, fs)
    columns = np.column_stack(
        [central_difference(velocity, fs), velocity, np.sin(angle - orthosis.zero), dry],
    )
    values = np.array([orthosis.inertia, orthosis.viscous, orthosis.gravity, orthosis.coulomb])
    strap = columns @ values - (torque - orthosis.offset)
    matters = orthosis.coulomb > MIN_FRICTION_SHARE * float(np.std(strap))
    return StrapTorque(strap, columns, orthosis.covariance, moving if matters else np.ones(len(angle), bool))


def from_limb(swing: StrappedSwing, limb: Limb, limb_angle: np.ndarray) -> StrapTorque:
    """Return the strap's torque from the balance of the limb; `limb_angle`, shape (n,) [rad]."""
    if swing.knee_torque is None:
        raise ValueError(f"{swing.name}: found no knee torque, expected the muscles' for the limb's balance")
    fs = swing.fs
    angle, torque = zero_phase_lowpass(
        np.column_stack([limb_angle, swing.knee_torque]), DERIVATIVE_LOWPASS_HZ, DERIVATIVE_LOWPASS_ORDER, fs
    ).T
    velocity = central_difference(angle, fs)
    columns = -np.column_stack([central_difference(velocity, fs), np.sin(angle - limb.zero), velocity])
    values = np.array([limb.inertia, limb.gravity, limb.viscous])
    return StrapTorque(torque + columns @ values, columns, limb.covariance, np.ones(len(angle), bool))


def _direction(velocity: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Return the sign of the motion, interpolated linearly through reversals, where friction changes its side."""
    sign = np.sign(velocity)
    if not moving.any():
        return np.zeros_like(sign)
    at = np.arange(len(sign), dtype=float)
    filled = sign.copy()
    for run in runs(~moving):
        filled[run] = np.interp(at[run], at[moving], sign[moving])
    return filled
