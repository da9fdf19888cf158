r"""Inertias that bodies can have, from normal equations alone.

Least squares finds base parameters; of the bodies that make the same effort, all or none may exist. With P_i, linear in
theta, the pseudo-inertia of link i (`models/pseudo_inertia.py`),

.. math::
   \min_\theta\ \tfrac12\theta^\top N\theta - b^\top\theta
   \quad\text{s.t.}\quad P_i(\theta) \succeq \epsilon\,1,\quad \theta_j \ge l_j,\quad G\theta \ge 0

is convex [1]_. First it is asked whether bodies exist that make just the effort of least squares; if they do they are
taken, and nothing is lost. What efforts do not show (directions in which N is flat) goes to the `nearest` bodies.

.. [1] C. D. Sousa, R. Cortesao, "Physical feasibility of robot base inertial parameter identification: a linear matrix
   inequality approach", Int. J. Robotics Research 33, 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.pseudo_inertia import LEAST, LENGTH, bodies_of, least_eigenvalue, pseudo_inertia, scaled, triangle

BODY = 10
SEEN = 1e-10
"""Eigenvalue of N with unit diagonal, over its largest, below which a direction is not shown."""

PULL = 1e-9
"""Weight of nearness to `nearest` while a bound acts, as a share of the objective."""

TOLERANCE = 1e-9  # of the solver
SOLVED = ("Solved", "AlmostSolved")
IMPOSSIBLE = ("PrimalInfeasible", "AlmostPrimalInfeasible")


@dataclass(frozen=True)
class Quadratic:
    """A sum of squares as least squares leave it: theta' N theta / 2 - b' theta, in directions that N shows.

    theta = seen y + unseen z, where the sum grows by |y - best|^2 / 2 and z changes nothing.
    """

    best: np.ndarray  # (s,)
    seen: np.ndarray  # (c, s)
    unseen: np.ndarray  # (c, c - s)

    @classmethod
    def of(cls, normal: np.ndarray, projected: np.ndarray, least: float = SEEN) -> Quadratic:
        """`normal` N (c, c), `projected` b (c,)."""
        size = np.sqrt(np.diag(normal))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
        shown = values > least * values[-1]
        seen = scale[:, None] * vectors[:, shown] / np.sqrt(values[shown])
        return cls(seen.T @ projected, seen, scale[:, None] * vectors[:, ~shown])

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
    free : bool
        Whether least squares itself was consistent: `loss` is then 0 to rounding.
    held : ndarray of bool, shape (links,)
        Links whose pseudo-inertia is on the bound.
    at_bound : ndarray of bool, shape (c,)
        Other parameters that are on theirs.
    """

    values: np.ndarray
    loss: float
    free: bool
    held: np.ndarray
    at_bound: np.ndarray


def consistent_inertias(
    normal: np.ndarray,
    projected: np.ndarray,
    links: int,
    *,
    lowest: np.ndarray | None = None,
    rows: np.ndarray | None = None,
    nearest: np.ndarray | None = None,
    weight: float = 0.0,
) -> ConsistentFit:
    """The consistent theta of least squares.

    Parameters
    ----------
    normal : ndarray, shape (c, c)
        Y'WY; the first 10 `links` columns are those of `KinematicTree.regressor`.
    projected : ndarray, shape (c,)
        Y'W effort.
    lowest : ndarray, shape (c,), optional
        What parameters behind the links' are at least; -inf where anything goes, which is the default.
    rows : ndarray, shape (r, c), optional
        What is not negative, such as friction over the speeds of the recordings.
    nearest : ndarray, shape (links, 10), optional
        Bodies that are preferred among those that make the same effort; left out, the smallest are.
    weight : float
        Of the squared distance to `nearest` [1 / (kg m^2)^2], in Frobenius' norm of the scaled pseudo-inertia: how much
        these are believed against the efforts.
    """
    normal, projected = np.asarray(normal, float), np.asarray(projected, float)
    c = len(projected)
    lowest = np.full(c, -np.inf) if lowest is None else np.asarray(lowest, float)
    rows = np.zeros((0, c)) if rows is None else np.asarray(rows, float)
    start = np.zeros((links, BODY)) if nearest is None else np.asarray(nearest, float)
    told = Quadratic.of(normal, projected)
    to_pseudo = np.zeros((links * BODY, c))
    for i in range(links):
        to_pseudo[i * BODY : (i + 1) * BODY, i * BODY : (i + 1) * BODY] = triangle()
    wanted = (start @ triangle().T).ravel()
    bounds = np.vstack([np.eye(c)[np.isfinite(lowest)], rows])
    least = np.concatenate([lowest[np.isfinite(lowest)], np.zeros(len(rows))])
    problem = _Problem(to_pseudo, wanted, bounds, least, links)
    found = None
    if not weight > 0.0:
        found = problem.on_the_way(told.unseen, told.seen @ told.best)
    free = found is not None
    if found is None:
        both = np.hstack([told.seen, told.unseen])
        pull = weight or PULL * (told.best @ told.best) / max(_square(to_pseudo @ (told.seen @ told.best)), _square(wanted))
        found = problem.compromise(both, told.best, pull)
    values = _repaired(found, links)
    slack = values - lowest
    values = np.where(slack < 0.0, lowest, values)
    bodies = values[: links * BODY].reshape(links, BODY)
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    tiny = 1e-6 * np.sqrt(told.best @ told.best) / scale
    return ConsistentFit(
        values,
        told.loss(values, normal, projected),
        free,
        least_eigenvalue(bodies) < 1e-5 * np.linalg.norm(scaled(bodies), axis=(1, 2)) + 2.0 * LEAST,
        slack < np.where(np.isfinite(lowest), tiny, -np.inf),
    )


