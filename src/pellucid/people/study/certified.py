"""Certify the transparency of a condition: test all indices together against the margins of study.toml.

Beside the tests stand doubts on the change of an end point, of order, learning, lost and failed movements
(`find_doubts`), and a mixed model of all movements with covariates of each (`model_of`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..._errors import StudyError
from ...units import parse_quantity
from ..certificate import (
    ESTIMAND_METHODS,
    LEFT_OUT_DOUBT,
    Doubt,
    LostCounts,
    certificate_from_tests,
    doubts_of_loss,
    doubts_of_lost_people,
    learning_doubt,
    period_doubt,
)
from ..design_columns import DIRECTION_UP, MeasuredMovement
from ..equivalence import Equivalence, Margin, Method, equivalence
from ..indices import CutOff, Index, PercentOf, Worse
from ..mixed_model import MIN_MOVEMENTS, MixedModel, Thirds, failed_model, mixed_model, thirds
from ..power import Active, find_equivalence_participants, lasting_bounds
from ..session_periods import MIN_ORDERED_PEOPLE, adjustment
from .assessment_result import Certified, EndPoint
from .measured_study import MeasuredStudy
from .movement_curves import Curves, compare_with_control
from .pointing import SessionOrder

if TYPE_CHECKING:
    from .assessment_result import Assessed, AssessmentResult
    from .assessment_table import AssessmentTable

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
    seen: Mapping[str, np.ndarray], order: SessionOrder, tests: Mapping[str, Equivalence],
) -> tuple[dict[str, tuple[Doubt, ...]], dict[str, tuple[float, float]], tuple[str, ...]]:  # fmt: skip
    """Return the doubts and the trend of each end point, and sentences on what cannot be tested.

    A trend is the change from the first to the last third of a session, with its p value.
    """
    doubts, trends, unknown = {}, {}, []
    if not order.period:
        unknown.append(
            f"{order.unknown}: the effects of period and carry-over cannot be separated from those of conditions."
        )
    for name, point in wanted.items():
        test = tests[name]
        own = [period_doubt(seen[name], test)]
        if order.period and adjustment(len(people), test.sessions).is_plain:
            unknown.append(
                f"With {len(people)} participants the effect of the period is not estimated."
                if len(people) < MIN_ORDERED_PEOPLE
                else f"{condition} came equally long after {found.control} for everybody: the effect of the period "
                "cannot be separated from that of the condition."
            )
        own += _learning(found, whole, point, condition, people, seen[name], order, test, trends, unknown)
        failed = {each.condition for each in whole.failed if each.participant in people} & {found.control, condition}
        if point.index.cut_off is CutOff.AT_LEAST_SEEN and failed:
            own += _left_out(found, whole, point, condition, people, test)
        doubts[name] = tuple(each for each in own if each is not None)
    return doubts, trends, tuple(dict.fromkeys(unknown))


def _learning(found, whole, point, condition, people, seen, order, test, trends, unknown) -> list[Doubt]:
    base = _control(found, point.index.name)
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
    doubt = learning_doubt(drift, at_end, test)
    trends[point.index.name] = float(np.median(drift)), doubt.p_value
    return [doubt]


def _left_out(found, whole, point, condition, people, test) -> list[Doubt]:
    """Return a doubt if failed movements, counted as longer than any other, change the verdict."""
    every = whole.lasted + whole.failed
    bounds = lasting_bounds(every, people, found.conditions, found.control, condition, point.differences)
    if bounds is None:
        return []
    low, high = bounds
    counted = equivalence(
        low, point.margin, upper=high, alpha=test.alpha, method=cast("Method", test.method), sessions=test.sessions,
        largest_carry_over=test.largest_carry_over,
    )  # fmt: skip
    return [Doubt(LEFT_OUT_DOUBT, float("nan"), counted, always=True)]


PLANNED_POWER = 0.9
"""Power for which the number of participants is planned."""

SIMULATED_STUDY_COUNT = 1000
"""Number of simulated studies behind the planned number of participants."""


def end_points(spec: AssessmentTable, indices: Mapping[str, Index]) -> dict[str, EndPoint]:
    """Return the end points with stated margins; refuse an unknown name or unit."""
    made = {}
    for name, stated in spec.index_margins.items():
        where = f"[assessment.margins] {name}"
        if name not in indices:
            raise StudyError(f"{where}: found no index of this name, expected one of {', '.join(indices)}")
        index = indices[name]
        share = stated.strip().endswith("%")
        size = parse_quantity(stated, "1" if share else index.unit, where)
        if not size > 0.0:
            raise StudyError(f'{where}: found "{stated}", expected a size above 0')
        if share and index.percent_of is PercentOf.NOTHING_AT_ALL:
            raise StudyError(f'{where}: found "{stated}", expected {index.unit}: {index.words} has no zero to share')
        ratio = share and index.scaled
        if share and index.needs_robot:
            raise StudyError(f'{where}: found "{stated}", expected {index.unit}: without the robot there is none')
        margin = Margin.of_ratio(size) if ratio else Margin.either_way(size)
        margin = Margin(-inf, margin.high) if index.worse is Worse.IF_MORE else margin
        made[name] = EndPoint(name, index.along, stated, margin, ratio)
    return made


def certify_conditions(
    found: AssessmentResult,
    spec: AssessmentTable,
    whole: MeasuredStudy,
    order: SessionOrder,
    curves: Curves,
    executor: Any = None,
) -> tuple[Certified, ...]:
    """Certify every condition but control. `spec` is [assessment].

    Nothing is returned if no margins are stated, or if one participant alone can be compared.
    """
    wanted = end_points(spec, found.indices)
    if not wanted:
        if spec.curves:
            raise StudyError("[assessment.curves]: found margins of curves alone, expected [assessment.margins] too")
        return ()
    if len(found.participants) < 2:
        # A session is assessed after its first participant: indices are then told, and nothing is tested.
        return ()
    made = []
    for condition in found.conditions:
        if condition != found.control:
            lacking = [
                n for n in wanted if n not in found.assessed or condition not in found.assessed[n].table.conditions
            ]
            if lacking:
                raise StudyError(
                    f"[assessment.margins]: found no {', '.join(lacking)} in {condition}, expected every index with a "
                    "margin: a claim about what was not recorded cannot be tested; record it or take the margin out "
                    "before the data are seen"
                )
            made.append(_certify(found, spec, wanted, condition, whole, order, curves, executor))
    return tuple(made)


def _certify(
    found: AssessmentResult,
    spec: AssessmentTable,
    wanted: Mapping[str, EndPoint],
    condition: str,
    whole: MeasuredStudy,
    order: SessionOrder,
    curves: Curves,
    executor: Any,
) -> Certified:
    alpha, method = spec.alpha, ESTIMAND_METHODS[spec.estimand]
    people = [p for p in found.participants if all(p in found.assessed[n].table.participants for n in wanted)]
    if len(people) < 2:
        raise StudyError(
            f"[assessment.margins], {condition}: found {len(people)} participants with all of {', '.join(wanted)}, "
            "expected two or more"
        )
    seen = {name: _differences(found.assessed[name], point, condition, found.control, people)
            for name, point in wanted.items()}  # fmt: skip
    tests, other = (
        {name: _of_people(found, whole, point, condition, people, seen[name], alpha, used, order,
                          spec.largest_carry_over)
         for name, point in wanted.items()}
        for used in (method, "signed_rank" if method == "skew_robust" else "skew_robust")
    )  # fmt: skip
    models = {name: model_of(whole, point, condition, _control(found, name), people, order)
              for name, point in wanted.items()}  # fmt: skip
    # An index without values of single movements has no mixed model, only participants' values.
    fitted = {name: of_model(models[name], point, alpha) for name, point in wanted.items()
              if models[name].movements}  # fmt: skip
    beside = {next(iter(other.values())).method: other, **({"mixed_model": fitted} if fitted else {})}
    doubts, trends, unknown = find_doubts(found, whole, wanted, condition, people, seen, order, tests)
    shown = compare_with_control(curves, people, condition, found.control, spec.curves, found.along, alpha)
    with_margins = {f"{c.quantity} curve": c.comparison for c in shown if c.stated}
    pair = found.control, condition
    lost = lost_movements(whole, wanted, with_margins, pair, people)
    everybody = (*found.participants, *found.without)
    lost_people = tuple(person for person in everybody if person not in people)
    for name, doubt in (
        *doubts_of_loss({**tests, **with_margins}, lost, alpha, spec.max_left_out,
                        people_with_losses(whole, wanted, pair, people)).items(),
        *doubts_of_lost_people({**tests, **with_margins}, len(lost_people), alpha, spec.max_left_out).items(),
    ):  # fmt: skip
        doubts[name] = (*doubts.get(name, ()), doubt)
    joint = certificate_from_tests(tests, alpha, doubts, with_margins, spec.share_rule)
    active = Active(spec.estimand, spec.people, spec.share_rule.alpha, bool(order.period), spec.largest_carry_over,
                    bool(trends))  # fmt: skip
    return Certified(
        condition, joint, wanted, len(people), _needed(wanted, tests, seen, alpha, active, executor), spec.estimand,
        tuple(people), models, beside, trends, unknown, _failed(whole, pair, people), shown, lost, spec.max_left_out,
        lost_people,
    )  # fmt: skip


def _control(found: AssessmentResult, name: str) -> str | None:
    """Return the control that an end point is compared with; None if it has none."""
    table = found.assessed[name].table
    return found.control if found.control in table.conditions or table.index.over_control else None


def _of_people(
    found: AssessmentResult, whole: MeasuredStudy, point: EndPoint, condition: str, people: list[str],
    seen: np.ndarray, alpha: float, method: Method, order: SessionOrder, largest_carry_over: float,
) -> Equivalence:  # fmt: skip
    pair, upper = (found.control, condition), None
    if point.index.cut_off is CutOff.AT_LEAST_SEEN:
        bounds = lasting_bounds(whole.lasted, people, found.conditions, *pair, point.differences)
        if bounds is not None:
            seen, upper = bounds
    elif point.index.cut_off is CutOff.SEEN_DURATION:
        # A mean that includes a movement without a seen end has no upper bound.
        cut = {(each.participant, each.condition) for each in whole.lasted if not each.settled}
        base, own = (np.array([(person, c) in cut for person in people]) for c in pair)
        seen, upper = np.where(base, -inf, seen), np.where(own, inf, seen)
    control = _control(found, point.index.name)
    sessions = order.sessions(people, found.conditions, control, condition)
    return equivalence(
        seen, point.margin, upper=upper, alpha=alpha, method=method, sessions=sessions,
        largest_carry_over=largest_carry_over,
    )  # fmt: skip


def _needed(
    wanted: Mapping[str, EndPoint], tests: Mapping[str, Equivalence], seen: Mapping[str, np.ndarray], alpha: float,
    active: Active, executor: Any,
) -> int | None:  # fmt: skip
    if len(next(iter(seen.values()))) < 3:
        return None
    # The effects of periods are none of how much people differ.
    seen = {name: seen[name] if tests[name].bounded else tests[name].differences for name in wanted}
    covariance = np.atleast_2d(np.cov(np.array(list(seen.values()))))
    # An index without control, such as a torque, is planned about its own mean.
    change = [float(d.mean()) if point.margin.low == -inf else 0.0
              for d, point in zip(seen.values(), wanted.values(), strict=True)]  # fmt: skip
    return find_equivalence_participants(
        covariance, [point.margin for point in wanted.values()], power=PLANNED_POWER, change=change, alpha=alpha,
        active=active, studies=SIMULATED_STUDY_COUNT, executor=executor,
    )  # fmt: skip


def _failed(whole: MeasuredStudy, pair: tuple[str, str], people: list[str]) -> dict[str, tuple[int, int]]:
    def count(each: tuple, condition: str) -> int:
        return sum(x.condition == condition and x.participant in people for x in each)

    return {c: (count(whole.failed, c), count(whole.failed, c) + count(whole.lasted, c)) for c in pair}


def _differences(each: Assessed, point: EndPoint, condition: str, control: str, people: list[str]) -> np.ndarray:
    rows = [each.table.participants.index(person) for person in people]
    own = each.table.column(condition)[rows]
    there = control in each.table.conditions and not each.table.index.over_control
    return point.differences(own, each.table.column(control)[rows] if there else None)
