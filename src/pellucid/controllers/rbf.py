"""A small neural compensation: radial basis functions of angle and velocity that learn what the strap still carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .coupling import Coupling
from .disturbance_observer import StrapTorqueObserver
from .limits import Limits


@dataclass
class RbfCompensation:
    """u = w . phi(q, v), w' = rate tau phi - leak w, |w| bounded: learning that any motion changes, none can run away.

    Attributes
    ----------
    coupling : Coupling
        For the observer of the strap's torque, which is what it learns from.
    period : float
        [s].
    rate, leak : float
        Of learning and forgetting [1/s].
    bound : float
        Of every weight [N m].
    angles, velocities : tuple of float
        Smallest and largest centre [rad], [rad/s].
    limits : Limits
        Of the gate.
    """

    coupling: Coupling
    period: float
    rate: float = 4.0
    leak: float = 0.05
    bound: float = 3.0
    angles: tuple[float, float] = (-0.4, 1.6)
    velocities: tuple[float, float] = (-4.0, 4.0)
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self):
        self.observer = StrapTorqueObserver(self.coupling, self.period)
        self._gate = self.limits.gate(self.period)
        self._count = 0
        q, v = np.linspace(*self.angles, 5), np.linspace(*self.velocities, 7)
        self._centres = np.array([(a, b) for a in q for b in v])
        self._scale = np.array([q[1] - q[0], v[1] - v[0]])
        self.weights = np.zeros(len(self._centres))

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
        wanted = 0.0
        if np.isfinite(position) and np.isfinite(torque):
            place = (np.array([position, self.observer.velocity]) - self._centres) / self._scale
            phi = np.exp(-np.sum(place**2, axis=1))
            phi /= phi.sum() + 1e-12
            wanted = float(self.weights @ phi)
            change = self.period * (self.rate * self.observer.torque * phi - self.leak * self.weights)
            self.weights = np.clip(self.weights + change, -self.bound, self.bound)
        self._count += 1
        sound = float(position) if np.isfinite(torque) else float("nan")
        return self._gate.step(wanted, sound, self.observer.raw_velocity, time, self._count)
