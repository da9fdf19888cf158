"""Residuals of a regression by cross-validation over blocks: each block is predicted from all the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .regression import Solution

BLOCK_COUNT = 10
"""Number of blocks into which all data are cut; a block never spans two recordings."""


def cross_validated_residuals(found: Solution, lengths: Sequence[int]) -> tuple[np.ndarray, ...]:
    """Return residuals of shape (n_i,) per stretch of `lengths`, each block predicted by a fit to the other blocks.

    The model is linearised at the solution. Parameters on a bound stay there.
    """
    free = ~found.at_bound
    scale = np.maximum(np.linalg.norm(found.jacobian[:, free], axis=0), np.finfo(float).tiny)
    w = found.jacobian[:, free] / scale
    gram, moment = w.T @ w, w.T @ found.residual
    ends, made = np.cumsum(lengths), []
    for end, length in zip(ends, lengths, strict=True):
        rows = np.arange(end - length, end)
        parts = max(1, round(BLOCK_COUNT * length / len(w)))
        blocks = []
        for block in np.array_split(rows, parts):
            own = w[block]
            rest = np.linalg.lstsq(gram - own.T @ own, moment - own.T @ found.residual[block], rcond=1e-10)[0]
            blocks.append(found.residual[block] - own @ rest)
        made.append(np.concatenate(blocks))
    return tuple(made)
