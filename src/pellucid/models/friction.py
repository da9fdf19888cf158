"""Friction against velocity, with the interval that the parameters' covariance leaves: what a report draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import _core
from .joint import JointModel


@dataclass(frozen=True)
class FrictionCurve:
    """Friction of one joint over a range of velocities, at one load.

    Parameters
    ----------
    velocity : ndarray, shape (n,)
        [rad/s or m/s].
    load : float
        What the joint carries besides friction: gravity and inertia, in the effort's unit.
    friction, standard_error : ndarray, shape (n,)
        In the effort's unit; positive opposes positive velocity.
    """

    velocity: np.ndarray
    load: float
    friction: np.ndarray
    standard_error: np.ndarray


def friction_curve(
    model: JointModel, values: np.ndarray, covariance: np.ndarray, velocity: np.ndarray, load: float = 0.0
) -> FrictionCurve:
    """The core's friction over `velocity`, with its standard error by the delta method.

    Parameters
    ----------
    model : JointModel
    values : ndarray, shape (p,)
        Free parameters in the order of `model.symbols`, SI.
    covariance : ndarray, shape (p, p)
        Of `values`.
    velocity : ndarray, shape (n,)
        [rad/s or m/s].
    load : float
        Load the joint carries, in the effort's unit.

    Returns
    -------
    FrictionCurve
    """
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
