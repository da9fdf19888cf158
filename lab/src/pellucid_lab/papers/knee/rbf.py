"""A small neural compensation: radial basis functions of angle and velocity that learn what the strap still carries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .strap_law import StrapLaw


@dataclass
class RbfCompensation(StrapLaw):
    """The law u = w . phi(q, v) with w' = rate tau phi - leak w.

    tau is the strap's torque, and every weight is bounded.
    """

    rate: float = 4.0  # Rate of learning [1/s]
    leak: float = 0.05  # Rate of forgetting [1/s]
    bound: float = 3.0  # Largest absolute value of every weight [N m]
    angles: tuple[float, float] = (-0.4, 1.6)  # Smallest and largest centre in angle [rad]
    velocities: tuple[float, float] = (-4.0, 4.0)  # Smallest and largest centre in velocity [rad/s]

    def __post_init__(self):
        super().__post_init__()
        q, v = np.linspace(*self.angles, 5), np.linspace(*self.velocities, 7)
        self._centres = np.array([(a, b) for a in q for b in v])
        self._scale = np.array([q[1] - q[0], v[1] - v[0]])
        self.weights = np.zeros(len(self._centres))

    def wanted(self, position: float, torque: float) -> float:
        """Return the network's torque [N m], and let its weights learn."""
        if not (np.isfinite(position) and np.isfinite(torque)):
            return 0.0
        place = (np.array([position, self.observer.velocity]) - self._centres) / self._scale
        phi = np.exp(-np.sum(place**2, axis=1))
        phi /= phi.sum() + 1e-12
        wanted = float(self.weights @ phi)
        change = self.period * (self.rate * self.observer.torque * phi - self.leak * self.weights)
        self.weights = np.clip(self.weights + change, -self.bound, self.bound)
        return wanted
