"""Doubts on the change of an end point, of a study's movements: order, learning, lost and failed movements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..certificate import LEFT_OUT_DOUBT, Doubt, LostCounts, carry_over_doubt, learning_doubt, period_doubt
from ..equivalence import Method, equivalence
from ..indices import CutOff
from ..mixed_model import MIN_MOVEMENTS
from ..power import lasting_bounds
from .measured_study import MeasuredStudy
from .movement_model import movements_of, thirds_of
from .pointing import SessionOrder

if TYPE_CHECKING:
    from .assessment_result import AssessmentResult
    from .certified_condition import EndPoint


def lost_movements(
    whole: MeasuredStudy, wanted: Mapping[str, EndPoint], curves: Iterable[str], pair: tuple[str, str],
    people: list[str],
) -> dict[str, LostCounts]:  # fmt: skip
    """Count the movements of both conditions that gave no value, for each end point and curve.

    Median durations include movements that were cut off and targets that were never reached. Other indices of duration
    include those that were cut off.
    """

    def count(each: Iterable, condition: str) -> int:
        return sum(x.condition == condition and x.participant in people for x in each)

    found: dict[str, LostCounts] = {}
    for name in (*wanted, *curves):
        known = whole.movements
        cut_off = wanted[name].index.cut_off if name in wanted else CutOff.NO_VALUE
        if cut_off is not CutOff.NO_VALUE:
            known = (*whole.lasted, *(whole.failed if cut_off is CutOff.AT_LEAST_SEEN else ()))
        found[name] = {}
        for condition in pair:
            total = count(whole.movements, condition) + sum(
                sum(whole.left_out[recording].values())
                for recording, (person, own) in whole.recorded.items()
                if own == condition and person in people
            )
            found[name][condition] = max(total - count(known, condition), 0), total
    return found


def people_with_losses(
    whole: MeasuredStudy, wanted: Mapping[str, EndPoint], pair: tuple[str, str], people: list[str]
) -> dict[str, np.ndarray]:
    """Return, by end point, which of the `people` lost a movement in one of both conditions, (n,)."""
    by_person = {person: lost_movements(whole, wanted, (), pair, [person]) for person in people}
    return {
        name: np.array([any(gone for gone, _ in by_person[person][name].values()) for person in people])
        for name in wanted
    }


def find_doubts(
    found: AssessmentResult, whole: MeasuredStudy, wanted: Mapping[str, EndPoint], condition: str, people: list[str],
    seen: Mapping[str, np.ndarray], order: SessionOrder, alpha: float, method: Method,
) -> tuple[dict[str, tuple[Doubt, ...]], dict[str, tuple[float, float]], tuple[str, ...]]:  # fmt: skip
    """Return the doubts and the trend of each end point, and sentences on what cannot be tested.

    A trend is the change from the first to the last third of a session, with its p value.
    """
    doubts, trends, unknown = {}, {}, []
    if not order.period:
        unknown.append(f"{order.unknown}: what order and carry-over did cannot be told from what conditions did.")
    for name, point in wanted.items():
        own = []
        if order.period:
            own += _of_order(found, point, condition, people, seen[name], order, alpha, method, unknown)
        own += _learning(found, whole, point, condition, people, seen[name], order, alpha, method, trends, unknown)
        failed = {each.condition for each in whole.failed if each.participant in people} & {found.control, condition}
        if point.index.cut_off is CutOff.AT_LEAST_SEEN and failed:
            own += _left_out(found, whole, point, condition, people, alpha, method)
        doubts[name] = tuple(own)
    return doubts, trends, tuple(dict.fromkeys(unknown))


def _of_order(found, point, condition, people, seen, order, alpha, method, unknown) -> list[Doubt]:
    made = []
    table = found.assessed[point.index.name].table
    control = found.control if found.control in table.conditions or table.index.over_control else None
    later = order.later(people, condition, control)
    doubt = period_doubt(seen, later, point.margin, alpha=alpha, method=method)
    if doubt is None:
        few = len(people) < 4
        unknown.append(
            f"With {len(people)} participants an effect of the period is not looked for."
            if few
            else f"{condition} came equally long after {found.control} for everybody: an effect of the period cannot "
            "be told from its own."
        )
    else:
        made.append(doubt)
    if found.control in table.conditions:
        rows = [table.participants.index(person) for person in people]
        values = np.log(table.values[rows]) if point.ratio else table.values[rows]
        periods = np.array([[order.by_condition[person, c] for c in table.conditions] for person in people])
        at = table.conditions.index
        lingers = carry_over_doubt(values, periods, at(found.control), at(condition), point.margin, alpha=alpha)
        if lingers is None:
            unknown.append(
                "Orders differ too little between people to tell what lingers of the condition before (carry-over)."
            )
        else:
            made.append(lingers)
    return made


def _learning(found, whole, point, condition, people, seen, order, alpha, method, trends, unknown) -> list[Doubt]:
    table = found.assessed[point.index.name].table
    base = found.control if found.control in table.conditions or table.index.over_control else None
    conditions = [condition] if base is None else [base, condition]
    own = movements_of(whole, point, conditions, people, order)
    if not own:
        return []
    parts = [thirds_of(own, c, people, order) for c in conditions]
    if None in parts:
        unknown.append(
            f"Whether movements were still changing is not looked for: somebody has fewer than {MIN_MOVEMENTS} of a "
            "condition, "
            "or several recordings of it whose order (period, repetition) is not stated."
        )
        return []
    signs = (1.0,) if base is None else (-1.0, 1.0)
    drift = np.sum([[s * each.drift for each in part] for s, part in zip(signs, parts, strict=True)], axis=0)
    late = np.sum([[s * each.last for each in part] for s, part in zip(signs, parts, strict=True)], axis=0)
    at_end = (1.0 + seen) * np.exp(late) - 1.0 if point.index.over_control else seen + late
    doubt = learning_doubt(drift, at_end, point.margin, alpha=alpha, method=method)
    trends[point.index.name] = float(np.median(drift)), doubt.p_value
    return [doubt]


def _left_out(found, whole, point, condition, people, alpha, method) -> list[Doubt]:
    """Return a doubt if failed movements, counted as longer than any other, change the verdict."""
    every = whole.lasted + whole.failed
    bounds = lasting_bounds(every, people, found.conditions, found.control, condition, point.differences)
    if bounds is None:
        return []
    low, high = bounds
    counted = equivalence(low, point.margin, upper=high, alpha=alpha, method=method)
    return [Doubt(LEFT_OUT_DOUBT, float("nan"), counted, always=True)]
