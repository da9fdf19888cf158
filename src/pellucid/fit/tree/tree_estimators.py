r"""Other ways to the same numbers: ordinary and robust least squares, instruments against noise in the motion; and by
name, output error.

Ordinary least squares lets the strongest joint drown the weakest. Weighted least squares, the house's choice, gives
each joint the weight of its residual. Robust least squares lowers, within each joint, what lies beyond Huber's 1.345
robust deviations. All three take the recorded motion for exact. Where it is not, columns carry noise, and estimates
shrink; instruments Z that follow the motion but not its noise do not,

.. math::
   \beta \leftarrow \beta + \Big(\sum_j w_j Z_j^T W_j\Big)^{-1} \sum_j w_j Z_j^T \rho_j .

Without a controller and its reference no loop can be simulated; Z is then the same regressor a little before and a
little after, their mean: noise of the motion has forgotten itself over that lag, and the motion has not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ..joint.reweighting import MAX_REWEIGHTINGS, robust_weights
from .output_error import solve_output_error
from .tree_regression import Linearised, TreeModel, TreeRows, TreeSolution, fit_rows, linearised, loads_of

METHODS = ("ordinary", "weighted", "robust", "instrumental", "output_error")
"""Plainest first."""
LAG = 0.02  # s; twice what a 50 Hz low-pass remembers
STAYS = 1e-4  # Of the RMS effort, the change at which iterations stop


def solved_by(method: str, model: TreeModel, rows: TreeRows, rate: float) -> tuple[TreeSolution, Linearised]:
    """A model's numbers by one of `METHODS`; rows at `rate` [Hz]."""
    if method == "ordinary":
        return fit_rows(model, rows, rounds=0)
    if method == "weighted":
        return fit_rows(model, rows)
    if method == "robust":
        return solve_robust(model, rows)
    if method == "instrumental":
        return solve_instrumental(model, rows, max(1, round(LAG * rate)))
    if method == "output_error":
        return solve_output_error(model, rows, rate)
    raise IdentificationError(f"found method {method!r}, expected one of {', '.join(METHODS)}")


def solve_robust(model: TreeModel, rows: TreeRows) -> tuple[TreeSolution, Linearised]:
    """Weighted least squares with Huber's weights within each joint, until efforts stay."""
    found, at = fit_rows(model, rows)
    for iteration in range(MAX_REWEIGHTINGS):
        weights = [robust_weights(r) ** 2 for r in at.residuals(found.values)]
        before, (found, at) = found, fit_rows(model, rows, weights=weights, start=found)
        if _change(at, found.values - before.values) < STAYS:
            return replace(found, iterations=iteration + 1, converged=True), at
    return replace(found, iterations=MAX_REWEIGHTINGS, converged=False), at


def solve_instrumental(model: TreeModel, rows: TreeRows, lag: int) -> tuple[TreeSolution, Linearised]:
    """Instruments are columns `lag` rows before and after; rows whose instruments are out of reach do not count."""
    found, _ = fit_rows(model, rows)
    n = len(rows.stretch)
    early, late = np.arange(n) - lag, np.arange(n) + lag
    whole = (early >= 0) & (late < n)
    whole[whole] = rows.stretch[early[whole]] == rows.stretch[late[whole]]
    kept = replace(rows, used=rows.used & whole[:, None])
    if not kept.used.any(axis=0).all():
        raise IdentificationError(
            f"instruments {lag} rows apart leave a joint without rows: expected longer recordings"
        )
    values, converged, steps = found.values.copy(), False, 0
    while not converged and steps < 10:
        steps += 1
        at = linearised(model, kept, loads_of(rows, model, values), model.alpha(values))
        z = _between(model, rows, values, kept, lag)
        p = len(values)
        gram, pull = np.zeros((p, p)), np.zeros(p)
        for j, (place, x, r) in enumerate(zip(at.places, at.columns, at.residuals(values), strict=True)):
            gram[np.ix_(place, place)] += z[j].T @ x / found.sd[j] ** 2
            pull[place] += z[j].T @ r / found.sd[j] ** 2
        free = np.flatnonzero(found.seen & ~found.held)
        size = np.sqrt(np.abs(np.diag(gram)))[free]
        unit = gram[np.ix_(free, free)] / np.outer(size, size)
        step = np.zeros(p)
        step[free] = np.linalg.solve(unit, pull[free] / size) / size
        lower, upper = model.bounds
        after = np.clip(values + step, lower, upper)
        converged, values = _change(at, after - values) < STAYS, after
    at = linearised(model, kept, loads_of(rows, model, values), model.alpha(values))
    sd = np.array([np.sqrt(np.mean(r**2)) for r in at.residuals(values)])
    return replace(found, values=values, sd=sd, iterations=steps, converged=converged), at


def _between(model: TreeModel, rows: TreeRows, values: np.ndarray, kept: TreeRows, lag: int) -> tuple[np.ndarray, ...]:
    """Mean of each joint's columns `lag` rows before and after those `kept`, (n_j, c)."""
    sides = []
    for by in (-lag, lag):
        used = np.roll(kept.used, by, axis=0)
        there = replace(rows, used=used)
        sides.append(linearised(model, there, loads_of(rows, model, values), model.alpha(values)).columns)
    return tuple(0.5 * (a + b) for a, b in zip(*sides, strict=True))


def _change(at: Linearised, step: np.ndarray) -> float:
    """Largest RMS effort that a step makes at a joint, over that joint's RMS effort."""
    each = zip(at.places, at.columns, at.rows.size, strict=True)
    return max(float(np.sqrt(np.mean((x @ step[place]) ** 2)) / size) for place, x, size in each)
