r"""Fit physically consistent bodies with a prior that acts where the efforts tell little.

Efforts determine some combinations of a robot's inertial parameters exactly, some poorly, and others not at all. Bodies
of least squares alone, even consistent ones, may therefore have the mass of a neighbour or a centre outside the link.
The fit minimises the weighted sum of squares plus weight times the entropic distance [1]_ from stated bodies,

.. math::
   d = \sum_i \mathrm{tr}(P_i {P_i^0}^{-1}) - \ln\det(P_i {P_i^0}^{-1}) - 4

with P the (reduced) pseudo-inertia of `consistent_inertias`. The distance is the same in every frame, and convex in the
ten inertial parameters. It grows without bound towards impossible bodies, so its solutions are always consistent.

**Weight.** Near the stated bodies, half of the distance is the negative logarithm of a normal prior with a relative
standard deviation of 1: bodies may be half or twice as stated. The sum of squares counts every row as independent. Rows
are not: over a correlation time of T rows, 2 T rows tell as much as one. The weight is therefore 2 T times the mean
weighted square of the residuals. No error decides on it. The prior counts as much as one independent measurement of
each parameter. It decides where the efforts tell nothing, and adds less than a standard error elsewhere.

If the prior is wrong by its own standard deviation, parameters move by :math:`w^2 (N + wH)^{-1} H (N + wH)^{-1}`, a
covariance with H the distance's curvature at the solution. It is part of each interval. A parameter counts as coming
from the prior if this part of its variance exceeds that of the efforts.

**Bodies that nobody stated** are guessed from the kinematics: each link is a rod from its joint to the next, all of one
density, which least squares determines.

.. [1] T. Lee, P. M. Wensing, F. C. Park, "Geometric robot dynamic identification: a convex programming approach", IEEE
   Trans. Robotics 36, 2020.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.kinematic_tree import Link, Tree
from ..urdf import STAND_IN
from .consistent_inertias import (
    BODY_PARAMETER_COUNT,
    EIGENVALUE_TOLERANCE,
    MIN_EIGENVALUE,
    SCALING_LENGTH_M,
    ConsistentFit,
    ConsistentSolution,
    FullParametrisation,
    Solver,
    SplitObjective,
    bodies_from_pseudo_inertia,
    least_eigenvalue,
    least_reduced_eigenvalue,
    least_sum_of_squares,
    make_consistent_estimate,
    pseudo_inertia,
    reduced_pseudo_inertia,
    solve_consistent,
)
from .fit_tree import correlation_times, residuals_on
from .tree_estimate import FROM_PRIOR_REASON, TreeEstimate
from .tree_regression import NormalEquations, TreeModel, TreeRows, TreeSolution, fit_rows, plain_solution


@dataclass(frozen=True)
class PriorSettings:
    """Settings of the fit with a prior."""

    # A body counts as outside if a pivot of its pseudo-inertia is a smaller share of the diagonal element. Rounding
    # decides whether a matrix closer to singular has an inverse.
    min_pivot_share: float = 1e-12
    max_newton_steps: int = 100  # largest number of Newton steps
    decrement_tolerance: float = 1e-5  # Newton steps stop when the decrement is at most this share of the weight
    # Least weight as a share of the weighted sum of squared efforts, so that rounding does not decide instead.
    min_weight_share: float = 1e-11
    barrier_share: float = 1e-3  # strength of the logarithmic barrier at other parameters' bounds, over the weight
    # Smallest root mean square extent of a body of the prior in every direction [m]. A robot's description may contain
    # point masses, which have no entropic distance.
    min_body_extent_m: float = 0.01
    # The cost of consistency alone is that of a prior with this share of the weight.
    light_weight_share: float = 1e-3
    max_negligible_cost_percent: float = 0.01  # increase of the sum of squares that counts as none [%]
    # Radius of guessed rods as a share of the mean distance between joints, and where all joints are in one place [m].
    guessed_radius_share: float = 0.2
    guessed_radius_m: float = 0.05


PRIOR_SETTINGS = PriorSettings()


@dataclass(frozen=True, eq=False)
class InertiaPrior:
    """Bodies that the efforts may correct, and their weight."""

    bodies: np.ndarray  # (links, 10)
    weight: float
    stated: bool  # whether the robot's description states them; otherwise they are guessed from the kinematics


def guessed_bodies(tree: Tree) -> np.ndarray:
    """Return rods of density 1 from each joint to the next, shape (links, 10); their mass is in units of the density.

    A link that carries several joints reaches to their mean. One that carries none continues by the mean distance along
    its parent's direction.
    """
    places = {joint.child: [each.place for each in tree.order if each.parent == joint.child] for joint in tree.order}
    ends = {link: np.mean(each, axis=0) if each else None for link, each in places.items()}
    lengths = [length for end in ends.values() if end is not None and (length := float(np.linalg.norm(end))) > 0.0]
    mean = float(np.mean(lengths)) if lengths else 0.0
    radius = PRIOR_SETTINGS.guessed_radius_share * mean or PRIOR_SETTINGS.guessed_radius_m
    made = []
    for joint in tree.order:
        end = ends[joint.child]
        end = np.zeros(3) if end is None else end
        length = float(np.linalg.norm(end))
        mass = np.pi * radius**2 * (length + 2.0 * radius)
        along = np.outer(end, end) / 12.0 + 0.5 * radius**2 * np.eye(3)  # second moments per mass about the centre
        inertia = mass * (np.trace(along) * np.eye(3) - along)
        made.append(Link.about_centre(joint.child, mass, tuple(0.5 * end), inertia[np.triu_indices(3)]).numbers)
    return np.array(made)


def make_prior(
    model: TreeModel, rows: TreeRows, start: TreeSolution, *, stated: bool = True, in_si: bool = True
) -> InertiaPrior:
    """Return the prior of a model's bodies at the solution `start` without bounds.

    With `stated` false, the bodies of the robot's description do not count. `in_si` is False if the unit of the efforts
    is not known; the bodies are then scaled as the efforts require. Links without a stated body have guessed ones.
    """
    tree = model.robot.tree
    maker = FullParametrisation.of(model).maker
    known = stated & (maker[:, 0] > 0.0) & np.any(maker != STAND_IN.numbers, axis=1)
    wrong = np.flatnonzero(known & (least_eigenvalue(maker) < -EIGENVALUE_TOLERANCE))
    if wrong.size:
        raise IdentificationError(
            f"found moments of inertia of body {wrong[0] + 1} that no body has, expected each to be at most the sum of "
            "the other two about the centre of mass: correct the robot's description, or state inertia_prior = false"
        )
    bodies = np.where(known[:, None], maker, 0.0)
    guess = np.where(known[:, None], 0.0, guessed_bodies(tree))
    if known.any() and not known.all():
        # The guessed links have the density that gives them the mean mass of stated ones.
        guess *= maker[known, 0].mean() / guess[~known, 0].mean()
        bodies = bodies + guess
    elif not known.any():
        bodies = guess
    if not known.any() or not in_si:
        bodies = bodies * _best_scale(model, rows, start, bodies)
    return InertiaPrior(_with_extent(bodies), _weight(model, rows, start), bool(known.any()))


def _weight(model: TreeModel, rows: TreeRows, start: TreeSolution) -> float:
    """Return the rows that tell as much as one, times the mean weighted square of the residuals."""
    residuals = residuals_on(model, start.values, rows)
    # It is about 1, and less where `fit_rows` bounds the weights of joints that are predicted very well.
    square = sum(float(np.sum((r / sd) ** 2)) for r, sd in zip(residuals, start.sd, strict=True))
    return 2.0 * float(correlation_times(rows, residuals).mean()) * square / max(sum(map(len, residuals)), 1)


def _best_scale(model: TreeModel, rows: TreeRows, start: TreeSolution, bodies: np.ndarray) -> float:
    """Return the factor by which `bodies`, (links, 10), come nearest to the base parameters of least squares."""
    r = len(model.base.names)
    rigid = model.base.combination[:, : bodies.size] @ bodies.ravel()
    gram = np.zeros((r, r))
    for j, lines in enumerate(rows.lines):
        part = rows.rigid[lines, j] / start.sd[j]
        gram += part.T @ part
    top, size = float(rigid @ gram @ start.values[:r]), float(rigid @ gram @ rigid)
    return top / size if top > 0.0 and size > 0.0 else 1.0


def _with_extent(bodies: np.ndarray) -> np.ndarray:
    """Give points, rods and plates among the bodies the least extent of a prior in every direction."""
    least = PRIOR_SETTINGS.min_body_extent_m**2
    flat = least_reduced_eigenvalue(bodies) < bodies[:, 0] * least
    lift = (flat * np.maximum(bodies[:, 0], MIN_EIGENVALUE / SCALING_LENGTH_M**2))[:, None, None] * np.diag(
        [1.0, 1.0, 1.0, 0.0]
    )
    # What the margin takes from the second moments is given back first.
    p = pseudo_inertia(bodies)
    taken = (p - reduced_pseudo_inertia(bodies)) * flat[:, None, None]
    floor = MIN_EIGENVALUE * flat[:, None, None] * np.eye(4)
    return bodies_from_pseudo_inertia(p + 1.01 * taken + least * lift + floor)


def entropic_solver(prior: InertiaPrior, begin: np.ndarray | None = None) -> Solver:
    """Return a solver that pulls towards the bodies of a prior by the entropic distance.

    It starts each search from the solution before, the first one from `begin`, (c,), if there is one.
    """
    before: list[np.ndarray] = [] if begin is None else [begin]

    def solve(spread: FullParametrisation, equations: NormalEquations, sd: np.ndarray) -> ConsistentFit:
        bounds = spread.numbers.bounds
        fit = _minimise_entropic(*spread.sums(equations, sd), prior, *bounds, before[-1] if before else None)
        before[:] = [fit.values]
        return fit

    return solve


def _minimise_entropic(
    normal: np.ndarray,
    projected: np.ndarray,
    prior: InertiaPrior,
    lowest: np.ndarray,
    highest: np.ndarray,
    begin: np.ndarray | None = None,
) -> ConsistentFit:
    """Minimise theta'N theta / 2 - b'theta + weight / 2 times the entropic distance by a damped Newton method.

    Weak logarithmic barriers keep the parameters inside their bounds.
    """
    bodies = prior.bodies
    k = BODY_PARAMETER_COUNT * len(bodies)
    basis = reduced_pseudo_inertia(np.eye(BODY_PARAMETER_COUNT))  # (10, 4, 4)
    back = np.linalg.inv(reduced_pseudo_inertia(bodies))
    pull = np.einsum("iab,tba->it", back, basis).ravel()
    told = SplitObjective.of(normal, projected)
    effort = float(told.best @ told.best)
    weight = max(prior.weight, PRIOR_SETTINGS.min_weight_share * effort)
    push = PRIOR_SETTINGS.barrier_share * weight
    below, above = np.isfinite(lowest), np.isfinite(highest)
    room = 1e-3 * np.sqrt(effort / np.maximum(np.diag(normal), 1e-12 * normal.max()))
    if begin is None:
        start = told.seen @ told.best
        theta = np.where(below, np.maximum(start, np.where(below, lowest, 0.0) + room), start)
        both = below & above
        theta[both] = np.minimum(theta[both], 0.5 * (lowest[both] + highest[both]))
        theta[above & ~below] = np.minimum(theta, highest - room)[above & ~below]
        theta[:k] = bodies.ravel()
        theta[k:] = np.where(np.diag(normal)[k:] > 0.0, theta[k:], np.where(below[k:], lowest[k:] + 1.0, 0.0))
    else:
        theta = begin

    def value(x: np.ndarray) -> float:
        low, high = x[below] - lowest[below], highest[above] - x[above]
        if np.any(low <= 0.0) or np.any(high <= 0.0):
            return np.inf
        log = log_determinant(x[:k].reshape(-1, BODY_PARAMETER_COUNT))
        edges = np.log(low).sum() + np.log(high).sum()
        return float(0.5 * x @ normal @ x - projected @ x + 0.5 * weight * (pull @ x[:k] - log) - push * edges)

    now = value(theta)
    for _ in range(PRIOR_SETTINGS.max_newton_steps):
        slope, hessian = normal @ theta - projected, normal.copy()
        trace, curve = _log_determinant_slopes(theta[:k], basis)
        slope[:k] += 0.5 * weight * (pull - trace)
        hessian[:k, :k] += 0.5 * weight * curve
        for mask, gap, way in ((below, theta - lowest, -1.0), (above, highest - theta, 1.0)):
            slope[mask] += way * push / gap[mask]
            hessian[mask, mask] += push / gap[mask] ** 2
        step = -plain_solution(hessian, slope, ridge=1e-13)
        decrement = float(-slope @ step)
        share = 1.0
        while not (after := value(theta + share * step)) <= now - 1e-4 * share * decrement and share > 1e-10:
            share *= 0.5
        if share <= 1e-10:
            break  # rounding hides any further decrease
        theta, now = theta + share * step, after
        if decrement <= PRIOR_SETTINGS.decrement_tolerance * weight:
            break
    return ConsistentFit(
        theta,
        told.loss(theta, normal, projected),
        told.told,
        False,
        np.zeros(len(bodies), bool),
        np.minimum(theta - lowest, highest - theta) < room,
    )


def log_determinant(bodies: np.ndarray) -> float:
    """Return the sum of the log determinants of `bodies`, (links, 10); minus infinity if one is, or nearly is, none."""
    matrices = reduced_pseudo_inertia(bodies)
    try:
        pivots = np.diagonal(np.linalg.cholesky(matrices), axis1=1, axis2=2)
    except np.linalg.LinAlgError:
        return -np.inf
    if np.any(pivots**2 < PRIOR_SETTINGS.min_pivot_share * np.diagonal(matrices, axis1=1, axis2=2)):
        return -np.inf
    return float(2.0 * np.log(pivots).sum())


def _log_determinant_slopes(values: np.ndarray, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return slope, (10 links,), and negative curvature, (10 links, 10 links), of the log determinants of links."""
    inverse = np.linalg.inv(reduced_pseudo_inertia(values.reshape(-1, BODY_PARAMETER_COUNT)))
    moved = inverse[:, None] @ basis  # P^-1 E_t, (links, 10, 4, 4)
    shape = (len(moved), len(basis), -1)
    each = moved.reshape(shape) @ moved.swapaxes(2, 3).reshape(shape).swapaxes(1, 2)
    curve = np.zeros((len(values), len(values)))
    for i, block in enumerate(each):
        at = slice(BODY_PARAMETER_COUNT * i, BODY_PARAMETER_COUNT * (i + 1))
        curve[at, at] = block
    return np.trace(moved, axis1=2, axis2=3).ravel(), curve


