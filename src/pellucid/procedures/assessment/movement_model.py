"""Movements of control and of a condition as a mixed model has them: logarithms or values, with what else acts on
each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...assessment.equivalence import Equivalence, Margin
from ...assessment.learning import Thirds, thirds
from ...assessment.measured import DIRECTION_UP, MeasuredMovement
from ...assessment.mixed_model import MixedModel, failed_model, mixed_model
from .measured_study import MeasuredStudy
from .session_order import SessionOrder

if TYPE_CHECKING:
    from .certified import EndPoint

MOST_LEVELS = 8
"""Amplitudes that have an effect each; of more of them the effect is a straight line."""

LASTING = {"duration_median": "duration"}
"""Indices of how long movements lasted, and the value of a movement that they are of."""


def movements_of(
    whole: MeasuredStudy, point: EndPoint, conditions: Sequence[str], participants: Sequence[str], order: SessionOrder
) -> list[tuple[MeasuredMovement, float]]:
    """Movements with their value, in the order in which they were made, of cells that their participant has in all
    `conditions`; none where the index is not of single movements."""
    of = LASTING.get(point.index.name, "" if point.index.spread else point.index.of)
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
    """Early and late movements of a condition, by participant; None where their order is not known or they are few."""
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
    """The change of one end point from every movement of these `people`; `control` None where it has none."""
    conditions = [condition] if control is None else [control, condition]
    own = movements_of(whole, point, conditions, people, order)
    if not own:
        return failed_model(len(people), 0, "no value of single movements")
    if point.index.of == "duration" or point.index.name in LASTING:
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
    """Amplitude and trial, each also times the condition, direction and period; (n,) each."""
    made: dict[str, np.ndarray] = {}
    amplitude = [m.cell[0] for m, _ in own]
    levels = [] if None in amplitude else sorted(set(amplitude))
    if 1 < len(levels) <= MOST_LEVELS:
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
    """From 0, the first of a participant's movements in a condition, to 1, the last."""
    groups: dict[tuple[str, str], list[int]] = {}
    for i, (m, _) in enumerate(own):
        groups.setdefault((m.participant, m.condition), []).append(i)
    made = np.zeros(len(own))
    for rows in groups.values():
        made[rows] = np.arange(len(rows)) / max(len(rows) - 1, 1)
    return made


def of_model(model: MixedModel, point: EndPoint, alpha: float) -> Equivalence:
    """The model's change against the end point's margin, in the unit of participants' changes."""
    if not point.index.over_control:
        return model.equivalence(point.margin, alpha)
    # A share of control is exp of a difference of logarithms, less 1; tests do not mind.
    with np.errstate(divide="ignore"):
        ends = (float(np.log1p(max(end, -1.0))) for end in (point.margin.low, point.margin.high))
        made = model.equivalence(Margin(*ends), alpha)
    low, high = (float(np.expm1(end)) for end in made.interval)
    return replace(made, margin=point.margin, estimate=float(np.expm1(made.estimate)), interval=(low, high))
