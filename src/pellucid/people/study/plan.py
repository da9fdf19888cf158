"""Plan the number of participants for a certificate of transparency, from margins and expected spreads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._errors import PellucidError, StudyError
from ...study.answer import Answer, AnswerNumber, AnswerVerdict, Assumption, Basis, Step
from ...study.procedures.procedure import Progress, quiet
from ...study.study import Study
from ...units import COORDINATES_BY_UNIT
from ..analysis import EndPoint, Estimand
from ..equivalence import Margin
from ..indices import indices_along
from ..power import (
    CERTIFICATE_SIZES,
    Active,
    equivalence_power,
    expected_size,
    find_equivalence_participants,
    participants_for_changes,
    planned_power,
)
from ..share_of_people import MIN_PEOPLE
from .assessment_result import kept_certificates
from .assessment_table import AssessmentTable

TRUE_CHANGE_SHARES = {0.0: "none", 0.25: "a quarter", 1.0 / 3.0: "a third", 0.5: "a half"}
"""True changes for which the number is planned, as shares of the margin, with their names."""

END_POINT_CORRELATIONS = (0.0, 0.5)
"""Correlations of people's changes between end points. Correlated end points pass together more often."""

SIMULATING = "simulating experiments"
"""What a plan does, as its progress names it."""

SEARCH_SHARE = 0.9
"""Share of the search for numbers of people in the time of a plan with a number that was decided on."""


@dataclass(frozen=True)
class Plan:
    """Table of the number of participants by true change."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str | int, ...], ...]
    note: str
    answer: Answer


def plan(
    study: Study,
    *,
    power: float = 0.9,
    participants: int | None = None,
    pilot: Mapping[str, np.ndarray] | None = None,
    noise_shares: Mapping[str, float] | None = None,
    studies: int = 2000,
    executor: Any = None,
    on_progress: Progress = quiet,
) -> Plan:
    """Plan the participants needed for the margins and spreads of a study with [assessment].

    `participants` is a number that has been decided on: it is refused if no data of so many could certify. `pilot`
    holds people's changes by end point, (n,), as a pilot study's certificate has them: people are then drawn from it.
    `noise_shares` are the shares of the variance of these changes that are noise of single movements.
    """
    on_progress(SIMULATING, 0.0)
    spec = study.find_table(AssessmentTable)
    where = f"{study.folder}, study.toml"
    if spec is None or not spec.analysis.margins:
        raise StudyError(f"{where}: found no [assessment.margins], expected the allowed change of each index")
    joints = study.config.rig.joints
    along = COORDINATES_BY_UNIT["m" if len(joints) == 1 and joints[0].motion == "prismatic" else "rad"]
    points = spec.analysis.end_points(indices_along(along))
    margins = [point.margin for point in points.values()]
    if participants is not None and participants < MIN_PEOPLE:
        raise StudyError(
            f"{where}: found {participants} participants, expected at least {MIN_PEOPLE}, which a claim of "
            "transparency requires"
        )
    analysis = spec.analysis
    ordered = analysis.design != "parallel sessions"
    noise = () if noise_shares is None else tuple(noise_shares.get(name, 0.0) for name in points)
    active = Active.of(analysis, order=ordered, learning=True, noise=noise)
    options = {"alpha": spec.false_transparent, "active": active, "studies": studies, "executor": executor}
    if pilot is not None:
        return _of_pilot(points, pilot, margins, power, participants, options, on_progress)
    if set(spec.spreads) != set(points):
        raise StudyError(
            f"{where}: found [assessment.spreads] of {', '.join(spec.spreads) or 'nothing'}, expected those of "
            f"{', '.join(points)}: the standard deviations of people's changes, from a pilot study or the literature"
        )
    try:
        spreads = [
            expected_size(point, "sd", spec.spreads[name], f"{where}, [assessment.spreads] {name}")
            for name, point in points.items()
        ]
    except PellucidError as error:
        raise StudyError(str(error)) from None
    joint, alone = participants_for_changes(
        spreads, margins, tuple(TRUE_CHANGE_SHARES), END_POINT_CORRELATIONS, power=power, **options,
        on_done=lambda share: on_progress(SIMULATING, SEARCH_SHARE * share),
    )
    heads = ["True change", "All together", "Going together", *(p.index.short for p in points.values())]
    rows = [
        [words, *(_people(n) for n in (*together, *each))]
        for words, together, each in zip(TRUE_CHANGE_SHARES.values(), joint, alone, strict=True)
    ]
    if participants is not None:
        heads.append(f"Power with {participants} people (%)")
        ends = np.array([margin.high for margin in margins])
        for i, (row, share) in enumerate(zip(rows, TRUE_CHANGE_SHARES, strict=True)):
            on_progress(SIMULATING, SEARCH_SHARE + (1.0 - SEARCH_SHARE) * i / len(rows))
            found = planned_power(points, np.array(spreads), share * ends, (participants,), **options)
            row.append(round(100.0 * found.power[0]))
    return Plan(
        _title(power),
        tuple(heads),
        tuple(map(tuple, rows)),
        f"{_tested(analysis.estimand, analysis.people, spec.false_transparent)}, people's changes normal; "
        f"correlation between end points: {END_POINT_CORRELATIONS[1]:g}. {_active_words(ordered)} {studies} "
        "studies simulated for each number of people.",
        _plan_answer(
            rows, power, participants, _basis(studies, "people sampled from the spreads that study.toml states"),
            Assumption("people's changes", "normal", is_question=False),
        ),
    )


def _basis(studies: int, people: str) -> Basis:
    """Return the basis of a plan: experiments that were simulated for each number of people."""
    return Basis(studies, studies, "experiment", people, is_simulated=True)


def _plan_answer(
    rows: Sequence[Sequence[str | int]], power: float, participants: int | None, basis: Basis, *assumed: Assumption
) -> Answer:
    """Return whether the number of people that was decided on, or any that was tried, certifies in enough studies.

    The first row is of a robot that changes nothing, the last of the largest true change that is planned for.
    """
    first, last = rows[0], rows[-1]
    share = f"{100.0 * power:g} % of studies"
    needed = first[1]
    at_most = f"a change of {last[0]} of the margin needs {last[1]}"
    if participants is None:
        verdict: AnswerVerdict = "yes" if isinstance(needed, int) else "no"
        said = f"For a robot that changes nothing, {needed} people are needed; {at_most}"
        reason = "" if verdict == "yes" else f"even for a robot that changes nothing, {needed} people are needed"
        question = f"Can at most {CERTIFICATE_SIZES[-1]} people show transparency in {share}?"
    else:
        reached = int(first[-1])
        verdict = "yes" if reached >= 100.0 * power else "no"
        said = (
            f"With {participants} people {reached} % of studies show that a robot changes nothing; for {share} "
            f"{needed} people are needed, and {at_most}"
        )
        reason = "" if verdict == "yes" else f"{participants} people show it in {reached} % of studies"
        question = f"Are {participants} people enough to show transparency in {share}?"
    numbers = [
        AnswerNumber(f"people needed, true change {words}", count, "1")
        for words, count, *_ in rows
        if isinstance(count, int)
    ]
    if verdict == "yes":
        step = Step("Record these people and add their recordings to study.toml; then check them", "check")
    elif isinstance(needed, int):
        step = Step("Plan as many people as are needed", "plan", ("--participants", str(needed)))
    else:
        step = Step("Measure more finely, or state wider margins in study.toml; then plan again")
    return Answer(question, verdict, said, reason, numbers=tuple(numbers), basis=basis, assumed=assumed, next=(step,))


def pilot_changes(pilot: Study) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Return people's changes of an assessed pilot by end point, (n,), and the shares of noise in their variances.

    They are those of the condition in which people differ most.
    """
    found = kept_certificates(pilot, "those of the plan")
    widest = max(found.certified, key=lambda each: sum(
        float(np.var(test.differences)) / test.margin.high**2 for test in each.certificate.end_points.values()
    ))  # fmt: skip
    tests = widest.certificate.end_points
    shares = {name: test.share_test().noise_share for name, test in tests.items()}
    return {name: test.differences for name, test in tests.items()}, shares


