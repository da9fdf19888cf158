r"""Find parameters that change over the time of a recording, as a warming drive or a drifting sensor makes them.

Each parameter may change along a straight line over every recording,

.. math::
   \tau = W (\beta + s_t d) + e, \qquad s_t \in [-1/2, 1/2],

with s the time in the recording, centred and divided by its duration, and d the change from start to end. Parameters
drift if these columns save at least the share `MIN_IMPROVEMENT` of the error on blocks that are predicted from the
others, and if a change of their own is told from 0 at a confidence level that is corrected for their number
(Bonferroni). Least squares may weigh any part of a recording most, and a user may need the parameter of any other. The
interval therefore gets the variance :math:`d^2/4` of a parameter that is the start's or the end's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...numerics.block_test import MIN_IMPROVEMENT
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack
from ...numerics.uncertainty import sandwich_covariance
from .crossed_residuals import cross_validated_residuals
from .discrepancy import Discrepancy

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
