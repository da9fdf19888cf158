r"""Estimators for a robot's parameters: ordinary, weighted and robust least squares, instrumental variables, and output
error.

In ordinary least squares the strongest joint dominates. Weighted least squares, the default, weights each joint by its
residual. Robust least squares reduces, within each joint, the weight of residuals beyond Huber's 1.345 robust standard
deviations. All three assume an exact motion. Noise in the motion makes the columns noisy and biases the estimates
towards zero. Instruments Z that follow the motion but not its noise avoid this bias:

.. math::
   \beta \leftarrow \beta + \Big(\sum_j w_j Z_j^T W_j\Big)^{-1} \sum_j w_j Z_j^T \rho_j .

Simulated instruments would need the controller and its reference. Here Z is the mean of the regressor a short lag
before and after. Over that lag the noise is no longer correlated, while the motion still is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...numerics.robust_weights import MAX_REWEIGHTINGS, robust_weights
from .output_error import solve_output_error
from .tree_regression import LinearisedModel, TreeModel, TreeRows, TreeSolution, compute_loads, fit_rows, linearise_rows

ESTIMATION_METHODS = ("ordinary", "weighted", "robust", "instrumental", "output_error")
"""Estimators by name, the plainest first."""

INSTRUMENT_LAG_S = 0.02
"""Lag of the instruments [s], twice the memory of a 50 Hz low-pass."""

EFFORT_CHANGE_TOLERANCE = 1e-4
"""Iterations stop when a step changes every joint's effort by less than this share of its RMS effort."""


def solve_by_method(method: str, model: TreeModel, rows: TreeRows, rate: float) -> tuple[TreeSolution, LinearisedModel]:
    """Solve for a model's parameters by one of `ESTIMATION_METHODS`; `rate` is that of the rows [Hz]."""
    if method == "ordinary":
        return fit_rows(model, rows, rounds=0)
    if method == "weighted":
        return fit_rows(model, rows)
    if method == "robust":
        return solve_robust(model, rows)
    if method == "instrumental":
        return solve_instrumental(model, rows, max(1, round(INSTRUMENT_LAG_S * rate)))
    if method == "output_error":
        return solve_output_error(model, rows, rate)
    raise IdentificationError(f"found method {method!r}, expected one of {', '.join(ESTIMATION_METHODS)}")


def solve_robust(model: TreeModel, rows: TreeRows) -> tuple[TreeSolution, LinearisedModel]:
    """Solve weighted least squares with Huber's weights within each joint, until the efforts settle."""
    found, at = fit_rows(model, rows)
    for iteration in range(MAX_REWEIGHTINGS):
        weights = [robust_weights(r) ** 2 for r in at.residuals(found.values)]
        before, (found, at) = found, fit_rows(model, rows, weights=weights, start=found)
        if _largest_effort_change(at, found.values - before.values) < EFFORT_CHANGE_TOLERANCE:
            return replace(found, iterations=iteration + 1, converged=True), at
    return replace(found, iterations=MAX_REWEIGHTINGS, converged=False), at


def solve_instrumental(model: TreeModel, rows: TreeRows, lag: int) -> tuple[TreeSolution, LinearisedModel]:
    """Solve with instruments from the columns `lag` rows before and after.

    Rows within `lag` rows of either end of a recording do not count.
    """
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
        at = linearise_rows(model, kept, compute_loads(rows, model, values), model.alpha(values))
        z = _lagged_mean_columns(model, rows, values, kept, lag)
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
        converged, values = _largest_effort_change(at, after - values) < EFFORT_CHANGE_TOLERANCE, after
    at = linearise_rows(model, kept, compute_loads(rows, model, values), model.alpha(values))
    sd = np.array([np.sqrt(np.mean(r**2)) for r in at.residuals(values)])
    return replace(found, values=values, sd=sd, iterations=steps, converged=converged), at


def _lagged_mean_columns(
    model: TreeModel, rows: TreeRows, values: np.ndarray, kept: TreeRows, lag: int
) -> tuple[np.ndarray, ...]:
    """Return the mean of each joint's columns `lag` rows before and after the rows `kept`, (n_j, c)."""
    sides = []
    for by in (-lag, lag):
        used = np.roll(kept.used, by, axis=0)
        there = replace(rows, used=used)
        sides.append(linearise_rows(model, there, compute_loads(rows, model, values), model.alpha(values)).columns)
    return tuple(0.5 * (a + b) for a, b in zip(*sides, strict=True))


def _largest_effort_change(at: LinearisedModel, step: np.ndarray) -> float:
    """Return the largest RMS effort that a step makes at any joint, divided by that joint's RMS effort."""
    each = zip(at.places, at.columns, at.rows.size, strict=True)
    return max(float(np.sqrt(np.mean((x @ step[place]) ** 2)) / size) for place, x, size in each)