def _active_words(ordered: bool) -> str:
    orders = "in balanced orders, with the largest declared carry-over" if ordered else "without an order"
    return (
        f"Each simulated study has two conditions {orders}, a test for learning, and the tests of the shares of people "
        "within the margin and far beyond it."
    )


def _noise_words(active: Active) -> str:
    if not any(active.noise):
        return ""
    return (
        f"Up to {100.0 * max(active.noise):.0f} % of the variance of its changes comes from single movements, not from "
        "differences between people. "
    )


def _title(power: float) -> str:
    return f"People for a certificate in {100.0 * power:g} % of studies, by true change over margin"


def _tested(estimand: Estimand, people: float | None, alpha: float) -> str:
    share = f" ({100.0 * people:g} %)" if people is not None else ""
    return f"{estimand.capitalize()}{share} at {100.0 * alpha:g} %"


def _of_pilot(
    points: Mapping[str, EndPoint], pilot: Mapping[str, np.ndarray], margins: list[Margin], power: float,
    participants: int | None, options: dict[str, Any], on_progress: Progress,
) -> Plan:  # fmt: skip
    """Plan with people drawn from a pilot's own, all end points of a person together."""
    lacking = [name for name in points if name not in pilot]
    if lacking:
        raise StudyError(
            f"plan: found a pilot with {', '.join(pilot) or 'no end point'}, expected {', '.join(lacking)} too"
        )
    people = np.column_stack([pilot[name] for name in points])
    if len(people) < 3 or not np.isfinite(people).all():
        raise StudyError(f"plan: found {len(people)} people in the pilot, expected at least 3 with finite changes")
    covariance, ends = np.atleast_2d(np.cov(people, rowvar=False)), np.array([margin.high for margin in margins])
    heads = ["True change", "All together"]
    if participants is not None:
        heads.append(f"Power with {participants} people (%)")
    rows = []
    for i, (share, words) in enumerate(TRUE_CHANGE_SHARES.items()):
        on_progress(SIMULATING, i / len(TRUE_CHANGE_SHARES))
        own = {**options, "pilot": people, "change": share * ends}
        row: list[str | int] = [words, _people(find_equivalence_participants(covariance, margins, power=power, **own))]
        if participants is not None:
            row.append(round(100.0 * equivalence_power(covariance, margins, (participants,), **own).power[0]))
        rows.append(tuple(row))
    active = options["active"]
    return Plan(
        _title(power),
        tuple(heads),
        tuple(rows),
        f"{_tested(active.estimand, active.people, options['alpha'])}, people resampled from the pilot's "
        f"{len(people)}, shifted to the true change. {_active_words(active.order)} {options['studies']} studies "
        "simulated for each number of people. "
        f"{_noise_words(active)}With so few people, the distribution itself is uncertain.",
        _plan_answer(
            rows, power, participants, _basis(options["studies"], f"people sampled from the pilot's {len(people)}")
        ),
    )


def _people(needed: int | None) -> str | int:
    return f">{CERTIFICATE_SIZES[-1]}" if needed is None else needed
