"""Limits of a motion of several joints: positions, speeds, accelerations, efforts, and the clearance of an arm from
itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..._errors import PellucidError

Effort = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Function from position, velocity and acceleration, (n, m) each, to effort, (n, m) [N m; N]."""


@dataclass(frozen=True, eq=False)
class TreeLimits:
    """Limits of m joints; an infinite limit does not bind."""

    names: tuple[str, ...]
    low: np.ndarray  # (m,) [rad; m]
    high: np.ndarray
    velocity: np.ndarray  # [rad/s; m/s]
    acceleration: np.ndarray  # [rad/s^2; m/s^2]
    effort: np.ndarray | None = None  # largest effort of the drives [N m; N]
    effort_of: Effort | None = None  # effort that a motion needs, if it is known
    distance: Callable[[np.ndarray], np.ndarray] | None = None  # distance of the arm from itself at a position [m]
    clearance: float = 0.02  # smallest such distance that is allowed [m]

    def __post_init__(self):
        count = len(self.names)
        for what in ("low", "high", "velocity", "acceleration", "effort"):
            found = getattr(self, what)
            if found is None:
                continue
            found = np.array(found, dtype=float)
            object.__setattr__(self, what, found)
            if found.shape != (count,):
                raise PellucidError(f"limits: found {what} of shape {found.shape}, expected a number for each of "
                                    f"{count} joints: {', '.join(self.names)}")  # fmt: skip
            for name, value in zip(self.names, found, strict=True):
                whole = np.isfinite(value) if what in ("low", "high") else value > 0.0
                if not whole:
                    expected = "a finite place" if what in ("low", "high") else "> 0"
                    raise PellucidError(f"limits: joint {name!r}: found {what} {value:g}, expected {expected}")
        for name, low, high in zip(self.names, self.low, self.high, strict=True):
            if not low < high:
                raise PellucidError(f"limits: joint {name!r}: found low {low:g} and high {high:g}, expected low < high")
        if (self.effort is None) != (self.effort_of is None):
            raise PellucidError("limits: found only one of effort and effort_of, expected both: a limit of the effort "
                                "needs a function that computes the effort of a motion")  # fmt: skip

    def slacks(self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return the slack of each limit as a share of it, (n, limits), below 0 if it is exceeded. Inputs (n, m)."""
        half = 0.5 * (self.high - self.low)
        left = [(position - self.low) / half, (self.high - position) / half,
                1.0 - np.abs(velocity) / self.velocity, 1.0 - np.abs(acceleration) / self.acceleration]  # fmt: skip
        if self.effort_of is not None:
            left.append(1.0 - np.abs(self.effort_of(position, velocity, acceleration)) / self.effort)
        if self.distance is not None:
            # The slack is in tenths of a metre: as a share of the clearance it would repel arms that are merely near.
            left.append(10.0 * (self.distance(position) - self.clearance)[:, None])
        return np.concatenate(left, axis=1)

    def passed(self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> str | None:
        """Return a message about the first limit that a motion exceeds; None if it keeps all. Inputs (n, m)."""
        checks = [("place", position, self.low, self.high),
                  ("velocity", velocity, -self.velocity, self.velocity),
                  ("acceleration", acceleration, -self.acceleration, self.acceleration)]  # fmt: skip
        if self.effort_of is not None and self.effort is not None:
            checks.append(("effort", self.effort_of(position, velocity, acceleration), -self.effort, self.effort))
        for what, values, low, high in checks:
            over = np.maximum(values - high, low - values).max(axis=0)
            worst = int(np.argmax(over))
            if over[worst] > 1e-9 * max(1.0, abs(high[worst])):
                reached = values[:, worst][np.argmax(np.maximum(values - high, low - values)[:, worst])]
                return (f"joint {self.names[worst]!r}: {what} {reached:.4g}, expected within {low[worst]:.4g} and "
                        f"{high[worst]:.4g}")  # fmt: skip
        if self.distance is not None:
            near = float(self.distance(position).min())
            if near < self.clearance:
                return f"the arm comes within {1e3 * near:.0f} mm of itself, expected {1e3 * self.clearance:.0f} mm"
        return None
