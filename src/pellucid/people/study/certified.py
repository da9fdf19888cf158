"""Certify the transparency of a condition: test all indices together against the margins of study.toml."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._errors import StudyError
from ...units import parse_quantity
from ..certificate import ESTIMAND_METHODS, certificate_from_tests, doubts_of_loss, doubts_of_lost_people
from ..equivalence import Equivalence, Margin, Method, equivalence
from ..equivalence_power import Active, find_equivalence_participants
from ..indices import CutOff, Index, PercentOf, Worse
from ..power import lasting_bounds
from .certificate_doubts import find_doubts, lost_movements, people_with_losses
from .certified_condition import Certified, EndPoint
from .measured_study import MeasuredStudy
from .movement_curves import Curves, compare_with_control
from .movement_model import model_of, of_model
from .pointing import SessionOrder

if TYPE_CHECKING:
    from .assessment_result import Assessed, AssessmentResult
    from .assessment_table import AssessmentTable

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
        {name: _of_people(found, whole, point, condition, people, seen[name], alpha, used)
         for name, point in wanted.items()}
        for used in (method, "signed_rank" if method == "skew_robust" else "skew_robust")
    )  # fmt: skip
    models = {name: model_of(whole, point, condition, _control(found, name), people, order)
              for name, point in wanted.items()}  # fmt: skip
    # An index without values of single movements has no mixed model, only participants' values.
    fitted = {name: of_model(models[name], point, alpha) for name, point in wanted.items()
              if models[name].movements}  # fmt: skip
    beside = {next(iter(other.values())).method: other, **({"mixed_model": fitted} if fitted else {})}
    doubts, trends, unknown = find_doubts(found, whole, wanted, condition, people, seen, order, alpha, method)
    shown = compare_with_control(curves, people, condition, found.control, spec.curves, found.along, alpha)
    with_margins = {f"{c.quantity} curve": c.comparison for c in shown if c.stated}
    pair = found.control, condition
    lost = lost_movements(whole, wanted, with_margins, pair, people)
    everybody = (*found.participants, *found.without)
    lost_people = tuple(person for person in everybody if person not in people)
    for name, doubt in (
        *doubts_of_loss({**tests, **with_margins}, lost, alpha, spec.max_left_out,
                        people_with_losses(whole, wanted, pair, people), method).items(),
        *doubts_of_lost_people({**tests, **with_margins}, len(lost_people), alpha, spec.max_left_out, method).items(),
    ):  # fmt: skip
        doubts[name] = (*doubts.get(name, ()), doubt)
    joint = certificate_from_tests(tests, alpha, doubts, with_margins, spec.people)
    active = Active(spec.estimand, spec.people, bool(order.period), bool(trends))
    return Certified(
        condition, joint, wanted, len(people), _needed(wanted, seen, alpha, active, executor), spec.estimand,
        tuple(people), models, beside, trends, unknown, _failed(whole, pair, people), shown, lost, spec.max_left_out,
        lost_people,
    )  # fmt: skip


def _control(found: AssessmentResult, name: str) -> str | None:
    """Return the control that an end point is compared with; None if it has none."""
    table = found.assessed[name].table
    return found.control if found.control in table.conditions or table.index.over_control else None


def _of_people(
    found: AssessmentResult, whole: MeasuredStudy, point: EndPoint, condition: str, people: list[str],
    seen: np.ndarray, alpha: float, method: Method,
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
    return equivalence(seen, point.margin, upper=upper, alpha=alpha, method=method)


def _needed(
    wanted: Mapping[str, EndPoint], seen: Mapping[str, np.ndarray], alpha: float, active: Active, executor: Any
) -> int | None:
    if len(next(iter(seen.values()))) < 3:
        return None
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
