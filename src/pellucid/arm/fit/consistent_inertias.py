r"""Solve normal equations for physically consistent inertial parameters.

Least squares finds base parameters. Bodies with these base parameters may or may not be physically possible. With P_i,
linear in theta, the pseudo-inertia of link i (`pseudo_inertia`),

.. math::
   \min_\theta\ \tfrac12\theta^\top N\theta - b^\top\theta
   \quad\text{s.t.}\quad P_i(\theta) \succeq \epsilon\,1,\quad l_j \le \theta_j \le u_j

is convex [1]_. If possible bodies reproduce the effort of least squares exactly, they are the solution, without loss.
In directions that the efforts do not determine, where N is flat, the solution is as close as possible to the `nearest`
bodies. This is the fit of a payload. That of a robot prefers stated bodies, see `inertia_prior`.

Whether a body can have its ten numbers: the pseudo-inertia of a rigid body [2]_.

With mass m, first moments h and inertia I about one origin,

.. math::
   P = \begin{pmatrix} \tfrac12\mathrm{tr}(I)\,1 - I & h \\ h^\top & m \end{pmatrix}
     = \int \begin{pmatrix} r \\ 1 \end{pmatrix}\begin{pmatrix} r \\ 1 \end{pmatrix}^{\!\top} \rho(r)\,dr

so that some distribution of mass has these numbers exactly where P is positive semidefinite: the mass is not negative,
moments about the centre of mass neither, and no moment is larger than the other two together. P is linear in the ten.

Simulators store principal moments with few digits, and refuse bodies whose moments are on the bound. The bound is
therefore that of the pseudo-inertia with its block S of second moments reduced to :math:`S - \kappa\,\mathrm{tr}(S)1`
(`reduced_pseudo_inertia`). With :math:`\kappa` half of `TRIANGLE_MARGIN`, two principal moments together exceed the
third by this share of it.

Fit a robot with physically consistent links and dissipative joints.

The model is that of `tree_regression`, in the ten inertial parameters of every link instead of base parameters. With
base = K numbers, the normal matrix N becomes K'NK, and no sums are recomputed. Joints have the weights of the fit
without bounds. Parameters that the efforts do not determine come from the maker's bodies or from the smallest ones, and
each is marked accordingly.

Active bounds invalidate the covariance of least squares. The intervals are the jackknife's over segments [3]_: each
segment is omitted in turn, and the others are fitted again within the same bounds.

.. [1] C. D. Sousa, R. Cortesao, "Physical feasibility of robot base inertial parameter identification: a linear matrix
   inequality approach", Int. J. Robotics Research 33, 2014.
.. [2] P. M. Wensing, S. Kim, J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial parameter
   identification", IEEE Robot. Autom. Lett. 3, 2018.
.. [3] B. Efron, C. Stein, "The jackknife estimate of variance", Ann. Statist. 9, 1981.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ..._errors import IdentificationError
from ...models.kinematic_tree import BODY_QUANTITIES, TRIANGLE_MARGIN
from .fit_tree import UNDETERMINED_REASON, TreeUncertainty, make_tree_estimate, student_ratio
from .tree_estimate import FROM_PRIOR_REASON, BaseParameters, TreeEstimate
from .tree_regression import (
    LinearisedModel,
    NormalEquations,
    TreeModel,
    TreeRows,
    TreeSolution,
    compute_loads,
    linearise_rows,
    sum_normal_equations,
)

SCALING_LENGTH_M = 0.1
"""Length that makes masses and first moments comparable with moments of inertia [m]; no verdict depends on it."""

MIN_EIGENVALUE = 1e-8
"""Eigenvalue that a consistent body's pseudo-inertia has at least, with `SCALING_LENGTH_M` [kg m^2]: 1 mg at 10 cm."""

EIGENVALUE_TOLERANCE = 1e-12
"""A least eigenvalue may be this far below 0: rounding of a body of one point, which is just allowed [kg m^2]."""


def pseudo_inertia(bodies: np.ndarray) -> np.ndarray:
    """P of bodies, shape (..., 10) in the order of `kinematic_tree.BODY`; gives (..., 4, 4) in SI."""
    return _matrices(bodies, _pseudo_inertia_basis())


