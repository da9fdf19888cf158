"""Standardised features: mean 0 and variance 1, and 0 everywhere for a feature that does not vary."""

from __future__ import annotations

import numpy as np

CONSTANT_SHARE = 1e-9
"""A feature is constant if its standard deviation is below this share of its largest magnitude. Sums of n equal numbers
leave a deviation of some 1e-16 of them; divided by that, a joint's angle in another recording would be any number.
"""


def mean_and_scale(x: np.ndarray, weight: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard deviation of each column of `x` (n, k), both (k,).

    `weight` (n,) weighs the rows; None: every row counts the same.

    A constant column has the scale infinity: divided by it, whatever it is later counts as its mean. What such a
    feature does to the torque is not in what was fitted.
    """
    if weight is None:
        mean, deviation = x.mean(axis=0), x.std(axis=0)
    else:
        mean = np.average(x, axis=0, weights=weight)
        deviation = np.sqrt(np.average((x - mean) ** 2, axis=0, weights=weight))
    varies = deviation > CONSTANT_SHARE * np.abs(x).max(axis=0)
    return mean, np.where(varies, deviation, np.inf)
