"""Fit one model of a robot by weighted least squares, with intervals for its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.parameter import Parameter
from ...models.robot import Robot
from ...numerics.regression import make_parameters
from ..tree_motion import TreeMotion
from .friction_terms import STRIBECK_VELOCITY_NAME, plain_families
from .tree_estimate import TreeEstimate
from .tree_regression import LinearisedModel, TreeModel, TreeRows, TreeSolution, collect_rows, fit_rows
from .tree_uncertainty import TreeUncertainty, estimate_uncertainty

UNDETERMINED_REASON = "nothing in these recordings tells it from the others"
"""Reason for refusing the interval of a parameter that the recordings do not determine."""

GRID_SEARCH_REASON = "searched on a grid, not fitted"
"""Reason for refusing the interval of a Stribeck velocity."""


def fit_tree(
    robot: Robot,
    motions: Sequence[TreeMotion],
    families: Sequence[Sequence[str]] | None = None,
    *,
    name: str = "base",
    width: float = 0.0,
) -> TreeEstimate:
    """Fit base parameters and friction by weighted least squares.

    `families` are the friction terms of each joint, plain ones by default. `width` is that of the smooth sign of
    friction, 0 for the true sign [rad/s; m/s].
    """
    rows = collect_rows(robot, motions, width=width)
    plain = plain_families(len(robot.names), robot.shared)
    model = TreeModel(robot, rows.base, plain if families is None else tuple(map(tuple, families)))
    return make_tree_estimate(name, rows, *fit_rows(model, rows))


def make_tree_estimate(
    name: str,
    rows: TreeRows,
    found: TreeSolution,
    at: LinearisedModel,
    *,
    method: str = "weighted",
    uncertainty: TreeUncertainty | None = None,
    notes: Sequence[str] = (),
) -> TreeEstimate:
    """Build an estimate with intervals from the solution `found` of the rows, linearised there (`at`)."""
    model = at.model
    sure = estimate_uncertainty(at, found) if uncertainty is None else uncertainty
    parameters = _parameters(model, rows, found, at, sure)
    speeds = {f"{model.robot.names[k]}.{STRIBECK_VELOCITY_NAME}": (k, v) for k, v in (model.speeds or {}).items()}
    ripples = []
    for i, ripple in enumerate(model.ripples):
        first = len(model.base.names) + len(model.parts) + 2 * i
        ripples.append(replace(ripple, sine=found.values[first], cosine=found.values[first + 1]))
    for label, (k, value) in speeds.items():
        unit = f"{model.robot.units[k][0]}/s"
        parameters[label] = Parameter(label, unit, value, 0.0, refused=GRID_SEARCH_REASON)
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
    model: TreeModel, rows: TreeRows, found: TreeSolution, at: LinearisedModel, sure: TreeUncertainty
) -> dict[str, Parameter]:
    """Return the parameters by name, each with its influence on the effort of all joints."""
    power = np.zeros(len(found.values))
    for place, x in zip(at.places, at.columns, strict=True):
        power[place] += np.sum(x**2, axis=0)
    whole = sum(float(np.sum(rows.effort[lines, j] ** 2)) for j, lines in enumerate(rows.lines))
    plain = make_parameters(model.names, model.units, found.values, sure.covariance, found.held, ~found.seen)
    made = {}
    for parameter, seen, strength in zip(plain, found.seen, power, strict=True):
        refused = "" if seen else UNDETERMINED_REASON
        influence = float(np.sqrt(strength / whole))
        made[parameter.name] = replace(parameter, influence=influence, refused=refused)
    return made