def _square(x: np.ndarray) -> float:
    return float(x @ x)


def _repaired(values: np.ndarray, links: int) -> np.ndarray:
    """What the solver left below the bound by its tolerance is lifted onto it."""
    bodies = values[: links * BODY].reshape(links, BODY)
    short = np.maximum(LEAST - least_eigenvalue(bodies), 0.0)
    lift = np.diag([1.0, 1.0, 1.0, LENGTH**-2])
    lifted = bodies_of(pseudo_inertia(bodies) + 1.01 * short[:, None, None] * lift)
    return np.concatenate([np.where(short[:, None] > 0.0, lifted, bodies).ravel(), values[links * BODY :]])


@dataclass(frozen=True)
class _Problem:
    """Bounds on theta = base + directions y, and how to be near."""

    to_pseudo: np.ndarray  # (10 links, c)
    wanted: np.ndarray  # (10 links,)
    bounds: np.ndarray  # (r, c)
    least: np.ndarray  # (r,)
    links: int

    def on_the_way(self, unseen: np.ndarray, base: np.ndarray) -> np.ndarray | None:
        """Of base + unseen z the consistent one nearest to what is wanted; None where there is none."""
        if not np.all(self.bounds @ base >= self.least) and not np.abs(self.bounds @ unseen).max(initial=0.0) > 0.0:
            return None
        near = self.to_pseudo @ unseen
        found = self._solve(unseen, base, near.T @ near, near.T @ (self.to_pseudo @ base - self.wanted))
        return None if found is None else base + unseen @ found

    def compromise(self, both: np.ndarray, best: np.ndarray, pull: float) -> np.ndarray:
        """The consistent theta = both (y, z) with the least |y - best|^2 / 2 + pull |P - wanted|^2 / 2."""
        near = self.to_pseudo @ both
        hessian = pull * (near.T @ near)
        hessian[np.arange(len(best)), np.arange(len(best))] += 1.0
        slope = -pull * (near.T @ self.wanted)
        slope[: len(best)] -= best
        found = self._solve(both, np.zeros(len(both)), hessian, slope)
        if found is None:
            raise IdentificationError(
                "no bodies and friction within their bounds were found by the solver; check signs and gears of the "
                "drives, whose columns may ask for friction that pushes"
            )
        return both @ found

    def _solve(self, ways: np.ndarray, base: np.ndarray, hessian: np.ndarray, slope: np.ndarray) -> np.ndarray | None:
        """The least of x'Hx/2 + slope'x with base + ways x consistent; None where nothing is."""
        import clarabel
        from scipy import sparse

        column, row = np.tril_indices(4)
        eye = np.tile(np.where(column == row, LEAST, 0.0), self.links)
        scale = 1.0 / np.maximum(np.linalg.norm(self.bounds @ ways, axis=1), 1e-12)
        a = np.vstack([-(self.bounds @ ways) * scale[:, None], -(self.to_pseudo @ ways)])
        b = np.concatenate([(self.bounds @ base - self.least) * scale, self.to_pseudo @ base - eye])
        cones = [clarabel.NonnegativeConeT(len(self.bounds))] if len(self.bounds) else []
        cones += [clarabel.PSDTriangleConeT(4)] * self.links
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        size = max(np.abs(hessian).max(), 1e-300)
        solver = clarabel.DefaultSolver(
            sparse.csc_matrix(np.triu(hessian / size)), slope / size, sparse.csc_matrix(a), b, cones, settings
        )
        solution = solver.solve()
        status = str(solution.status)
        if status in IMPOSSIBLE:
            return None
        if status not in SOLVED:
            return None
        return np.array(solution.x)