def prior_covariance(found: ConsistentSolution, prior: InertiaPrior) -> np.ndarray:
    """Return the covariance, (c, c), of what an error of the prior's bodies makes of each parameter.

    Such errors have the covariance of the prior itself.
    """
    normal, projected = found.spread.sums(found.equations, found.sd)
    k, c = prior.bodies.size, len(normal)
    told = SplitObjective.of(normal, projected)
    weight = max(prior.weight, PRIOR_SETTINGS.min_weight_share * float(told.best @ told.best))
    basis = reduced_pseudo_inertia(np.eye(BODY_PARAMETER_COUNT))
    curvature = 0.5 * weight * _log_determinant_slopes(found.fit.values[:k], basis)[1]
    both = normal.copy()
    both[:k, :k] += curvature
    scale = 1.0 / np.sqrt(np.maximum(np.diag(both), 1e-300))
    unit = both * np.outer(scale, scale) + 1e-13 * np.eye(c)
    # A parameter moves by (N + wH)^-1 wH times the error, whose covariance is H^-1.
    moved = np.linalg.solve(unit, (np.eye(c)[:, :k] * scale[:k]) @ np.linalg.cholesky(curvature)) * scale[:, None]
    return weight * moved @ moved.T


def solve_with_prior(
    model: TreeModel, rows: TreeRows, *, start: TreeSolution | None = None, stated: bool = True, in_si: bool = True
) -> tuple[ConsistentSolution, InertiaPrior]:
    """Solve a model for consistent bodies near its prior (`make_prior`), from a `start` without bounds."""
    start = fit_rows(model, rows)[0] if start is None else start
    prior = make_prior(model, rows, start, stated=stated, in_si=in_si)
    return solve_consistent(model, rows, start=start, solver=entropic_solver(prior)), prior


