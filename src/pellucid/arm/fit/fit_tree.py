"""Fit one model of a robot by weighted least squares, with intervals for its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.estimates import Parameter
from ...models.robot import Robot
from ...numerics.motion import require_fitted
from ...numerics.regression import make_parameters
from ..tree_motion import TreeMotion
from .base_parameters import BaseParameters
from .friction_terms import FURTHER_MOTOR_TERMS, FURTHER_TERMS, STRIBECK_VELOCITY_NAME, plain_families
from .tree_estimate import TreeEstimate
from .tree_families import FamilyChoice, SpectralLine, choose_families, choose_ripples
from .tree_regression import LinearisedModel, TreeModel, TreeRows, TreeSolution, collect_rows, compute_loads, fit_rows
from .tree_uncertainty import (
    SegmentJackknife,
    SegmentsOut,
    TreeUncertainty,
    cross_validate_segments,
    estimate_uncertainty,
    heldout_errors,
    jackknife_segments,
)

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


@dataclass(frozen=True, eq=False)
class TreeIdentification:
    """Identification of a robot from its recordings.

    Attributes
    ----------
    rows : TreeRows
        Regression rows of the fitted recordings.
    base, best : TreeEstimate
        Estimate with plain friction, and estimate with friction and ripple chosen within these rows.
    choice : FamilyChoice
        Chosen friction terms, in the order of the choice.
    lines : sequence of Line
        Strongest spectral line of each motor's residual over its angle.
    base_out, best_out, maker_out : SegmentsOut or None
        Errors on left-out segments of both estimates, and of the maker's inertias with fitted friction; None if not
        requested.
    jackknife : SegmentJackknife or None
        Jackknife check of the best estimate's standard errors.
    heldout : mapping of str to ndarray
        Errors of "base" and "best" on held-out recordings, (m,) [%].
    """

    rows: TreeRows
    base: TreeEstimate
    best: TreeEstimate
    choice: FamilyChoice
    lines: Sequence[SpectralLine]
    base_out: SegmentsOut | None
    best_out: SegmentsOut | None
    maker_out: SegmentsOut | None
    jackknife: SegmentJackknife | None
    heldout: dict[str, np.ndarray]


def identify_tree(
    robot: Robot,
    motions: Sequence[TreeMotion],
    judged: Sequence[TreeMotion] = (),
    *,
    width: float = 0.0,
    leave_out: bool = True,
    terms: Sequence[str] = FURTHER_TERMS + FURTHER_MOTOR_TERMS,
    ripple: bool = True,
) -> TreeIdentification:
    """Identify a robot from `motions`, and test it on held-out motions `judged`.

    `width` is that of the smooth sign of friction [rad/s; m/s]. `leave_out` adds cross-validation over segments.
    `terms` are the friction terms that joints may get. `ripple` adds a search for drive ripple.
    """
    require_fitted(motions, "identify_tree")
    rows = collect_rows(robot, motions, width=width)
    rate = motions[0].rate
    plain = plain_model(rows)
    base = make_tree_estimate("base", rows, *fit_rows(plain, rows))
    choice, lines, found, at = fit_best_model(rows, rate, terms, ripple)
    sure = estimate_uncertainty(at, found)
    best = make_tree_estimate("best", rows, found, at, uncertainty=sure, notes=_notes(rows, choice, at.model))
    base_out = best_out = maker_out = jackknife = None

    def choose_and_fit(part: TreeRows) -> tuple[TreeModel, TreeSolution]:
        *_, solution, linearised = fit_best_model(part, rate, terms, ripple)
        return linearised.model, solution

    if leave_out and rows.segments > 1:
        base_out = cross_validate_segments(rows, lambda part: (plain, fit_rows(plain, part)[0]))
        best_out = cross_validate_segments(rows, choose_and_fit)
        jackknife = jackknife_segments(at.model, rows, found, sure.covariance, sure.textbook)
        maker = rows_without_maker_effort(rows, motions)
        friction = plain_model(maker)
        maker_out = cross_validate_segments(maker, lambda part: (friction, fit_rows(friction, part)[0]))
        maker_out = replace(maker_out, errors=maker_out.errors * maker.size / rows.size)
    heldout = {e.name: heldout_errors(e, judged) for e in (base, best)} if judged else {}
    return TreeIdentification(rows, base, best, choice, lines, base_out, best_out, maker_out, jackknife, heldout)


def plain_model(rows: TreeRows) -> TreeModel:
    """Return the model with base parameters and plain friction."""
    return TreeModel(rows.robot, rows.base, plain_families(len(rows.robot.names), rows.robot.shared))


def fit_best_model(
    rows: TreeRows, rate: float, terms: Sequence[str] = FURTHER_TERMS + FURTHER_MOTOR_TERMS, ripple: bool = True
) -> tuple[FamilyChoice, Sequence[SpectralLine], TreeSolution, LinearisedModel]:
    """Choose friction `terms`, and `ripple` if requested, within `rows` at `rate` [Hz], and fit the model."""
    choice = choose_families(rows, terms)
    model = TreeModel(rows.robot, rows.base, choice.families, choice.speeds)
    found, at = fit_rows(model, rows)
    ripples, lines = choose_ripples(at, found, rate) if ripple else ((), ())
    if ripples:
        model = replace(model, ripples=ripples)
        found, at = fit_rows(model, rows, load=compute_loads(rows, model, found.values))
    return choice, lines, found, at


def rows_without_maker_effort(rows: TreeRows, motions: Sequence[TreeMotion]) -> TreeRows:
    """Return rows for the baseline with the maker's links: their effort is subtracted, and rotors and friction remain
    to be fitted."""
    robot = rows.robot
    stated = np.concatenate(
        [robot.tree.core.regressor(m.position, m.velocity, m.acceleration) @ robot.tree.parameters for m in motions]
    )
    rotors = [f"{name}.rotor_inertia" for name in robot.names]
    motors = [f"{robot.names[i]}.motor_inertia" for i in robot.shared]
    turns = np.asarray(robot.turns)
    acceleration = np.concatenate([m.acceleration for m in motions])
    m = len(robot.names)
    rigid = np.zeros((*rows.effort.shape, m + len(motors)))
    rigid[:, np.arange(m), np.arange(m)] = acceleration
    for i, motor in enumerate(robot.shared):
        rigid[:, :, m + i] = np.outer(acceleration @ turns[motor], turns[motor])
    names = (*rotors, *motors)
    base = BaseParameters(names, names, np.arange(len(names)), np.eye(len(names)))
    return replace(rows, base=base, rigid=rigid, effort=rows.effort - stated)


def _notes(rows: TreeRows, choice: FamilyChoice, model: TreeModel) -> tuple[str, ...]:
    """Return the choices of friction and ripple in words."""
    said = [
        f"{rows.robot.names[x.joint]} was given {x.term.replace('_', ' ')}: it saves {x.saved:.1f} % of the squares "
        f"that are missed on segments left out (p = {x.p_value:.2g})"
        for x in choice.taken
    ]
    said += [
        f"{rows.robot.names[x.motor]} has a ripple of {x.order:.1f} periods a turn of its joint" for x in model.ripples
    ]
    return tuple(said)
