"""Weighted least squares: weights by speed and recording, and Huber's weights against outliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...models.joint import JointModel
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack
from ...numerics.robust_weights import MAX_REWEIGHTINGS, robust_weights
from .friction_solver import solve_family

SPEED_BINS = 8
"""Number of speed bands, each with a weight of its own in every recording."""

def speed_weights(model: JointModel, data: Stack[Motion], residual: np.ndarray) -> np.ndarray:
    """Return weights, (m,): 1 / standard deviation of the residual, per recording and per band of speed.

    Friction models err most at low speed, so those samples get less weight. `residual` has shape (m,).
    """
    speed = data.reduced([np.abs(m.velocity) for m in data.motions])
    edges = np.quantile(speed, np.linspace(0.0, 1.0, SPEED_BINS + 1)[1:-1])
    band = np.searchsorted(edges, speed)
    owner = np.repeat(np.arange(len(data.motions)), data.lengths)
    group = owner * SPEED_BINS + band
    power = np.bincount(group, residual**2)
    count = np.bincount(group)
    free = 1.0 - len(model.symbols) / len(residual)
    sd = np.sqrt(power[group] / np.maximum(count[group], 1) / free)
    floor = 0.05 * np.sqrt(np.mean(residual**2)) + np.finfo(float).tiny
    return 1.0 / np.maximum(sd, floor)


def solve_weighted(model: JointModel, data: Stack[Motion], first: Solution, consistent: bool = True) -> Solution:
    """Solve weighted least squares with weights from the residuals of `first`, refined twice."""
    found = first
    for _ in range(3):
        w = speed_weights(model, data, found.residual)
        found = solve_family(model, data, weights=w, consistent=consistent, after=found)
    return found


def solve_robust(model: JointModel, data: Stack[Motion], first: Solution, consistent: bool = True) -> Solution:
    """Solve iteratively reweighted least squares with Huber's weights.

    Iterations end when no parameter changes by more than 1e-4 of its value.
    """
    found = first
    for iteration in range(MAX_REWEIGHTINGS):
        w = robust_weights(found.residual)
        before, found = found, solve_family(model, data, weights=w, consistent=consistent, after=found)
        step = np.max(np.abs(found.values - before.values) / np.maximum(np.abs(before.values), 1e-9))
        if step < 1e-4:
            return replace(found, iterations=iteration + 1, converged=True)
    return replace(found, iterations=MAX_REWEIGHTINGS, converged=False)
