r"""Fit a robot with physically consistent links and dissipative joints.

The model is that of `tree_regression`, in the ten inertial parameters of every link instead of base parameters. With
base = K numbers, the normal matrix N becomes K'NK, and no sums are recomputed. Joints have the weights of the fit
without bounds. Parameters that the efforts do not determine come from the maker's bodies or from the smallest ones, and
each is marked accordingly.

Active bounds invalidate the covariance of least squares. The intervals are the jackknife's over segments [1]_: each is
left out in turn, and the rest is fitted again within the same bounds.

.. [1] B. Efron, C. Stein, "The jackknife estimate of variance", Ann. Statist. 9, 1981.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.kinematic_tree import BODY_QUANTITIES
from ...numerics.uncertainty import student_to_normal_ratio
from .base_parameters import BaseParameters
from .consistent_inertias import ConsistentFit, solve_consistent_inertias
from .fit_tree import UNDETERMINED_REASON, make_tree_estimate
from .tree_estimate import TreeEstimate
from .tree_regression import (
    LinearisedModel,
    NormalEquations,
    TreeModel,
    TreeRows,
    TreeSolution,
    compute_loads,
    fit_rows,
    linearise_rows,
    sum_normal_equations,
)
from .tree_uncertainty import TreeUncertainty

FROM_PRIOR_REASON = "from the prior: the motion does not show it"
"""Reason for refusing the interval of a parameter whose value comes from the maker's bodies."""

MAX_STEPS = 6
"""Largest number of Gauss-Newton steps. A model without load terms needs one."""

LOAD_CHANGE_TOLERANCE = 1e-4
"""Gauss-Newton steps stop when the load changes by at most this share of the RMS effort."""

STUDENT_RATIO_ONE_DEGREE = 6.5
"""Ratio of Student's 97.5 % quantile to the normal one for a single degree of freedom."""


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


def nearest_bodies_solver(nearest: np.ndarray | None = None, weight: float | np.ndarray = 0.0) -> Solver:
    """Return a solver for the consistent bodies with the least sum of squares.

    Among equal ones it takes those `nearest` to stated bodies, (links, 10), or the smallest. A `weight` pulls the
    solution towards the stated bodies at the cost of the sum of squares.
    """

    def solve(spread: FullParametrisation, equations: NormalEquations, sd: np.ndarray) -> ConsistentFit:
        lowest, highest = spread.numbers.bounds
        sums = spread.sums(equations, sd)
        return solve_consistent_inertias(
            *sums, spread.links, lowest=lowest, highest=highest, nearest=nearest, weight=weight
        )

    return solve


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
    start: TreeSolution | None = None,
    nearest: np.ndarray | None = None,
    solver: Solver | None = None,
) -> ConsistentSolution:
    """Solve a `model` over `rows` for consistent bodies, from a `start` without bounds.

    `nearest` are preferred bodies, (links, 10), as in `solve_consistent_inertias`. Another `solver` may weight them
    more.
    """
    solver = solver or nearest_bodies_solver(nearest)
    start = fit_rows(model, rows)[0] if start is None else start
    spread, values, before = FullParametrisation.of(model), start.values, None
    for _ in range(MAX_STEPS if model.loads else 1):
        load = compute_loads(rows, model, values) if model.loads else None
        if before is not None:
            moved = np.sqrt(np.mean((load - before) ** 2, axis=0))
            if np.all(moved <= LOAD_CHANGE_TOLERANCE * np.maximum(rows.size, 1e-12)):
                break
        before = load
        at = linearise_rows(model, rows, load, model.alpha(values) if model.loads else None)
        equations = sum_normal_equations(at)
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
    """Fit physically consistent links, with intervals from the jackknife over segments."""
    return make_consistent_estimate(
        name, rows, solve_consistent(model, rows, start=start, nearest=nearest), nearest=nearest
    )


def make_consistent_estimate(
    name: str,
    rows: TreeRows,
    found: ConsistentSolution,
    *,
    nearest: np.ndarray | None = None,
    told: np.ndarray | None = None,
    notes: Sequence[str] = (),
) -> TreeEstimate:
    """Build an estimate with intervals from the solution `found`.

    `told`, (c,), marks the parameters that the efforts determine; by default those of the fit. The others come from the
    `nearest` bodies, if there are any.
    """
    spread, fit = found.spread, found.fit
    told = fit.told if told is None else told
    covariance = jackknife_covariance(found)
    freedom = float(max(len(_segments_with_rows(found.equations)) - 1, 1))
    covariance *= (student_to_normal_ratio(freedom) if freedom > 1.0 else STUDENT_RATIO_ONE_DEGREE) ** 2
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
        uncertainty=TreeUncertainty(covariance, freedom, 0, covariance, np.zeros(len(columns))),
        notes=(*notes, *_notes(found)),
    )
    why = UNDETERMINED_REASON if nearest is None else FROM_PRIOR_REASON
    parameters = {
        label: replace(each, refused=why) if each.refused == UNDETERMINED_REASON else each
        for label, each in estimate.parameters.items()
    }
    return replace(estimate, parameters=parameters)


def _notes(found: ConsistentSolution) -> tuple[str, ...]:
    """State in words by how much consistency increases the residuals."""
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
