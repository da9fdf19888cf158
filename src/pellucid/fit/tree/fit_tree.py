"""A robot identified: one model, one estimator, and everything that is to be said of its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion
from ..parameter import Parameter
from ..regression import make_parameters
from .friction_terms import SPEED, plain_families
from .tree_estimate import TreeEstimate
from .tree_regression import Linearised, TreeModel, TreeRows, TreeSolution, fit_rows, tree_rows
from .tree_uncertainty import TreeUncertainty, tree_uncertainty

UNSEEN = "nothing in these recordings tells it from the others"
SEARCHED = "searched on a grid, not fitted"


def fit_tree(
    robot: Robot,
    motions: Sequence[TreeMotion],
    families: Sequence[Sequence[str]] | None = None,
    *,
    name: str = "base",
    width: float = 0.0,
) -> TreeEstimate:
    """Weighted least squares of base parameters with friction `families` of each joint, plain ones if not given;
    `width` of the smooth sign of friction, 0 for the true sign [rad/s; m/s]."""
    rows = tree_rows(robot, motions, width=width)
    plain = plain_families(len(robot.names), robot.shared)
    model = TreeModel(robot, rows.base, plain if families is None else tuple(map(tuple, families)))
    return estimate_of(name, rows, *fit_rows(model, rows))


def estimate_of(
    name: str,
    rows: TreeRows,
    found: TreeSolution,
    at: Linearised,
    *,
    method: str = "weighted",
    uncertainty: TreeUncertainty | None = None,
    notes: Sequence[str] = (),
) -> TreeEstimate:
    """What was `found` of the rows, linearised `at` it, with intervals."""
    model = at.model
    sure = tree_uncertainty(at, found) if uncertainty is None else uncertainty
    parameters = _parameters(model, rows, found, at, sure)
    speeds = {f"{model.robot.names[k]}.{SPEED}": (k, v) for k, v in (model.speeds or {}).items()}
    ripples = []
    for i, ripple in enumerate(model.ripples):
        first = len(model.base.names) + len(model.parts) + 2 * i
        ripples.append(replace(ripple, sine=found.values[first], cosine=found.values[first + 1]))
    for label, (k, value) in speeds.items():
        unit = f"{model.robot.units[k][0]}/s"
        parameters[label] = Parameter(label, unit, value, 0.0, refused=SEARCHED)
    size = len(parameters)
    covariance = np.zeros((size, size))
    covariance[: len(found.values), : len(found.values)] = sure.covariance
    return TreeEstimate(
        title=f"{len(model.robot.names)} joints, {len(found.values)} parameters, {name}",
        name=name,
        robot=model.robot,
        families=model.families,
        parameters=parameters,
        covariance=covariance,
        velocity_width=rows.width,
        ripples=tuple(ripples),
        readings={n: model.base.reading(n) for n in model.base.names},
        residual_sd=tuple(float(x) for x in found.sd),
        freedom=sure.freedom,
        method=method,
        notes=tuple(notes),
    )


def _parameters(
    model: TreeModel, rows: TreeRows, found: TreeSolution, at: Linearised, sure: TreeUncertainty
) -> dict[str, Parameter]:
    """By name, with what each makes of all joints' effort."""
    power = np.zeros(len(found.values))
    for place, x in zip(at.places, at.columns, strict=True):
        power[place] += np.sum(x**2, axis=0)
    whole = sum(float(np.sum(rows.effort[lines, j] ** 2)) for j, lines in enumerate(rows.lines))
    plain = make_parameters(model.names, model.units, found.values, sure.covariance, found.held, ~found.seen)
    made = {}
    for parameter, seen, strength in zip(plain, found.seen, power, strict=True):
        refused = "" if seen else UNSEEN
        influence = float(np.sqrt(strength / whole))
        made[parameter.name] = replace(parameter, influence=influence, refused=refused)
    return made
