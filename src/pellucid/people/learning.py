"""Were movements still changing while they were recorded? The change from control at the end of a session.

A mean over a session holds the tries with which it began. If people still get used to the robot, the change that they
would live with is that of the last movements, not the mean. So values less the mean of movements that are alike, in
their order, are divided into thirds: the last third less the first says whether people change, and the mean change with
the last third in place of all is the change at the end. No curve of learning is supposed.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

MIN_MOVEMENTS = 9
"""Thirds are compared only if a condition has at least this many movements, three in each third."""


@dataclass(frozen=True)
class Thirds:
    """Means of the first and the last third of a participant's movements, less the mean of similar movements."""

    first: float
    last: float

    @property
    def drift(self) -> float:
        """Change from the first third to the last."""
        return self.last - self.first


def thirds(values: Sequence[float], cells: Sequence[Hashable]) -> Thirds | None:
    """Return the first and the last third of `values`, (n,), in the order of recording; None with too few.

    `cells` assigns each value to its cell of similar movements.
    """
    y = np.asarray(values, float)
    if len(y) < MIN_MOVEMENTS:
        return None
    kinds = {cell: i for i, cell in enumerate(dict.fromkeys(cells))}
    which = np.array([kinds[cell] for cell in cells])
    rest = y - (np.bincount(which, y) / np.bincount(which))[which]
    part = len(y) // 3
    return Thirds(float(rest[:part].mean()), float(rest[-part:].mean()))
