"""The answer of an assessment: is a condition transparent, or without margins, do conditions change movement?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..._printed_command import printed_command
from ...study.answer import (
    FOLDER,
    PAPER_STEP,
    Answer,
    AnswerNumber,
    AnswerPart,
    AnswerVerdict,
    Basis,
    Step,
    reason_of_parts,
)
from ...study.pages.quantities import MINUS_SIGN, name_words
from ...study.pages.values import Value
from ..certificate import FAIL, PASS
from ..certificate_text import (
    carry_over_note,
    interval_level,
    interval_with_unit,
    lowered,
    margin_text,
    p_statement,
    signed_text,
)
from ..comparison import smallest_p, smallest_told_p
from ..equivalence import BEYOND_MARGIN
from ..indices import leading_index
from ..power import CERTIFICATE_SIZES, MIN_FORECAST_PEOPLE
from ..share_of_people import MIN_PEOPLE, limits
from .assessment_tables import people_words
from .certified_rows import certificate_reasons, deciding_end_point, loss_remedy
from .pointing import reason_words
from .primary_change import PrimaryChange, primary_change
from .statements import headline, unsettled_text

if TYPE_CHECKING:
    from .assessment_result import Assessed, AssessmentResult, Certified

CERTIFICATE_VERDICTS: dict[str, AnswerVerdict] = {PASS: "yes", FAIL: "no"}
"""Verdict of each certificate; any other is "cannot say"."""


def assessment_answer(found: AssessmentResult) -> Answer:
    """Return whether a condition is transparent, or without a certificate whether conditions change movement."""
    return certificate_answer(found) if found.certified else _change_answer(found)


CERTIFICATE_STEP = Step("Write the certificate's page for a reviewer", "certificate")
"""What to do next with a certificate that says yes or no."""

CONTROLLER_STEP = Step(
    "Compensate what the robot leaves in the end points beyond their margins: another controller, or less weight and "
    "friction; then repeat the study"
)
"""What to do next where every condition lies beyond a margin."""


def certificate_answer(found: AssessmentResult) -> Answer:
    """Return whether a condition is transparent, with what to record where nobody can say."""
    parts = [
        AnswerPart(each.condition, CERTIFICATE_VERDICTS.get(each.certificate.verdict, "cannot say"), reason)
        for each, reason in zip(found.certified, certificate_reasons(found), strict=True)
    ]
    said = {part.verdict for part in parts}
    # One transparent condition is enough; all must be shown to be none for "no".
    verdict: AnswerVerdict = "yes" if "yes" in said else "no" if said == {"no"} else "cannot say"
    question = _certificate_question(found)
    is_post_hoc = any(each.certificate.post_hoc for each in found.certified)
    if is_post_hoc:
        question += " Post hoc: this is not the registered analysis."
    open_ones = [each for each in found.certified if each.certificate.verdict not in (PASS, FAIL)]
    recording = _recording_steps(found, open_ones) if verdict == "cannot say" else ()
    following = [*recording, *_order_step(found), *([CONTROLLER_STEP] if verdict == "no" else [])]
    following += [*_exclusion_step(found), *([CERTIFICATE_STEP] if verdict != "cannot say" else [])]
    return Answer(
        question, verdict, _decisions_text(found), reason_of_parts(parts, verdict),
        tuple(parts),
        tuple(_numbers(found)), _basis(found), next=tuple(dict.fromkeys(following)),
        qualifier="post hoc" if is_post_hoc else "",
    )  # fmt: skip


def reviewed_answer(found: AssessmentResult) -> Answer:
    """Return the answer on the page for a reviewer, which is written already: after yes, a paper follows it."""
    following = [
        replace(PAPER_STEP, folder=step.folder) if step.name == CERTIFICATE_STEP.name else step
        for step in found.answer.next
        if step.name != CERTIFICATE_STEP.name or found.answer.verdict == "yes"
    ]
    return replace(found.answer, next=tuple(following))


def _certificate_question(found: AssessmentResult) -> str:
    """Return the question of a certificate, with its conditions, end points and margins."""
    conditions = listed_or([_quoted(each.condition) for each in found.certified])
    first = found.certified[0]
    by_margin: dict[str, list[str]] = {}
    for name, point in first.end_points.items():
        test = first.certificate.end_points[name]
        margin = margin_text(point, test).removesuffix(carry_over_note(point, test)).replace("-", MINUS_SIGN)
        by_margin.setdefault(margin, []).append(lowered(point.index.words))
    changes = (f"changes of {' and '.join(words)} within {margin}" for margin, words in by_margin.items())
    within = ", ".join(changes).replace("within none to", "up to")
    if len(first.end_points) > MAX_ASKED_END_POINTS:
        within = f"changes of all {len(first.end_points)} end points within their margins"
    return f"Do people move under {conditions} as under {_quoted(found.control)} (transparent), with {within}?"


MAX_ASKED_END_POINTS = 3
"""Largest number of end points that a question names."""


def _quoted(condition: str) -> str:
    return f'"{name_words(condition)}"'


def listed_or(names: Sequence[str]) -> str:
    """Return names in words, the last after "or"."""
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _exclusion_step(found: AssessmentResult) -> tuple[Step, ...]:
    """Return what a claim of transparency needs where too many movements are excluded and no verdict depends on it."""
    excluded = sum(found.left_out.values())
    total, allowed = found.movements + excluded, max(each.max_left_out for each in found.certified)
    if excluded <= allowed * total or any(map(loss_remedy, found.certified)):
        return ()
    limit, counts = f"at most {100.0 * allowed:g} % of movements", f"here {excluded:,} of {total:,} are"
    if found.exclusions:
        return (Step(
            f"Only to claim transparency: change the task or the stated rule so that {limit} are excluded; {counts}, "
            "and more data under the same rule do not help"
        ),)  # fmt: skip
    return (Step(
        f"Only to claim transparency: {_record(found)} again so that {limit} are excluded; {counts}, "
        f"{_reasons_text(found)}"
    ),)  # fmt: skip


def _order_step(found: AssessmentResult) -> tuple[Step, ...]:
    """Return that the order of conditions is to be stated, where it is not."""
    if found.is_simulated or _order_count(found):
        return ()
    return (Step(
        "State in which order each person had the conditions (`period` of each recording in study.toml): until then, "
        "practice or fatigue may be the cause of a change"
    ),)  # fmt: skip


def _recording_steps(found: AssessmentResult, undecided: Sequence[Certified]) -> tuple[Step, ...]:
    """Return the recordings and the number of people to add, each with the conditions that need them."""
    conditions: dict[str, list[str]] = {}
    for each in undecided:
        for text in _recording_texts(found, each):
            conditions.setdefault(text, []).append(each.condition)
    return tuple(Step(f"{', '.join(map(name_words, names))}: {text}") for text, names in conditions.items())


def _recording_texts(found: AssessmentResult, each: Certified) -> tuple[str, ...]:
    """Return what to record if a certificate is undecided: lost trials, and the number of people to add."""
    own, now, texts = each.certificate, each.participants, []
    if remedy := loss_remedy(each):
        texts.append(f"{remedy[:1].lower()}{remedy[1:].rstrip('.')}")
    elif any(test.bounded for test in own.end_points.values()):
        texts.append(f"{_record(found)} the movements until they settle, of the same {now} people or more")
    elif alone := [p.index.short for n, p in each.end_points.items() if own.end_points[n].verdict == BEYOND_MARGIN]:
        return (
            f"{_beyond_people_text(found, each.needed_beyond, now)}: tested alone, {lowered(' and '.join(alone))} "
            "would be beyond its margin already",
        )
    is_beyond = any(own.tested(name) == BEYOND_MARGIN for name in each.end_points)
    if not texts or (now < MIN_PEOPLE and not is_beyond):
        texts.append(_people_text(found, each.needed, now))
    return tuple(texts)


def _beyond_people_text(found: AssessmentResult, needed: int | None, now: int) -> str:
    """Return the number of people who would show a change as large as that seen to be beyond its margin."""
    if needed is None:
        return (
            f"no number of people up to {CERTIFICATE_SIZES[-1]} would show a change as large as this to be beyond its "
            f"margin in 9 of 10 studies; {_record(found)} more movements of each person"
        )
    in_all = f"{_adding_text(found, needed, now)}," if needed > now else f"{_record(found)} more people"
    return f"{in_all} to show in 9 of 10 studies that it is not transparent, if changes are as seen here"


def _people_text(found: AssessmentResult, needed: int | None, now: int) -> str:
    """Return the number of people to add by the power analysis, or what to do where no number would decide.

    The analysis counts with the smallest number of people for a claim.
    """
    if now < MIN_FORECAST_PEOPLE:
        return (
            f"{_adding_text(found, MIN_PEOPLE, now)}, the smallest number for a claim; with {MIN_FORECAST_PEOPLE} the "
            "power analysis says how many are needed"
        )
    more_movements = f"{_record(found)} more movements of each person"
    if needed is None:
        return (
            f"more people will not show it transparent (people vary so much that {CERTIFICATE_SIZES[-1]} would not be "
            f"enough). {more_movements.capitalize()}, plan a study with a wider margin, or change the controller"
        )
    if needed > now:
        return (
            f"{_adding_text(found, needed, now)}: then 9 of 10 studies show that a robot which changes nothing is "
            "transparent"
        )
    return (
        f"it may change movement: with {needed} people, 9 of 10 studies of a robot that changes nothing show it "
        f"transparent. Change the controller, or {more_movements}"
    )


def _adding_text(found: AssessmentResult, needed: int, now: int) -> str:
    """Return how to add people up to a number that is `needed`."""
    where = f" ({_count_place(found)}, then {SIMULATE_AGAIN})" if found.rig_file else ""
    return f"{_record(found)} {_more_people(needed - now)}, {needed} in all{where}"


def _record(found: AssessmentResult) -> str:
    return "simulate" if found.is_simulated else "record"


SIMULATE_AGAIN = f"`{printed_command('simulate', FOLDER)}` and `{printed_command('assess', FOLDER)}`"
"""Commands after a change of the rig; alone they would make the same people again."""


def _count_place(found: AssessmentResult) -> str:
    """Return where a study says how many people are simulated."""
    return f"`count` in `[people]` of `{FOLDER}/{found.rig_file}`"


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
    reason = "" if told else alone or _undetected_text(found, each, alpha)
    asked, words = listed_or([_quoted(part.name) for part in parts]), lowered(each.table.index.words)
    return Answer(
        f"Does {asked} change people's {words}, compared with {_quoted(found.control)}?",
        "yes" if told else "cannot say",
        f"{_differing_text(found, each, differing[each.name])}{_changes_text(found)}{also}",
        reason,
        tuple(parts),
        tuple(_numbers(found)),
        _basis(found),
        next=_change_steps(found, [part.name for part in parts if part.verdict != "yes"]),
    )


def _undetected_text(found: AssessmentResult, each: Assessed, alpha: float) -> str:
    """Return the test that tells no condition from control in an index, with its p value and what few people allow."""
    compared, count = each.comparison, len(each.table.participants)
    words, m = lowered(each.table.index.words), len(each.comparison.pairwise)
    if found.control not in each.table.conditions:
        text = f"{RANK_TESTS} find no difference from {found.control} in {words} ({count} people)"
        return f"{text}{_least_text(min(1.0, m * smallest_p(count)), count, alpha)}"
    if compared.p_value is None:
        return f"no test finds a difference from {found.control} in {words} ({count} people)"
    told = f"({p_statement(compared.p_value)}, {count} people)"
    text = f"Friedman's test over the {len(compared.conditions)} conditions finds no difference in {words} {told}"
    if compared.p_value < alpha:
        text = (
            f"Friedman's test finds a difference in {words} among the {len(compared.conditions)} conditions {told}, "
            f"but Nemenyi's test finds none from {found.control}"
        )
    return f"{text}{_least_text(smallest_told_p(count, len(compared.conditions)), count, alpha)}"


CONTROL_TESTS = "Friedman's and Nemenyi's tests"
"""Tests that tell a condition from control, as a sentence names them."""

RANK_TESTS = "signed-rank tests corrected after Holm"
"""Tests where an index has no value of its own in control."""


def _least_text(least: float, count: int, alpha: float) -> str:
    """Return that few people cannot show a difference by the test that decides; "" where they can."""
    return "" if least < alpha else f". With {count} people, the smallest possible p is {least:.2g}"


def _differing_text(found: AssessmentResult, each: Assessed, conditions: Sequence[str]) -> str:
    """Return the conditions that differ from control in an index with their p values, in a sentence; "" for none."""
    if not conditions:
        return ""
    compared = each.comparison
    against_control = found.control in each.table.conditions
    p = {c: max(compared.p_value or 0.0, compared.pair(found.control, c)) if against_control else
         compared.pairwise[c].holm for c in conditions}  # fmt: skip
    named = ", ".join(f"{condition} ({p_statement(value)})" for condition, value in p.items())
    tests = CONTROL_TESTS if against_control else RANK_TESTS
    return f"Different from {found.control} by {tests}: {named}. "


def _differing(found: AssessmentResult, each: Assessed, alpha: float) -> list[str]:
    """Return the conditions that tests tell from control in an index."""
    return [c for c in each.comparison.pairwise if each.differs(c, found.control, alpha)]


def _change_steps(found: AssessmentResult, untold: Sequence[str]) -> tuple[Step, ...]:
    """Return what to do next where nothing is certified: the number of people for `untold` conditions, and margins."""
    if len(found.participants) == 1 or found.has_margins or not untold:
        return (_margin_step(found),)
    return _more_people_step(found, untold), _margin_step(found)


def _more_people_step(found: AssessmentResult, untold: Sequence[str]) -> Step:
    """Return the numbers of people who would show the changes that were seen in `untold` conditions."""
    count, needed = len(found.participants), found.needed_as_seen
    text = "More people are needed"
    if numbers := [f"{name_words(name)} {_needed_words(needed[name], count)}" for name in untold if name in needed]:
        text = (
            f"People who would show the change of {lowered(leading_index().words)} seen here by the same tests, in "
            f"8 of 10 studies: {', '.join(numbers)}"
        )
    if found.rig_file:
        return Step(f"{text}. Raise {_count_place(found)}, then run {SIMULATE_AGAIN}")
    return Step(f"{text}. {_record(found).capitalize()} more people")


def _needed_words(needed: int | None, count: int) -> str:
    """Return a number of people by the power analysis; one that this study has is not enough."""
    return f"more than {count}" if needed is not None and needed <= count else people_words(needed)


def _margin_step(found: AssessmentResult) -> Step:
    """Return what to do next to ask about transparency: state margins, or record a participant to test with."""
    count = len(found.participants)
    if found.has_margins or count == 1:
        tested = "margins" if found.has_margins else "conditions"
        another = f"{_record(found).capitalize()} {'more people' if found.is_simulated else 'the next participant'}"
        return Step(f"{another}: {tested} are tested with two or more participants")
    few = f" (a claim needs {MIN_PEOPLE} people at least)" if count < MIN_PEOPLE else ""
    return Step(
        f"To ask whether a condition is transparent{few}, state the allowed change of each index in "
        "`[assessment.margins]`, then check the study",
        "check",
    )


def _basis(found: AssessmentResult) -> Basis:
    used, excluded = len(found.participants), sum(found.left_out.values())
    movements = f"{found.movements:,} movements"
    if excluded:
        why = _causes_text(found)
        movements = f"{found.movements:,} of {found.movements + excluded:,} movements ({excluded:,} excluded: {why}"
        allowed = max((each.max_left_out for each in found.certified), default=1.0)
        movements += f"; a claim of transparency allows at most {100.0 * allowed:g} %)" if allowed < 1.0 else ")"
    return Basis(used, used + len(found.without), "participant", movements, more=(_plan_text(found),))


def _reasons_text(found: AssessmentResult) -> str:
    """Return why movements are excluded."""
    reasons = {reason_words(kind): n for kind, n in found.left_out.items() if n}
    return ", ".join(f"{n:,} {words}" for words, n in reasons.items()) if len(reasons) > 1 else next(iter(reasons))


def _causes_text(found: AssessmentResult) -> str:
    """Return why movements are excluded, with the stated rules and the only direction of those in use."""
    ways = {movement.cell[1] for movement in found.measured}
    way = f"; all in use go {found.along.ways[ways.pop()]}" if len(ways) == 1 else ""
    stated = f"; stated rule: {', '.join(found.exclusions)}" if found.exclusions else ""
    return f"{_reasons_text(found)}{stated}{way}"


def _plan_text(found: AssessmentResult) -> str:
    """Return in a sentence whether the analysis was registered, and in how many orders people had the conditions."""
    orders = _order_count(found)
    order = "the order of conditions is not stated" if not orders else (
        f"people had the conditions in {orders} order{'s' if orders > 1 else ''}"
    )
    if not found.certified:
        return f"{order[:1].upper()}{order[1:]}."
    apart = any(each.certificate.post_hoc for each in found.certified)
    known = "is not the registered one" if apart else "was registered before the data" if found.is_registered else (
        "was not registered before the data"
    )
    return f"The analysis {known}; {order}."


def _order_count(found: AssessmentResult) -> int:
    """Return the number of different orders of conditions among the participants; 0 if they are not stated."""
    places = {} if found.order is None else found.order.by_condition
    by_person: dict[str, list[tuple[float, str]]] = {}
    for (person, condition), place in places.items():
        if person in found.participants:
            by_person.setdefault(person, []).append((place, condition))
    return len({tuple(condition for _, condition in sorted(own)) for own in by_person.values()})


def _numbers(found: AssessmentResult) -> list[AnswerNumber]:
    """Return the changes of the leading index, and of every end point with a margin, by condition."""
    names = dict.fromkeys([leading_index().name, *(name for each in found.certified for name in each.end_points)])
    tests = {(each.condition, name): (point, each.certificate)
             for each in found.certified for name, point in each.end_points.items()}  # fmt: skip
    made = []
    for name in names:
        if name not in found.assessed:
            continue
        words = found.assessed[name].table.index.words
        for condition, change in known_changes(found, name).items():
            row = f"{found.study}.transparency.{name}.{condition.lower()}"
            what, ends = f"{words}, {condition}", (change.low, change.high)
            if (condition, name) in tests:
                point, own = tests[condition, name]
                low, high = map(point.shown, own.end_points[name].interval)
                what, ends = f"{what}, {interval_level(own.alpha)} interval", (low, high)
            made.append(AnswerNumber(what, change.value, change.unit or "1", ends, row))
    return made


LOWER_BOUND = "lower bound: some movements had not settled"
"""Words instead of an interval where only a lower bound of a change is known."""


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
        ends = f"{level} {change.interval} {change.unit}".replace("-", MINUS_SIGN) if change.interval else (
            LOWER_BOUND if change.at_least else f"{level} not known"
        )
        parts.append(f"{condition} {shown} {change.unit} ({ends})")
    words = each.table.index.words
    people = f"{len(findings.participants)} {'people' if len(findings.participants) != 1 else 'person'}"
    return f"{words} against {findings.control}, {people}: {', '.join(parts)}.{_cut_text(findings)}"


def _decisions_text(findings: AssessmentResult) -> str:
    """Return each condition's verdict with the number of the one rule that decides it, in sentences."""
    told = [_decision(findings, each) for each in findings.certified]
    margins = list(dict.fromkeys(margin for _, margin in told))
    common = len(margins) == 1
    parts = [text if common or not margin else f"{text}, margin {margin}" for text, margin in told]
    shared = f", margin {margins[0]}" if common and margins[0] else ""
    people = f"{len(findings.participants)} people"
    return f"{'; '.join(parts)}. Compared with {findings.control}, {people}{shared}.{_cut_text(findings)}"


