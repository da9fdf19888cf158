r"""A maker's inertias as a prior: what is believed where the motion shows little.

Two distances of bodies from the maker's, both convex in the ten numbers, so that normal equations suffice:

.. math::
   d_E = \sum_i \lVert S(P_i - P_i^0)S \rVert_F^2 \big/ \lVert S P_i^0 S \rVert_F^2, \qquad
   d_B = \sum_i \mathrm{tr}(P_i {P_i^0}^{-1}) - \ln\det(P_i {P_i^0}^{-1}) - 4

with P the pseudo-inertia. The Euclidean one hangs on the length that masses and moments are compared by; the entropic
one [1]_ is the same in every frame, and grows without bound towards what no body can be, so that its bodies are always
inside. The sum of squares is then least together with weight times distance. The weight is the one whose fits err least
on segments left out, each in turn, of those that are fitted; no other rows are looked at.

A number comes from the prior where the efforts' share of what is known of it, the diagonal of
:math:`(N + wH)^{-1} N` with H the distance's curvature, is below one half.

.. [1] T. Lee, P. M. Wensing, F. C. Park, "Geometric robot dynamic identification: a convex programming approach", IEEE
   Trans. Robotics 36, 2020.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.pseudo_inertia import (
    EIGENVALUE_TOLERANCE,
    MIN_EIGENVALUE,
    SCALING_LENGTH_M,
    bodies_from_pseudo_inertia,
    least_eigenvalue,
    pseudo_inertia,
    scaled_pseudo_inertia,
    triangle_matrix,
)
from .consistent_fit import ConsistentSolution, Solver, Spread, consistent_estimate, nearest_bodies, solve_consistent
from .consistent_inertias import BODY, ConsistentFit, Quadratic
from .tree_estimate import TreeEstimate
from .tree_regression import NormalEquations, TreeModel, TreeRows, TreeSolution, fit_rows

WEIGHTS = tuple(float(10.0**k) for k in range(-3, 6))
"""Tried, on the scale of the weighted sum of squares."""

STEPS = 100  # of Newton, at most
SETTLED = 1e-9  # decrement at which they stop, over the objective
BARRIER = 1e-6  # of what is least: how strongly bounds of other numbers push
UNSHOWN = 0.5  # share of what is known
EXTENT = 0.01
"""Root mean square reach that a body of the prior has in every direction [m]: a description may hold points."""


@dataclass(frozen=True)
class PriorChoice:
    """A `weight` that was chosen, and for each that was tried the mean weighted square of what is `missed` on segments
    left out."""

    distance: str
    weight: float
    missed: Mapping[float, float]


def euclidean(maker: np.ndarray, weight: float) -> Solver:
    """Near to the `maker`'s bodies, (links, 10), by the Euclidean distance."""
    size = np.sum(scaled_pseudo_inertia(maker) ** 2, axis=(1, 2))
    return nearest_bodies(maker, weight / np.maximum(size, 1e-6 * size.max()))


def entropic(maker: np.ndarray, weight: float) -> Solver:
    """Near to the `maker`'s bodies, (links, 10), by the entropic distance."""
    maker = _rounded(maker)

    def solve(spread: Spread, equations: NormalEquations, sd: np.ndarray) -> ConsistentFit:
        return _newton(*spread.sums(equations, sd), maker, weight, *spread.numbers.bounds)

    return solve


def _rounded(maker: np.ndarray) -> np.ndarray:
    """The same with extent: points, rods and plates reach `EXTENT` in every direction."""
    wrong = np.flatnonzero(least_eigenvalue(maker) < -EIGENVALUE_TOLERANCE)
    if wrong.size:
        raise IdentificationError(
            f"found moments of inertia of body {wrong[0] + 1} that no body has, expected each to be at most the sum of "
            "the other two about the centre of mass: mend the robot's description, or take the euclidean distance"
        )
    flat = least_eigenvalue(maker) < maker[:, 0] * EXTENT**2
    lift = (flat * np.maximum(maker[:, 0], MIN_EIGENVALUE / SCALING_LENGTH_M**2))[:, None, None] * np.diag(
        [1.0, 1.0, 1.0, 0.0]
    )
    return bodies_from_pseudo_inertia(
        pseudo_inertia(maker) + EXTENT**2 * lift + MIN_EIGENVALUE * flat[:, None, None] * np.eye(4)
    )


DISTANCES: Mapping[str, Callable[[np.ndarray, float], Solver]] = {"entropic": entropic, "euclidean": euclidean}