def fit_consistent(
    model: TreeModel,
    rows: TreeRows,
    *,
    start: TreeSolution | None = None,
    stated: bool = True,
    in_si: bool = True,
    name: str = "consistent",
) -> tuple[TreeEstimate, ConsistentSolution]:
    """Fit physically consistent links, with intervals from the jackknife over segments.

    `stated` and `in_si` are those of `make_prior`. Parameters that come from the prior are marked. The notes state how
    much consistency, and additionally the prior, increase the error.
    """
    start = fit_rows(model, rows)[0] if start is None else start
    found, prior = solve_with_prior(model, rows, start=start, stated=stated, in_si=in_si)
    estimate = make_consistent_estimate(name, rows, found, prior_covariance(found, prior))
    return replace(estimate, notes=(_prior_note(prior, estimate), _cost_note(found, prior))), found


def _prior_note(prior: InertiaPrior, estimate: TreeEstimate) -> str:
    source = "stated in the robot's description" if prior.stated else "guessed from the positions of the joints"
    size = prior.bodies.size
    count = sum(p.refused == FROM_PRIOR_REASON for p in list(estimate.parameters.values())[:size])
    return f"{count} of {size} inertial parameters are determined mainly by the prior, the inertias {source}"


def _cost_note(found: ConsistentSolution, prior: InertiaPrior) -> str:
    """State by how much consistency and the prior increase the residuals, compared with base parameters alone."""
    least = max(least_sum_of_squares(found), 1e-300)
    light = replace(prior, weight=PRIOR_SETTINGS.light_weight_share * prior.weight)
    start = TreeSolution(found.parameters, found.sd, np.ones(0, bool), np.ones(0, bool))
    solver = entropic_solver(light, found.fit.values)
    alone = solve_consistent(found.spread.model, found.at.rows, start=start, solver=solver)
    share, prior_share = (100.0 * each.fit.loss / least for each in (alone, found))
    if share <= PRIOR_SETTINGS.max_negligible_cost_percent:
        text = "consistent inertias fit as well as least squares"
    else:
        text = (
            "consistent inertias do not fit as well as least squares: the nearest increase the weighted sum of squared "
            f"residuals by {_rounded(share)} %"
        )
    return f"{text}; with the chosen inertias it is {_rounded(prior_share)} % higher"


def _rounded(percent: float) -> str:
    """Return a percentage with two digits and without an exponent."""
    return f"{float(f'{percent:.2g}'):.15g}"
