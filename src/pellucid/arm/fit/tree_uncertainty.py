r"""Covariance of a robot's parameters, robust to residuals that are correlated in time and between joints.

The textbook covariance treats every row of every joint as independent. Here rows are cut into blocks of ten correlation
times (the mean of the joints'), with all joints of a block together. Blocks are nearly independent of each other, rows
within one are not [1]_. With W_b the weighted rows of block b, H_b its part of the projection, and r_b its residuals,

.. math::
   C = k^2 B \Big(\sum_b W_b^T (I - H_b)^{-1/2} r_b\, r_b^T (I - H_b)^{-1/2} W_b\Big) B,
   \qquad B = \Big(\sum_b W_b^T W_b\Big)^{-1}.

The root corrects for the part of each block's residual that the fit removed (CR2 [2]_). k is the ratio of Student's
quantile to the normal one, with one degree of freedom less than there are blocks. Segments play no part and nothing is
fitted again. The jackknife over segments, which end where a robot stops, is therefore an independent check.

.. [1] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
.. [2] R. M. Bell, D. F. McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage samples",
   Survey Methodology 28, 2002.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...numerics.uncertainty import BLOCK_CORRELATION_TIMES, MIN_BLOCKS, correlation_time, student_to_normal_ratio
from ..tree_motion import TreeMotion
from .tree_estimate import TreeEstimate
from .tree_regression import LinearisedModel, TreeModel, TreeRows, TreeSolution, compute_loads, fit_rows, linearise_rows

ModelFit = Callable[[TreeRows], tuple[TreeModel, TreeSolution]]
"""A function from rows to a model and its values, which includes all choices."""


@dataclass(frozen=True)
class SegmentsOut:
    """Errors of cross-validation over segments.

    Attributes
    ----------
    errors : ndarray, shape (m,)
        RMS error divided by the RMS effort, both over the rows that count [%].
    each : ndarray, shape (S, m)
        Error of each segment, divided by the same RMS effort [%]; nan where a joint rests.
    models : tuple of TreeModel
        Model chosen without each segment.
    values : tuple of ndarray
        Parameters of each of these models.
    """

    errors: np.ndarray
    each: np.ndarray
    models: tuple[TreeModel, ...]
    values: tuple[np.ndarray, ...]

    @property
    def mean(self) -> float:
        """Mean error over joints [%]."""
        return float(self.errors.mean())


def residuals_on(model: TreeModel, values: np.ndarray, rows: TreeRows) -> tuple[np.ndarray, ...]:
    """Return the residuals of each joint on the rows that count, (n_j,)."""
    return linearise_rows(model, rows, compute_loads(rows, model, values)).residuals(values)


def relative_errors(residuals: tuple[np.ndarray, ...], size: np.ndarray) -> np.ndarray:
    """Return the RMS residual of each joint divided by its RMS effort `size`, (m,) [%]; nan without rows."""
    found = [np.sqrt(np.mean(r**2)) if len(r) else np.nan for r in residuals]
    return 100.0 * np.array(found) / size


def cross_validate_segments(rows: TreeRows, fit: ModelFit) -> SegmentsOut:
    """Return the errors on each segment of what `fit` finds from all other segments."""
    numbers = np.unique(rows.segment[rows.used.any(axis=1)])
    if len(numbers) < 2:
        raise IdentificationError(f"found {len(numbers)} segment to fit and judge by, expected at least 2")
    models, values, each = [], [], []
    squares, counts = np.zeros((2, len(rows.size)))
    for number in numbers:
        model, found = fit(rows.only(numbers[numbers != number]))
        residuals = residuals_on(model, found.values, rows.only([number]))
        models.append(model)
        values.append(found.values)
        squares += [np.sum(r**2) for r in residuals]
        counts += [len(r) for r in residuals]
        each.append(relative_errors(residuals, rows.size))
    errors = 100.0 * np.sqrt(squares / np.maximum(counts, 1)) / rows.size
    return SegmentsOut(errors, np.array(each), tuple(models), tuple(values))


def heldout_errors(estimate: TreeEstimate, motions: Sequence[TreeMotion]) -> np.ndarray:
    """Return the RMS error of an estimate on held-out recordings, divided by the RMS effort of each joint, (m,) [%]."""
    off = np.concatenate([m.effort - estimate.effort(m) for m in motions])
    effort, moving = (np.concatenate([getattr(m, name) for m in motions]) for name in ("effort", "moving"))
    count = moving.sum(axis=0)
    if not count.all():
        still = estimate.robot.names[int(np.argmin(count))]
        names = ", ".join(sorted({m.recording for m in motions}))
        raise IdentificationError(f"joint {still!r} never moves in {names}: expected motion to judge by")
    return 100.0 * np.sqrt(np.sum(moving * off**2, axis=0) / np.sum(moving * effort**2, axis=0))


AGREEMENT_FACTOR = 2.0
"""A stated standard error agrees with the jackknife's if their ratio is within this factor."""


@dataclass(frozen=True)
class SegmentJackknife:
    """Standard errors by the jackknife, compared with stated ones; nan for parameters on a bound or undetermined."""

    sd: np.ndarray  # jackknife standard errors, (p,)
    stated: np.ndarray  # stated standard errors, (p,)
    textbook: np.ndarray  # standard errors for white residuals, (p,)
    segments: int  # number of segments

    @property
    def ratios(self) -> np.ndarray:
        """Stated over jackknife standard errors, of the parameters that have both."""
        both = np.isfinite(self.sd) & np.isfinite(self.stated) & (self.sd > 0.0) & (self.stated > 0.0)
        return self.stated[both] / self.sd[both]

    @property
    def share_within(self) -> float:
        """Share of parameters for which both agree within `AGREEMENT_FACTOR` [%]."""
        ratios = self.ratios
        return (
            float(100.0 * np.mean((ratios < AGREEMENT_FACTOR) & (ratios > 1.0 / AGREEMENT_FACTOR)))
            if len(ratios)
            else float("nan")
        )

    @property
    def textbook_ratio(self) -> float:
        """Median ratio of jackknife to textbook standard errors."""
        both = (self.textbook > 0.0) & np.isfinite(self.sd)
        return float(np.median(self.sd[both] / self.textbook[both]))