def _newton(
    normal: np.ndarray, projected: np.ndarray, maker: np.ndarray, weight: float, lowest: np.ndarray, highest: np.ndarray
) -> ConsistentFit:
    """The least of theta'N theta / 2 - b'theta + weight / 2 the entropic distance, bounds pushing a little: damped
    Newton, which stays inside."""
    k, c = BODY * len(maker), len(projected)
    basis = pseudo_inertia(np.eye(BODY))  # (10, 4, 4)
    back = np.linalg.inv(pseudo_inertia(maker))
    pull = np.einsum("iab,tba->it", back, basis).ravel()
    told = Quadratic.of(normal, projected)
    push = BARRIER * (told.best @ told.best) / max(len(told.best), 1)
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
        p = pseudo_inertia(x[:k].reshape(-1, BODY))
        sign, log = np.linalg.slogdet(p)
        if np.any(sign <= 0) or np.any(p[:, 3, 3] <= 0.0) or np.any(np.linalg.eigvalsh(p)[:, 0] <= 0.0):
            return np.inf
        if np.any(x[below] <= lowest[below]) or np.any(x[above] >= highest[above]):
            return np.inf
        edges = np.log(x[below] - lowest[below]).sum() + np.log(highest[above] - x[above]).sum()
        return float(0.5 * x @ normal @ x - projected @ x + 0.5 * weight * (pull @ x[:k] - log.sum()) - push * edges)

    now = value(theta)
    for _ in range(STEPS):
        inverse = np.linalg.inv(pseudo_inertia(theta[:k].reshape(-1, BODY)))
        moved = np.einsum("iab,tbc->itac", inverse, basis)  # P^-1 E_t
        slope, hessian = normal @ theta - projected, normal.copy()
        slope[:k] += 0.5 * weight * (pull - np.trace(moved, axis1=2, axis2=3).ravel())
        curve = np.einsum("itab,isba->its", moved, moved)
        for i in range(len(maker)):
            at = slice(BODY * i, BODY * (i + 1))
            hessian[at, at] += 0.5 * weight * curve[i]
        for mask, gap, way in ((below, theta - lowest, -1.0), (above, highest - theta, 1.0)):
            slope[mask] += way * push / gap[mask]
            hessian[mask, mask] += push / gap[mask] ** 2
        size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        unit = hessian / np.outer(size, size) + 1e-13 * np.eye(c)
        step = -np.linalg.solve(unit, slope / size) / size
        decrement = float(-slope @ step)
        share = 1.0
        while not value(theta + share * step) <= now - 1e-4 * share * decrement and share > 1e-10:
            share *= 0.5
        theta = theta + share * step
        now = value(theta)
        if decrement <= SETTLED * (told.best @ told.best):
            break
    return ConsistentFit(
        theta,
        told.loss(theta, normal, projected),
        told.told,
        False,
        np.zeros(len(maker), bool),
        np.minimum(theta - lowest, highest - theta) < room,
    )


def chosen_weight(
    found: ConsistentSolution, maker: np.ndarray, distance: str = "entropic", weights: Sequence[float] = WEIGHTS
) -> PriorChoice:
    """The weight of the `maker`'s bodies, (links, 10), with which least is missed on segments left out in turn, of a
    solution without prior; `distance` one of `DISTANCES`."""
    equations, spread = found.equations, found.spread
    whole = equations.total()
    numbers = np.flatnonzero(equations.count.any(axis=1))
    if len(numbers) < 2:
        raise IdentificationError(f"found {len(numbers)} segment to choose a prior's weight by, expected at least 2")
    missed = {}
    for weight in weights:
        solver, total = DISTANCES[distance](maker, weight), 0.0
        for s in numbers:
            part = equations.segment(s)
            values = spread.matrix @ solver(spread, whole.minus(part), found.sd).values
            total += float(np.sum(part.squares(values)[0] / found.sd**2))
        missed[weight] = total / float(whole.count.sum())
    return PriorChoice(distance, min(missed, key=missed.__getitem__), missed)


def shown_share(found: ConsistentSolution, maker: np.ndarray, choice: PriorChoice) -> np.ndarray:
    """Of every number, (c,), the share of what is known of it that the efforts tell: 1 where the prior says nothing."""
    spread = found.spread
    normal, _ = spread.sums(found.equations, found.sd)
    k, c = BODY * len(maker), len(normal)
    curve = np.zeros((c, c))
    inverse, basis = None, pseudo_inertia(np.eye(BODY))
    if choice.distance == "entropic":
        inverse = np.linalg.inv(pseudo_inertia(_rounded(maker)))
    size = np.sum(scaled_pseudo_inertia(maker) ** 2, axis=(1, 2))
    for i in range(len(maker)):
        at = slice(BODY * i, BODY * (i + 1))
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
    start: TreeSolution | None = None,
    maker: np.ndarray | None = None,
    distance: str = "entropic",
    name: str = "prior",
) -> tuple[TreeEstimate, PriorChoice]:
    """An estimate drawn to the `maker`'s bodies, (links, 10), those of the robot's description if not given, by a
    weight that is chosen within `rows`; of each number it is said whether it comes from the prior."""
    if distance not in DISTANCES:
        raise IdentificationError(f"found distance {distance!r} of a prior, expected one of {', '.join(DISTANCES)}")
    start = fit_rows(model, rows)[0] if start is None else start
    maker = Spread.of(model).maker if maker is None else maker
    plain = solve_consistent(model, rows, start=start, nearest=maker)
    choice = chosen_weight(plain, maker, distance)
    found = solve_consistent(model, rows, start=start, solver=DISTANCES[distance](maker, choice.weight))
    share = shown_share(found, maker, choice)
    note = (
        f"the maker's inertias weigh {choice.weight:g} ({distance}): what is missed on segments left out is then least"
    )
    told = share >= UNSHOWN
    return consistent_estimate(name, rows, found, nearest=maker, told=told, notes=(note,)), choice
