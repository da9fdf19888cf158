"""Find friction that changes within a recording, as that of a gear that warms up does: by its residual over time."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

BLOCK_COUNT = 8
"""A recording is divided into this many blocks of time."""

MIN_ROWS_PER_BLOCK = 20
"""Smallest number of rows in a block that tell its friction."""


@dataclass(frozen=True)
class FrictionDrift:
    """Change of the friction level over one recording."""

    change: float  # friction at its end minus friction at its start, by a straight line [N m or N]
    standard_error: float  # standard error of the change, from the blocks' scatter about the line [N m or N]

    @property
    def z_value(self) -> float:
        """The change over its standard error."""
        return self.change / self.standard_error if self.standard_error > 0.0 else 0.0


def find_friction_drift(time: np.ndarray, velocity: np.ndarray, residual: np.ndarray) -> FrictionDrift | None:
    """Return how much the friction level changes over a recording; None if it is too short to tell.

    Parameters
    ----------
    time, velocity, residual : ndarray, shape (n,) each
        Time [s], velocity [rad/s or m/s], and measured minus predicted effort [N m or N], without rows at rest.
    """
    edges = np.linspace(time[0], time[-1], BLOCK_COUNT + 1) if len(time) else np.zeros(1)
    centres, levels = [], []
    for low, high in pairwise(edges.tolist()):
        inside = (time >= low) & (time <= high)
        way = np.sign(velocity[inside])
        # With both directions a constant residual does not look like friction.
        if min(int(np.sum(way > 0.0)), int(np.sum(way < 0.0))) < MIN_ROWS_PER_BLOCK:
            continue
        centres.append(0.5 * (low + high))
        levels.append(0.5 * (residual[inside][way > 0.0].mean() - residual[inside][way < 0.0].mean()))
    if len(levels) < BLOCK_COUNT // 2:
        return None
    x = np.array(centres) - np.mean(centres)
    y = np.array(levels)
    slope = float(x @ y / (x @ x))
    off = y - y.mean() - slope * x
    error = float(np.sqrt(off @ off / max(len(x) - 2, 1) / (x @ x)))
    span = float(time[-1] - time[0])
    return FrictionDrift(slope * span, error * span)