def _decision(findings: AssessmentResult, each: Certified) -> tuple[str, str]:
    """Return the verdict on a condition with the number that decides it, and the margin of its end point."""
    own, stated = each.certificate, f"{each.condition}: {each.certificate.statement}"
    if not each.end_points:
        return stated, ""
    name = deciding_end_point(each)
    point, test = each.end_points[name], own.end_points[name]
    words, margin = lowered(point.index.words), margin_text(point, test).replace("-", MINUS_SIGN)
    if own.is_decided_by_people(name):
        shares = test.share_test(own.rule)
        far = [signed_text(point, end) for end in limits(test.margin, shares.rule.far_margins) if np.isfinite(end)]
        told = (
            f"{shares.far} of {shares.people} people changed {words} by more than {shares.rule.far_margins:g} margins "
            f"(beyond {' or '.join(far)} {point.unit}; {p_statement(own.p_beyond(name))})"
        )
        return f"{stated}, {told.replace('-', MINUS_SIGN)}", margin
    change = primary_change(findings, name, each.condition)
    shown = "not known" if change is None else (
        f"{change_value(findings, name, each.condition, change)} {change.unit}".rstrip()
    )
    ends = interval_with_unit(point, test).replace("-", MINUS_SIGN)
    return f"{stated}, {words} {shown} ({interval_level(own.alpha)} interval {ends})", margin


def _cut_text(findings: AssessmentResult) -> str:
    """Return the numbers of movements that had not settled, in a sentence; "" without any."""
    cut = unsettled_text(findings)
    return f" {cut}." if cut else ""
