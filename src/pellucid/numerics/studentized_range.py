"""The range of several independent standard normal numbers, without scipy.stats, which takes long to load.

The chance that it is at most q is k times the integral of phi(z) (Phi(z) - Phi(z - q))^(k - 1) over z: the largest of
the k numbers is z, and all others lie within q below it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.special import ndtr

STEP = 0.05
"""Step of the sum that replaces the integral. Of a function this smooth the sum is exact up to rounding."""

REACH = 9.0
"""The density of a normal number vanishes beyond this many standard deviations, at the accuracy of a double."""


def range_tail(value: np.ndarray | float, count: int) -> np.ndarray:
    """Return the chance that the range of `count` standard normal numbers exceeds each `value`, of the same shape."""
    z = np.arange(-REACH, REACH + STEP, STEP)
    below, others = ndtr(z), count - 1
    beyond = below**others - (below - ndtr(z - np.asarray(value, float)[..., None])) ** others
    density = np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
    return np.clip(count * STEP * beyond @ density, 0.0, 1.0)


@lru_cache(maxsize=64)
def range_quantile(chance: float, count: int) -> float:
    """Return the value that the range of `count` standard normal numbers exceeds with a `chance` above 0."""
    from scipy.optimize import brentq  # loads slowly

    return brentq(lambda value: float(range_tail(value, count)) - chance, 0.0, 40.0, xtol=1e-13)
