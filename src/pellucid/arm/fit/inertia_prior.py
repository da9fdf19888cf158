r"""Fit a robot with the maker's inertias as a prior, for parameters that the motion hardly determines.

There are two distances of bodies from the maker's. Both are convex in the ten inertial parameters, so normal equations
suffice:

.. math::
   d_E = \sum_i \lVert S(P_i - P_i^0)S \rVert_F^2 \big/ \lVert S P_i^0 S \rVert_F^2, \qquad
   d_B = \sum_i \mathrm{tr}(P_i {P_i^0}^{-1}) - \ln\det(P_i {P_i^0}^{-1}) - 4

with P the pseudo-inertia. The Euclidean distance depends on the length by which masses and moments are compared. The
entropic one [1]_ is the same in every frame. It grows without bound towards impossible bodies, so its solutions are
always consistent. The fit minimises the sum of squares plus weight times distance. The weight is chosen by
cross-validation over the segments of the fitted recordings.

A parameter counts as coming from the prior if the efforts' share of its information is below one half. This share is
the diagonal of :math:`(N + wH)^{-1} N`, with H the distance's curvature.

.. [1] T. Lee, P. M. Wensing, F. C. Park, "Geometric robot dynamic identification: a convex programming approach", IEEE
   Trans. Robotics 36, 2020.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
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
    make_consistent_estimate,
    nearest_bodies_solver,
    pseudo_inertia,
    scaled_pseudo_inertia,
    solve_consistent,
    triangle_matrix,
)
from .tree_estimate import TreeEstimate
from .tree_regression import NormalEquations, TreeModel, TreeRows, fit_rows, plain_solution

PRIOR_WEIGHTS = tuple(float(10.0**k) for k in range(-3, 6))
"""Weights of the prior that are tried, on the scale of the weighted sum of squares."""


@dataclass(frozen=True)
class PriorSettings:
    """Settings of the fit with the maker's inertias as a prior."""

    max_newton_steps: int = 100  # largest number of Newton steps
    decrement_tolerance: float = 1e-9  # newton steps stop when the decrement is at most this share of the objective
    # Strength of the logarithmic barrier at the bounds of other parameters, as a share of the objective per parameter.
    barrier_share: float = 1e-6
    # A parameter comes from the prior if the efforts contribute less than this share of its information.
    min_effort_share: float = 0.5
    # Smallest root mean square extent of a body of the prior in every direction [m]. A robot's description may contain
    # point masses, which have no entropic distance.
    min_body_extent_m: float = 0.01


PRIOR_SETTINGS = PriorSettings()


@dataclass(frozen=True)
class PriorChoice:
    """Choice of a prior's weight."""

    distance: str  # "entropic" or "euclidean"
    weight: float  # chosen weight
    missed: Mapping[float, float]  # mean weighted squared error on left-out segments, by weight


def euclidean_solver(maker: np.ndarray, weight: float) -> Solver:
    """Return a solver that pulls towards the `maker`'s bodies, (links, 10), by the Euclidean distance."""
    size = np.sum(scaled_pseudo_inertia(maker) ** 2, axis=(1, 2))
    return nearest_bodies_solver(maker, weight / np.maximum(size, 1e-6 * size.max()))


def entropic_solver(maker: np.ndarray, weight: float) -> Solver:
    """Return a solver that pulls towards the `maker`'s bodies, (links, 10), by the entropic distance."""
    maker = _with_extent(maker)

    def solve(spread: FullParametrisation, equations: NormalEquations, sd: np.ndarray) -> ConsistentFit:
        return _minimise_entropic(*spread.sums(equations, sd), maker, weight, *spread.numbers.bounds)

    return solve


def _with_extent(maker: np.ndarray) -> np.ndarray:
    """Give points, rods and plates among the bodies the least extent of a prior in every direction."""
    wrong = np.flatnonzero(least_eigenvalue(maker) < -EIGENVALUE_TOLERANCE)
    if wrong.size:
        raise IdentificationError(
            f"found moments of inertia of body {wrong[0] + 1} that no body has, expected each to be at most the sum of "
            "the other two about the centre of mass: mend the robot's description, or take the euclidean distance"
        )
    flat = least_eigenvalue(maker) < maker[:, 0] * PRIOR_SETTINGS.min_body_extent_m**2
    lift = (flat * np.maximum(maker[:, 0], MIN_EIGENVALUE / SCALING_LENGTH_M**2))[:, None, None] * np.diag(
        [1.0, 1.0, 1.0, 0.0]
    )
    return bodies_from_pseudo_inertia(
        pseudo_inertia(maker)
        + PRIOR_SETTINGS.min_body_extent_m**2 * lift
        + MIN_EIGENVALUE * flat[:, None, None] * np.eye(4)
    )


