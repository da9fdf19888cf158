"""Measure how a channel changes from sample to sample: its range, its resolution, its typical change."""

from __future__ import annotations

import numpy as np


class Scale:
    """Range and resolution of a signal, and its typical change over a stride.

    Attributes
    ----------
    range : float
        Largest minus smallest value.
    resolution : float
        Smallest difference between two values.
    stride : int
        Number of samples over which changes are measured, long enough that the resolution does not matter.
    typical : float
        99th percentile of the changes over the stride.
    """

    def __init__(self, x: np.ndarray):
        finite = x[np.isfinite(x)]
        self.range = float(np.ptp(finite)) if finite.size else 0.0
        levels = np.diff(np.unique(finite))
        levels = levels[levels > 1e-9 * self.range]
        self.resolution = float(levels.min()) if levels.size else 0.0
        self.stride, self.typical = 1, 0.0
        while True:
            moved = np.abs(x[self.stride :] - x[: -self.stride])
            moved = moved[np.isfinite(moved)]
            self.typical = float(np.quantile(moved, 0.99)) if moved.size else 0.0
            if self.typical >= 20 * self.resolution or 2 * self.stride > max(1, len(x) // 50):
                break
            self.stride *= 2

    @property
    def resolved(self) -> bool:
        """Whether the typical change is well above the resolution."""
        return self.typical >= 8 * self.resolution > 0.0
