r"""How much of an identified friction is compensated: what exceeds the true friction in one case of twenty at most.

With f(v, y) = a(v, y)^T b the friction of a joint at speeds v under loads y, and draws of what the true friction may
be, everything included that the model leaves out, the friction is with probability 0.95 at once everywhere above

.. math::
   l(v, y) = m(v, y) - c\, \sigma(v, y), \qquad P\left(\max_{v, y} \frac{m - f}{\sigma} \le c\right) = 0.95

with m and :math:`\sigma` the draws' mean and standard deviation. Carried is the friction of the model's own form below
l that carries most on average: a linear programme in its coefficients, each between 0 and what was found. Coefficients
that trade for each other, Coulomb for viscous friction, cost nothing: only their sum has to stay below the truth. Each
coefficient's own lower end would leave most of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ... import _core
from ...models.friction_terms import STRIBECK_VELOCITY
from ...models.joint import PARAMETER_INDEX, SYMBOLS_BY_NAME

EXCEEDANCE_PROBABILITY = 0.05
"""Probability with which the carried friction may exceed the true friction somewhere."""

SPEED_GRID_COUNT = 9
"""Number of speeds at which friction is compared."""

LOAD_GRID_COUNT = 5
"""Number of loads at which friction is compared."""

NORMAL_DRAW_COUNT = 2000
"""Number of draws of the true friction."""

NORMAL_DRAW_SEED = 20261122
"""Seed of these draws, so that equal fits carry equal friction."""

PROBE_COEFFICIENT = 0.5
"""Value at which a coefficient's friction per unit is asked of the core: within the bounds of every one."""

RECORDED_QUANTILES = (0.01, 0.99)
"""Quantiles of the recorded speeds and loads between which friction counts as known."""


@dataclass(frozen=True)
class SteadyStates:
    """Steady motion both ways under loads that the drive moves, or is moved by; each (k,), SI."""

    velocity: np.ndarray
    load: np.ndarray

    @classmethod
    def within(cls, velocity: np.ndarray, load: np.ndarray) -> SteadyStates:
        """Over the speeds and loads of a recording, each (m,) [rad/s or m/s], [effort]."""
        speeds, loads = (np.quantile(np.abs(x), RECORDED_QUANTILES) for x in (velocity, load))
        v, y, direction, side = np.meshgrid(
            np.linspace(speeds[0], speeds[1], SPEED_GRID_COUNT),
            np.linspace(loads[0], loads[1], LOAD_GRID_COUNT),
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
            vector[[PARAMETER_INDEX[target] for target in SYMBOLS_BY_NAME[name].targets]] = PROBE_COEFFICIENT
            effort = _core.inverse_dynamics(vector, still, velocity, self.load)
            made[:, column] = (effort - self.load) * direction / PROBE_COEFFICIENT
        return made


def carried_friction(
    names: Sequence[str], values: np.ndarray, terms: np.ndarray, drawn: np.ndarray
) -> Mapping[str, float]:
    """Coefficients that are carried, of those found, `names` and `values` (p,), which make friction by `terms` (k, p);
    `drawn` (n, k) is what the true friction may be."""
    from scipy.optimize import linprog

    found = np.maximum(np.asarray(values, float), 0.0)
    middle, spread = drawn.mean(axis=0), drawn.std(axis=0)
    if not len(found):
        return {}
    unsure = spread > 1e-12 * max(float(np.abs(middle).max(initial=0.0)), np.finfo(float).tiny)
    least = middle
    if unsure.any():
        beyond = np.max((middle - drawn)[:, unsure] / spread[unsure], axis=1)
        least = middle - np.quantile(beyond, 1.0 - EXCEEDANCE_PROBABILITY) * spread
    bounds = [(0.0, x) for x in found]
    made = linprog(-terms.sum(axis=0), A_ub=terms, b_ub=np.maximum(least, 0.0), bounds=bounds, method="highs")
    carried = np.zeros(len(names)) if made.x is None else np.clip(made.x, 0.0, found)
    return dict(zip(names, map(float, carried), strict=True))


def draw_normal(mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Draws of a normal vector, (n, p), the same every time."""
    spread, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    root = vectors * np.sqrt(np.maximum(spread, 0.0))
    return mean + standard_draws(len(mean), NORMAL_DRAW_SEED) @ root.T


@lru_cache(maxsize=8)
def standard_draws(count: int, seed: int) -> np.ndarray:
    """Draws of `count` independent standard normal variables, (n, count), the same every time, not to be written to."""
    drawn = np.random.default_rng(seed).standard_normal((NORMAL_DRAW_COUNT, count))
    drawn.flags.writeable = False
    return drawn
