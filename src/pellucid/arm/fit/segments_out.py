"""Cross-validate a robot's model over segments: each is left out in turn, and all choices are repeated without it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ..tree_motion import TreeMotion
from .tree_estimate import TreeEstimate
from .tree_regression import TreeModel, TreeRows, TreeSolution, compute_loads, linearise_rows

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
