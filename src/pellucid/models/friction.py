"""Curve of friction over velocity for reports, with the confidence interval from the parameters' covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import _core
from .joint import JointModel


@dataclass(frozen=True)
class FrictionCurve:
    """Friction of one joint over a range of velocities, at one load."""

    velocity: np.ndarray  # (n,) [rad/s or m/s]
    load: float  # What the joint carries besides friction: gravity and inertia, in the effort's unit
    friction: np.ndarray  # friction, standard_error: (n,) In the effort's unit; positive opposes positive velocity
    standard_error: np.ndarray


def friction_curve(
    model: JointModel, values: np.ndarray, covariance: np.ndarray, velocity: np.ndarray, load: float = 0.0
) -> FrictionCurve:
    """The core's friction over `velocity`, with its standard error by the delta method. `values` (p,); `covariance`
    (p, p); `velocity` (n,) [rad/s or m/s]."""
    velocity = np.ascontiguousarray(velocity, float)
    values = np.asarray(values, float)
    carried = np.full_like(velocity, load)

    def friction(at: np.ndarray) -> np.ndarray:
        return np.asarray(_core.friction(model.vector(at), velocity, carried))

    # Steps far below the standard errors: the curve is smooth in its parameters.
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    steps = np.where(scale > 0.0, 1e-3 * scale, 1e-6 * np.maximum(np.abs(values), 1e-3))
    jacobian = np.empty((len(velocity), len(values)))
    for j, step in enumerate(steps):
        ahead, behind = values.copy(), values.copy()
        ahead[j] += step
        behind[j] -= step
        jacobian[:, j] = (friction(ahead) - friction(behind)) / (2.0 * step)
    variance = np.einsum("ij,jk,ik->i", jacobian, np.asarray(covariance, float), jacobian)
    return FrictionCurve(velocity, float(load), friction(values), np.sqrt(np.maximum(variance, 0.0)))
