"""Is a condition transparent? Indices against the margins that study.toml states, all of them together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._errors import PellucidError, StudyError
from ...assessment.certificate import FAIL, PASS, Certificate, certificate
from ...assessment.equivalence import BEYOND, Equivalence, Margin
from ...assessment.equivalence_power import equivalence_needed
from ...assessment.indices import Index
from ...fit.parameter import Verdict
from ...recordings.results import ResultRow
from ...units import parse_quantity
from ..result import FigureTable

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


def certified(found: AssessmentResult, spec: AssessmentTable, executor: Any = None) -> tuple[Certified, ...]:
    """Every condition but control against the margins; empty where none are stated. `spec` [assessment]."""
    wanted = end_points(spec, found.indices)
    if not wanted:
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
            made.append(_certified(found, spec, wanted, condition, executor))
    return tuple(made)


def _certified(
    found: AssessmentResult, spec: AssessmentTable, wanted: Mapping[str, EndPoint], condition: str, executor: Any
) -> Certified:
    people = [p for p in found.participants if all(p in found.assessed[n].table.participants for n in wanted)]
    seen = {name: _differences(found.assessed[name], point, condition, found.control, people)
            for name, point in wanted.items()}  # fmt: skip
    margins = {name: point.margin for name, point in wanted.items()}
    try:
        made = certificate(seen, margins, alpha=spec.false_transparent)
    except PellucidError as error:
        raise StudyError(f"[assessment.margins], {condition}: {error}") from None
    needed = None
    if len(people) > 2:
        covariance = np.atleast_2d(np.cov(np.array(list(seen.values()))))
        # What lies around its own margin by nature, such as a torque, is planned about its mean.
        change = [float(d.mean()) if point.margin.low == -inf else 0.0
                  for d, point in zip(seen.values(), wanted.values(), strict=True)]  # fmt: skip
        needed = equivalence_needed(
            covariance, list(margins.values()), power=PLANNED_POWER, change=change, alpha=spec.false_transparent,
            studies=STUDIES, executor=executor,
        )  # fmt: skip
    return Certified(condition, made, wanted, len(people), needed)


def _differences(each: Assessed, point: EndPoint, condition: str, control: str, people: list[str]) -> np.ndarray:
    rows = [each.table.participants.index(person) for person in people]
    own = each.table.column(condition)[rows]
    there = control in each.table.conditions and not each.table.index.over_control
    return point.differences(own, each.table.column(control)[rows] if there else None)


def certificate_table(found: AssessmentResult) -> FigureTable:
    """Every end point of every condition: its middle change, interval and margin, and what is said."""
    rows = []
    for each in found.certified:
        for name, point in each.end_points.items():
            own = each.certificate.end_points[name]
            rows.append(
                (each.condition, point.index.short, f"{_signed(point, own.estimate)} {point.unit}".strip(),
                 _interval(point, own), point.stated, _p(own.p_within), each.certificate.said_of(name))
            )  # fmt: skip
    share = 100.0 * (1.0 - 2.0 * found.certified[0].certificate.alpha)
    heads = ("Condition", "Index", "Change", f"{share:g} % interval", "Margin", "p within", "Said")
    return FigureTable("Certificate: changes against the margins stated", heads, tuple(rows))


def _signed(point: EndPoint, value: float) -> str:
    return f"{point.shown(value):+.3g}"


def _interval(point: EndPoint, own: Equivalence) -> str:
    low, high = own.interval
    if not np.isfinite(low):
        return "none: too few people"
    return f"{_signed(point, low)} to {_signed(point, high)}"


def _p(p: float) -> str:
    return "< 0.001" if p < 0.001 else f"{p:.2g}"


def certificate_sentences(found: AssessmentResult) -> tuple[str, ...]:
    """A sentence on each condition."""
    return tuple(_sentence(each) for each in found.certified)


def _sentence(each: Certified) -> str:
    said, names = each.certificate.verdict, list(each.end_points)
    level = f"{100.0 * each.certificate.alpha:g} %"
    if said == PASS:
        return (
            f"{each.condition}: transparent. All {len(names)} end points lie within their margins; were one of them "
            f"beyond, this would be said in at most {level} of studies."
        )
    by = {word: [each.end_points[n].index.short for n in names if each.certificate.said_of(n) == word]
          for word in ("within", "undecided", "beyond")}  # fmt: skip
    if said == FAIL:
        return f"{each.condition}: not transparent. Beyond the margin: {', '.join(by['beyond'])}." + (
            f" Within: {', '.join(by['within'])}." if by["within"] else ""
        )
    alone = [each.end_points[n].index.short for n in names if each.certificate.end_points[n].verdict == BEYOND]
    if alone:
        return (
            f"{each.condition}: cannot say. Each alone {', '.join(alone)} would be beyond its margin; that the largest "
            f"of {len(names)} is, {each.participants} people are too few to tell from chance."
        )
    more = (
        f"With about {each.needed} people in place of {each.participants} a study would say so in 9 of 10 cases, if "
        "nothing changes and people differ as these do."
        if each.needed is not None and each.needed > each.participants
        else "As people differ here, these many would mostly have shown it were there no change: there may be one."
        if each.needed is not None
        else "With people who differ as these do, no study of up to 128 would: measure more finely, or more movements."
    )
    return f"{each.condition}: cannot say. Undecided: {', '.join(by['undecided'])}. {more}"


def certificate_verdicts(found: AssessmentResult) -> tuple[Verdict, ...]:
    """The sentences as verdicts: what fails warns."""
    kinds = ("warning" if each.certificate.verdict == FAIL else "note" for each in found.certified)
    return tuple(Verdict(kind, said) for kind, said in zip(kinds, certificate_sentences(found), strict=True))


def certificate_rows(found: AssessmentResult, digest: str | None) -> tuple[ResultRow, ...]:
    """``<study>.certificate.<condition>.…``: 1 transparent, 0 not, 0.5 cannot say; then each end point."""
    rows = []
    for each in found.certified:
        head, own = f"{found.study}.certificate.{each.condition.lower()}", each.certificate

        def add(name: str, value: float | None, unit: str, note: str = "", head=head) -> None:
            rows.append(ResultRow(f"{head}.{name}", value, unit, "assess", "fitted", digest, note))

        add("transparent", {PASS: 1.0, FAIL: 0.0}.get(own.verdict, 0.5), "1", own.verdict)
        add("p", own.p_value, "1", "that all end points lie within, signed ranks counted")
        add("participants", each.participants, "1")
        add("needed", each.needed, "1", "for 90 %, if nothing changes; none: more than 128")
        for name, point in each.end_points.items():
            part = own.end_points[name]
            add(f"{name}.change", point.shown(part.estimate), point.unit, "middle of participants' changes")
            add(f"{name}.low", _finite(point.shown(part.interval[0])), point.unit, "90 % interval at the usual level")
            add(f"{name}.high", _finite(point.shown(part.interval[1])), point.unit)
            add(f"{name}.p_within", part.p_within, "1", f"margin {point.stated}")
            add(f"{name}.p_beyond", own.beyond[name], "1", "after Holm")
            add(f"{name}.bayes_factor", _finite(part.bayes_factor), "1", "of within against beyond")
    return tuple(rows)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
