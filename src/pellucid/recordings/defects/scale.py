"""How a channel moves from sample to sample: its range, its resolution, its typical stride."""

from __future__ import annotations

import numpy as np


class Scale:
    """How a signal moves over a stride long enough that its resolution does not matter."""

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
        """Whether its typical stride is well beyond its resolution."""
        return self.typical >= 8 * self.resolution > 0.0
