"""How a robot's model predicts segments that took no part in anything: each left out in turn, all chosen anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...signals.tree_motion import TreeMotion
from .tree_estimate import TreeEstimate
from .tree_regression import TreeModel, TreeRows, TreeSolution, linearised, loads_of

Fit = Callable[[TreeRows], tuple[TreeModel, TreeSolution]]
"""From rows to a model and its values, with everything that is chosen on the way."""


@dataclass(frozen=True)
class SegmentsOut:
    """What was missed.

    Attributes
    ----------
    errors : ndarray, shape (m,)
        RMS of what was missed over the RMS effort, both over rows that count [%].
    each : ndarray, shape (S, m)
        The same of each segment, over the same RMS effort; nan where a joint rested.
    models : tuple of TreeModel
        What was chosen without each segment.
    values : tuple of ndarray
        And its parameters.
    """

    errors: np.ndarray
    each: np.ndarray
    models: tuple[TreeModel, ...]
    values: tuple[np.ndarray, ...]

    @property
    def mean(self) -> float:
        """Over joints [%]."""
        return float(self.errors.mean())


def missed(model: TreeModel, values: np.ndarray, rows: TreeRows) -> tuple[np.ndarray, ...]:
    """Residuals of each joint on the rows that count, (n_j,)."""
    return linearised(model, rows, loads_of(rows, model, values)).residuals(values)


def errors_of(residuals: tuple[np.ndarray, ...], size: np.ndarray) -> np.ndarray:
    """RMS over a joint's RMS effort `size`, (m,) each [%]; nan without rows."""
    found = [np.sqrt(np.mean(r**2)) if len(r) else np.nan for r in residuals]
    return 100.0 * np.array(found) / size


def segments_out(rows: TreeRows, fit: Fit) -> SegmentsOut:
    """Errors of what `fit` makes of all segments but one, on that one."""
    numbers = np.unique(rows.segment[rows.used.any(axis=1)])
    if len(numbers) < 2:
        raise IdentificationError(f"found {len(numbers)} segment to fit and judge by, expected at least 2")
    models, values, each = [], [], []
    squares, counts = np.zeros((2, len(rows.size)))
    for number in numbers:
        model, found = fit(rows.only(numbers[numbers != number]))
        residuals = missed(model, found.values, rows.only([number]))
        models.append(model)
        values.append(found.values)
        squares += [np.sum(r**2) for r in residuals]
        counts += [len(r) for r in residuals]
        each.append(errors_of(residuals, rows.size))
    errors = 100.0 * np.sqrt(squares / np.maximum(counts, 1)) / rows.size
    return SegmentsOut(errors, np.array(each), tuple(models), tuple(values))


def heldout_errors(estimate: TreeEstimate, motions: Sequence[TreeMotion]) -> np.ndarray:
    """Of recordings that took no part, together: RMS of what an estimate misses over the RMS effort, over rows that
    count, (m,) [%]."""
    off = np.concatenate([m.effort - estimate.effort(m) for m in motions])
    effort, moving = (np.concatenate([getattr(m, name) for m in motions]) for name in ("effort", "moving"))
    count = moving.sum(axis=0)
    if not count.all():
        still = estimate.robot.names[int(np.argmin(count))]
        names = ", ".join(sorted({m.recording for m in motions}))
        raise IdentificationError(f"joint {still!r} never moves in {names}: expected motion to judge by")
    return 100.0 * np.sqrt(np.sum(moving * off**2, axis=0) / np.sum(moving * effort**2, axis=0))
