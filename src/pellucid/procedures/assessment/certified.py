"""Is a condition transparent? Indices against the margins that study.toml states, all of them together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._errors import StudyError
from ...assessment.certificate import Certificate, certificate_from_tests
from ...assessment.equivalence import Equivalence, Margin, equivalence
from ...assessment.equivalence_power import find_equivalence_participants
from ...assessment.indices import Index
from ...assessment.lasting_bounds import lasting_bounds
from ...assessment.mixed_model import MixedModel
from ...units import parse_quantity
from .certificate_doubts import doubts_of, doubts_of_loss, lost_movements
from .measured_study import MeasuredStudy
from .movement_curves import CurveEndPoint, Curves, compared_curves
from .movement_model import model_of, of_model
from .session_order import SessionOrder

if TYPE_CHECKING:
    from .assessment_result import Assessed, AssessmentResult
    from .procedure import AssessmentTable

UPWARDS = ("unsettled", "end_absolute", "end_spread", "torque_rms", "torque_peak", "work")
"""Indices of which less is never worse: their margin has an upper end alone."""

PLANNED_POWER, STUDIES = 0.9, 1000
"""Of a study whose size is told, and simulated studies behind that."""


@dataclass(frozen=True)
class EndPoint:
    """One index with its margin, as the study states it."""

    index: Index
    stated: str
    margin: Margin  # Of logarithms of ratios where `ratio`, else in the index's unit
    ratio: bool

    def differences(self, own: np.ndarray, control: np.ndarray | None) -> np.ndarray:
        """By participant, what is held against the margin; (n,) each."""
        if control is None:
            return own
        return np.log(own / control) if self.ratio else own - control

    def shown(self, value: float) -> float:
        """A difference as people read it: in %, or in the unit that tables show."""
        if self.ratio:
            return 100.0 * float(np.expm1(value))
        return (100.0 if self.index.over_control else self.index.shown[0]) * value

    @property
    def logs(self) -> bool:
        """Whether movements are compared by logarithms: where people are by ratios."""
        return self.ratio or self.index.over_control

    @property
    def unit(self) -> str:
        """Of `shown`."""
        if self.ratio or self.index.over_control:
            return "%"
        return self.index.shown[1]


@dataclass(frozen=True)
class Certified:
    """What a study says of one condition's transparency."""

    condition: str
    certificate: Certificate
    end_points: Mapping[str, EndPoint]
    participants: int  # With all end points
    needed: int | None  # Who would show it with a chance of 90 %, were there no change at all; None: more than tried
    rests_on: str = "signed_rank"  # The test that the study states
    models: Mapping[str, MixedModel] = field(default_factory=dict)  # By end point, of every movement
    # By end point, the test that the verdict does not rest on: signed ranks, or the model
    beside: Mapping[str, Equivalence] = field(default_factory=dict)
    trends: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # From first to last third; and its p
    unknown: tuple[str, ...] = ()  # What could not be told, in sentences
    failed: Mapping[str, tuple[int, int]] = field(default_factory=dict)  # By condition, targets without a movement, of
    curves: tuple[CurveEndPoint, ...] = ()
    # By end point and by condition, movements of which it knows nothing, of
    lost: Mapping[str, Mapping[str, tuple[int, int]]] = field(default_factory=dict)
    max_left_out: float = 0.0  # The share of movements that the study allows to be lost


def end_points(spec: AssessmentTable, indices: Mapping[str, Index]) -> dict[str, EndPoint]:
    """The stated margins; a name or a unit that does not fit is told."""
    made = {}
    for name, stated in spec.margins.items():
        where = f"[assessment.margins] {name}"
        if name not in indices:
            raise StudyError(f"{where}: found no index of this name, expected one of {', '.join(indices)}")
        index = indices[name]
        share = stated.strip().endswith("%")
        size = parse_quantity(stated, "1" if share else index.unit, where)
        if not size > 0.0:
            raise StudyError(f'{where}: found "{stated}", expected a size above 0')
        if share and not (index.scaled or index.over_control or index.name == "unsettled"):
            raise StudyError(f'{where}: found "{stated}", expected {index.unit}: {index.words} has no zero to share')
        ratio = share and index.scaled
        if ratio and name.startswith(("torque", "work")):
            raise StudyError(f'{where}: found "{stated}", expected {index.unit}: without the robot there is none')
        margin = Margin.of_ratio(size) if ratio else Margin.either_way(size)
        made[name] = EndPoint(index, stated, Margin(-inf, margin.high) if name in UPWARDS else margin, ratio)
    return made


