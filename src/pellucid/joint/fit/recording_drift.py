r"""Find parameters that change from recording to recording, as hot and cold machines or a gain set anew make them.

Every fitted recording r that determines its parameters has an estimate of its own, :math:`b_r`, with a variance
:math:`v_r` that allows for coloured residuals and for what the model neglects: a motion may show an effect that another
does not, and that is no drift. A parameter differs if Cochran's

.. math::
   Q = \sum_r \frac{(b_r - \bar b)^2}{v_r}, \qquad \bar b = \frac{\sum_r b_r / v_r}{\sum_r 1 / v_r}

is larger than chance allows, at a level that is corrected for the number of parameters (Bonferroni), and if parameters
of their own save at least the share `MIN_IMPROVEMENT` of the error on blocks that are left out. The variance between
recordings is that of DerSimonian and Laird [1]_. A value for all recordings, and for the next one, is uncertain by it;
the interval therefore gets it.

.. [1] R. DerSimonian, N. Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7, 1986.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...numerics.block_test import MIN_IMPROVEMENT
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack
from .crossed_residuals import cross_validated_residuals
from .recording_agreement import RecordingRows, estimate_step

RECORDING_DRIFT_CAUSE = "a drift between recordings"
"""Cause that is stated where the spread between recordings adds most to a parameter's interval."""


@dataclass(frozen=True)
class RecordingDrift:
    """Parameters by recording, and how far they spread beyond their errors."""

    names: tuple[str, ...]  # parameters, p of them
    recordings: tuple[str, ...]  # recordings with estimates of their own, r of them
    values: np.ndarray  # estimates of each recording, (r, p), SI
    spread: np.ndarray  # standard deviation between recordings beyond the estimates' own errors, (p,), SI
    is_told: np.ndarray  # mask of the parameters that differ, (p,)
    improvement: float  # share of the error on blocks left out that parameters by recording save

    @property
    def covariance(self) -> np.ndarray:
        """What the spread adds to the parameters' covariance, (p, p)."""
        return np.diag(np.where(self.is_told, np.square(self.spread), 0.0))


def find_recording_drift(
    names: Sequence[str], found: Solution, data: Stack[Motion], *, neglected: np.ndarray, level: float = 0.95
) -> RecordingDrift | None:
    """Return the parameters by recording of the solution `found` on `data`.

    `neglected`, (p, p), is the covariance that allows for what the model neglects. Parameters on a bound or without an
    effect do not differ. `level` is the confidence level for all parameters
    together. Returns None where fewer than two recordings determine their parameters.
    """
    from scipy.special import chdtrc

    owner = [m.recording for m in data.motions]
    if len(set(owner)) < 2:
        return None
    weights = found.weights[:, None]
    w, residual = found.jacobian * weights, found.residual * found.weights
    norms = np.linalg.norm(w, axis=0)
    free = (norms > 1e-12 * norms.max()) & ~found.at_bound
    if not free.any() or not np.any(residual):
        return None
    rows = np.repeat(owner, data.lengths)
    parts, steps, variances = [], [], []
    for name in dict.fromkeys(owner):
        mine = rows == name
        lengths = [n for n, own in zip(data.lengths, owner, strict=True) if own == name]
        part = RecordingRows(name, "fitted", w[mine][:, free], residual[mine], residual[mine], lengths)
        step = estimate_step([part])
        if step is not None and np.all(np.diag(step[1]) > 0.0):
            parts.append(part)
            steps.append(step[0])
            variances.append(np.diag(step[1]) + np.diag(neglected)[free])
    if len(parts) < 2:
        return None
    own, variance = np.array(steps), np.array(variances)
    precision = 1.0 / variance
    mean = (own * precision).sum(axis=0) / precision.sum(axis=0)
    excess = (precision * (own - mean) ** 2).sum(axis=0)
    usual = precision.sum(axis=0) - (precision**2).sum(axis=0) / precision.sum(axis=0)
    between = np.sqrt(np.maximum(excess - (len(parts) - 1), 0.0) / usual)
    improvement = _improvement(parts)
    p_values = chdtrc(len(parts) - 1, excess)
    values = np.tile(found.values, (len(parts), 1))
    values[:, free] += own
    spread, told = np.zeros(len(names)), np.zeros(len(names), bool)
    spread[free] = between
    told[free] = (p_values < (1.0 - level) / free.sum()) & (improvement >= MIN_IMPROVEMENT)
    return RecordingDrift(tuple(names), tuple(p.recording for p in parts), values, spread, told, improvement)


def _improvement(parts: Sequence[RecordingRows]) -> float:
    """Return the share of the error on blocks left out that parameters by recording save."""
    errors = [_error_without_blocks(parts), float(np.linalg.norm([_error_without_blocks([p]) for p in parts]))]
    return 1.0 - errors[1] / errors[0] if errors[0] > 0.0 else 0.0


def _error_without_blocks(parts: Sequence[RecordingRows]) -> float:
    """Return the norm of the residuals of blocks that are predicted from the others of the same recordings."""
    w, e = np.concatenate([p.w for p in parts]), np.concatenate([p.e for p in parts])
    step = np.linalg.lstsq(w, e, rcond=1e-10)[0]
    solution = Solution(step, w, e - w @ step, np.ones(len(e)), np.zeros(w.shape[1], bool), 1, True)
    lengths = [n for p in parts for n in p.lengths]
    return float(np.linalg.norm(np.concatenate(cross_validated_residuals(solution, lengths))))
