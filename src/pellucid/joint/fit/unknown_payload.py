r"""Estimate a payload that nobody stated, from a recording with it and a joint that was identified without it.

A payload adds inertia and weight, and nothing else. With the joint's parameters :math:`\beta` and the regressor W of
the recording,

.. math::
   \tau - \tau_{model}(\beta) = W_J\,\Delta J + W_g\,\Delta g + W_0\,\Delta\tau_0 + e

where an offset may differ, too. Friction that grows with the load grows with the payload, because both columns are
those of the model. A point mass at the distance d has :math:`\Delta g = m g d` and :math:`\Delta J = m d^2`. Errors of
the joint's parameters move the payload: the statistical ones through the recording's motion, those of neglected effects
by the share that they have of the joint's own inertia and weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.joint import GRAVITY, JointModel
from ...models.parameter import Parameter
from ...numerics.motion import Motion
from ...numerics.regression import reduce_motions, regression_rows
from ...numerics.uncertainty import sandwich_covariance

MIN_PAYLOAD_Z = 3.0
"""A payload is told if its weight and its inertia exceed zero by more than so many standard errors."""

MIN_EXPLAINED_SHARE = 0.5
"""A payload is told if it explains at least this share of the power of what the joint alone misses."""

MAX_DISTANCE_ERROR_SHARE = 0.25
"""Mass and distance are told apart only if the distance's standard error is at most this share of it."""

UNTOLD_DISTANCE = "this motion does not tell the payload's inertia well enough: state its distance, or move faster"
"""Reason why the interval of a payload's mass is refused."""


@dataclass(frozen=True)
class UnknownPayload:
    """A payload that was estimated from one recording."""

    recording: str
    weight: Parameter  # weight times distance [N*m]
    inertia: Parameter  # inertia about the joint's axis [kg*m^2]
    mass: Parameter  # mass as a point [kg]; refused if its distance cannot be told
    distance: Parameter  # its distance from the axis [m]
    explained: float  # share of the power that the joint alone misses which the payload explains, at most 1
    is_told: bool  # whether weight and inertia are certain and explain what is missed

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Mass and distance if they can be told, then weight and inertia."""
        point = (self.mass, self.distance) if self.mass.trusted else ()
        return (*point, self.weight, self.inertia)


def estimate_payload(
    model: JointModel,
    values: np.ndarray,
    covariance: np.ndarray,
    statistical: np.ndarray,
    motions: Sequence[Motion],
    distance: float = 0.0,
) -> UnknownPayload | None:
    """Estimate the payload in the motions of one recording; None if the model has no free inertia and weight.

    `values`, (p,), with `covariance` and its `statistical` part, both (p, p), are those of the joint without it. A
    stated `distance` [m] of more than 0 leaves the mass alone to be found.
    """
    names = list(model.names)
    if model.motion != "rotary" or model.effort_unit != "N*m" or not {"inertia", "gravity"} <= set(names):
        return None
    at = [names.index(name) for name in ("inertia", "gravity")]
    data = reduce_motions(motions)
    w, effort = regression_rows(model, values, data)
    columns = w[:, [*at, *(names.index(n) for n in ("offset",) if n in names)]]
    norms = np.linalg.norm(columns, axis=0)
    if len(columns) < 4 * columns.shape[1] or not norms.all() or np.linalg.cond(columns / norms) > 1e6:
        return None
    missed = data.target - effort
    if not (np.isfinite(missed).all() and np.isfinite(covariance).all() and np.isfinite(statistical).all()):
        return None
    solver = np.linalg.pinv(columns / norms) / norms[:, None]
    found = solver @ missed
    left = missed - columns @ found
    power = float(np.sum((missed - missed.mean()) ** 2))
    explained = 1.0 - float(left @ left) / max(power, np.finfo(float).tiny)
    moved = solver @ w
    own = sandwich_covariance(columns, left, data.lengths) + moved @ statistical @ moved.T
    beside = np.sqrt(np.maximum(np.diag(covariance - statistical)[at], 0.0)) / np.abs(values[at])
    # An effect that changes the joint's inertia or weight by a share may change those of the payload by that share.
    errors = own[:2, :2] + np.diag((beside * found[:2]) ** 2)
    return _as_point(motions[0].recording, found[:2], errors, distance, explained)


def _as_point(
    recording: str, found: np.ndarray, covariance: np.ndarray, distance: float, explained: float
) -> UnknownPayload:
    """Return the point mass with an inertia and a weight, `found` (2,), and their `covariance`, (2, 2)."""
    error = np.sqrt(np.diag(covariance))
    told = bool(np.all(found > MIN_PAYLOAD_Z * error)) or (distance > 0.0 and found[1] > MIN_PAYLOAD_Z * error[1])
    inertia, weight = (float(x) for x in found)
    refused = ""
    if distance > 0.0:
        mass, mass_error, far, far_error = weight / (GRAVITY * distance), error[1] / (GRAVITY * distance), distance, 0.0
    elif told:
        far, mass = inertia * GRAVITY / weight, weight**2 / (GRAVITY**2 * inertia)
        # These are the derivatives of log d and log m by inertia and weight.
        slopes = np.array([[1.0 / inertia, -1.0 / weight], [-1.0 / inertia, 2.0 / weight]])
        far_error, mass_error = np.array([far, mass]) * np.sqrt(np.diag(slopes @ covariance @ slopes.T))
        refused = UNTOLD_DISTANCE if far_error > MAX_DISTANCE_ERROR_SHARE * far else ""
    else:
        mass = mass_error = far = far_error = float("nan")
        refused = UNTOLD_DISTANCE
    return UnknownPayload(
        recording,
        Parameter("payload_weight", "N*m", weight, float(error[1])),
        Parameter("payload_inertia", "kg*m^2", inertia, float(error[0])),
        Parameter("payload_mass", "kg", float(mass), float(mass_error), refused=refused),
        Parameter("payload_distance", "m", float(far), float(far_error), refused=refused),
        explained,
        told and explained >= MIN_EXPLAINED_SHARE,
    )
