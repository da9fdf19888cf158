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

import numpy as np

RESISTING = ("coulomb", "viscous", "stribeck", "load", "square_root")
"""What the names of friction begin with."""

EXCEEDED = 0.05
"""Share of cases in which what is carried may exceed the true friction somewhere."""

SPEEDS, LOADS, DRAWS, SEED = 9, 5, 2000, 20261122


def is_friction(name: str) -> bool:
    """Whether a parameter is a coefficient of friction."""
    return name.startswith(RESISTING) and name != "stribeck_velocity"


REACH = (0.01, 0.99)
"""Between which shares of the speeds and loads that were recorded, ordered by size, friction is known."""


@dataclass(frozen=True)
class SteadyStates:
    """Steady motion both ways under loads that the drive moves, or is moved by; each (k,), SI."""

    velocity: np.ndarray
    load: np.ndarray

    @classmethod
    def within(cls, velocity: np.ndarray, load: np.ndarray) -> SteadyStates:
        """Over the speeds and loads of a recording, each (m,) [rad/s or m/s], [effort]."""
        speeds, loads = (np.quantile(np.abs(x), REACH) for x in (velocity, load))
        v, y, direction, side = np.meshgrid(
            np.linspace(*speeds, SPEEDS), np.linspace(*loads, LOADS), (1.0, -1.0), (1.0, -1.0), indexing="ij"
        )
        return cls((v * direction).ravel(), (y * side).ravel())

    def terms(self, names: Sequence[str], stribeck_velocity: float = 0.0) -> np.ndarray:
        """What resists, per unit of the coefficients `names`, (k, p)."""
        v, driven = np.abs(self.velocity), self.velocity * self.load > 0.0
        boundary = np.exp(-((v / stribeck_velocity) ** 2)) if stribeck_velocity > 0.0 else np.zeros(len(v))
        size = {"coulomb": np.ones(len(v)), "viscous": v, "stribeck": boundary, "load": np.abs(self.load)}
        size["square"] = np.sqrt(v)
        only = {
            "positive": self.velocity > 0.0, "negative": self.velocity < 0.0, "motoring": driven, "generating": ~driven,
        }  # fmt: skip
        columns = [np.zeros((len(v), 0))]
        for name in names:
            kind, _, which = name.partition("_")
            columns.append((size[kind] * only.get(which, 1.0))[:, None])
        return np.hstack(columns)


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
        least = middle - np.quantile(beyond, 1.0 - EXCEEDED) * spread
    bounds = [(0.0, x) for x in found]
    made = linprog(-terms.sum(axis=0), A_ub=terms, b_ub=np.maximum(least, 0.0), bounds=bounds, method="highs")
    carried = np.zeros(len(names)) if made.x is None else np.clip(made.x, 0.0, found)
    return dict(zip(names, map(float, carried), strict=True))


def drawn_normal(mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Draws of a normal vector, (n, p), the same every time."""
    spread, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    root = vectors * np.sqrt(np.maximum(spread, 0.0))
    return mean + np.random.default_rng(SEED).standard_normal((DRAWS, len(mean))) @ root.T