DISTANCE_SOLVERS: Mapping[str, Callable[[np.ndarray, float], Solver]] = {
    "entropic": entropic_solver,
    "euclidean": euclidean_solver,
}
"""Solvers with a prior, by the name of their distance."""


def _minimise_entropic(
    normal: np.ndarray, projected: np.ndarray, maker: np.ndarray, weight: float, lowest: np.ndarray, highest: np.ndarray
) -> ConsistentFit:
    """Minimise theta'N theta / 2 - b'theta + weight / 2 times the entropic distance by a damped Newton method.

    Weak logarithmic barriers keep the parameters inside their bounds.
    """
    k = BODY_PARAMETER_COUNT * len(maker)
    basis = pseudo_inertia(np.eye(BODY_PARAMETER_COUNT))  # (10, 4, 4)
    back = np.linalg.inv(pseudo_inertia(maker))
    pull = np.einsum("iab,tba->it", back, basis).ravel()
    told = SplitObjective.of(normal, projected)
    push = PRIOR_SETTINGS.barrier_share * (told.best @ told.best) / max(len(told.best), 1)
    below, above = np.isfinite(lowest), np.isfinite(highest)
    start = told.seen @ told.best
    room = 1e-3 * np.sqrt((told.best @ told.best) / np.maximum(np.diag(normal), 1e-12 * normal.max()))
    theta = np.where(below, np.maximum(start, np.where(below, lowest, 0.0) + room), start)
    both = below & above
    theta[both] = np.minimum(theta[both], 0.5 * (lowest[both] + highest[both]))
    theta[above & ~below] = np.minimum(theta, highest - room)[above & ~below]
    theta[:k] = maker.ravel()
    theta[k:] = np.where(np.diag(normal)[k:] > 0.0, theta[k:], np.where(below[k:], lowest[k:] + 1.0, 0.0))

    def value(x: np.ndarray) -> float:
        p = pseudo_inertia(x[:k].reshape(-1, BODY_PARAMETER_COUNT))
        sign, log = np.linalg.slogdet(p)
        if np.any(sign <= 0) or np.any(p[:, 3, 3] <= 0.0) or np.any(np.linalg.eigvalsh(p)[:, 0] <= 0.0):
            return np.inf
        if np.any(x[below] <= lowest[below]) or np.any(x[above] >= highest[above]):
            return np.inf
        edges = np.log(x[below] - lowest[below]).sum() + np.log(highest[above] - x[above]).sum()
        return float(0.5 * x @ normal @ x - projected @ x + 0.5 * weight * (pull @ x[:k] - log.sum()) - push * edges)

    now = value(theta)
    for _ in range(PRIOR_SETTINGS.max_newton_steps):
        inverse = np.linalg.inv(pseudo_inertia(theta[:k].reshape(-1, BODY_PARAMETER_COUNT)))
        moved = np.einsum("iab,tbc->itac", inverse, basis)  # P^-1 E_t
        slope, hessian = normal @ theta - projected, normal.copy()
        slope[:k] += 0.5 * weight * (pull - np.trace(moved, axis1=2, axis2=3).ravel())
        curve = np.einsum("itab,isba->its", moved, moved)
        for i in range(len(maker)):
            at = slice(BODY_PARAMETER_COUNT * i, BODY_PARAMETER_COUNT * (i + 1))
            hessian[at, at] += 0.5 * weight * curve[i]
        for mask, gap, way in ((below, theta - lowest, -1.0), (above, highest - theta, 1.0)):
            slope[mask] += way * push / gap[mask]
            hessian[mask, mask] += push / gap[mask] ** 2
        step = -plain_solution(hessian, slope, ridge=1e-13)
        decrement = float(-slope @ step)
        share = 1.0
        while not value(theta + share * step) <= now - 1e-4 * share * decrement and share > 1e-10:
            share *= 0.5
        theta = theta + share * step
        now = value(theta)
        if decrement <= PRIOR_SETTINGS.decrement_tolerance * (told.best @ told.best):
            break
    return ConsistentFit(
        theta,
        told.loss(theta, normal, projected),
        told.told,
        False,
        np.zeros(len(maker), bool),
        np.minimum(theta - lowest, highest - theta) < room,
    )


