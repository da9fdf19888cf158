"""A small fuzzy compensation, as reviews of exoskeletons know it: nine stated rules, no model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .coupling import Coupling
from .disturbance_observer import StrapTorqueObserver
from .limits import Limits

# Rows: the strap pulls backwards, not at all, forwards; columns: the orthosis moves backwards, rests, moves forwards.
# Entries: share of the largest torque. A pull with the motion is followed fully; one against it is a wish to stop.
RULES = np.array([[-1.0, -0.7, -0.3], [-0.2, 0.0, 0.2], [0.3, 0.7, 1.0]])


def memberships(x: float) -> np.ndarray:
    """How far a number is negative, zero and positive: triangles over -1, 0, 1 that sum to 1.

    Parameters
    ----------
    x : float
        [1].

    Returns
    -------
    ndarray, shape (3,)
        [1].
    """
    x = float(np.clip(x, -1, 1))
    return np.array([max(-x, 0.0), 1 - abs(x), max(x, 0.0)])


@dataclass
class FuzzyCompensation:
    """Nine rules on the observed strap torque and the velocity; the output is their weighted mean.

    Attributes
    ----------
    coupling : Coupling
        For the observer of the strap's torque.
    period : float
        [s].
    torque_scale, velocity_scale : float
        What counts as a full pull and a full speed [N m], [rad/s].
    largest : float
        The torque of a rule that says 1 [N m].
    limits : Limits
        Of the gate.
    """

    coupling: Coupling
    period: float
    torque_scale: float = 1.0
    velocity_scale: float = 2.0
    largest: float = 1.5
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self):
        self.observer = StrapTorqueObserver(self.coupling, self.period)
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
        pull = memberships(self.observer.torque / self.torque_scale)
        motion = memberships(self.observer.velocity / self.velocity_scale)
        wanted = self.largest * float(pull @ RULES @ motion)
        self._count += 1
        sound = float(position) if np.isfinite(torque) else float("nan")
        return self._gate.step(wanted, sound, self.observer.raw_velocity, time, self._count)
