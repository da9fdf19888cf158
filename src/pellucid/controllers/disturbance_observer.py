"""The strap's torque as a disturbance of the orthosis, from encoder and spring alone: a baseline without EMG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .coupling import Coupling, friction_slope
from .limits import Limits
from .stability import LinearSystem


@dataclass
class StrapTorqueObserver:
    """What must have acted on the orthosis besides spring, gravity and friction: its momentum observer.

    p' = tau_e - b v - G sin q - F tanh(v/w) + tau,  tau = a (I v - p): the strap's torque behind a low-pass of
    bandwidth a. The velocity is a difference of angles behind a low-pass, v' = c (dq/dt - v).

    Attributes
    ----------
    coupling : Coupling
        Of which only the orthosis is used.
    period : float
        [s].
    bandwidth, velocity_bandwidth : float
        a and c [rad/s].
    width : float
        w [rad/s].
    """

    coupling: Coupling
    period: float
    bandwidth: float = 40.0
    velocity_bandwidth: float = 120.0
    width: float = 0.05
    velocity: float = field(default=0.0, init=False)
    raw_velocity: float = field(default=0.0, init=False)
    torque: float = field(default=0.0, init=False)
    _momentum: float = field(default=0.0, init=False)
    _position: float | None = field(default=None, init=False)

    def step(self, position: float, torque: float) -> None:
        """One period. What is not finite leaves the observer where it is.

        Parameters
        ----------
        position, torque : float
            Encoder [rad] and spring [N m].
        """
        if not (np.isfinite(position) and np.isfinite(torque)):
            return
        m, before = self.coupling, position if self._position is None else self._position
        self._position = position
        self.raw_velocity = (position - before) / self.period
        self.velocity += self.velocity_bandwidth * self.period * (self.raw_velocity - self.velocity)
        friction = m.orthosis_viscous * self.velocity + m.coulomb * np.tanh(self.velocity / self.width)
        known = torque - friction - m.orthosis_gravity * np.sin(position)
        self._momentum += self.period * (known + self.torque)
        self.torque = float(self.bandwidth * (m.orthosis_inertia * self.velocity - self._momentum))

    def linear(self, slope: float) -> tuple[np.ndarray, np.ndarray]:
        """Near the hanging place, with friction as a viscous coefficient.

        Parameters
        ----------
        slope : float
            [N m s/rad].

        Returns
        -------
        following : ndarray, shape (4, 6)
            Next last angle, velocity, momentum and torque, by those states, the angle and the spring's torque.
        now : ndarray, shape (2, 6)
            Velocity and torque of this period, by the same.
        """
        m, (last, v, p, x, q, spring) = self.coupling, np.eye(6)
        v = v + self.velocity_bandwidth * ((q - last) - self.period * v)
        known = spring - (m.orthosis_viscous + slope) * v - m.orthosis_gravity * q
        p = p + self.period * (known + x)
        x = self.bandwidth * (m.orthosis_inertia * v - p)
        return np.array([q, v, p, x]), np.array([v, x])


@dataclass
class DisturbanceObserver:
    """Carries gravity and friction by model and follows the observed strap torque.

    u = G sin q + s_f (F + F_a) tanh(v/w) + gain tau. No EMG and no limb: it answers only once the strap already pulls.

    Attributes
    ----------
    coupling : Coupling
        Of which only the orthosis is used.
    period : float
        [s].
    gravity, friction : float
        Shares carried [1].
    gain : float
        On the observed strap torque [1].
    bandwidth : float
        Of the observer [rad/s].
    assist_width : float
        w [rad/s].
    limits : Limits
        Of the gate.
    """

    coupling: Coupling
    period: float
    gravity: float = 0.8
    friction: float = 0.5
    gain: float = 1.0
    bandwidth: float = 40.0
    assist_width: float = 0.6
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self):
        self.observer = StrapTorqueObserver(self.coupling, self.period, self.bandwidth)
        self._gate = self.limits.gate(self.period)
        self._count = 0

    @property
    def fault(self) -> str:
        """As of the gate."""
        return self._gate.fault

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """One control period.

        Parameters
        ----------
        time, position, torque : float
            [s], output encoder [rad], spring [N m].
        emg : sequence
            Not used.

        Returns
        -------
        float
            Torque wanted from the spring [N m].
        """
        self.observer.step(position, torque)
        v, m = self.observer.velocity, self.coupling
        wanted = (
            self.gravity * m.orthosis_gravity * np.sin(position)
            + self.friction * (m.coulomb + m.actuator_coulomb) * np.tanh(v / self.assist_width)
            + self.gain * self.observer.torque
        )
        self._count += 1
        sound = float(position) if np.isfinite(torque) else float("nan")
        return self._gate.step(float(wanted), sound, self.observer.raw_velocity, time, self._count)

    def linear(self, speed: float = 1.0) -> LinearSystem:
        """The controller near the hanging place, as `stability.margins` takes it.

        Parameters
        ----------
        speed : float
            Amplitude of the velocity at which friction is linearised [rad/s].

        Returns
        -------
        LinearSystem
            Sampled; from encoder and spring to torque wanted.
        """
        m = self.coupling
        following, (v, x) = self.observer.linear(friction_slope(speed, m.coulomb, self.observer.width))
        slope = self.friction * friction_slope(speed, m.coulomb + m.actuator_coulomb, self.assist_width)
        q = np.eye(6)[4]
        command = self.gravity * m.orthosis_gravity * q + slope * v + self.gain * x
        return LinearSystem(following[:, :4], following[:, 4:], command[None, :4], command[None, 4:])