def choose_weight(found: ConsistentSolution, maker: np.ndarray, distance: str = "entropic") -> PriorChoice:
    """Choose the weight of the `maker`'s bodies, (links, 10), with the smallest error on left-out segments.

    `found` is the solution without prior; `distance` is one of `DISTANCE_SOLVERS`.
    """
    equations, spread = found.equations, found.spread
    whole = equations.total()
    numbers = np.flatnonzero(equations.count.any(axis=1))
    if len(numbers) < 2:
        raise IdentificationError(f"found {len(numbers)} segment to choose a prior's weight by, expected at least 2")
    missed = {}
    for weight in PRIOR_WEIGHTS:
        solver, total = DISTANCE_SOLVERS[distance](maker, weight), 0.0
        for s in numbers.tolist():
            part = equations.segment(s)
            values = spread.matrix @ solver(spread, whole.minus(part), found.sd).values
            total += float(np.sum(part.squares(values)[0] / found.sd**2))
        missed[weight] = total / float(whole.count.sum())
    return PriorChoice(distance, min(missed, key=missed.__getitem__), missed)


def effort_information_shares(found: ConsistentSolution, maker: np.ndarray, choice: PriorChoice) -> np.ndarray:
    """Return the share of each parameter's information that comes from the efforts, (c,); the rest is from the
    prior."""
    spread = found.spread
    normal, _ = spread.sums(found.equations, found.sd)
    k, c = BODY_PARAMETER_COUNT * len(maker), len(normal)
    curve = np.zeros((c, c))
    inverse, basis = None, pseudo_inertia(np.eye(BODY_PARAMETER_COUNT))
    if choice.distance == "entropic":
        inverse = np.linalg.inv(pseudo_inertia(_with_extent(maker)))
    size = np.sum(scaled_pseudo_inertia(maker) ** 2, axis=(1, 2))
    for i in range(len(maker)):
        at = slice(BODY_PARAMETER_COUNT * i, BODY_PARAMETER_COUNT * (i + 1))
        if inverse is None:
            curve[at, at] = triangle_matrix().T @ triangle_matrix() / max(size[i], 1e-6 * size.max())
        else:
            moved = inverse[i] @ basis
            curve[at, at] = 0.5 * np.einsum("tab,sba->ts", moved, moved)
    both = normal + choice.weight * curve
    scale = np.sqrt(np.maximum(np.diag(both), 1e-300))
    unit = both / np.outer(scale, scale) + 1e-13 * np.eye(c)
    share = np.diag(np.linalg.solve(unit, normal / np.outer(scale, scale))).copy()
    share[k:] = np.where(np.diag(normal)[k:] > 0.0, np.maximum(share[k:], 0.0), 0.0)
    return share


def fit_with_prior(
    model: TreeModel,
    rows: TreeRows,
    *,
    maker: np.ndarray | None = None,
    distance: str = "entropic",
) -> tuple[TreeEstimate, PriorChoice]:
    """Fit a model with a prior at the `maker`'s bodies, (links, 10), by default those of the robot's description.

    The prior's weight is chosen within `rows`. Parameters that come from the prior are marked.
    """
    if distance not in DISTANCE_SOLVERS:
        raise IdentificationError(
            f"found distance {distance!r} of a prior, expected one of {', '.join(DISTANCE_SOLVERS)}"
        )
    start = fit_rows(model, rows)[0]
    maker = FullParametrisation.of(model).maker if maker is None else maker
    plain = solve_consistent(model, rows, start=start, nearest=maker)
    choice = choose_weight(plain, maker, distance)
    found = solve_consistent(model, rows, start=start, solver=DISTANCE_SOLVERS[distance](maker, choice.weight))
    share = effort_information_shares(found, maker, choice)
    note = (
        f"the maker's inertias weigh {choice.weight:g} ({distance}): what is missed on segments left out is then least"
    )
    told = share >= PRIOR_SETTINGS.min_effort_share
    return make_consistent_estimate("prior", rows, found, nearest=maker, told=told, notes=(note,)), choice
