r"""A robot whose links are bodies that can exist, and whose joints only lose power.

The model of `tree_regression`, in the ten numbers of every link instead of base parameters: with base = K numbers, the
sums N become K'NK, and nothing is summed again. Joints weigh as in the fit without bounds. What the efforts do not show
comes from the maker's bodies or from the smallest, and each parameter says so.

Bounds bend a fit, so that no covariance of least squares holds: intervals are the jackknife's over segments [1]_, each
left out in turn and the rest fitted again within the same bounds.

.. [1] B. Efron, C. Stein, "The jackknife estimate of variance", Ann. Statist. 9, 1981.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.kinematic_tree import BODY_QUANTITIES
from ..uncertainty import student_to_normal_ratio
from .base_parameters import BaseParameters
from .consistent_inertias import ConsistentFit, consistent_inertias
from .fit_tree import UNSEEN, estimate_of
from .tree_estimate import TreeEstimate
from .tree_regression import (
    Linearised,
    NormalEquations,
    TreeModel,
    TreeRows,
    TreeSolution,
    fit_rows,
    linearised,
    loads_of,
    normal_equations,
)
from .tree_uncertainty import TreeUncertainty

FROM_PRIOR = "from the prior: the motion does not show it"
STEPS = 6  # of Gauss and Newton, at most; without load terms the first is the last
SETTLED = 1e-4  # of the RMS effort, the change at which they stop
FEW = 6.5  # Student's quantile over the normal one for a single degree of freedom


@dataclass(frozen=True, eq=False)
class Spread:
    """A `model` of base parameters in all numbers of its robot: `numbers`, the same model of c numbers, and `matrix`
    (p, c) with the model's parameters = matrix @ numbers."""

    model: TreeModel
    numbers: TreeModel
    matrix: np.ndarray

    @classmethod
    def of(cls, model: TreeModel) -> Spread:
        """Of a model."""
        base, r = model.base, len(model.base.names)
        p, others = len(base.members), len(model.names) - r
        matrix = np.zeros((r + others, p + others))
        matrix[:r, :p], matrix[r:, p:] = base.combination, np.eye(others)
        alone = BaseParameters(base.members, base.members, np.arange(p), np.eye(p))
        return cls(model, replace(model, base=alone), matrix)

    @property
    def links(self) -> int:
        """How many bodies."""
        return len(self.model.robot.tree.order)

    @property
    def maker(self) -> np.ndarray:
        """The bodies of the robot's description, (links, 10)."""
        return self.model.robot.tree.parameters.reshape(self.links, len(BODY_QUANTITIES))

    def sums(self, equations: NormalEquations, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """N (c, c) and b (c,) of all rows of `equations`, joints weighing as 1 / `sd` (m,)."""
        weight, whole = 1.0 / sd**2, equations.total()
        gram, moment = np.tensordot(weight, whole.gram[0], 1), weight @ whole.moment[0]
        return self.matrix.T @ gram @ self.matrix, self.matrix.T @ moment


Solver = Callable[[Spread, NormalEquations, np.ndarray], ConsistentFit]
"""The consistent numbers of all rows of equations, joints weighing as 1 / sd (m,)."""


def nearest_bodies(nearest: np.ndarray | None = None, weight: float | np.ndarray = 0.0) -> Solver:
    """Of the bodies that make the least sum of squares those `nearest` to others, (links, 10), or the smallest; with a
    `weight`, nearer to these than that."""

    def solve(spread: Spread, equations: NormalEquations, sd: np.ndarray) -> ConsistentFit:
        lowest, highest = spread.numbers.bounds
        sums = spread.sums(equations, sd)
        return consistent_inertias(*sums, spread.links, lowest=lowest, highest=highest, nearest=nearest, weight=weight)

    return solve


@dataclass(frozen=True, eq=False)
class ConsistentSolution:
    """Where a consistent `fit` of a model's numbers ended, linearised `at` it, from `equations` by segment; joints
    weigh as 1 / `sd` (m,)."""

    spread: Spread
    fit: ConsistentFit
    at: Linearised
    equations: NormalEquations
    sd: np.ndarray
    solver: Solver

    @property
    def parameters(self) -> np.ndarray:
        """Of the model of base parameters, (p,)."""
        return self.spread.matrix @ self.fit.values


def solve_consistent(
    model: TreeModel,
    rows: TreeRows,
    *,
    start: TreeSolution | None = None,
    nearest: np.ndarray | None = None,
    solver: Solver | None = None,
) -> ConsistentSolution:
    """The consistent solution of a `model` over `rows`, from a `start` without bounds; of `nearest` bodies (links, 10)
    see `consistent_inertias`; another `solver` may believe them more."""
    solver = solver or nearest_bodies(nearest)
    start = fit_rows(model, rows)[0] if start is None else start
    spread, values, before = Spread.of(model), start.values, None
    for _ in range(STEPS if model.loads else 1):
        load = loads_of(rows, model, values) if model.loads else None
        if before is not None:
            moved = np.sqrt(np.mean((load - before) ** 2, axis=0))
            if np.all(moved <= SETTLED * np.maximum(rows.size, 1e-12)):
                break
        before = load
        at = linearised(model, rows, load, model.alpha(values) if model.loads else None)
        equations = normal_equations(at)
        fit = solver(spread, equations, start.sd)
        values = spread.matrix @ fit.values
    return ConsistentSolution(spread, fit, at, equations, start.sd, solver)


def fit_consistent(
    model: TreeModel,
    rows: TreeRows,
    *,
    start: TreeSolution | None = None,
    nearest: np.ndarray | None = None,
    name: str = "consistent",
) -> TreeEstimate:
    """An estimate whose links are bodies that can exist; its intervals are the jackknife's over segments."""
    return consistent_estimate(name, rows, solve_consistent(model, rows, start=start, nearest=nearest), nearest=nearest)


def consistent_estimate(
    name: str,
    rows: TreeRows,
    found: ConsistentSolution,
    *,
    nearest: np.ndarray | None = None,
    told: np.ndarray | None = None,
    notes: Sequence[str] = (),
) -> TreeEstimate:
    """What was `found`, with intervals; `told` (c,) are the numbers that efforts tell, if not all that they can, the
    others being those of the `nearest` bodies, if any."""
    spread, fit = found.spread, found.fit
    told = fit.told if told is None else told
    covariance = jackknifed(found)
    freedom = float(max(len(_recorded(found.equations)) - 1, 1))
    covariance *= (student_to_normal_ratio(freedom) if freedom > 1.0 else FEW) ** 2
    every = np.arange(len(spread.numbers.names))
    columns = tuple(x @ spread.matrix[place] for place, x in zip(found.at.places, found.at.columns, strict=True))
    at = replace(found.at, model=spread.numbers, places=(every,) * len(columns), columns=columns)
    whole = found.equations.total()
    sd = np.sqrt(whole.squares(found.parameters)[0] / np.maximum(whole.count[0], 1.0))
    estimate = estimate_of(
        name,
        rows,
        TreeSolution(fit.values, sd, told, fit.at_bound),
        at,
        method="consistent",
        uncertainty=TreeUncertainty(covariance, freedom, 0, covariance, np.zeros(len(columns))),
        notes=(*notes, *_notes(found)),
    )
    why = UNSEEN if nearest is None else FROM_PRIOR
    parameters = {
        label: replace(each, refused=why) if each.refused == UNSEEN else each
        for label, each in estimate.parameters.items()
    }
    return replace(estimate, parameters=parameters)


def _notes(found: ConsistentSolution) -> tuple[str, ...]:
    """What consistency cost."""
    if found.fit.free:
        return ("bodies that can exist make just the effort of least squares",)
    names = [
        joint.child for joint, held in zip(found.spread.model.robot.tree.order, found.fit.held, strict=True) if held
    ]
    least = found.spread.sums(found.equations, found.sd)
    whole = found.equations.total()
    square = float(np.sum(whole.square[0] / found.sd**2)) - float(least[1] @ found.fit.values)
    share = 100.0 * found.fit.loss / max(square, 1e-300)
    held = f"; on the bound: {', '.join(names)}" if names else ""
    return (f"consistent inertias raise the weighted sum of squared residuals by {share:.2g} %{held}",)


def jackknifed(found: ConsistentSolution) -> np.ndarray:
    """Covariance (c, c) of the numbers by leaving each segment out in turn."""
    whole = found.equations.total()
    parts = (found.equations.segment(s) for s in _recorded(found.equations))
    each = np.array([found.solver(found.spread, whole.minus(part), found.sd).values for part in parts])
    apart = each - each.mean(axis=0)
    return (len(each) - 1) / len(each) * apart.T @ apart


def _recorded(equations: NormalEquations) -> np.ndarray:
    """Segments with rows."""
    return np.flatnonzero(equations.count.any(axis=1))
