"""Weights of robust least squares."""

from __future__ import annotations

import numpy as np

HUBER_THRESHOLD = 1.345
"""Huber's threshold in robust standard deviations. The estimate then has 95 % efficiency on Gaussian residuals."""


MAX_REWEIGHTINGS = 30
"""Largest number of iterations of robust reweighting."""


def robust_weights(residual: np.ndarray) -> np.ndarray:
    """Return the square roots of Huber's weights, (m,), for residuals scaled by their median absolute deviation."""
    scale = 1.4826 * np.median(np.abs(residual - np.median(residual))) + np.finfo(float).tiny
    return np.sqrt(np.minimum(1.0, HUBER_THRESHOLD * scale / np.maximum(np.abs(residual), np.finfo(float).tiny)))
