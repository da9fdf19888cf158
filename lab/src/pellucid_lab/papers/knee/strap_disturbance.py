"""The strap's torque as a disturbance of the orthosis, from encoder and spring alone: a baseline without EMG."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellucid.controllers.coupling import friction_slope
from pellucid.controllers.stability import LinearSystem

from .strap_law import StrapLaw


@dataclass
class StrapDisturbance(StrapLaw):
    """A law that carries gravity and friction by model and follows the observed strap torque.

    u = s_g G sin q + s_f (F + F_a) tanh(v/w) + gain tau. It uses neither EMG nor a model of the limb, so that it
    answers only once the strap already pulls.
    """

    gravity: float = 0.8  # s_g: share of the orthosis's gravity that is carried [1]
    friction: float = 0.5  # s_f: share of Coulomb friction that is carried [1]
    gain: float = 1.0  # Gain on the observed strap torque [1]
    bandwidth: float = 40.0  # Bandwidth of the observer [rad/s]
    assist_width: float = 0.6  # w: speed over which friction's smooth sign changes [rad/s]

    def __post_init__(self):
        super().__post_init__()
        self.observer.bandwidth = self.bandwidth

    def wanted(self, position: float, torque: float) -> float:
        """Return gravity, friction and the followed strap torque [N m]."""
        v, m = self.observer.velocity, self.coupling
        return (
            self.gravity * m.orthosis_gravity * np.sin(position)
            + self.friction * (m.coulomb + m.actuator_coulomb) * np.tanh(v / self.assist_width)
            + self.gain * self.observer.torque
        )

    def linear(self, speed: float = 1.0) -> LinearSystem:
        """Return the controller linearised about hanging, as `stability.margins` takes it. `speed` [rad/s]."""
        m = self.coupling
        following, (v, x) = self.observer.linear(friction_slope(speed, m.coulomb, self.observer.width))
        slope = self.friction * friction_slope(speed, m.coulomb + m.actuator_coulomb, self.assist_width)
        q = np.eye(6)[4]
        command = self.gravity * m.orthosis_gravity * q + slope * v + self.gain * x
        return LinearSystem(following[:, :4], following[:, 4:], command[None, :4], command[None, 4:])
