"""Mixed model of the movements of control and of a condition, with covariates of each movement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..design_columns import DIRECTION_UP, MeasuredMovement
from ..equivalence import Equivalence, Margin
from ..indices import CutOff
from ..mixed_model import MixedModel, Thirds, failed_model, mixed_model, thirds
from .measured_study import MeasuredStudy
from .pointing import SessionOrder

if TYPE_CHECKING:
    from .certified_condition import EndPoint

MAX_AMPLITUDE_LEVELS = 8
"""Largest number of amplitudes with a separate effect each. With more, the effect of amplitude is a straight line."""


def movements_of(
    whole: MeasuredStudy, point: EndPoint, conditions: Sequence[str], participants: Sequence[str], order: SessionOrder
) -> list[tuple[MeasuredMovement, float]]:
    """Return movements with their values in chronological order; none if the index has no values of single movements.

    Only cells that a participant has in all `conditions` are used.
    """
    of = "" if point.index.spread else point.index.of
    own = []
    for m in whole.movements:
        value = m.values.get(of, np.nan)
        there = m.condition in conditions and m.participant in participants
        if (
            there
            and np.isfinite(value)
            and point.index.direction in ("", m.cell[1])
            and (value > 0.0 or not point.logs)
        ):
            own.append((m, float(np.log(value)) if point.logs else float(value)))
    cells: dict[tuple, set] = {}
    for m, _ in own:
        cells.setdefault((m.participant, m.cell), set()).add(m.condition)
    own = [each for each in own if len(cells[each[0].participant, each[0].cell]) == len(conditions)]
    return sorted(own, key=lambda each: (order.within[each[0].recording], each[0].movement.start))


def thirds_of(
    own: Sequence[tuple[MeasuredMovement, float]], condition: str, participants: Sequence[str], order: SessionOrder
) -> list[Thirds] | None:
    """Return early and late movements of a condition, by participant; None if unknown order or too few movements."""
    made = []
    for person in participants:
        mine = [(m, y) for m, y in own if (m.participant, m.condition) == (person, condition)]
        if any(order.within[m.recording] < 0 for m, _ in mine):
            return None
        found = thirds([y for _, y in mine], [m.cell for m, _ in mine])
        if found is None:
            return None
        made.append(found)
    return made


def model_of(
    whole: MeasuredStudy, point: EndPoint, condition: str, control: str | None, people: Sequence[str],
    order: SessionOrder,
) -> MixedModel:  # fmt: skip
    """Fit the mixed model of one end point to every movement of these `people`; `control` is None if it has none."""
    conditions = [condition] if control is None else [control, condition]
    own = movements_of(whole, point, conditions, people, order)
    if not own:
        return failed_model(len(people), 0, "no value of single movements")
    if point.index.cut_off is not CutOff.NO_VALUE:
        cut = sum(
            not each.settled for each in whole.lasted if each.condition in conditions and each.participant in people
        )
        if cut:
            return failed_model(len(people), len(own), f"{cut} movements were cut off: a mean of them is one of where")
    under = None if control is None else np.array([m.condition == condition for m, _ in own])
    who = np.array([m.participant for m, _ in own])
    if {(m.participant, m.condition) for m, _ in own} != {(p, c) for p in people for c in conditions}:
        return failed_model(len(people), len(own), "a participant lacks movements that are alike")
    return mixed_model(np.array([y for _, y in own]), who, under, _covariates(own, under, order))


def _covariates(
    own: Sequence[tuple[MeasuredMovement, float]], under: np.ndarray | None, order: SessionOrder
) -> dict[str, np.ndarray]:
    """Return the covariates, (n,) each: amplitude and trial, alone and times the condition, direction, and period."""
    made: dict[str, np.ndarray] = {}
    amplitude = [m.cell[0] for m, _ in own]
    levels = [] if None in amplitude else sorted(set(amplitude))
    if 1 < len(levels) <= MAX_AMPLITUDE_LEVELS:
        made |= {f"amplitude {level:g}": np.array([float(a == level) for a in amplitude]) for level in levels[1:]}
    elif levels[1:]:
        made["amplitude"] = np.array(amplitude, float)
    known = all(order.within[m.recording] >= 0 for m, _ in own)
    if known:
        made["trial"] = _trial(own)
    if under is not None:
        made |= {f"{name} x condition": (each - each.mean()) * (under - 0.5) for name, each in made.items()}
    made["direction"] = np.array([float(m.cell[1] == DIRECTION_UP) for m, _ in own])
    if order.period:
        made["period"] = np.array([float(order.period[m.recording]) for m, _ in own])
    return made


def _trial(own: Sequence[tuple[MeasuredMovement, float]]) -> np.ndarray:
    """Return the rank of each movement in its participant and condition, (n,), from 0 (first) to 1 (last)."""
    groups: dict[tuple[str, str], list[int]] = {}
    for i, (m, _) in enumerate(own):
        groups.setdefault((m.participant, m.condition), []).append(i)
    made = np.zeros(len(own))
    for rows in groups.values():
        made[rows] = np.arange(len(rows)) / max(len(rows) - 1, 1)
    return made


def of_model(model: MixedModel, point: EndPoint, alpha: float) -> Equivalence:
    """Test the model's change against the end point's margin, in the unit of participants' changes."""
    if not point.index.over_control:
        return model.equivalence(point.margin, alpha)
    # A change as a share of control is exp(difference of logarithms) - 1; the transformation does not affect tests.
    with np.errstate(divide="ignore"):
        ends = (float(np.log1p(max(end, -1.0))) for end in (point.margin.low, point.margin.high))
        made = model.equivalence(Margin(*ends), alpha)
    low, high = (float(np.expm1(end)) for end in made.interval)
    return replace(made, margin=point.margin, estimate=float(np.expm1(made.estimate)), interval=(low, high))
