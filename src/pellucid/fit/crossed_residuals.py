"""What a regression misses on blocks of its own data that it is not shown: each predicted from all the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .regression import Solution

PARTS = 10  # into which the data are cut, along recordings


def crossed_residuals(found: Solution, lengths: Sequence[int]) -> tuple[np.ndarray, ...]:
    """Residuals, (n_i,) per stretch of `lengths`, of each block by the values that the other blocks give, on the model
    linearised where the solution ended; what a bound holds stays there."""
    free = ~found.at_bound
    scale = np.maximum(np.linalg.norm(found.jacobian[:, free], axis=0), np.finfo(float).tiny)
    w = found.jacobian[:, free] / scale
    gram, moment = w.T @ w, w.T @ found.residual
    ends, made = np.cumsum(lengths), []
    for end, length in zip(ends, lengths, strict=True):
        rows = np.arange(end - length, end)
        parts = max(1, round(PARTS * length / len(w)))
        blocks = []
        for block in np.array_split(rows, parts):
            own = w[block]
            rest = np.linalg.lstsq(gram - own.T @ own, moment - own.T @ found.residual[block], rcond=1e-10)[0]
            blocks.append(found.residual[block] - own @ rest)
        made.append(np.concatenate(blocks))
    return tuple(made)
