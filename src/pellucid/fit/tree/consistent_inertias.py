r"""Inertias that bodies can have, from normal equations alone.

Least squares finds base parameters; of the bodies that make the same effort, all or none may exist. With P_i, linear in
theta, the pseudo-inertia of link i (`models/pseudo_inertia.py`),

.. math::
   \min_\theta\ \tfrac12\theta^\top N\theta - b^\top\theta
   \quad\text{s.t.}\quad P_i(\theta) \succeq \epsilon\,1,\quad l_j \le \theta_j \le u_j

is convex [1]_. First it is asked whether bodies exist that make just the effort of least squares; if they do they are
taken, and nothing is lost. What efforts do not show (directions in which N is flat) goes to the `nearest` bodies.

.. [1] C. D. Sousa, R. Cortesao, "Physical feasibility of robot base inertial parameter identification: a linear matrix
   inequality approach", Int. J. Robotics Research 33, 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.pseudo_inertia import (
    MIN_EIGENVALUE,
    SCALING_LENGTH_M,
    bodies_from_pseudo_inertia,
    least_eigenvalue,
    pseudo_inertia,
    scaled_pseudo_inertia,
    triangle_matrix,
)

BODY = 10
SEEN = 1e-10
"""Eigenvalue of N with unit diagonal, over its largest, below which a direction is not shown."""

UNTOLD = 1e-6
"""Share of a parameter in directions that are not shown, squared, from which on it has no value of its own."""

PULL = 1e-9
"""Weight of nearness to `nearest` while a bound acts, as a share of the objective."""

TOLERANCE = 1e-9  # of the solver
SOLVED = ("Solved", "AlmostSolved")


@dataclass(frozen=True)
class Quadratic:
    """A sum of squares as least squares leave it: theta' N theta / 2 - b' theta, in directions that N shows.

    theta = seen y + unseen z, where the sum grows by |y - best|^2 / 2 and z changes nothing.
    """

    best: np.ndarray  # (s,)
    seen: np.ndarray  # (c, s)
    unseen: np.ndarray  # (c, c - s)
    told: np.ndarray  # (c,) bool: parameters that have a value of their own

    @classmethod
    def of(cls, normal: np.ndarray, projected: np.ndarray, least: float = SEEN) -> Quadratic:
        """`normal` N (c, c), `projected` b (c,)."""
        size = np.sqrt(np.diag(normal))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
        shown = values > least * values[-1]
        seen = scale[:, None] * vectors[:, shown] / np.sqrt(values[shown])
        told = np.sum(vectors[:, ~shown] ** 2, axis=1) < UNTOLD
        return cls(seen.T @ projected, seen, scale[:, None] * vectors[:, ~shown], told)

    def loss(self, values: np.ndarray, normal: np.ndarray, projected: np.ndarray) -> float:
        """How far the sum of squares at `values` is above its least."""
        return float(max(values @ normal @ values - 2.0 * projected @ values + self.best @ self.best, 0.0))


@dataclass(frozen=True)
class ConsistentFit:
    """A consistent theta.

    Attributes
    ----------
    values : ndarray, shape (c,)
    loss : float
        By how much the weighted sum of squares is above that of least squares.
    told : ndarray of bool, shape (c,)
        Parameters that the efforts tell; others have the values that bodies near the preferred ones have.
    free : bool
        Whether least squares itself was consistent: `loss` is then 0 to rounding.
    held : ndarray of bool, shape (links,)
        Links whose pseudo-inertia is on the bound.
    at_bound : ndarray of bool, shape (c,)
        Other parameters that are on theirs.
    """

    values: np.ndarray
    loss: float
    told: np.ndarray
    free: bool
    held: np.ndarray
    at_bound: np.ndarray


def consistent_inertias(
    normal: np.ndarray,
    projected: np.ndarray,
    links: int,
    *,
    lowest: np.ndarray | None = None,
    highest: np.ndarray | None = None,
    nearest: np.ndarray | None = None,
    weight: float | np.ndarray = 0.0,
) -> ConsistentFit:
    """The consistent theta of least squares.

    Parameters
    ----------
    normal : ndarray, shape (c, c)
        Y'WY; the first 10 `links` columns are those of `KinematicTree.regressor`.
    projected : ndarray, shape (c,)
        Y'W effort.
    lowest, highest : ndarray, shape (c,), optional
        Bounds of what stands behind the links' numbers; left out, none.
    nearest : ndarray, shape (links, 10), optional
        Bodies that are preferred among those that make the same effort; left out, the smallest are.
    weight : float or ndarray, shape (links,)
        Of each body's squared distance to `nearest` [1 / (kg m^2)^2], in Frobenius' norm of the scaled pseudo-inertia:
        how much these are believed against the efforts.
    """
    normal, projected = np.asarray(normal, float), np.asarray(projected, float)
    c = len(projected)
    lowest = np.full(c, -np.inf) if lowest is None else np.asarray(lowest, float)
    highest = np.full(c, np.inf) if highest is None else np.asarray(highest, float)
    start = np.zeros((links, BODY)) if nearest is None else np.asarray(nearest, float)
    told = Quadratic.of(normal, projected)
    problem = _Problem(links, (start @ triangle_matrix().T).ravel(), lowest, highest)
    found = None if np.any(np.asarray(weight) > 0.0) else problem.on_the_way(told)
    free = found is not None
    if found is None:
        found = problem.compromise(told, weight)
    values = np.clip(_repaired(found, links), lowest, highest)
    room = np.minimum(values - lowest, highest - values)
    bodies = values[: links * BODY].reshape(links, BODY)
    # What 1e-6 of the effort makes of a column alone is nothing.
    nothing = 1e-6 * np.sqrt((told.best @ told.best) / np.maximum(np.diag(normal), 1e-12 * np.max(np.diag(normal))))
    return ConsistentFit(
        values,
        told.loss(values, normal, projected),
        told.told,
        free,
        least_eigenvalue(bodies)
        < 2.0 * MIN_EIGENVALUE + 1e-5 * np.linalg.norm(scaled_pseudo_inertia(bodies), axis=(1, 2)),
        room < nothing,
    )


def _square(x: np.ndarray) -> float:
    return float(x @ x)


def _repaired(values: np.ndarray, links: int) -> np.ndarray:
    """What the solver left below the bound by its tolerance is lifted onto it."""
    bodies = values[: links * BODY].reshape(links, BODY)
    rounding = 1e-14 * np.linalg.norm(scaled_pseudo_inertia(bodies), axis=(1, 2))
    short = np.maximum(MIN_EIGENVALUE + rounding - least_eigenvalue(bodies), 0.0)
    lift = np.diag([1.0, 1.0, 1.0, SCALING_LENGTH_M**-2])
    lifted = bodies_from_pseudo_inertia(pseudo_inertia(bodies) + 1.01 * short[:, None, None] * lift)
    return np.concatenate([np.where(short[:, None] > 0.0, lifted, bodies).ravel(), values[links * BODY :]])


@dataclass(frozen=True)
class _Problem:
    """Bodies and bounds, and which bodies are preferred."""

    links: int
    wanted: np.ndarray  # (10 links,) triangles
    lowest: np.ndarray  # (c,)
    highest: np.ndarray  # (c,)

    def _pseudo(self, ways: np.ndarray) -> np.ndarray:
        """Triangles of links, (10 links, k), of theta's columns (c, k)."""
        blocks = ways[: self.links * BODY].reshape(self.links, BODY, -1)
        return (triangle_matrix() @ blocks).reshape(self.links * BODY, -1)

    def on_the_way(self, told: Quadratic) -> np.ndarray | None:
        """Of least squares the consistent theta nearest to what is wanted; None where there is none."""
        base = told.seen @ told.best
        near = self._pseudo(told.unseen)
        found = self._solve(told.unseen, base, near.T @ near, near.T @ (self._pseudo(base)[:, 0] - self.wanted))
        return None if found is None else base + told.unseen @ found

    def compromise(self, told: Quadratic, weight: float | np.ndarray) -> np.ndarray:
        """The consistent theta whose loss and weighted distance to what is wanted are least together."""
        ways = np.hstack([told.seen, told.unseen])
        near, s = self._pseudo(ways), len(told.best)
        if not np.any(np.asarray(weight) > 0.0):
            whole = _square(told.best)
            weight = PULL * whole / max(_square(near[:, :s] @ told.best), _square(self.wanted))
        each = np.repeat(np.broadcast_to(weight, self.links), BODY)
        hessian = (near * each[:, None]).T @ near
        hessian[np.arange(s), np.arange(s)] += 1.0
        slope = -near.T @ (each * self.wanted)
        slope[:s] -= told.best
        found = self._solve(ways, np.zeros(len(ways)), hessian, slope)
        if found is None:
            raise IdentificationError(
                "found no bodies and friction within their bounds that come near the efforts, expected some: check the "
                "signs of drives and gears, and that every recorded joint moves"
            )
        return ways @ found

    def _solve(self, ways: np.ndarray, base: np.ndarray, hessian: np.ndarray, slope: np.ndarray) -> np.ndarray | None:
        """x with the least x'Hx / 2 + slope'x of consistent base + ways x; None where there is none."""
        import clarabel
        from scipy import sparse

        low, high = np.isfinite(self.lowest), np.isfinite(self.highest)
        bounds = np.vstack([ways[low], -ways[high]])
        slack = np.concatenate([(base - self.lowest)[low], (self.highest - base)[high]])
        size = np.linalg.norm(bounds, axis=1)
        fixed = size < 1e-12 * max(size.max(initial=0.0), 1e-300)
        if np.any(slack[fixed] < 0.0):
            return None
        bounds, slack = bounds[~fixed] / size[~fixed, None], slack[~fixed] / size[~fixed]
        column, row = np.tril_indices(4)
        margin = np.tile(np.where(column == row, MIN_EIGENVALUE, 0.0), self.links)
        a = np.vstack([-bounds, -self._pseudo(ways)])
        b = np.concatenate([slack, self._pseudo(base)[:, 0] - margin])
        cones = [clarabel.NonnegativeConeT(len(slack))] if len(slack) else []
        cones += [clarabel.PSDTriangleConeT(4)] * self.links
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        size = np.abs(hessian).max(initial=1e-300)
        quadratic, constraints = sparse.csc_matrix(np.triu(hessian / size)), sparse.csc_matrix(a)
        solution = clarabel.DefaultSolver(quadratic, slope / size, constraints, b, cones, settings).solve()
        return np.array(solution.x) if str(solution.status) in SOLVED else None
