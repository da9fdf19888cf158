"""Angles that jump by a turn in mid-trial: found, said and undone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """An angle without its jumps."""

    angle: np.ndarray  # (n,) [rad]
    wraps: tuple[int, ...]  # Samples at which a turn was added or taken off

    def said(self, name: str, time: np.ndarray) -> str:
        """The jumps of channel `name` in one sentence, at `time`, shape (n,) [s]; empty where there were none."""
        if not self.wraps:
            return ""
        when = ", ".join(f"{time[i]:.2f} s" for i in self.wraps[:5]) + (", ..." if len(self.wraps) > 5 else "")
        times = "once" if len(self.wraps) == 1 else f"{len(self.wraps)} times"
        return f"{name} wraps by a whole turn {times} (at {when}); it was unwrapped."


def unwrap(angle: np.ndarray, turn: float = 2.0 * np.pi) -> Unwrapped:
    """Undo jumps of whole turns. `angle` (n,) [rad]; `turn` [rad]."""
    angle = np.asarray(angle, float)
    known = np.flatnonzero(np.isfinite(angle))
    found = angle.copy()
    found[known] = np.unwrap(angle[known], period=turn)
    turns = np.round((found[known] - angle[known]) / turn)
    return Unwrapped(found, tuple(int(known[i + 1]) for i in np.flatnonzero(np.diff(turns))))
