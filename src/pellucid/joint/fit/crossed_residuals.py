"""Cross-validate a regression over blocks of the fitted recordings: each block is predicted from all the others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...numerics.column_norms import column_norms
from ...numerics.regression import Solution

BLOCK_COUNT = 10
"""Number of blocks into which all data are cut; a block never spans two recordings."""


def block_labels(lengths: Sequence[int]) -> list[np.ndarray]:
    """Return the block of each sample, (n_i,) per stretch of `lengths`; blocks are numbered over all stretches."""
    total, first, made = sum(lengths), 0, []
    for length in lengths:
        parts = max(1, round(BLOCK_COUNT * length / total))
        made.append(first + np.arange(length) * parts // max(length, 1))
        first += parts
    return made


def rows_of_blocks(labels: np.ndarray) -> Iterator[tuple[int, slice | np.ndarray]]:
    """Yield each block of `labels`, (m,), with its rows: a slice where they follow each other, else a mask, (m,)."""
    edges = np.flatnonzero(np.diff(labels)) + 1
    first, last = [0, *edges.tolist()], [*edges.tolist(), len(labels)]
    blocks = np.unique(labels)
    if len(blocks) == len(first):
        yield from sorted((int(labels[a]), slice(a, b)) for a, b in zip(first, last, strict=True))
    else:
        for block in blocks:
            yield int(block), labels == block


def values_without_blocks(
    found: Solution, labels: np.ndarray, instruments: np.ndarray | None = None
) -> dict[int, np.ndarray]:
    """Return the parameters, (p,), that a solution has without each block, by the block's number.

    `labels`, (m,), are the blocks of the solution's rows. The model is linearised at the solution, whose own weights
    and `instruments`, (m, p), are used. Parameters on a bound stay there.
    """
    free = ~found.at_bound
    scale = np.maximum(column_norms(found.jacobian[:, free]), np.finfo(float).tiny)
    w = found.jacobian[:, free] / scale * found.weights[:, None]
    z = w if instruments is None else instruments[:, free] / scale * found.weights[:, None]
    residual = found.residual * found.weights
    gram, moment = z.T @ w, z.T @ residual
    made = {}
    for block, own in rows_of_blocks(labels):
        rest = gram - z[own].T @ w[own], moment - z[own].T @ residual[own]
        made[block] = found.values.copy()
        made[block][free] += np.linalg.lstsq(*rest, rcond=1e-10)[0] / scale
    return made


def residuals_without_blocks(
    residual: np.ndarray, jacobian: np.ndarray, values: np.ndarray, without: dict[int, np.ndarray], labels: np.ndarray
) -> np.ndarray:
    """Return residuals, (m,), in which each block is predicted by the parameters that were found without it.

    `residual`, (m,), and the model's `jacobian`, (m, p), are those at `values`, (p,).
    """
    steps = np.zeros((int(labels.max()) + 1, len(values)))
    for block, other in without.items():
        if block < len(steps):
            steps[block] = other - values
    return residual - np.einsum("ij,ij->i", jacobian, steps[labels])


def cross_validated_residuals(found: Solution, lengths: Sequence[int]) -> tuple[np.ndarray, ...]:
    """Return residuals of shape (n_i,) per stretch of `lengths`, each block predicted by a fit to the other blocks.

    The model is linearised at the solution. Parameters on a bound stay there.
    """
    labels = np.concatenate(block_labels(lengths))
    without = values_without_blocks(found, labels)
    crossed = residuals_without_blocks(found.residual, found.jacobian, found.values, without, labels)
    return tuple(np.split(crossed, np.cumsum(lengths)[:-1]))
