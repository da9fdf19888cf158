"""Cross-validation over segments of recordings, to test additional columns of a joint's model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from ...models.friction_terms import is_friction
from ...models.joint import PARALLEL_STIFFNESS, JointModel
from ...numerics.block_test import compare_held_out
from ...numerics.motion import SLOW_SHARE, Motion
from ...numerics.regression import Solution, Stack, regression_rows
from ...numerics.uncertainty import correlation_time
from .discrepancy import NEGLECTED_EFFECTS, TWISTED_ANGLE, UNEQUAL_LOAD_LOSSES, States
from .friction_solver import block_labels, rows_of_blocks
from .recording_agreement import shares_of_time

MAX_ROWS = 50_000
"""Rows beyond this number are thinned."""

MIN_ROWS_PER_COLUMN = 10
"""Columns are tried only with this many rows for each."""

MIN_CONTRASTED_ROWS = 5
"""Smallest number of rows of each kind for which a segment shows a difference of errors between two kinds."""

MIN_RELATIVE_EIGENVALUE = 1e-10
"""Directions of the normal equations with less than this share of the largest eigenvalue count as undetermined."""

MIN_SQUARED_REMAINDER = 1e-8
"""A column adds something only if this squared share of it lies outside the span of those that are there."""

TRAVEL_EFFECTS = (
    "friction that changes along the travel",
    "friction that is largest in the middle of the travel",
    "viscosity that changes along the travel",
)
"""Neglected effects that are friction which depends on the position."""


class LeftOutColumns:
    """Rows of a regression in segments for cross-validation, and the columns to which causes add others.

    Attributes
    ----------
    friction : ndarray of bool, shape (p,)
        Which of the model's parameters are friction.
    states : States
        States of the joint in all m rows.
    time : ndarray, shape (m,)
        Time of every row from start to end of its recording, from -1/2 to 1/2.
    effort_unit : str
        Unit of the effort.
    measured, effort : ndarray, shape (m,)
        Measured and modelled effort in all rows.
    own_error : float
        Mean square error of the model alone on left-out stretches, in the effort's unit squared.
    error : float
        That of the extended model.
    """

    def __init__(
        self,
        own: np.ndarray,
        measured: np.ndarray,
        effort: np.ndarray,
        states: States,
        *,
        jacobian: Callable[[], np.ndarray],
        friction: np.ndarray,
        time: np.ndarray,
        labels: np.ndarray,
        rows: np.ndarray,
        effort_unit: str,
    ) -> None:
        """Take the attributes, the segment of each row, `labels`, (m,), and the `rows` that count, (k,).

        `own`, (k, p), are the columns of the parameters in these rows. `jacobian` gives them in all rows: hours of data
        have no memory for them.
        """
        self._jacobian, self.friction, self.time, self.effort_unit = jacobian, friction, time, effort_unit
        self.measured, self.effort, self.states = measured, effort, states
        self.stiffness = (-1, 0.0)  # column and value of the stiffness of a parallel spring; no column: -1
        self._rows, self._labels = rows, labels[rows]
        self._target = (measured - effort)[rows]
        self._columns, self._own = own, _with_unit_columns(own)
        self._beside = self._own[:, :0]
        # A twisted angle is no friction, and its column is nearly that of a misaligned axis.
        others = (*TRAVEL_EFFECTS, UNEQUAL_LOAD_LOSSES, TWISTED_ANGLE)
        used = self.states.part(self._rows)
        self._add([f(used) for n, f in NEGLECTED_EFFECTS.items() if n not in others])

    @cached_property
    def jacobian(self) -> np.ndarray:
        """Columns of the model's parameters in all rows, (m, p)."""
        return self._jacobian()

    def add(self, columns: Sequence[np.ndarray]) -> None:
        """Make columns, each of shape (m,), part of the model that causes extend."""
        self._add([each[self._rows] for each in columns])

    def _add(self, columns: Sequence[np.ndarray]) -> None:
        """Make columns in the rows that count part of the model."""
        made, basis = self._scaled(columns), np.column_stack([self._own, self._beside])
        shared = basis.T @ made
        left = 1.0 - np.sum(shared * _solve(basis.T @ basis, shared), axis=0)
        self._beside = np.column_stack([self._beside, made[:, left > MIN_SQUARED_REMAINDER]])

    def saved(self, columns: Sequence[np.ndarray], before: np.ndarray | None = None) -> tuple[float, float]:
        """Return the share of the squared error on left-out stretches that columns save, and its p value.

        `before`, (m,), is another effort, which the model without the columns is compared on.
        """
        wide = np.column_stack([self._own, self._beside, self._made(columns)])
        if len(self._rows) < MIN_ROWS_PER_COLUMN * wide.shape[1]:
            return 0.0, 1.0
        plain = wide[:, : self._own.shape[1] + self._beside.shape[1]]
        target = self._target if before is None else (before - self.effort)[self._rows]
        return _compare(self._left_out(plain, target), self._left_out(wide, self._target))

    @cached_property
    def own_error(self) -> float:
        """Mean square error of the model alone on left-out stretches, in the effort's unit squared."""
        return float(np.mean(self._left_out(self._own, self._target) ** 2))

    @property
    def error(self) -> float:
        """Mean square error of the extended model in cross-validation."""
        return float(np.mean(self._left_out(np.column_stack([self._own, self._beside]), self._target) ** 2))

    def share(self, columns: Sequence[np.ndarray]) -> float:
        """Return the share of the squared error of the model alone that columns save."""
        wide = np.column_stack([self._own, self._made(columns)])
        return max(_compare(self._left_out(self._own, self._target), self._left_out(wide, self._target))[0], 0.0)

    def saved_beyond(self, columns: Sequence[np.ndarray], others: Sequence[np.ndarray]) -> tuple[float, float]:
        """Return the share of the squared error of the extended model and `others` that columns save, and its p
        value."""
        plain = np.column_stack([self._own, self._beside, self._made(others)])
        wide = np.column_stack([plain, self._made(columns)])
        return _compare(self._left_out(plain, self._target), self._left_out(wide, self._target))

    def saved_beside(self, columns: Sequence[np.ndarray], beside: Sequence[np.ndarray]) -> tuple[float, float]:
        """Return the share of the squared error of the model and a few columns that others save, and its p value."""
        plain = np.column_stack([self._own, self._made(beside)])
        wide = np.column_stack([plain, self._made(columns)])
        return _compare(self._left_out(plain, self._target), self._left_out(wide, self._target))

    def contrast(self, near: np.ndarray) -> tuple[float, float]:
        """Return how many times larger the squared error is in rows `near`, a mask of shape (m,), than in the others.

        It is the median over left-out stretches, by the extended model; 1 where too few stretches have both kinds of
        rows. The second number is the share of the squared error by which that of all rows exceeds that of the others.
        """
        squares = self._left_out(np.column_stack([self._own, self._beside]), self._target) ** 2
        near, ratios = near[self._rows], []
        blocks = np.unique(self._labels)
        for block in blocks:
            own = self._labels == block
            inside, outside = squares[own & near], squares[own & ~near]
            if min(len(inside), len(outside)) >= MIN_CONTRASTED_ROWS:
                ratios.append(float(inside.mean()) / max(float(outside.mean()), np.finfo(float).tiny))
        if 2 * len(ratios) < len(blocks):
            return 1.0, 0.0
        return float(np.median(ratios)), 1.0 - float(squares[~near].mean()) / float(squares.mean())

    def coefficients(self, columns: Sequence[np.ndarray]) -> np.ndarray:
        """Return the least-squares coefficients of additional columns, (k,)."""
        made = np.column_stack([each[self._rows] for each in columns])
        norms = _norms(made)
        wide = np.column_stack([self._own, self._beside, made / norms])
        return np.linalg.lstsq(wide, self._target, rcond=1e-10)[0][-made.shape[1] :] / norms

    def spring(self) -> tuple[float, float, float] | None:
        """Return the least-squares stiffness of a spring in parallel to the drive, with its error.

        The third number is that of independent rows. There is no result where too few rows are left.
        """
        if len(self._rows) < MIN_ROWS_PER_COLUMN * (self._own.shape[1] + self._beside.shape[1] + 1):
            return None
        position = self.states.position[self._rows]
        others = np.arange(self._columns.shape[1]) != self.stiffness[0]
        wide = np.column_stack([_with_unit_columns(self._columns[:, others]), self._beside])
        scales, vectors = np.linalg.eigh(wide.T @ wide)
        kept = scales > MIN_RELATIVE_EIGENVALUE * scales[-1]
        basis = wide @ (vectors[:, kept] / np.sqrt(scales[kept]))
        target = self._target + self.stiffness[1] * position
        apart, target = (x - basis @ (basis.T @ x) for x in (position, target))
        size = float(apart @ apart)
        stiffness = float(apart @ target) / size
        left = target - stiffness * apart
        memory = max(2.0 * correlation_time(left, [len(left)]), 1.0)
        return stiffness, float(np.sqrt(memory * np.mean(left**2) / size)), len(left) / memory

    def _made(self, columns: Sequence[np.ndarray]) -> np.ndarray:
        return self._scaled([each[self._rows] for each in columns])

    def _scaled(self, columns: Sequence[np.ndarray]) -> np.ndarray:
        return _with_unit_columns(np.column_stack([self._own[:, :0], *columns]))

    def _left_out(self, columns: np.ndarray, target: np.ndarray) -> np.ndarray:
        """Return the residual, (k,), of each stretch by a fit of `columns`, (k, p), to the others."""
        gram, moment, made = columns.T @ columns, columns.T @ target, np.empty(len(target))
        blocks = [own for _, own in rows_of_blocks(self._labels)]
        grams = np.array([gram - columns[own].T @ columns[own] for own in blocks])
        moments = np.array([moment - columns[own].T @ target[own] for own in blocks])
        for own, values in zip(blocks, _solve(grams, moments[:, :, None])[:, :, 0], strict=True):
            made[own] = target[own] - columns[own] @ values
        return made


