"""Plan the number of participants for a certificate of transparency, from margins and expected spreads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._errors import StudyError
from ...assessment.equivalence_power import CANDIDATE_SIZES, participants_for_changes
from ...assessment.indices import indices_along
from ...studies.study import Study
from ...units import COORDINATES_BY_UNIT, parse_quantity
from .assessment_table import AssessmentTable
from .certified import end_points
from .certified_condition import EndPoint

TRUE_CHANGE_SHARES = {0.0: "none", 0.25: "a quarter", 1.0 / 3.0: "a third", 0.5: "a half"}
"""True changes for which the number is planned, as shares of the margin, with their names."""

END_POINT_CORRELATIONS = (0.0, 0.5)
"""Correlations of people's changes between end points. Correlated end points pass together more often."""


@dataclass(frozen=True)
class Plan:
    """Table of the number of participants by true change."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str | int, ...], ...]
    note: str


def plan(study: Study, *, power: float = 0.9, studies: int = 2000, executor: Any = None) -> Plan:
    """Plan the participants needed for the margins and spreads of a study with [assessment]."""
    spec = study.find_table(AssessmentTable)
    where = f"{study.folder}, study.toml"
    if spec is None or not spec.margins:
        raise StudyError(f"{where}: found no [assessment.margins], expected how far a robot may change each index")
    joints = study.config.rig.joints
    along = COORDINATES_BY_UNIT["m" if len(joints) == 1 and joints[0].motion == "prismatic" else "rad"]
    points = end_points(spec, indices_along(along))
    if set(spec.spreads) != set(points):
        raise StudyError(
            f"{where}: found [assessment.spreads] of {', '.join(spec.spreads) or 'nothing'}, expected those of "
            f"{', '.join(points)}: how much people's changes differ, as a pilot's certificate or another study tells it"
        )
    spreads = [_spread(point, spec.spreads[name]) for name, point in points.items()]
    joint, alone = participants_for_changes(
        spreads,
        [point.margin for point in points.values()],
        tuple(TRUE_CHANGE_SHARES),
        END_POINT_CORRELATIONS,
        power=power,
        alpha=spec.false_transparent,
        studies=studies,
        executor=executor,
    )
    heads = ("True change", "All together", "Going together", *(p.index.short for p in points.values()))
    rows = tuple(
        (words, *(_people(n) for n in (*together, *each)))
        for words, together, each in zip(TRUE_CHANGE_SHARES.values(), joint, alone, strict=True)
    )
    return Plan(
        f"People for a certificate in {100.0 * power:g} % of studies, by true change over margin",
        heads,
        rows,
        f"Signed ranks at {100.0 * spec.false_transparent:g} %, people's changes normal; going together: correlated by "
        f"{END_POINT_CORRELATIONS[1]:g} over end points. {studies} studies simulated for each number of people.",
    )


def _people(needed: int | None) -> str | int:
    return f">{CANDIDATE_SIZES[-1]}" if needed is None else needed


def _spread(point: EndPoint, stated: str) -> float:
    """Return a stated spread in the unit of people's changes; logarithms for ratios."""
    where = f"[assessment.spreads] {point.index.name}"
    share = stated.strip().endswith("%")
    size = parse_quantity(stated, "1" if share else point.index.unit, where)
    if not size > 0.0 or share != point.stated.strip().endswith("%"):
        raise StudyError(
            f'{where}: found "{stated}", expected a size above 0 of the kind of its margin, {point.stated}'
        )
    return float(np.log1p(size)) if point.ratio else size
