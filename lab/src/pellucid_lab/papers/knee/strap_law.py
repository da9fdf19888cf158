"""Observer of the strap's torque from encoder and spring alone, and the base class of every law that uses it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pellucid import _core
from pellucid.controllers.control_law import Limits, gate_values
from pellucid.controllers.coupling import Coupling


@dataclass
class StrapTorqueObserver:
    """A momentum observer of the torque that acts on the orthosis besides spring, gravity and friction.

    p' = tau_e - b v - G sin q - F tanh(v/w) + tau,  tau = a (I v - p): the strap's torque behind a low-pass of
    bandwidth a. The velocity is a difference of angles behind a low-pass, v' = c (dq/dt - v).
    """

    coupling: Coupling  # The model; only its orthosis is used
    period: float  # [s]
    bandwidth: float = 40.0  # a: bandwidth of the observed torque [rad/s]
    velocity_bandwidth: float = 120.0  # c: bandwidth of the velocity [rad/s]
    width: float = 0.05  # w: speed over which friction's smooth sign changes [rad/s]
    velocity: float = field(default=0.0, init=False)
    raw_velocity: float = field(default=0.0, init=False)
    torque: float = field(default=0.0, init=False)
    _momentum: float = field(default=0.0, init=False)
    _position: float | None = field(default=None, init=False)

    def step(self, position: float, torque: float) -> None:
        """Advance by one period; a reading that is not finite changes nothing. `position` [rad], `torque` [N m]."""
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
        """Return the observer linearised about hanging, with friction as a viscous coefficient `slope` [N m s/rad].

        The first array, (4, 6), gives the next state; the second, (2, 6), gives the present velocity and torque.
        """
        m, (last, v, p, x, q, spring) = self.coupling, np.eye(6)
        v = v + self.velocity_bandwidth * ((q - last) - self.period * v)
        known = spring - (m.orthosis_viscous + slope) * v - m.orthosis_gravity * q
        p = p + self.period * (known + x)
        x = self.bandwidth * (m.orthosis_inertia * v - p)
        return np.array([q, v, p, x]), np.array([v, x])


@dataclass
class StrapLaw(ABC):
    """A law without EMG: each period it observes the strap, computes a torque and sends it through the safety gate."""

    coupling: Coupling  # The model; only its orthosis is used
    period: float  # [s]
    limits: Limits = field(default_factory=Limits, kw_only=True)  # Limits of the safety gate

    def __post_init__(self):
        self.observer = StrapTorqueObserver(self.coupling, self.period)
        self._gate = _core.SafetyGate(**{**gate_values(self.limits, self.period), "max_repeats": 2})
        self._count = 0

    @property
    def fault(self) -> str:
        """Fault that the safety gate has latched; "none" if there is none."""
        return self._gate.fault

    @abstractmethod
    def wanted(self, position: float, torque: float) -> float:
        """Return the torque before the gate [N m], with the observer up to date. `position` [rad], `torque` [N m]."""

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """Return the command [N m] of one control period. `time` [s], `position` [rad], `torque` [N m]."""
        self.observer.step(position, torque)
        wanted = float(self.wanted(position, torque))
        self._count += 1
        sound = float(position) if np.isfinite(torque) else float("nan")
        return self._gate.step(wanted, sound, self.observer.raw_velocity, time, self._count)