class LeftOutStretches(LeftOutColumns):
    """Rows of a single joint's regression, with the model that causes extend.

    Attributes
    ----------
    model : JointModel
        Model that is extended, p parameters.
    values : ndarray, shape (p,)
        Its values.
    """

    def __init__(
        self,
        model: JointModel,
        data: Stack[Motion],
        values: np.ndarray,
        states: States,
        slow_speed_share: float,
        found: Solution | None = None,
    ) -> None:
        """Take the attributes, and the solution `found` whose values these are, if there is one."""
        rows = counted_rows(_share_of_slow_samples(data, slow_speed_share) < SLOW_SHARE)
        if found is not None and found.is_exact:
            own, effort = found.jacobian[rows], data.target - found.residual
        else:
            own, effort = regression_rows(model, values, data, rows)
        self.model, self.data, self.values = model, data, values
        super().__init__(
            own, data.target, effort, states,
            jacobian=lambda: regression_rows(model, values, data)[0],
            friction=np.array([is_friction(name) for name in model.names], bool),
            time=shares_of_time(data),
            labels=segments_of(data.lengths),
            rows=rows,
            effort_unit=model.effort_unit,
        )  # fmt: skip
        if PARALLEL_STIFFNESS in model.names:
            at = model.names.index(PARALLEL_STIFFNESS)
            self.stiffness = at, float(values[at])

    def column(self, signal: Callable[[Motion], np.ndarray]) -> np.ndarray:
        """Return a signal of every motion, (n,), in the rows of the regression, (m,)."""
        return np.concatenate([m.rows(signal(m)) for m in self.data.motions])

    def columns(self, signals: Callable[[Motion], np.ndarray]) -> list[np.ndarray]:
        """Return signals of every motion, (n, k), in the rows of the regression, k of (m,)."""
        return list(np.concatenate([m.rows(signals(m)) for m in self.data.motions]).T)


