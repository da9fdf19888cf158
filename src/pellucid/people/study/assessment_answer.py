"""The answer of an assessment: is a condition transparent, or without margins, do conditions change movement?"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...study.answer import PAPER_STEP, Answer, AnswerNumber, AnswerPart, AnswerVerdict, Basis, Step
from ...study.pages.quantities import MINUS_SIGN
from ...study.pages.values import Value
from ..certificate import FAIL, PASS
from ..equivalence import BEYOND_MARGIN
from ..indices import leading_index
from ..power import CERTIFICATE_SIZES, MIN_FORECAST_PEOPLE
from ..share_of_people import MIN_PEOPLE
from .certified_rows import certificate_reasons, loss_remedy
from .primary_change import PrimaryChange, primary_change
from .statements import headline, lowered

if TYPE_CHECKING:
    from .assessment_result import Assessed, AssessmentResult, Certified

CERTIFICATE_VERDICTS: dict[str, AnswerVerdict] = {PASS: "yes", FAIL: "no"}
"""Verdict of each certificate; any other is "cannot say"."""


def assessment_answer(found: AssessmentResult) -> Answer:
    """Return whether a condition is transparent, or without a certificate whether conditions change movement."""
    return certificate_answer(found) if found.certified else _change_answer(found)


CERTIFICATE_STEP = Step("Write the certificate's page for a reviewer", "certificate")
"""What to do next with a certificate that says yes or no."""


def certificate_answer(found: AssessmentResult) -> Answer:
    """Return whether a condition is shown to be transparent, with what to record where nobody can say."""
    parts = [
        AnswerPart(each.condition, CERTIFICATE_VERDICTS.get(each.certificate.verdict, "cannot say"), reason)
        for each, reason in zip(found.certified, certificate_reasons(found), strict=True)
    ]
    said = {part.verdict for part in parts}
    # One transparent condition is enough; all must be shown to be none for "no".
    verdict: AnswerVerdict = "yes" if "yes" in said else "no" if said == {"no"} else "cannot say"
    question = "Is any condition shown to be transparent?" if len(parts) > 1 else "Is it transparent?"
    is_post_hoc = any(each.certificate.post_hoc for each in found.certified)
    if is_post_hoc:
        question += " Post hoc: this is not the registered analysis."
    against = [part for part in parts if part.verdict == verdict != "yes"]
    reason = "; ".join(f"{part.name}: {part.reason}" for part in against)
    steps = [_recording_step(each) for each in found.certified if each.certificate.verdict not in (PASS, FAIL)]
    stated = "; ".join(f"{one.condition.replace('_', ' ')}: {one.certificate.statement}" for one in found.certified)
    beyond = "".join(f"{_beyond_text(each)} " for each in found.certified if each.certificate.verdict == FAIL)
    following = steps if verdict == "cannot say" else [CERTIFICATE_STEP]
    return Answer(
        question, verdict, f"{stated}. {beyond}{_changes_text(found)}", reason, tuple(parts),
        tuple(_numbers(found)), _basis(found), next=tuple(dict.fromkeys(following)),
        qualifier="post hoc" if is_post_hoc else "",
    )  # fmt: skip


def reviewed_answer(found: AssessmentResult) -> Answer:
    """Return the answer on the page for a reviewer, which is written already: a paper follows it."""
    following = (
        replace(PAPER_STEP, folder=step.folder) if step.name == CERTIFICATE_STEP.name else step
        for step in found.answer.next
    )
    return replace(found.answer, next=tuple(following))


def _beyond_text(each: Certified) -> str:
    """Name the end points of a condition that lie beyond their margins."""
    own = each.certificate
    words = [f"{point.index.words.lower()}{own.far_note(name)}" for name, point in each.end_points.items()
             if own.said_of(name) == BEYOND_MARGIN]  # fmt: skip
    return f"Beyond the margin in {each.condition.replace('_', ' ')}: {', '.join(words)}." if words else ""


def _recording_step(each: Certified) -> Step:
    """Return the recordings and the number of people to add if a certificate is undecided."""
    now, condition = each.participants, each.condition.replace("_", " ")
    more_precise = f"more movements of each person with {condition}, or measure more finely"
    if now < MIN_PEOPLE and each.needed is None and now >= MIN_FORECAST_PEOPLE:
        return Step(
            f"Record {more_precise}, with {MIN_PEOPLE} people or more: a claim needs at least {MIN_PEOPLE}, and with "
            f"the variation of these {now}, no study of up to {CERTIFICATE_SIZES[-1]} people would show it"
        )
    if now < MIN_PEOPLE:
        return Step(
            f"Record {_more_people(MIN_PEOPLE - now)}, {MIN_PEOPLE} in all, the smallest number for a claim; then "
            "assess again"
        )
    if remedy := loss_remedy(each):
        return Step(remedy.rstrip("."))
    if any(test.bounded for test in each.certificate.end_points.values()):
        return Step(f"Record the movements of {condition} until they settle, of the same {now} people or more")
    if each.needed is not None and each.needed > now:
        return Step(
            f"Record {_more_people(each.needed - now)} with {condition}, about {each.needed} in all, which show it in "
            "9 of 10 studies if the robot changes nothing; then assess again"
        )
    return Step(f"Record {more_precise}; additional people alone are unlikely to decide it")


def _more_people(count: int) -> str:
    return "1 more person" if count == 1 else f"{count} more people"


def _change_answer(found: AssessmentResult) -> Answer:
    """Return whether conditions change the leading index, naming each condition that a test tells from control."""
    each = found.assessed.get(leading_index().name) or next(iter(found.assessed.values()))
    alpha = 1.0 - found.confidence
    alone = "with one participant, no test is possible" if len(found.participants) == 1 else ""
    differing = {name: _differing(found, own, alpha) for name, own in found.assessed.items()}
    parts = []
    for condition in (c for c in found.conditions if c != found.control):
        names = [name for name, conditions in differing.items() if condition in conditions]
        words = ", ".join(lowered(found.assessed[name].table.index.words) for name in names)
        told = condition in differing[each.name]
        reason = f"differs in {words}" if names else alone or "no test finds a difference from control"
        parts.append(AnswerPart(condition, "yes" if told else "cannot say", reason))
    others: dict[tuple[str, ...], list[str]] = {}
    for name, conditions in differing.items():
        if name != each.name and conditions:
            others.setdefault(tuple(conditions), []).append(lowered(found.assessed[name].table.index.words))
    also = "".join(f" {' and '.join(told)} also different in: {', '.join(words)}." for told, words in others.items())
    told = any(part.verdict == "yes" for part in parts)
    without = f"no test finds a difference from {found.control} in {lowered(each.table.index.words)}"
    reason = "" if told else alone or without
    return Answer(
        f"Do these conditions change people's {lowered(each.table.index.words)}, against {found.control}?",
        "yes" if told else "cannot say",
        f"{_changes_text(found)}{also}",
        reason,
        tuple(parts),
        tuple(_numbers(found)),
        _basis(found),
        next=(_margin_step(found),),
    )


def _differing(found: AssessmentResult, each: Assessed, alpha: float) -> list[str]:
    """Return the conditions that tests tell from control in an index."""
    return [c for c in each.comparison.pairwise if each.differs(c, found.control, alpha)]


def _margin_step(found: AssessmentResult) -> Step:
    """Return what to do next where nothing is certified: record another person, or state margins."""
    if found.has_margins or len(found.participants) == 1:
        tested = "margins" if found.has_margins else "conditions"
        return Step(f"Record the next participant: {tested} are tested with two or more participants")
    text = "State the allowed change of each index in `[assessment.margins]`, then check the study"
    return Step(text, "check")


def _basis(found: AssessmentResult) -> Basis:
    used, excluded = len(found.participants), sum(found.left_out.values())
    recorded = f" of {found.movements + excluded:,}" if excluded else ""
    return Basis(used, used + len(found.without), "participant", f"{found.movements:,}{recorded} movements")


def _numbers(found: AssessmentResult) -> list[AnswerNumber]:
    """Return the changes of the leading index, and of every end point with a margin, by condition."""
    names = dict.fromkeys([leading_index().name, *(name for each in found.certified for name in each.end_points)])
    made = []
    for name in names:
        if name not in found.assessed:
            continue
        words = found.assessed[name].table.index.words
        for condition, change in known_changes(found, name).items():
            row = f"{found.study}.transparency.{name}.{condition.lower()}"
            ends = (change.low, change.high)
            made.append(AnswerNumber(f"{words}, {condition}", change.value, change.unit or "1", ends, row))
    return made


def known_changes(findings: AssessmentResult, name: str) -> dict[str, PrimaryChange]:
    """Return the primary changes of an index from control, by condition."""
    changes = {c: primary_change(findings, name, c) for c in findings.conditions if c != findings.control}
    return {c: change for c, change in changes.items() if change is not None}


def change_value(findings: AssessmentResult, name: str, condition: str, change: PrimaryChange) -> Value:
    """Return a primary change as every part of a page shows it, under the id of its row in results.json."""
    text = change.figure if np.isfinite(change.value) else change.text
    row = f"{findings.study}.transparency.{name}.{condition.lower()}"
    return Value(row, change.value, text.replace("-", MINUS_SIGN))


def _changes_text(findings: AssessmentResult) -> str:
    """Return the leading index's changes with their intervals, in a sentence."""
    name = leading_index().name
    each = findings.assessed.get(name)
    changes = known_changes(findings, name) if each is not None else {}
    if each is None or not changes:
        return headline(findings)
    level, parts = f"{100.0 * findings.confidence:g} % CI", []
    for condition, change in changes.items():
        shown = change_value(findings, name, condition, change)
        ends = f"{change.interval} {change.unit}".replace("-", MINUS_SIGN) if change.interval else "not known"
        parts.append(f"{condition.replace('_', ' ')} {shown} {change.unit} ({level} {ends})")
    words = each.table.index.words
    people = f"{len(findings.participants)} {'people' if len(findings.participants) != 1 else 'person'}"
    cut = [f"{100.0 * one.curve.cut:.0f} % in {one.condition}" for one in findings.settling if one.curve.cut]
    more = f" Never settled: {', '.join(cut)}." if cut else ""
    return f"{words} against {findings.control}, {people}: {', '.join(parts)}.{more}"