def _matrices(bodies: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return matrices, (..., 4, 4), that are linear in `bodies`, (..., 10), from that of each number, (10, 16)."""
    bodies = np.asarray(bodies, float)
    return (bodies @ basis).reshape(*bodies.shape[:-1], 4, 4)


@cache
def _pseudo_inertia_basis() -> np.ndarray:
    """Return P of a unit of each of the ten numbers, (10, 16)."""
    m, hx, hy, hz, xx, xy, xz, yy, yz, zz = np.eye(10)
    half = 0.5 * (xx + yy + zz)
    rows = [[half - xx, -xy, -xz, hx], [-xy, half - yy, -yz, hy], [-xz, -yz, half - zz, hz], [hx, hy, hz, m]]
    return np.array(rows).reshape(16, 10).T.copy()


@cache
def _reduced_basis() -> np.ndarray:
    """Return the reduced P of a unit of each of the ten numbers, (10, 16)."""
    p = pseudo_inertia(np.eye(10))
    trace = p[:, 0, 0] + p[:, 1, 1] + p[:, 2, 2]
    return (p - 0.5 * TRIANGLE_MARGIN * trace[:, None, None] * np.diag([1.0, 1.0, 1.0, 0.0])).reshape(10, 16)


def bodies_from_pseudo_inertia(pseudo: np.ndarray) -> np.ndarray:
    """The ten numbers whose pseudo-inertia this is, (..., 4, 4); gives (..., 10)."""
    p = np.asarray(pseudo, float)
    trace = p[..., 0, 0] + p[..., 1, 1] + p[..., 2, 2]
    moments = [trace - p[..., 0, 0], -p[..., 0, 1], -p[..., 0, 2], trace - p[..., 1, 1], -p[..., 1, 2],
               trace - p[..., 2, 2]]  # fmt: skip
    return np.stack([p[..., 3, 3], p[..., 0, 3], p[..., 1, 3], p[..., 2, 3], *moments], axis=-1)


def reduced_pseudo_inertia(bodies: np.ndarray) -> np.ndarray:
    """Return P of bodies without half of `TRIANGLE_MARGIN` of the trace of its second moments, (..., 4, 4), in SI.

    Where it is positive semidefinite, the principal moments keep the margin.
    """
    return _matrices(bodies, _reduced_basis())


def scaled_pseudo_inertia(bodies: np.ndarray) -> np.ndarray:
    """P with masses times `SCALING_LENGTH_M`^2 and first moments times `SCALING_LENGTH_M`, (..., 4, 4) [kg m^2]."""
    return _scaled(pseudo_inertia(bodies))


def _scaled(pseudo: np.ndarray) -> np.ndarray:
    scale = np.array([1.0, 1.0, 1.0, SCALING_LENGTH_M])
    return pseudo * np.outer(scale, scale)


@cache
def triangle_matrix() -> np.ndarray:
    """Return the matrix from the ten numbers to the upper triangle of `scaled_pseudo_inertia`, shape (10, 10).

    The triangle is read column by column. Entries off the diagonal are multiplied by the root of 2, so that the norm of
    the result is the Frobenius norm.
    """
    return _triangles(scaled_pseudo_inertia(np.eye(10)))


@cache
def reduced_triangle_matrix() -> np.ndarray:
    """Return the matrix from the ten numbers to the upper triangle of the scaled `reduced_pseudo_inertia`, (10, 10)."""
    return _triangles(_scaled(reduced_pseudo_inertia(np.eye(10))))


def _triangles(units: np.ndarray) -> np.ndarray:
    column, row = np.tril_indices(4)
    root = np.where(row == column, 1.0, np.sqrt(2.0))
    return np.stack([unit[row, column] * root for unit in units], axis=-1)


def least_eigenvalue(bodies: np.ndarray) -> np.ndarray:
    """Return the least eigenvalue of `scaled_pseudo_inertia`, (...,) [kg m^2]; below 0 no body has these numbers."""
    return np.linalg.eigvalsh(scaled_pseudo_inertia(bodies))[..., 0]


def least_reduced_eigenvalue(bodies: np.ndarray) -> np.ndarray:
    """Return the least eigenvalue of the scaled `reduced_pseudo_inertia`, (...,) [kg m^2]; below 0 a body is outside
    the margin."""
    return np.linalg.eigvalsh(_scaled(reduced_pseudo_inertia(bodies)))[..., 0]


BODY_PARAMETER_COUNT = 10
"""Number of inertial parameters of a body."""


@dataclass(frozen=True)
class ConsistencySettings:
    """Tolerances of the search for consistent bodies."""

    # A direction is undetermined if its eigenvalue of N, scaled to unit diagonal, is below this share of the largest.
    min_relative_eigenvalue: float = 1e-10
    # A parameter is undetermined if the undetermined directions contain at least this squared share of it.
    max_undetermined_share: float = 1e-6
    # Weight of the distance to `nearest` while a bound is active, as a share of the objective.
    preference_weight_share: float = 1e-9
    solver_tolerance: float = 1e-9  # tolerance of the conic solver on gap and feasibility
    max_steps: int = 6  # largest number of Gauss-Newton steps. A model without load terms needs one.
    # Gauss-Newton steps stop when the load changes by at most this share of the RMS effort.
    load_change_tolerance: float = 1e-4


CONSISTENCY_SETTINGS = ConsistencySettings()


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
    def of(
        cls, normal: np.ndarray, projected: np.ndarray, least: float = CONSISTENCY_SETTINGS.min_relative_eigenvalue
    ) -> SplitObjective:
        """Split the objective with N = `normal`, (c, c), and b = `projected`, (c,).

        `least` is the smallest relative eigenvalue of a determined direction.
        """
        size = np.sqrt(np.diag(normal))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
        shown = values > least * values[-1]
        seen = scale[:, None] * vectors[:, shown] / np.sqrt(values[shown])
        told = np.sum(vectors[:, ~shown] ** 2, axis=1) < CONSISTENCY_SETTINGS.max_undetermined_share
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
        least_reduced_eigenvalue(bodies)
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
    short = np.maximum(MIN_EIGENVALUE + rounding - least_reduced_eigenvalue(bodies), 0.0)
    lift = np.diag([1.0, 1.0, 1.0, SCALING_LENGTH_M**-2])
    lifted = bodies_from_pseudo_inertia(pseudo_inertia(bodies) + 1.02 * short[:, None, None] * lift)
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

    def _pseudo(self, ways: np.ndarray, triangles: np.ndarray | None = None) -> np.ndarray:
        """Return the triangles of the links' pseudo-inertias, (10 links, k), for columns of theta, (c, k).

        Another matrix of `triangles` gives those of other forms of the pseudo-inertia.
        """
        triangles = triangle_matrix() if triangles is None else triangles
        blocks = ways[: self.links * BODY_PARAMETER_COUNT].reshape(self.links, BODY_PARAMETER_COUNT, -1)
        return (triangles @ blocks).reshape(self.links * BODY_PARAMETER_COUNT, -1)

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
            most = max(_squared_norm(near[:, :s] @ told.best), _squared_norm(self.wanted))
            weight = CONSISTENCY_SETTINGS.preference_weight_share * _squared_norm(told.best) / most
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
        reduced = reduced_triangle_matrix()
        a = np.vstack([-bounds, -self._pseudo(ways, reduced)])
        b = np.concatenate([slack, self._pseudo(base, reduced)[:, 0] - margin])
        cones = [clarabel.NonnegativeConeT(len(slack))] if len(slack) else []
        cones += [clarabel.PSDTriangleConeT(4)] * self.links
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = CONSISTENCY_SETTINGS.solver_tolerance
        size = np.abs(hessian).max(initial=1e-300)
        quadratic, constraints = sparse.csc_matrix(np.triu(hessian / size)), sparse.csc_matrix(a)
        solution = clarabel.DefaultSolver(quadratic, slope / size, constraints, b, cones, settings).solve()
        return np.array(solution.x) if str(solution.status) in SOLVED_STATUSES else None


@dataclass(frozen=True, eq=False)
class FullParametrisation:
    """A model of base parameters, written in all inertial parameters of its robot."""

    model: TreeModel  # model with p parameters, the base parameters among them
    numbers: TreeModel  # the same model with c parameters, all inertial parameters among them
    matrix: np.ndarray  # matrix from the c parameters to the p, (p, c)

    @classmethod
    def of(cls, model: TreeModel) -> FullParametrisation:
        """Expand a model of base parameters."""
        base, r = model.base, len(model.base.names)
        p, others = len(base.members), len(model.names) - r
        matrix = np.zeros((r + others, p + others))
        matrix[:r, :p], matrix[r:, p:] = base.combination, np.eye(others)
        alone = BaseParameters(base.members, base.members, np.arange(p), np.eye(p))
        return cls(model, replace(model, base=alone), matrix)

    @property
    def links(self) -> int:
        """Number of links."""
        return len(self.model.robot.tree.order)

    @property
    def maker(self) -> np.ndarray:
        """Inertial parameters of the links in the robot's description, (links, 10)."""
        return self.model.robot.tree.parameters.reshape(self.links, len(BODY_QUANTITIES))

    def sums(self, equations: NormalEquations, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return N, (c, c), and b, (c,), summed over all rows of `equations`, with joints weighted by 1 / `sd`^2,
        (m,)."""
        weight, whole = 1.0 / sd**2, equations.total()
        gram, moment = np.tensordot(weight, whole.gram[0], 1), weight @ whole.moment[0]
        return self.matrix.T @ gram @ self.matrix, self.matrix.T @ moment


Solver = Callable[[FullParametrisation, NormalEquations, np.ndarray], ConsistentFit]
"""A function from normal equations and the residual standard deviation of each joint, (m,), to a consistent fit."""


@dataclass(frozen=True, eq=False)
class ConsistentSolution:
    """Result of a consistent fit."""

    spread: FullParametrisation
    fit: ConsistentFit  # values of all inertial parameters and friction coefficients
    at: LinearisedModel  # model linearised at the solution
    equations: NormalEquations  # normal equations by segment
    sd: np.ndarray  # residual standard deviation of each joint, which gives its weight, (m,)
    solver: Solver

    @property
    def parameters(self) -> np.ndarray:
        """Parameters of the model of base parameters, (p,)."""
        return self.spread.matrix @ self.fit.values


def solve_consistent(
    model: TreeModel,
    rows: TreeRows,
    *,
    start: TreeSolution,
    solver: Solver,
) -> ConsistentSolution:
    """Solve a `model` over `rows` for consistent bodies by a `solver`, from a `start` without bounds."""
    spread, values, before = FullParametrisation.of(model), start.values, None
    for _ in range(CONSISTENCY_SETTINGS.max_steps if model.loads else 1):
        load = compute_loads(rows, model, values) if model.loads else None
        if before is not None:
            moved = np.sqrt(np.mean((load - before) ** 2, axis=0))
            if np.all(moved <= CONSISTENCY_SETTINGS.load_change_tolerance * np.maximum(rows.size, 1e-12)):
                break
        before = load
        at = linearise_rows(model, rows, load, model.alpha(values) if model.loads else None)
        equations = sum_normal_equations(at)
        fit = solver(spread, equations, start.sd)
        values = spread.matrix @ fit.values
    return ConsistentSolution(spread, fit, at, equations, start.sd, solver)


def make_consistent_estimate(
    name: str,
    rows: TreeRows,
    found: ConsistentSolution,
    of_prior: np.ndarray,
) -> TreeEstimate:
    """Build an estimate with intervals from the solution `found`.

    `of_prior`, (c, c), is the covariance that errors of the prior make. It is part of the intervals. Parameters most of
    whose variance it is are marked as from the prior.
    """
    spread, fit = found.spread, found.fit
    covariance = jackknife_covariance(found)
    freedom = float(max(len(_segments_with_rows(found.equations)) - 1, 1))
    covariance *= student_ratio(freedom) ** 2
    normal = found.spread.sums(found.equations, found.sd)[0]
    told = (np.diag(of_prior) <= np.diag(covariance)) & (np.diag(normal) > 0.0)
    covariance = covariance + of_prior
    every = np.arange(len(spread.numbers.names))
    columns = tuple(x @ spread.matrix[place] for place, x in zip(found.at.places, found.at.columns, strict=True))
    at = replace(found.at, model=spread.numbers, places=(every,) * len(columns), columns=columns)
    whole = found.equations.total()
    sd = np.sqrt(whole.squares(found.parameters)[0] / np.maximum(whole.count[0], 1.0))
    estimate = make_tree_estimate(
        name,
        rows,
        TreeSolution(fit.values, sd, told, fit.at_bound),
        at,
        method="consistent",
        uncertainty=TreeUncertainty(covariance, freedom, covariance),
    )
    parameters = {
        label: replace(each, refused=FROM_PRIOR_REASON) if each.refused == UNDETERMINED_REASON else each
        for label, each in estimate.parameters.items()
    }
    return replace(estimate, parameters=parameters)


def least_sum_of_squares(found: ConsistentSolution) -> float:
    """Return the weighted sum of squared residuals of least squares, on the model linearised at a solution."""
    normal, projected = found.spread.sums(found.equations, found.sd)
    best = SplitObjective.of(normal, projected).best
    return float(np.sum(found.equations.total().square[0] / found.sd**2)) - float(best @ best)


def jackknife_covariance(found: ConsistentSolution) -> np.ndarray:
    """Return the covariance, (c, c), of all parameters by leaving each segment out in turn."""
    whole = found.equations.total()
    parts = (found.equations.segment(s) for s in _segments_with_rows(found.equations))
    each = np.array([found.solver(found.spread, whole.minus(part), found.sd).values for part in parts])
    apart = each - each.mean(axis=0)
    return (len(each) - 1) / len(each) * apart.T @ apart


def _segments_with_rows(equations: NormalEquations) -> np.ndarray:
    """Return the indices of segments with rows."""
    return np.flatnonzero(equations.count.any(axis=1))
