"""State the findings of an assessment, and missing evidence, in sentences that do not exceed the numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...models.estimates import Verdict
from ..certificate_text import lowered, p_statement
from ..comparison import smallest_p
from ..equivalence import WITHIN_MARGIN
from ..indices import index_names, leading_index
from .assessment_tables import PRINTED_UNITS
from .pointing import reason_words
from .primary_change import ESTIMAND_WORDS, primary_change

if TYPE_CHECKING:
    from .assessment_result import Assessed, AssessmentResult

MIN_ISOCHRONY_R2 = 0.8
"""Isochrony counts as preserved if the mean R² between amplitude and mean velocity is at least this."""


def headline(found: AssessmentResult) -> str:
    """Return the result in one sentence, after the verdict on each condition with stated margins."""
    verdicts_text = "".join(f"{one.condition}: {one.certificate.statement}. " for one in found.certified)
    who = f"{len(found.participants)} participant" + ("s" if len(found.participants) != 1 else "")
    counts_text = f"{len(found.conditions)} conditions, {who}, {found.movements} movements"
    leading = found.assessed.get(leading_index().name)
    if leading is None or not leading.comparison.against_control:
        return f"{verdicts_text}{counts_text}."
    told = {c: _change_and_interval(found, leading, c) for c in found.conditions if c != found.control}
    parts = [
        f"{condition} {value}" + (f" ({interval})" if interval else "")
        for condition, (value, interval) in told.items()
        if value
    ]
    cut = unsettled_text(found)
    more = f"; {cut}" if cut else ""
    words = lowered(leading.table.index.words)
    return f"{verdicts_text}{counts_text}; {words} against {found.control}: {', '.join(parts)}{more}."


def unsettled_text(found: AssessmentResult) -> str:
    """Return in words how many movements of each condition had not settled, and how they count; "" for none."""
    cut = [
        f"{each.curve.cut_count} of {each.curve.count} movements in {each.condition}"
        for each in found.settling
        if each.curve.cut_count
    ]
    if not cut:
        return ""
    also = ", including excluded ones," if found.left_out.get("unfinished") else ""
    return (
        f"{_listed(cut)}{also} had not settled when the next target came; they count as longer than seen (Kaplan-Meier)"
    )


def paragraph(found: AssessmentResult) -> str:
    """Return the findings and the missing evidence, with a paragraph for each index."""
    alpha = 1.0 - found.confidence
    n = len(found.participants)
    parts = [
        [
            f"{n} participant{'s' if n != 1 else ''} made {found.movements} movements in {len(found.conditions)} "
            f"conditions ({', '.join(found.conditions)}; control: {found.control})."
        ]
    ]
    if n < 2:
        parts[0].append("With one participant there is no test: the results describe this person only.")
    described = [name for name in index_names(lambda index: index.paragraph_place) if name in found.assessed]
    parts += [_index_sentences(found, found.assessed[name], alpha) for name in described]
    rest = _other_indices(found, alpha)
    if n > 2 and any(
        each.differs(c, found.control, alpha) is False and found.said_of(each.name, c) != WITHIN_MARGIN
        for each in found.assessed.values()
        for c in each.comparison.pairwise
    ):
        rest.append(
            f"A condition without a significant difference from {found.control} is not thereby equal to it: its "
            f"interval (CI, of the {ESTIMAND_WORDS[found.estimand]}) shows how large the change may be."
        )
    parts += [rest, _isochrony_sentence(found) + ([_limits(found, alpha)] if n > 1 else [])]
    return "\n\n".join(" ".join(part) for part in parts if part)


def _index_sentences(found: AssessmentResult, each: Assessed, alpha: float) -> list[str]:
    index, compared = each.table.index, each.comparison
    factor, unit = index.shown
    unit = PRINTED_UNITS.get(unit, unit)
    against = {a.condition: a for a in compared.against_control}
    parts = []
    for condition in each.table.conditions:
        mean = float(factor * np.mean(each.table.column(condition)))
        own = against.get(condition)
        change = _change(found, each, condition) if own is not None or condition != found.control else ""
        if index.over_control:
            told, _, interval = (change or _percent(mean)).partition(", ")
            parts.append(f"{told} in {condition}" + (f" ({interval})" if interval else ""))
            continue
        parts.append(f"{mean:.3g}{' ' if unit else ''}{unit} in {condition}" + (f" ({change})" if change else ""))
    sentences = [f"{_mean_of(index.words)} was {_listed(parts)}."]
    if index.over_control:
        sentences = [f"{index.sentence_words or index.words} changed from {found.control} by {_listed(parts)}."]
    if compared.friedman is None:
        return sentences
    test = compared.friedman
    exact = "exact " if test.exact_p_value is not None else ""
    result = f"Friedman's χ²({test.degrees_of_freedom}) = {test.statistic:.3g}, {exact}{p_statement(compared.p_value)}"
    if compared.p_value >= alpha:
        compared_text = _listed(compared.conditions) if index.over_control else "conditions"
        return [*sentences, f"No difference between {compared_text} was found ({result})."]
    pairs = [
        (a, b, compared.pair(a, b))
        for i, a in enumerate(compared.conditions)
        for b in compared.conditions[i + 1 :]
        if compared.pair(a, b) < alpha
    ]
    which = _listed([f"{a} from {b} ({p_statement(q)})" for a, b, q in pairs])
    told = f"Nemenyi's test distinguished {which}" if pairs else "Nemenyi's test identified no pair"
    return [*sentences, f"Conditions differed ({result}); {told}."]


def _mean_of(words: str) -> str:
    """``Duration`` becomes ``Mean duration``; a name that begins with an abbreviation keeps its capitals."""
    if words.startswith(("Median", "Share")):
        return f"The mean {lowered(words)}"
    return f"Mean {lowered(words)}"


def _change(found: AssessmentResult, each: Assessed, condition: str) -> str:
    """Format the primary change from control with its interval; empty if there is none."""
    return ", ".join(part for part in _change_and_interval(found, each, condition) if part)


def _change_and_interval(found: AssessmentResult, each: Assessed, condition: str) -> tuple[str, str]:
    """Format the primary change from control, and its interval; "" for what is not known."""
    change = primary_change(found, each.name, condition)
    if change is None:
        return "", ""
    ends = f"{change.interval} {change.unit}".rstrip()
    return change.text, f"{100 * found.confidence:g} % CI {ends}" if change.interval else ""


def _other_indices(found: AssessmentResult, alpha: float) -> list[str]:
    others = [e for e in found.assessed.values()
              if not e.table.index.paragraph_place and e.comparison.p_value is not None]  # fmt: skip
    differ = [e for e in others if e.comparison.p_value < alpha]
    same = [e for e in others if e.comparison.p_value >= alpha]

    def named(each: Assessed) -> str:
        return f"{lowered(each.table.index.words)} ({p_statement(each.comparison.p_value)})"

    sentences = [f"Conditions also differed in {_listed(list(map(named, differ)))}."] if differ else []
    return sentences + ([f"No difference was found in {_listed(list(map(named, same)))}."] if same else [])


def _listed(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def _isochrony_sentence(found: AssessmentResult) -> list[str]:
    if not found.isochrony:
        return []
    means = {(line.condition, line.direction): float(np.mean(line.velocity_r2)) for line in found.isochrony}
    (condition, direction), lowest = min(means.items(), key=lambda item: item[1])
    where = f"{lowest:.2f}, in {condition} {found.along.ways[direction]}"
    if lowest >= MIN_ISOCHRONY_R2:
        clause = f"grew with amplitude along a straight line in every condition (mean R² at least {where})"
    else:
        clause = f"did not grow with amplitude along a straight line in every condition (mean R² as low as {where})"
    return [
        f"Mean velocity {clause}. This relation alone is no evidence of transparency, because it persists with a robot "
        "that slows people down."
    ]


def _limits(found: AssessmentResult, alpha: float) -> str:
    n, m = len(found.participants), len(found.conditions) - 1
    best = m * smallest_p(n)
    if best >= alpha:
        return (
            f"With {n} participants, the smallest possible p value of the signed-rank test against control is "
            f"{best:.2g} after correction for {m} comparison{'s' if m != 1 else ''}, whatever the effect."
        )
    planned = [each for each in found.needed if each.change is not None]
    short = [each for each in planned if each.participants is not None and each.participants > n]
    if short:
        each = min(short, key=lambda e: e.participants)
        return (
            f"A change of {found.indices[each.index].words.lower()} by {100 * each.change:g} % would have needed about "
            f"{each.participants} participants for a power of 80 %."
        )
    enough = [each for each in planned if each.participants is not None]
    if not enough:
        return "The number of participants needed cannot be estimated from fewer than three."
    each = min(enough, key=lambda e: (e.index != leading_index().name, e.change))
    return (
        f"The number of participants was sufficient to detect a change of {found.indices[each.index].words.lower()} by "
        f"{100 * each.change:g} % with a power of 80 %."
    )


def verdicts(found: AssessmentResult, notes: Sequence[str] = ()) -> tuple[Verdict, ...]:
    """Return the verdicts that a reader must know before using the numbers."""
    found_verdicts = [Verdict("warning", f"{why}.") for why in found.unusable.values()]
    found_verdicts += [
        Verdict("warning", f"{person} is excluded from every comparison: {why}.")
        for person, why in found.without.items()
    ]
    found_verdicts += _one_sided(found)
    if len(found.participants) == 1:
        found_verdicts.append(
            Verdict("warning", f"Only {found.participants[0]} can be compared. A test needs more participants.")
        )
    total = sum(found.left_out.values())
    if total:
        words = ", ".join(
            f"{n} {reason_words(why)}" for why, n in found.left_out.items()
        )
        found_verdicts.append(
            Verdict("note", f"{total} of {total + found.movements} movements were excluded: {words}.")
        )
    found_verdicts += _filter_verdicts(found)
    found_verdicts += [Verdict("note", note) for note in notes]
    return tuple(found_verdicts)


def _one_sided(found: AssessmentResult) -> list[Verdict]:
    """Return a verdict if exclusions concern one condition more, since those who remain may be disturbed least."""
    if len(found.without) < 2:
        return []
    absent = Counter(condition for own in found.absent.values() for condition in own)
    condition, count = absent.most_common(1)[0]
    if count < len(found.without) or len(absent) > 1:
        return []
    total = len(found.without) + len(found.participants)
    return [
        Verdict(
            "warning",
            f"All {count} of {total} excluded participants lack {condition}: the remaining ones may be those whom it "
            "disturbs least.",
        )
    ]


def _filter_verdicts(found: AssessmentResult) -> list[Verdict]:
    """Return a verdict if another filter or rule reverses a result."""
    alpha = 1.0 - found.confidence
    turned, leading, steady = [], leading_index().name, ""
    for index in dict.fromkeys(s.index for s in found.sensitivity):
        p = {s.words: s.p_value for s in found.sensitivity if s.index == index and np.isfinite(s.p_value)}
        yes, no = ([rule_words(words) for words, q in p.items() if (q < alpha) == differs] for differs in (True, False))
        if index == leading and len(p) > 1 and not (yes and no):
            by_all = "significant with all" if yes else "not significant with any"
            steady = f" {found.indices[index].words} is {by_all} of them."
        if yes and no:
            filters_text = f"significant only with {_listed(yes)}" if len(yes) <= len(no) else (
                f"significant except with {_listed(no)}"
            )
            turned.append(f"{lowered(found.indices[index].words)} ({filters_text})")
    if not turned:
        return []
    text = (
        "The result of the comparison depends on the filter or on the definition of the movements' end: "
        f"{'; '.join(turned)}.{steady}"
    )
    registered = "Report the result by the registered analysis." if found.is_registered else (
        "Report the results by all of them: no analysis was registered before the data."
    )
    return [Verdict("warning", text, registered)]


def rule_words(rule: str) -> str:
    """Return a rule for movements as a sentence has it: "2.5 %" is a threshold of the speed, "8 Hz" a low-pass.

    >>> rule_words("2.5 %")
    'a speed threshold of 2.5 %'
    """
    kinds = {"%": "a speed threshold of", "Hz": "a low-pass of", "ms": "a marker delay of"}
    return f"{kinds.get(rule.rpartition(' ')[2], 'an end of movements at the')} {rule}"


def _percent(share: float) -> str:
    return f"{100.0 * share:+.1f} %"
