"""Find friction that changes within a recording, as that of a gear that warms up does: by its residual over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...numerics.block_test import MIN_IMPROVEMENT
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack
from ...numerics.uncertainty import sandwich_covariance
from .discrepancy import Discrepancy
from .friction_solver import cross_validated_residuals

BLOCK_COUNT = 8
"""A recording is divided into this many blocks of time."""

MIN_ROWS_PER_BLOCK = 20
"""Smallest number of rows in a block that tell its friction."""


@dataclass(frozen=True)
class FrictionDrift:
    """Change of the friction level over one recording."""

    change: float  # friction at its end minus friction at its start, by a straight line [N m or N]
    standard_error: float  # standard error of the change, from the blocks' scatter about the line [N m or N]

    @property
    def z_value(self) -> float:
        """The change over its standard error."""
        return self.change / self.standard_error if self.standard_error > 0.0 else 0.0


def find_friction_drift(time: np.ndarray, velocity: np.ndarray, residual: np.ndarray) -> FrictionDrift | None:
    """Return how much the friction level changes over a recording; None if it is too short to tell.

    Parameters
    ----------
    time, velocity, residual : ndarray, shape (n,) each
        Time [s], velocity [rad/s or m/s], and measured minus predicted effort [N m or N], without rows at rest.
    """
    edges = np.linspace(time[0], time[-1], BLOCK_COUNT + 1) if len(time) else np.zeros(1)
    centres, levels = [], []
    for low, high in pairwise(edges.tolist()):
        inside = (time >= low) & (time <= high)
        way = np.sign(velocity[inside])
        # With both directions a constant residual does not look like friction.
        if min(int(np.sum(way > 0.0)), int(np.sum(way < 0.0))) < MIN_ROWS_PER_BLOCK:
            continue
        centres.append(0.5 * (low + high))
        levels.append(0.5 * (residual[inside][way > 0.0].mean() - residual[inside][way < 0.0].mean()))
    if len(levels) < BLOCK_COUNT // 2:
        return None
    x = np.array(centres) - np.mean(centres)
    y = np.array(levels)
    slope = float(x @ y / (x @ x))
    off = y - y.mean() - slope * x
    error = float(np.sqrt(off @ off / max(len(x) - 2, 1) / (x @ x)))
    span = float(time[-1] - time[0])
    return FrictionDrift(slope * span, error * span)


DRIFT_CAUSE = "a drift within recordings"
"""Cause that is stated where a drift adds most to a parameter's interval."""

MAX_ROWS = 50_000
"""Rows beyond this number are thinned; a drift is slow."""

MIN_ROWS_PER_PARAMETER = 50
"""Smallest number of rows for each parameter, from which a drift is estimated."""


@dataclass(frozen=True)
class ParameterDrift:
    """Changes of parameters from the start to the end of the recordings."""

    names: tuple[str, ...]  # parameters, p of them
    change: np.ndarray  # mean change from start to end of a recording, (p,), SI
    standard_error: np.ndarray  # its standard error, (p,), SI
    is_told: np.ndarray  # mask of the parameters that drift, (p,)
    improvement: float  # share of the error on blocks left out that drifts save

    @property
    def covariance(self) -> np.ndarray:
        """What the drift adds to the parameters' covariance, (p, p)."""
        return np.diag(np.where(self.is_told, np.square(self.change) / 4.0, 0.0))


def find_parameter_drift(
    names: Sequence[str], found: Solution, data: Stack[Motion], level: float = 0.95
) -> ParameterDrift | None:
    """Return the drift of the parameters of the solution `found` on `data`; None if there are too few rows.

    Parameters that have no effect do not drift. `level` is the confidence level for all parameters together.
    """
    from scipy.special import ndtri

    share = [_share_of_time(m, data.motions) for m in data.motions]
    step = max(1, -(-len(found.residual) // MAX_ROWS))
    ends = np.cumsum(data.lengths)[:-1]
    kept = np.concatenate([at[::step] for at in np.split(np.arange(len(found.residual)), ends)])
    lengths = [-(-n // step) for n in data.lengths]
    weights = found.weights[kept]
    w, residual = found.jacobian[kept] * weights[:, None], found.residual[kept] * weights
    norms = np.linalg.norm(w, axis=0)
    free = (norms > 1e-12 * norms.max()) & ~found.at_bound
    p = int(free.sum())
    if len(residual) < 2 * MIN_ROWS_PER_PARAMETER * max(p, 1) or not np.any(residual):
        return None
    w = w[:, free]
    both = np.hstack([w, w * np.concatenate(share)[kept, None]])
    scale = np.linalg.norm(both, axis=0)
    if not np.all(scale > 0.0):
        return None
    both = both / scale
    one = np.ones(len(residual))
    steps = np.linalg.lstsq(both, residual, rcond=1e-10)[0]
    with_drift = Solution(steps, both, residual - both @ steps, one, np.zeros(2 * p, bool), 1, True)
    plain_steps = np.linalg.lstsq(both[:, :p], residual, rcond=1e-10)[0]
    plain = Solution(plain_steps, both[:, :p], residual - both[:, :p] @ plain_steps, one, np.zeros(p, bool), 1, True)
    errors = [
        float(np.linalg.norm(np.concatenate(cross_validated_residuals(each, lengths)))) for each in (plain, with_drift)
    ]
    improvement = 1.0 - errors[1] / errors[0] if errors[0] > 0.0 else 0.0
    covariance = sandwich_covariance(both, with_drift.residual, lengths)
    change, error = np.zeros(len(names)), np.full(len(names), np.inf)
    change[free] = (steps / scale)[p:]
    error[free] = np.sqrt(np.maximum(np.diag(covariance), 0.0))[p:] / scale[p:]
    times = float(ndtri(1.0 - 0.5 * (1.0 - level) / p))
    told = (np.abs(change) > times * error) & (improvement >= MIN_IMPROVEMENT)
    return ParameterDrift(tuple(names), change, error, told, improvement)


def add_drift(discrepancy: Discrepancy, drift: np.ndarray, drift_cause: str = DRIFT_CAUSE) -> Discrepancy:
    """Return the discrepancy with what a `drift` adds to the covariance, (p, p), of the same parameters."""
    before, added = np.diag(discrepancy.covariance), np.diag(drift)
    causes = tuple(
        drift_cause if more > usual else cause
        for cause, usual, more in zip(discrepancy.causes, before, added, strict=True)
    )
    return replace(discrepancy, covariance=discrepancy.covariance + drift, causes=causes)


def _share_of_time(motion: Motion, motions: Sequence[Motion]) -> np.ndarray:
    """Return the time of a motion's rows from -1/2 at the start of its recording to 1/2 at its end, (n,)."""
    same = [m.time for m in motions if m.recording == motion.recording]
    first, last = min(float(t[0]) for t in same), max(float(t[-1]) for t in same)
    return (motion.states[:, 0] - first) / max(last - first, np.finfo(float).tiny) - 0.5
