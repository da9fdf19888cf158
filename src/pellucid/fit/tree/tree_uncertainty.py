r"""How sure the numbers of a robot are: residuals remember, joints are disturbed together, and the fit bends to both.

The textbook counts every row of every joint as news. Here rows are cut into blocks of ten correlation times, the mean
of the joints', all joints of a block together; blocks are as good as independent of each other, rows within one are not
[1]_. With W_b the weighted rows of block b, H_b its part of the projection, and r_b its residuals,

.. math::
   C = k^2 B \Big(\sum_b W_b^T (I - H_b)^{-1/2} r_b\, r_b^T (I - H_b)^{-1/2} W_b\Big) B,
   \qquad B = \Big(\sum_b W_b^T W_b\Big)^{-1}.

The root undoes what the fit took of each block's residual (CR2 [2]_); k is Student's quantile over the normal one, for
as many degrees of freedom as there are blocks less one. Nothing is fitted again and segments play no part, so that the
jackknife over segments is an independent check: it leaves out stretches that end where a robot stops, and refits.

.. [1] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
.. [2] R. M. Bell, D. F. McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage samples",
   Survey Methodology 28, 2002.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..uncertainty import BLOCK_CORRELATION_TIMES, MIN_BLOCKS, correlation_time, student_to_normal_ratio
from .tree_regression import Linearised, TreeRows, TreeSolution

MOST_TAKEN = 0.999
"""Share of a block's direction that the fit may take: all of it would leave nothing to judge by."""


@dataclass(frozen=True)
class TreeUncertainty:
    """`covariance` (p, p), over `freedom` degrees, of blocks of `block` rows; the `textbook`'s (p, p); `memory` (m,) of
    each joint's residual in rows."""

    covariance: np.ndarray
    freedom: float
    block: int
    textbook: np.ndarray
    memory: np.ndarray


def memories(rows: TreeRows, residuals: tuple[np.ndarray, ...]) -> np.ndarray:
    """Correlation time of each joint's residual, (m,), in rows; what does not count is 0."""
    lengths = np.bincount(rows.stretch).tolist()
    found = []
    for lines, residual in zip(rows.lines, residuals, strict=True):
        whole = np.zeros(len(rows.stretch))
        whole[lines] = residual
        found.append(correlation_time(whole, lengths))
    return np.array(found)


def blocks_of(rows: TreeRows, memory: float) -> np.ndarray:
    """The block of each row, (N,), from 0: ten correlation times of `memory` rows each, and none across recordings."""
    lengths = np.bincount(rows.stretch)
    length = int(np.clip(round(BLOCK_CORRELATION_TIMES * memory), 1, max(1, len(rows.stretch) // MIN_BLOCKS)))
    made, first = [], 0
    for n in lengths:
        count = max(1, round(n / length))
        made.append(np.arange(n) * count // max(n, 1) + first)
        first += count
    return np.concatenate(made)


def tree_uncertainty(at: Linearised, found: TreeSolution) -> TreeUncertainty:
    """Of a solution, on the model linearised there; what a bound holds, or no row tells, has no covariance."""
    rows, p = at.rows, len(found.values)
    free = np.flatnonzero(found.seen & ~found.held)
    place_of = np.full(p, -1)
    place_of[free] = np.arange(len(free))
    residuals = at.residuals(found.values)
    memory = memories(rows, residuals)
    block = blocks_of(rows, float(memory.mean()))
    parts, gram = [], np.zeros((len(free), len(free)))
    for j, (place, x, r) in enumerate(zip(at.places, at.columns, residuals, strict=True)):
        known = place_of[place] >= 0
        own = x[:, known] / found.sd[j]
        parts.append((place_of[place[known]], own, r / found.sd[j], block[rows.lines[j]]))
        gram[np.ix_(parts[-1][0], parts[-1][0])] += own.T @ own
    size = np.sqrt(np.diag(gram))
    # B = L'L with L in the place of W: the projection's part of a block is (W L')(W L')'.
    root = np.linalg.inv(np.linalg.cholesky(gram / np.outer(size, size))) / size
    scores = []
    for b in range(int(block.max()) + 1):
        inner, pull = np.zeros_like(gram), np.zeros(len(free))
        for place, own, r, blocks in parts:
            first, last = np.searchsorted(blocks, [b, b + 1])
            mine = own[first:last]
            inner[np.ix_(place, place)] += mine.T @ mine
            pull[place] += mine.T @ r[first:last]
        if not pull.any():
            continue
        # (I - A A')^(-1/2) on a residual, seen through A', is (I - A'A)^(-1/2) on A'r.
        taken, ways = np.linalg.eigh(root @ inner @ root.T)
        left = 1.0 - np.clip(taken, 0.0, MOST_TAKEN)
        scores.append(root.T @ (ways @ ((ways.T @ (root @ pull)) / np.sqrt(left))))
    scores = np.array(scores)
    freedom = float(max(len(scores) - 1, 1))
    k = student_to_normal_ratio(freedom) if freedom > 1.0 else 6.5
    covariance, textbook = np.zeros((2, p, p))
    covariance[np.ix_(free, free)] = k**2 * scores.T @ scores
    textbook[np.ix_(free, free)] = root.T @ root
    return TreeUncertainty(covariance, freedom, int(np.bincount(block).max()), textbook, memory)
