r"""Estimate the drive constant from recordings with known payloads.

A payload of mass m at distance l adds :math:`m l^2` to the inertia and :math:`m g l` to the gravity of its recording.
In the drive's own unit u (ampere or volt)

.. math::  u = u(\beta', c), \qquad c = 1/k

where c multiplies the payload's contribution. It is one more parameter of the regression, with its interval. The
payloads must differ between recordings; otherwise the payload's column is proportional to columns of the joint. A
`model` with load friction includes the friction that the payload causes. Without that term, load friction counts as
gravity of the joint.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...models.filtered_dynamics import filtered_jacobian
from ...models.joint import JointModel
from ...models.parameter import Parameter
from ...numerics.motion import Motion
from ...numerics.regression import Stack, least_squares_within
from ...numerics.uncertainty import sandwich_covariance
from .friction_solver import solve_family

MAX_STEPS = 30
"""Gauss-Newton steps; a model without load friction needs two."""

STEP_TOLERANCE = 1e-7
"""The search ends when a step changes the effort by less than this share of it."""


def estimate_drive_constant(model: JointModel, data: Stack[Motion]) -> Parameter:
    """Estimate the effort per ampere or volt from known payloads [N*m/A, N*m/V, N/A or N/V]."""
    if len({m.payload for m in data.motions}) < 2:
        raise IdentificationError(
            "the drive constant needs recordings with at least two different payloads (none counts as one); "
            f"found {data.motions[0].payload[0]:g} kg in all"
        )
    lower, upper = (np.append(bound, end) for bound, end in zip(model.bounds(), (-np.inf, np.inf), strict=True))
    # The payload's scale starts at 0; the first step estimates it.
    values = np.append(solve_family(replace(model, payload_scale=0.0), data).values, 0.0)
    size = float(np.linalg.norm(data.target))
    for _ in range(MAX_STEPS):
        w, residual = _rows_with_payload(model, values, data)
        norms = np.linalg.norm(w, axis=0)
        if np.linalg.cond(w / np.maximum(norms, np.finfo(float).tiny)) > 1e6:
            raise IdentificationError("the payload's effort cannot be told from the joint's own in these recordings")
        step = least_squares_within(w, residual, lower - values, upper - values)
        values = values + step
        if np.linalg.norm(w @ step) < STEP_TOLERANCE * size:
            break
    w, residual = _rows_with_payload(model, values, data)
    covariance = sandwich_covariance(w, residual, data.lengths)
    inverse, sd = values[-1], float(np.sqrt(covariance[-1, -1]))
    if not inverse > 3.0 * sd:
        raise IdentificationError(
            f"the payload's effect on the drive is {inverse:.3g} +- {sd:.2g} {model.effort_unit} per unit of effort: "
            "too small or of the wrong sign; check the payload's mass and the sign of the drive's channel"
        )
    unit = f"{'N*m' if model.motion == 'rotary' else 'N'}/{model.effort_unit}"
    return Parameter("drive_constant", unit, float(1.0 / inverse), float(sd / inverse**2))


def _rows_with_payload(model: JointModel, values: np.ndarray, data: Stack[Motion]) -> tuple[np.ndarray, np.ndarray]:
    """Return the regressor, (m, p + 1), of the free parameters and the payload's scale, and the residual, (m,).

    The last of `values`, (p + 1,), is the scale.
    """
    scaled = replace(model, payload_scale=float(values[-1]))
    columns, efforts = [], []
    for motion in data.motions:
        own = scaled.vector(values[:-1])
        one = np.zeros_like(own)
        payload = replace(model, payload_scale=1.0).loaded(one, *motion.payload)
        selection = np.column_stack([model.selection(), payload])
        effort, jacobian = filtered_jacobian(scaled.loaded(own, *motion.payload), selection, motion)
        columns.append(motion.rows(jacobian))
        efforts.append(motion.rows(effort))
    return np.concatenate(columns), data.target - np.concatenate(efforts)
