"""What an assessment found and what it did not, in sentences that do not say more than the numbers do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..identification.fit import Verdict
from ..signals.pointing_check import REASONS
from .indices import INDICES, NEGATIVE
from .signed_rank import smallest_p

if TYPE_CHECKING:
    from .assessment_findings import Assessed, AssessmentFindings

MAIN = ("duration", "vmax", "emgacc", "torque_rms", "emg_level")
"""Indices that the paragraph goes through."""

ISOCHRONOUS = 0.8
"""Mean R² of amplitude and mean velocity from which on the relation counts as kept."""


def headline(found: AssessmentFindings) -> str:
    """The result in one sentence.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    str
    """
    who = f"{len(found.participants)} participant" + ("s" if len(found.participants) != 1 else "")
    said = f"{len(found.conditions)} conditions, {who}, {found.movements} movements"
    duration = found.assessed.get("duration")
    if duration is None or not duration.comparison.against_control:
        return f"{said}."
    parts = [
        f"{a.condition} {_percent(a.relative)}" for a in duration.comparison.against_control if a.relative is not None
    ]
    return f"{said}; duration against {found.control}: {', '.join(parts)}."


def paragraph(found: AssessmentFindings) -> str:
    """What was found and what was not.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    str
    """
    alpha = 1.0 - found.confidence
    n = len(found.participants)
    said = [
        f"{n} participant{'s' if n != 1 else ''} made {found.movements} movements in {len(found.conditions)} "
        f"conditions ({', '.join(found.conditions)}; control: {found.control})."
    ]
    if n < 2:
        said.append("With one participant there is no test: the figures describe this person and nobody else.")
    for name in MAIN:
        if name in found.assessed:
            said += _index_sentences(found, found.assessed[name], alpha)
    said += _isochrony_sentence(found)
    if n > 1:
        said.append(_limits(found, alpha))
    return " ".join(said)


def _index_sentences(found: AssessmentFindings, each: Assessed, alpha: float) -> list[str]:
    index, compared = each.table.index, each.comparison
    means = ", ".join(f"{c} {np.mean(each.table.column(c)):.3g}" for c in each.table.conditions)
    unit = "" if index.unit == "1" else f" {index.unit}"
    head = f"{index.words} was, in the mean, {means}{unit}"
    test = compared.friedman
    if test is None:
        return [f"{head}."]
    p = test.p_value if test.exact_p_value is None else test.exact_p_value
    counted = "counted " if test.exact_p_value is not None else ""
    result = f"χ²({test.degrees_of_freedom}) = {test.statistic:.3g}, {counted}{_p(p)}"
    if p >= alpha:
        said = [f"{head}; no difference between conditions was found ({result})."]
    else:
        pairs = [
            (a, b, compared.pair(a, b))
            for i, a in enumerate(compared.conditions)
            for b in compared.conditions[i + 1 :]
            if compared.pair(a, b) < alpha
        ]
        which = ", ".join(f"{a} and {b} ({_p(q)})" for a, b, q in pairs)
        said = [
            f"{head}; conditions differed ({result})"
            + (f", by Nemenyi's test {which}." if pairs else ", but Nemenyi's test could not say which.")
        ]
    open_ones = [
        a for a in compared.against_control
        if (p >= alpha or compared.pair(found.control, a.condition) >= alpha) and np.isfinite(a.interval[0])
    ]  # fmt: skip
    if open_ones and index.name not in NEGATIVE:
        base = 100.0 / float(each.table.column(found.control).mean())
        ranges = ", ".join(
            f"{a.condition} {_signed(base * a.interval[0])} to {_signed(base * a.interval[1])} %" for a in open_ones
        )
        said.append(
            f"Not told apart from {found.control} is not equal to it: within {100 * found.confidence:g} % intervals "
            f"the change may be {ranges}."
        )
    return said


def _isochrony_sentence(found: AssessmentFindings) -> list[str]:
    if not found.isochrony:
        return []
    means = {(line.condition, line.direction): float(np.mean(line.velocity_r2)) for line in found.isochrony}
    (condition, direction), lowest = min(means.items(), key=lambda item: item[1])
    kept = "was kept in every condition" if lowest >= ISOCHRONOUS else "was not kept everywhere"
    return [
        f"Mean velocity growing with amplitude {kept} (mean R² at least {lowest:.2f}, {condition} {direction}); this "
        "relation alone says little about transparency, since it survives a robot that slows people down."
    ]


def _limits(found: AssessmentFindings, alpha: float) -> str:
    n, m = len(found.participants), len(found.conditions) - 1
    best = m * smallest_p(n)
    if best >= alpha:
        return (
            f"With {n} participants the signed-rank test against control cannot give less than p = {best:.2g} after "
            f"correction for {m} comparison{'s' if m != 1 else ''}, whatever the effect."
        )
    short = [each for each in found.needed if each.participants is not None and each.participants > n]
    if short:
        each = min(short, key=lambda e: e.participants)
        return (
            f"A change of {INDICES[each.index].words.lower()} by {100 * each.change:g} % would have needed about "
            f"{each.participants} participants to be found in 8 of 10 studies."
        )
    smallest = min((each.change for each in found.needed), default=None)
    if smallest is None:
        return "How many participants would be needed cannot be told from fewer than three."
    return f"There were participants enough to find a change of {100 * smallest:g} % in 8 of 10 studies like this one."


def verdicts(found: AssessmentFindings, notes: Sequence[str] = ()) -> tuple[Verdict, ...]:
    """What a reader must know before using the numbers.

    Parameters
    ----------
    found : AssessmentFindings
    notes : sequence of str
        On recordings.

    Returns
    -------
    tuple of Verdict
    """
    said = [
        Verdict("warning", f"{person} is left out of every comparison: {why}.") for person, why in found.without.items()
    ]
    if len(found.participants) == 1:
        said.append(
            Verdict("warning", f"Only {found.participants[0]} can be compared: one participant, so nothing is tested.")
        )
    total = sum(found.left_out.values())
    if total:
        words = ", ".join(
            f"{n} {REASONS.get(why, 'that went as far as another label')}" for why, n in found.left_out.items()
        )
        said.append(Verdict("note", f"{total} of {total + found.movements} movements were left out: {words}."))
    said += _filter_verdicts(found)
    said += [Verdict("note", note) for note in notes]
    return tuple(said)


def _filter_verdicts(found: AssessmentFindings) -> list[Verdict]:
    """Does another filter or rule turn a result around?"""
    said = []
    alpha = 1.0 - found.confidence
    for index in dict.fromkeys(s.index for s in found.sensitivity):
        own = [s for s in found.sensitivity if s.index == index]
        p = {s.words: s.p_value for s in own if np.isfinite(s.p_value)}
        if p and min(p.values()) < alpha <= max(p.values()):
            yes, no = (", ".join(w for w, q in p.items() if (q < alpha) == found_) for found_ in (True, False))
            said.append(
                Verdict(
                    "warning",
                    f"{INDICES[index].words}: whether conditions differ hangs on the filter or the movement's end (yes "
                    f"with {yes}; no with {no}).",
                )
            )
        for condition in dict.fromkeys(s.condition for s in own):
            changes = [100.0 * s.change for s in own if s.condition == condition]
            if max(changes) - min(changes) > 5.0:
                said.append(
                    Verdict(
                        "note",
                        f"{INDICES[index].words}, {condition}: the change from {found.control} is {min(changes):.3g} "
                        f"to {max(changes):.3g} %, depending on the filter and on where movements end.",
                    )
                )
    return said


def _percent(share: float) -> str:
    return f"{100.0 * share:+.1f} %"


def _signed(value: float) -> str:
    return f"{value:+.1f}"


def _p(p: float) -> str:
    return "p < 0.001" if p < 1e-3 else f"p = {p:.3f}"
