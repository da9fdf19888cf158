r"""Estimate a payload that nobody stated, and how much of the identified friction a controller may carry.

The payload follows from a recording with it and a joint that was identified without it.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ... import _core
from ...models.estimates import Parameter
from ...models.friction_terms import STRIBECK_VELOCITY
from ...models.joint import GRAVITY, PARAMETER_INDEX, SYMBOLS_BY_NAME, JointModel
from ...numerics.motion import Motion
from ...numerics.regression import reduce_motions, regression_rows
from ...numerics.searches.linear_program import largest_within
from ...numerics.uncertainty import sandwich_covariance

MIN_PAYLOAD_Z = 3.0
"""Smallest ratio of weight, and of inertia, to its standard error for an identifiable payload."""

MIN_EXPLAINED_SHARE = 0.5
"""Smallest share of the residual power of the joint alone that an identifiable payload explains."""

MAX_DISTANCE_ERROR_SHARE = 0.25
"""Largest relative standard error of the distance for which mass and distance are reported separately."""

UNTOLD_DISTANCE = "this motion does not determine the payload's inertia: state its distance, or move faster"
"""Reason why the interval of a payload's mass is refused."""


@dataclass(frozen=True)
class FrictionDraws:
    """Steady states and draws at which carried friction is compared with the true friction."""

    # Probability with which the carried friction may exceed the true friction somewhere.
    exceedance_probability: float = 0.05
    speed_grid_count: int = 9  # Number of speeds at which friction is compared
    load_grid_count: int = 5  # Number of loads at which friction is compared
    count: int = 2000  # Number of draws of the true friction
    seed: int = 20261122  # Seed of these draws, so that equal fits carry equal friction
    # Value at which a coefficient's friction per unit is asked of the core: within the bounds of every one.
    probe_coefficient: float = 0.5
    # Quantiles of the recorded speeds and loads between which friction counts as known.
    recorded_quantiles: tuple[float, float] = (0.01, 0.99)


FRICTION_DRAWS = FrictionDraws()


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


@dataclass(frozen=True)
class SteadyStates:
    """Steady motion both ways under loads that the drive moves, or is moved by; each (k,), SI."""

    velocity: np.ndarray
    load: np.ndarray

    @classmethod
    def within(cls, velocity: np.ndarray, load: np.ndarray) -> SteadyStates:
        """Over the speeds and loads of a recording, each (m,) [rad/s or m/s], [effort]."""
        speeds, loads = (np.quantile(np.abs(x), FRICTION_DRAWS.recorded_quantiles) for x in (velocity, load))
        v, y, direction, side = np.meshgrid(
            np.linspace(speeds[0], speeds[1], FRICTION_DRAWS.speed_grid_count),
            np.linspace(loads[0], loads[1], FRICTION_DRAWS.load_grid_count),
            np.array((1.0, -1.0)),
            np.array((1.0, -1.0)),
            indexing="ij",
        )
        return cls((v * direction).ravel(), (y * side).ravel())

    def terms(self, names: Sequence[str], stribeck_velocity: float = 0.0) -> np.ndarray:
        """What resists, per unit of the coefficients `names`, (k, p), as the core's own friction has it."""
        direction = np.copysign(1.0, self.velocity)
        velocity = direction * np.maximum(np.abs(self.velocity), np.finfo(float).tiny)
        made, still = np.zeros((len(velocity), len(names))), np.zeros(len(velocity))
        for column, name in enumerate(names):
            vector = np.zeros(len(PARAMETER_INDEX))
            # An inertia of 1 makes the load the acceleration.
            vector[PARAMETER_INDEX["inertia"]], vector[PARAMETER_INDEX[STRIBECK_VELOCITY.name]] = 1.0, stribeck_velocity
            vector[[PARAMETER_INDEX[target] for target in SYMBOLS_BY_NAME[name].targets]] = (
                FRICTION_DRAWS.probe_coefficient
            )
            effort = _core.inverse_dynamics(vector, still, velocity, self.load)
            made[:, column] = (effort - self.load) * direction / FRICTION_DRAWS.probe_coefficient
        return made


def carried_friction(
    names: Sequence[str], values: np.ndarray, terms: np.ndarray, drawn: np.ndarray
) -> Mapping[str, float]:
    """Coefficients that are carried, of those found, `names` and `values` (p,), which make friction by `terms` (k, p);
    `drawn` (n, k) is what the true friction may be."""
    found = np.maximum(np.asarray(values, float), 0.0)
    middle, spread = drawn.mean(axis=0), drawn.std(axis=0)
    if not len(found):
        return {}
    unsure = spread > 1e-12 * max(float(np.abs(middle).max(initial=0.0)), np.finfo(float).tiny)
    least = middle
    if unsure.any():
        beyond = np.max((middle - drawn)[:, unsure] / spread[unsure], axis=1)
        least = middle - np.quantile(beyond, 1.0 - FRICTION_DRAWS.exceedance_probability) * spread
    carried = largest_within(terms.sum(axis=0), terms, np.maximum(least, 0.0), found)
    return dict(zip(names, map(float, carried), strict=True))


def draw_normal(mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Draws of a normal vector, (n, p), the same every time.

    They use the symmetric root of the correlations: it moves no more than they do, whereas the signs and, for equal
    spreads, the directions of eigenvectors are those of rounding.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    units = np.outer(scale, scale)
    correlation = np.divide(covariance, units, out=np.zeros_like(units), where=units > 0.0)
    spread, vectors = np.linalg.eigh(0.5 * (correlation + correlation.T))
    root = (vectors * np.sqrt(np.maximum(spread, 0.0))) @ vectors.T
    return mean + standard_draws(len(mean), FRICTION_DRAWS.seed) @ root * scale


@lru_cache(maxsize=8)
def standard_draws(count: int, seed: int) -> np.ndarray:
    """Draws of `count` independent standard normal variables, (n, count), the same every time, not to be written to."""
    drawn = np.random.default_rng(seed).standard_normal((FRICTION_DRAWS.count, count))
    drawn.flags.writeable = False
    return drawn
