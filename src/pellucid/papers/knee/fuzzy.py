"""A small fuzzy compensation, as reviews of exoskeletons know it: nine stated rules, no model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .strap_law import StrapLaw

# Rows: the strap pulls backwards, not at all, forwards; columns: the orthosis moves backwards, rests, moves forwards.
# Entries: share of the largest torque. A pull with the motion is followed fully; one against it is a wish to stop.
RULES = np.array([[-1.0, -0.7, -0.3], [-0.2, 0.0, 0.2], [0.3, 0.7, 1.0]])


def memberships(x: float) -> np.ndarray:
    """How far a number is negative, zero and positive: triangles over -1, 0, 1 that sum to 1. Gives (3,)."""
    x = float(np.clip(x, -1, 1))
    return np.array([max(-x, 0.0), 1 - abs(x), max(x, 0.0)])


@dataclass
class FuzzyCompensation(StrapLaw):
    """Nine rules on the observed strap torque and the velocity; the output is their weighted mean."""

    # torque_scale, velocity_scale: What counts as a full pull and a full speed [N m], [rad/s]
    torque_scale: float = 1.0
    velocity_scale: float = 2.0
    largest: float = 1.5  # The torque of a rule that says 1 [N m]

    def wanted(self, position: float, torque: float) -> float:
        """As of `StrapLaw`."""
        pull = memberships(self.observer.torque / self.torque_scale)
        motion = memberships(self.observer.velocity / self.velocity_scale)
        return self.largest * float(pull @ RULES @ motion)