def jackknife_segments(
    model: TreeModel, rows: TreeRows, found: TreeSolution, covariance: np.ndarray, textbook: np.ndarray
) -> SegmentJackknife:
    """Compute the jackknife of a solution with its `covariance`, (p, p), and the `textbook` one, (p, p).

    The model is not chosen again.
    """
    numbers = np.unique(rows.segment[rows.used.any(axis=1)])
    values = np.array([fit_rows(model, rows.only(numbers[numbers != n]), start=found)[0].values for n in numbers])
    sd = np.sqrt((len(numbers) - 1) / len(numbers) * np.sum((values - values.mean(axis=0)) ** 2, axis=0))
    free = found.seen & ~found.held
    stated, by_book = (np.where(free, np.sqrt(np.diag(c)), np.nan) for c in (covariance, textbook))
    return SegmentJackknife(np.where(free, sd, np.nan), stated, by_book, len(numbers))


MAX_LEVERAGE = 0.999
"""Upper limit of a block's leverage in any direction. A leverage of 1 would leave no residual."""


@dataclass(frozen=True)
class TreeUncertainty:
    """Covariance of a robot's parameters from blocks of rows."""

    covariance: np.ndarray  # block-robust covariance, (p, p)
    freedom: float  # degrees of freedom
    block: int  # number of rows in the longest block
    textbook: np.ndarray  # covariance for independent rows, (p, p)
    memory: np.ndarray  # correlation time of each joint's residual in rows, (m,)


def correlation_times(rows: TreeRows, residuals: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return the correlation time of each joint's residual, (m,), in rows; rows that do not count enter as 0."""
    lengths = np.bincount(rows.stretch).tolist()
    found = []
    for lines, residual in zip(rows.lines, residuals, strict=True):
        whole = np.zeros(len(rows.stretch))
        whole[lines] = residual
        found.append(correlation_time(whole, lengths))
    return np.array(found)


def block_numbers(rows: TreeRows, memory: float) -> np.ndarray:
    """Return the block number of each row, (N,).

    A block has ten correlation times of `memory` rows, and never spans two recordings.
    """
    lengths = np.bincount(rows.stretch)
    length = int(np.clip(round(BLOCK_CORRELATION_TIMES * memory), 1, max(1, len(rows.stretch) // MIN_BLOCKS)))
    made, first = [], 0
    for n in lengths:
        count = max(1, round(n / length))
        made.append(np.arange(n) * count // max(n, 1) + first)
        first += count
    return np.concatenate(made)


def estimate_uncertainty(at: LinearisedModel, found: TreeSolution) -> TreeUncertainty:
    """Compute the covariance of a solution on the model linearised there.

    It is 0 for parameters that are on a bound or undetermined.
    """
    rows, p = at.rows, len(found.values)
    free = np.flatnonzero(found.seen & ~found.held)
    place_of = np.full(p, -1)
    place_of[free] = np.arange(len(free))
    residuals = at.residuals(found.values)
    memory = correlation_times(rows, residuals)
    block = block_numbers(rows, float(memory.mean()))
    parts, gram = [], np.zeros((len(free), len(free)))
    for j, (place, x, r) in enumerate(zip(at.places, at.columns, residuals, strict=True)):
        known = place_of[place] >= 0
        own = x[:, known] / found.sd[j]
        parts.append((place_of[place[known]], own, r / found.sd[j], block[rows.lines[j]]))
        gram[np.ix_(parts[-1][0], parts[-1][0])] += own.T @ own
    size = np.sqrt(np.diag(gram))
    # B = L'L with L = `root`: the projection's part of a block is (W L')(W L')'.
    root = np.linalg.inv(np.linalg.cholesky(gram / np.outer(size, size))) / size
    score_rows = []
    for b in range(int(block.max()) + 1):
        inner, pull = np.zeros_like(gram), np.zeros(len(free))
        for place, own, r, blocks in parts:
            first, last = np.searchsorted(blocks, [b, b + 1])
            mine = own[first:last]
            inner[np.ix_(place, place)] += mine.T @ mine
            pull[place] += mine.T @ r[first:last]
        if not pull.any():
            continue
        # A' (I - A A')^(-1/2) r equals (I - A'A)^(-1/2) A' r.
        taken, ways = np.linalg.eigh(root @ inner @ root.T)
        left = 1.0 - np.clip(taken, 0.0, MAX_LEVERAGE)
        score_rows.append(root.T @ (ways @ ((ways.T @ (root @ pull)) / np.sqrt(left))))
    scores = np.array(score_rows)
    freedom = float(max(len(scores) - 1, 1))
    k = student_to_normal_ratio(freedom) if freedom > 1.0 else 6.5
    covariance, textbook = np.zeros((2, p, p))
    covariance[np.ix_(free, free)] = k**2 * scores.T @ scores
    textbook[np.ix_(free, free)] = root.T @ root
    return TreeUncertainty(covariance, freedom, int(np.bincount(block).max()), textbook, memory)