def counted_rows(kept: np.ndarray) -> np.ndarray:
    """Return the rows that a mask, (m,), keeps, thinned if there are many."""
    rows = np.flatnonzero(kept)
    return rows[:: max(1, -(-len(rows) // MAX_ROWS))]


def segments_of(lengths: Sequence[int]) -> np.ndarray:
    """Return the segment of each row, (m,), of stretches with so many rows."""
    return np.concatenate(block_labels(lengths))


def _solve(gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Solve normal equations of unit columns, (..., p, p), for (..., p, k); by least norm if they are dependent."""
    try:
        # The trace bounds the largest eigenvalue, so that no direction counts as undetermined.
        trace = np.trace(gram, axis1=-2, axis2=-1)[..., None, None]
        np.linalg.cholesky(gram - MIN_RELATIVE_EIGENVALUE * trace * np.eye(gram.shape[-1]))
    except np.linalg.LinAlgError:
        if gram.ndim > 2:
            return np.array([_solve(*each) for each in zip(gram, moment, strict=True)])
        return np.linalg.lstsq(gram, moment, rcond=MIN_RELATIVE_EIGENVALUE)[0]
    return np.linalg.solve(gram, moment)


def _compare(before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
    """Return the share of the squares of a residual that another one saves, and the p value of that."""
    found = compare_held_out({"before": [before], "after": [after]}, 0.0)
    if found.winner == "before":
        return 0.0, 1.0
    return 1.0 - float(after @ after) / float(before @ before), found.p_values["before"]


def _norms(columns: np.ndarray) -> np.ndarray:
    norms = np.linalg.norm(columns, axis=0)
    return np.where(norms > 0.0, norms, 1.0)


def _with_unit_columns(columns: np.ndarray) -> np.ndarray:
    """Return the columns that are not 0, scaled to unit norm."""
    return (columns / _norms(columns))[:, columns.any(axis=0)]


def _share_of_slow_samples(data: Stack[Motion], share: float) -> np.ndarray:
    """Return the share of each row, (m,), that the filters take from speeds below a share of the usual one."""
    known = vars(data).setdefault("_slow_samples", {})
    if share not in known:  # computed once, because every model of these recordings has the same kinematics
        power = sum(float(m.velocity @ m.velocity) for m in data.motions)
        slow = share * np.sqrt(power / sum(len(m.velocity) for m in data.motions))
        parts = [m.rows(np.abs(m.smooth((np.abs(m.velocity) <= slow).astype(float)))) for m in data.motions]
        known[share] = np.concatenate(parts)
    return known[share]
