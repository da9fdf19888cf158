r"""Solve normal equations for physically consistent inertial parameters.

Least squares finds base parameters. Bodies with these base parameters may or may not be physically possible. With P_i,
linear in theta, the pseudo-inertia of link i (`arm/pseudo_inertia.py`),

.. math::
   \min_\theta\ \tfrac12\theta^\top N\theta - b^\top\theta
   \quad\text{s.t.}\quad P_i(\theta) \succeq \epsilon\,1,\quad l_j \le \theta_j \le u_j

is convex [1]_. If possible bodies reproduce the effort of least squares exactly, they are the solution, without loss.
In directions that the efforts do not determine, where N is flat, the solution is as close as possible to the `nearest`
bodies.

.. [1] C. D. Sousa, R. Cortesao, "Physical feasibility of robot base inertial parameter identification: a linear matrix
   inequality approach", Int. J. Robotics Research 33, 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ..pseudo_inertia import (
    MIN_EIGENVALUE,
    SCALING_LENGTH_M,
    bodies_from_pseudo_inertia,
    least_eigenvalue,
    pseudo_inertia,
    scaled_pseudo_inertia,
    triangle_matrix,
)

BODY_PARAMETER_COUNT = 10
"""Number of inertial parameters of a body."""

MIN_RELATIVE_EIGENVALUE = 1e-10
"""A direction is undetermined if its eigenvalue of N, scaled to unit diagonal, is below this share of the largest."""

MAX_UNDETERMINED_SHARE = 1e-6
"""A parameter is undetermined if the undetermined directions contain at least this squared share of it."""

PREFERENCE_WEIGHT_SHARE = 1e-9
"""Weight of the distance to `nearest` while a bound is active, as a share of the objective."""

SOLVER_TOLERANCE = 1e-9
"""Tolerance of the conic solver on gap and feasibility."""

SOLVED_STATUSES = ("Solved", "AlmostSolved")
"""Statuses of the conic solver that count as a solution."""


@dataclass(frozen=True)
class SplitObjective:
    """The quadratic objective theta' N theta / 2 - b' theta, split into determined and undetermined directions.

    theta = seen y + unseen z. The objective grows by |y - best|^2 / 2 and does not depend on z.
    """

    best: np.ndarray  # minimiser in the determined directions, (s,)
    seen: np.ndarray  # determined directions, (c, s)
    unseen: np.ndarray  # undetermined directions, (c, c - s)
    told: np.ndarray  # mask of the determined parameters, (c,)

    @classmethod
    def of(cls, normal: np.ndarray, projected: np.ndarray, least: float = MIN_RELATIVE_EIGENVALUE) -> SplitObjective:
        """Split the objective with N = `normal`, (c, c), and b = `projected`, (c,).

        `least` is the smallest relative eigenvalue of a determined direction.
        """
        size = np.sqrt(np.diag(normal))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
        shown = values > least * values[-1]
        seen = scale[:, None] * vectors[:, shown] / np.sqrt(values[shown])
        told = np.sum(vectors[:, ~shown] ** 2, axis=1) < MAX_UNDETERMINED_SHARE
        return cls(seen.T @ projected, seen, scale[:, None] * vectors[:, ~shown], told)

    def loss(self, values: np.ndarray, normal: np.ndarray, projected: np.ndarray) -> float:
        """Return by how much the sum of squares at `values`, (c,), exceeds its minimum."""
        return float(max(values @ normal @ values - 2.0 * projected @ values + self.best @ self.best, 0.0))


@dataclass(frozen=True)
class ConsistentFit:
    """A physically consistent solution.

    Attributes
    ----------
    values : ndarray, shape (c,)
        Parameters.
    loss : float
        Excess of the weighted sum of squares over that of least squares.
    told : ndarray of bool, shape (c,)
        Parameters that the efforts determine. The others have the values of bodies near the preferred ones.
    free : bool
        Whether least squares itself was consistent; `loss` is then 0 to rounding.
    held : ndarray of bool, shape (links,)
        Links whose pseudo-inertia is on the bound.
    at_bound : ndarray of bool, shape (c,)
        Other parameters that are on their bounds.
    """

    values: np.ndarray
    loss: float
    told: np.ndarray
    free: bool
    held: np.ndarray
    at_bound: np.ndarray


def solve_consistent_inertias(
    normal: np.ndarray,
    projected: np.ndarray,
    links: int,
    *,
    lowest: np.ndarray | None = None,
    highest: np.ndarray | None = None,
    nearest: np.ndarray | None = None,
    weight: float | np.ndarray = 0.0,
) -> ConsistentFit:
    """Minimise the sum of squares over physically consistent parameters.

    Parameters
    ----------
    normal : ndarray, shape (c, c)
        Y'WY; the first 10 `links` columns are those of `KinematicTree.regressor`.
    projected : ndarray, shape (c,)
        Y'W effort.
    links : int
        Number of links.
    lowest, highest : ndarray, shape (c,), optional
        Bounds of the parameters that follow those of the links; none by default.
    nearest : ndarray, shape (links, 10), optional
        Preferred bodies among those with the same effort; the smallest by default.
    weight : float or ndarray, shape (links,)
        Weight of each body's squared distance to `nearest` [1 / (kg m^2)^2], in the Frobenius norm of the scaled
        pseudo-inertia.
    """
    normal, projected = np.asarray(normal, float), np.asarray(projected, float)
    c = len(projected)
    lowest = np.full(c, -np.inf) if lowest is None else np.asarray(lowest, float)
    highest = np.full(c, np.inf) if highest is None else np.asarray(highest, float)
    start = np.zeros((links, BODY_PARAMETER_COUNT)) if nearest is None else np.asarray(nearest, float)
    told = SplitObjective.of(normal, projected)
    problem = _Problem(links, (start @ triangle_matrix().T).ravel(), lowest, highest)
    found = None if np.any(np.asarray(weight) > 0.0) else problem.on_the_way(told)
    free = found is not None
    if found is None:
        found = problem.compromise(told, weight)
    values = np.clip(_lift_onto_bound(found, links), lowest, highest)
    room = np.minimum(values - lowest, highest - values)
    bodies = values[: links * BODY_PARAMETER_COUNT].reshape(links, BODY_PARAMETER_COUNT)
    # Parameters closer to a bound than 1e-6 of the effort count as on the bound.
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


def _squared_norm(x: np.ndarray) -> float:
    """Return the squared norm of a vector."""
    return float(x @ x)


def _lift_onto_bound(values: np.ndarray, links: int) -> np.ndarray:
    """Lift pseudo-inertias onto the bound if the solver left them below it by its tolerance."""
    bodies = values[: links * BODY_PARAMETER_COUNT].reshape(links, BODY_PARAMETER_COUNT)
    rounding = 1e-14 * np.linalg.norm(scaled_pseudo_inertia(bodies), axis=(1, 2))
    short = np.maximum(MIN_EIGENVALUE + rounding - least_eigenvalue(bodies), 0.0)
    lift = np.diag([1.0, 1.0, 1.0, SCALING_LENGTH_M**-2])
    lifted = bodies_from_pseudo_inertia(pseudo_inertia(bodies) + 1.01 * short[:, None, None] * lift)
    return np.concatenate(
        [np.where(short[:, None] > 0.0, lifted, bodies).ravel(), values[links * BODY_PARAMETER_COUNT :]]
    )


@dataclass(frozen=True)
class _Problem:
    """The conic problem: number of links, preferred bodies and bounds."""

    links: int
    wanted: np.ndarray  # triangles of the preferred bodies' pseudo-inertias, (10 links,)
    lowest: np.ndarray  # lower bounds, (c,)
    highest: np.ndarray  # upper bounds, (c,)

    def _pseudo(self, ways: np.ndarray) -> np.ndarray:
        """Return the triangles of the links' pseudo-inertias, (10 links, k), for columns of theta, (c, k)."""
        blocks = ways[: self.links * BODY_PARAMETER_COUNT].reshape(self.links, BODY_PARAMETER_COUNT, -1)
        return (triangle_matrix() @ blocks).reshape(self.links * BODY_PARAMETER_COUNT, -1)

    def on_the_way(self, told: SplitObjective) -> np.ndarray | None:
        """Return the consistent least-squares solution nearest to the preferred bodies; None if there is none."""
        base = told.seen @ told.best
        near = self._pseudo(told.unseen)
        found = self._solve(told.unseen, base, near.T @ near, near.T @ (self._pseudo(base)[:, 0] - self.wanted))
        return None if found is None else base + told.unseen @ found

    def compromise(self, told: SplitObjective, weight: float | np.ndarray) -> np.ndarray:
        """Return the consistent theta that minimises the loss plus the weighted distance to the preferred bodies."""
        ways = np.hstack([told.seen, told.unseen])
        near, s = self._pseudo(ways), len(told.best)
        if not np.any(np.asarray(weight) > 0.0):
            whole = _squared_norm(told.best)
            weight = (
                PREFERENCE_WEIGHT_SHARE
                * whole
                / max(_squared_norm(near[:, :s] @ told.best), _squared_norm(self.wanted))
            )
        each = np.repeat(np.broadcast_to(weight, self.links), BODY_PARAMETER_COUNT)
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
        """Minimise x'Hx / 2 + slope'x subject to a consistent theta = base + ways x; None if there is none."""
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
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = SOLVER_TOLERANCE
        size = np.abs(hessian).max(initial=1e-300)
        quadratic, constraints = sparse.csc_matrix(np.triu(hessian / size)), sparse.csc_matrix(a)
        solution = clarabel.DefaultSolver(quadratic, slope / size, constraints, b, cones, settings).solve()
        return np.array(solution.x) if str(solution.status) in SOLVED_STATUSES else None
