"""A robot identified whole: base parameters, the best friction of each joint, what both predict, and how sure it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion
from .base_parameters import BaseParameters
from .fit_tree import estimate_of
from .friction_terms import RICHER, RICHER_SHARED, plain_families
from .ripple import Line, chosen_ripples
from .segment_jackknife import SegmentJackknife, segment_jackknife
from .segments_out import SegmentsOut, heldout_errors, segments_out
from .tree_estimate import TreeEstimate
from .tree_families import FamilyChoice, chosen_families
from .tree_regression import Linearised, TreeModel, TreeRows, TreeSolution, fit_rows, loads_of, tree_rows
from .tree_uncertainty import tree_uncertainty


@dataclass(frozen=True, eq=False)
class TreeIdentification:
    """What is known of a robot after its recordings.

    Attributes
    ----------
    rows : TreeRows
        Of the recordings that were fitted.
    base, best : TreeEstimate
        Plain friction; friction and ripple chosen within these rows.
    choice : FamilyChoice
        What was chosen, in which order.
    lines : sequence of Line
        The strongest line of each motor's residual over its angle.
    base_out, best_out, maker_out : SegmentsOut or None
        Errors on segments left out; of the maker's inertias with friction fitted, too. None where not asked for.
    jackknife : SegmentJackknife or None
        Beside the best estimate's standard errors.
    heldout : mapping of str to ndarray
        Errors of "base" and "best" on recordings that took no part, (m,) [%].
    """

    rows: TreeRows
    base: TreeEstimate
    best: TreeEstimate
    choice: FamilyChoice
    lines: Sequence[Line]
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
    terms: Sequence[str] = RICHER + RICHER_SHARED,
    ripple: bool = True,
) -> TreeIdentification:
    """From recordings that are fitted, and others that are judged by alone; `width` of the smooth sign of friction
    [rad/s; m/s]; `leave_out`: whether segments are left out in turn; `terms` that joints may be given; `ripple`:
    whether drives are searched for one."""
    rows = tree_rows(robot, motions, width=width)
    rate = motions[0].rate
    plain = plain_model(rows)
    base = estimate_of("base", rows, *fit_rows(plain, rows))
    choice, lines, found, at = best_fit(rows, rate, terms, ripple)
    sure = tree_uncertainty(at, found)
    best = estimate_of("best", rows, found, at, uncertainty=sure, notes=_notes(rows, choice, at.model))
    base_out = best_out = maker_out = jackknife = None
    if leave_out and rows.segments > 1:
        base_out = segments_out(rows, lambda part: (plain, fit_rows(plain, part)[0]))
        best_out = segments_out(rows, lambda part: _model_of(best_fit(part, rate, terms, ripple)))
        jackknife = segment_jackknife(at.model, rows, found, sure.covariance, sure.textbook)
        maker = maker_rows(rows, motions)
        friction = plain_model(maker)
        maker_out = segments_out(maker, lambda part: (friction, fit_rows(friction, part)[0]))
        maker_out = replace(maker_out, errors=maker_out.errors * maker.size / rows.size)
    heldout = {e.name: heldout_errors(e, judged) for e in (base, best)} if judged else {}
    return TreeIdentification(rows, base, best, choice, lines, base_out, best_out, maker_out, jackknife, heldout)


def plain_model(rows: TreeRows) -> TreeModel:
    """Base parameters and plain friction."""
    return TreeModel(rows.robot, rows.base, plain_families(len(rows.robot.names), rows.robot.shared))


def best_fit(
    rows: TreeRows, rate: float, terms: Sequence[str] = RICHER + RICHER_SHARED, ripple: bool = True
) -> tuple[FamilyChoice, Sequence[Line], TreeSolution, Linearised]:
    """Friction `terms`, and `ripple` if it is asked for, chosen within `rows` at `rate` [Hz], and the fit with them."""
    choice = chosen_families(rows, terms)
    model = TreeModel(rows.robot, rows.base, choice.families, choice.speeds)
    found, at = fit_rows(model, rows)
    ripples, lines = chosen_ripples(at, found, rate) if ripple else ((), ())
    if ripples:
        model = replace(model, ripples=ripples)
        found, at = fit_rows(model, rows, load=loads_of(rows, model, found.values))
    return choice, lines, found, at


def _model_of(found: tuple[FamilyChoice, Sequence[Line], TreeSolution, Linearised]) -> tuple[TreeModel, TreeSolution]:
    return found[3].model, found[2]


def maker_rows(rows: TreeRows, motions: Sequence[TreeMotion]) -> TreeRows:
    """The simplest rival: links as their maker states them, so that only rotors and friction are left to fit."""
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
    """What was chosen, in words."""
    said = [
        f"{rows.robot.names[x.joint]} was given {x.term.replace('_', ' ')}: it saves {x.saved:.1f} % of the squares "
        f"that are missed on segments left out (p = {x.p_value:.2g})"
        for x in choice.taken
    ]
    said += [
        f"{rows.robot.names[x.motor]} has a ripple of {x.order:.1f} periods a turn of its joint" for x in model.ripples
    ]
    return tuple(said)