def certified(
    found: AssessmentResult,
    spec: AssessmentTable,
    whole: MeasuredStudy,
    order: SessionOrder,
    curves: Curves,
    executor: Any = None,
) -> tuple[Certified, ...]:
    """Every condition but control against the margins; empty where none are stated. `spec` [assessment]."""
    wanted = end_points(spec, found.indices)
    if not wanted:
        if spec.curves:
            raise StudyError("[assessment.curves]: found margins of curves alone, expected [assessment.margins] too")
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
            made.append(_certified(found, spec, wanted, condition, whole, order, curves, executor))
    return tuple(made)


def _certified(
    found: AssessmentResult,
    spec: AssessmentTable,
    wanted: Mapping[str, EndPoint],
    condition: str,
    whole: MeasuredStudy,
    order: SessionOrder,
    curves: Curves,
    executor: Any,
) -> Certified:
    alpha, stated = spec.false_transparent, spec.equivalence
    people = [p for p in found.participants if all(p in found.assessed[n].table.participants for n in wanted)]
    if len(people) < 2:
        raise StudyError(
            f"[assessment.margins], {condition}: found {len(people)} participants with all of {', '.join(wanted)}, "
            "expected two or more"
        )
    seen = {name: _differences(found.assessed[name], point, condition, found.control, people)
            for name, point in wanted.items()}  # fmt: skip
    ranks = {name: _by_ranks(found, whole, point, condition, people, seen[name], alpha)
             for name, point in wanted.items()}  # fmt: skip
    models = {name: model_of(whole, point, condition, _control(found, name), people, order)
              for name, point in wanted.items()}  # fmt: skip
    fitted = {name: of_model(models[name], point, alpha) for name, point in wanted.items()
              if models[name].movements}  # fmt: skip
    # What is of no single movements has no model; participants' values are all there is.
    tests, beside = (ranks, fitted) if stated == "signed_rank" else ({**ranks, **fitted}, {n: ranks[n] for n in fitted})
    doubts, trends, unknown = doubts_of(found, whole, wanted, condition, people, seen, order, alpha)
    shown = compared_curves(curves, people, condition, found.control, spec.curves, found.along, alpha)
    with_margins = {f"{c.quantity} curve": c.comparison for c in shown if c.stated}
    lost = lost_movements(whole, wanted, with_margins, (found.control, condition), people)
    for name, doubt in doubts_of_loss({**tests, **with_margins}, lost, alpha, spec.max_left_out).items():
        doubts[name] = (*doubts.get(name, ()), doubt)
    joint = certificate_from_tests(tests, alpha, doubts, with_margins)
    return Certified(
        condition, joint, wanted, len(people), _needed(wanted, seen, alpha, len(people), executor), stated, models,
        beside, trends, unknown, _failed(whole, (found.control, condition), people), shown, lost, spec.max_left_out,
    )  # fmt: skip


def _control(found: AssessmentResult, name: str) -> str | None:
    """Whether an end point has a control to be compared with; of what is over control movements have."""
    table = found.assessed[name].table
    return found.control if found.control in table.conditions or table.index.over_control else None


def _by_ranks(
    found: AssessmentResult, whole: MeasuredStudy, point: EndPoint, condition: str, people: list[str],
    seen: np.ndarray, alpha: float,
) -> Equivalence:  # fmt: skip
    name, pair = point.index.name, (found.control, condition)
    upper = None
    if name == "duration_median":
        bounds = lasting_bounds(whole.lasted, people, found.conditions, *pair, point.differences)
        if bounds is not None:
            seen, upper = bounds
    elif name == "duration":
        # A mean that one movement's unseen end belongs to is not known from above.
        cut = {(each.participant, each.condition) for each in whole.lasted if not each.settled}
        base, own = (np.array([(person, c) in cut for person in people]) for c in pair)
        seen, upper = np.where(base, -inf, seen), np.where(own, inf, seen)
    return equivalence(seen, point.margin, upper=upper, alpha=alpha)


def _needed(
    wanted: Mapping[str, EndPoint], seen: Mapping[str, np.ndarray], alpha: float, people: int, executor: Any
) -> int | None:
    if people < 3:
        return None
    covariance = np.atleast_2d(np.cov(np.array(list(seen.values()))))
    # What lies around its own margin by nature, such as a torque, is planned about its mean.
    change = [float(d.mean()) if point.margin.low == -inf else 0.0
              for d, point in zip(seen.values(), wanted.values(), strict=True)]  # fmt: skip
    return find_equivalence_participants(
        covariance, [point.margin for point in wanted.values()], power=PLANNED_POWER, change=change, alpha=alpha,
        studies=STUDIES, executor=executor,
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
