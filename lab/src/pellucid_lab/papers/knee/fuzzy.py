"""A small fuzzy compensation, as reviews of exoskeletons know it: nine stated rules, no model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .strap_law import StrapLaw

RULE_TORQUE_SHARES = np.array([[-1.0, -0.7, -0.3], [-0.2, 0.0, 0.2], [0.3, 0.7, 1.0]])
"""Output of each of nine rules, as a share of the largest torque.

Rows: the strap pulls backwards, not at all, forwards. Columns: the orthosis moves backwards, rests, moves forwards. A
pull along the motion is followed fully; one against it means that the wearer wants to stop.
"""


def memberships(x: float) -> np.ndarray:
    """Return the memberships of a number in negative, zero and positive, (3,): triangles over -1, 0, 1 of sum 1."""
    x = float(np.clip(x, -1, 1))
    return np.array([max(-x, 0.0), 1 - abs(x), max(x, 0.0)])


@dataclass
class FuzzyCompensation(StrapLaw):
    """Nine rules on the observed strap torque and the velocity; the output is their weighted mean."""

    torque_scale: float = 1.0  # Strap torque with full membership [N m]
    velocity_scale: float = 2.0  # Speed with full membership [rad/s]
    largest: float = 1.5  # Torque of a rule whose output is 1 [N m]

    def wanted(self, position: float, torque: float) -> float:
        """Return the mean of the rules' torques, weighted by their memberships [N m]."""
        pull = memberships(self.observer.torque / self.torque_scale)
        motion = memberships(self.observer.velocity / self.velocity_scale)
        return self.largest * float(pull @ RULE_TORQUE_SHARES @ motion)
