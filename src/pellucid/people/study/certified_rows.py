"""Tables, sentences, verdicts and rows of a certificate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...models.estimates import Verdict
from ...study.procedures.result import FigureTable
from ...study.results import ResultRow
from ..analysis import ANALYSIS_FILE
from ..certificate import (
    DOUBT_DESCRIPTIONS,
    FAIL,
    LEARNING_DOUBT,
    LEFT_OUT_DOUBT,
    LOST_MOVEMENTS_DOUBT,
    LOST_PEOPLE_DOUBT,
    PASS,
    PERIOD_DOUBT,
    UNEVEN_LOSSES_DOUBT,
    Doubt,
    too_many_lost,
)
from ..certificate_text import (
    carry_over_note,
    change_text,
    interval_level,
    interval_text,
    lowered,
    p_statement,
    p_text,
    people_text,
    share_reason,
    share_text,
    signed_text,
    tipping_text,
)
from ..equivalence import BEYOND_MARGIN, MAX_BAYES_FACTOR, MAX_TIPPING_POINT, UNDECIDED, WITHIN_MARGIN, Equivalence
from ..indices import leading_index
from ..power import CERTIFICATE_SIZES
from ..share_of_people import HIDDEN_SHARE, MIN_PEOPLE, TOO_FEW
from .movement_curves import QUANTITY_NAMES

if TYPE_CHECKING:
    from .assessment_result import AssessmentResult, Certified, EndPoint
    from .movement_curves import CurveEndPoint

TEST_NAMES = {
    "skew_robust": "mean of people's changes",
    "signed_rank": "pseudo-median of people's changes, by signed ranks",
    "mixed_model": "mean change by the mixed model of movements",
}
"""Names of the analyses: the estimand of each, and its test."""

ANALYSIS_NAMES = {"skew_robust": "mean", "signed_rank": "pseudo-median", "mixed_model": "mixed model"}
"""Short names of the analyses, for tables."""

TEST_ASSUMPTIONS = {
    "skew_robust": "people's changes are no more skewed than a lognormal distribution of sigma 1",
    "signed_rank": "people's changes are spread symmetrically about their pseudo-median",
    "curve": "people's curves are normally distributed about the mean curve",
}
"""Assumption under which the level of each test holds."""


def certificate_table(found: AssessmentResult) -> FigureTable:
    """Return a table of every end point's change, interval, margin and verdict, by condition."""
    rows = []
    for each in found.certified:
        for name, point in each.end_points.items():
            own = each.certificate.end_points[name]
            margin = f"{point.stated}{carry_over_note(point, own)}"
            rows.append(
                (each.condition, point.index.short, change_text(point, own), interval_text(point, own), margin,
                 p_text(own.p_within), each.certificate.said_of(name),
                 people_text(own.share_test(each.certificate.rule)),
                 tipping_text(each.certificate.tipping_point(name), own))
            )  # fmt: skip
    heads = ("Condition", "Index", "Change", _interval_head(found), "Margin", "p within", "Result", "People",
             "Tipping point of carry-over")  # fmt: skip
    return FigureTable(
        f"Certificate of the {TEST_NAMES[found.certified[0].test]}, against the margins stated", heads, tuple(rows)
    )


def beside_table(found: AssessmentResult) -> FigureTable:
    """Return a table of the sensitivity analyses: other tests of the same changes, and the mixed model of movements."""
    rows = []
    for each in found.certified:
        for test, results in each.beside.items():
            for name, own in results.items():
                point, model = each.end_points[name], each.models[name]
                fitted = test == "mixed_model"
                failed = fitted and bool(model.trouble)
                spread = f"{_scaled(point, model.spread):.3g} {point.unit}".strip() if fitted and not failed else None
                cells = (None, None) if failed else (change_text(point, own), interval_text(point, own))
                said = "no answer" if failed else own.verdict
                movements = model.movements if fitted else None
                rows.append((each.condition, point.index.short, ANALYSIS_NAMES[test], *cells, spread, movements, said))
    heads = ("Condition", "Index", "Analysis", "Change", _interval_head(found),
             "Standard deviation of people's changes", "Movements", "Said")  # fmt: skip
    return FigureTable("Sensitivity analyses (not used for verdicts)", heads, tuple(rows))


def doubt_table(found: AssessmentResult) -> FigureTable:
    """Return a table of doubts on each end point: p value, and verdict after correction."""
    rows = []
    for each in found.certified:
        for name, point in each.end_points.items():
            own = {doubt.what: doubt for doubt in each.certificate.doubts.get(name, ())}
            if own:
                contradicted = ", ".join(doubt.what for doubt in each.certificate.contradicted(name))
                cells = (_doubt(own.get(what)) for what in DOUBT_DESCRIPTIONS)
                rows.append((each.condition, point.index.short, *cells, contradicted or "none"))
    heads = ("Condition", "Index", *(what.capitalize() for what in DOUBT_DESCRIPTIONS), "Contradicts")
    kept = [i for i in range(len(heads)) if any(row[i] is not None for row in rows)]
    rows, heads = [tuple(row[i] for i in kept) for row in rows], tuple(heads[i] for i in kept if rows)
    return FigureTable("Other possible causes: p, and verdict after correction", heads, tuple(rows))


def _doubt(doubt: Doubt | None) -> str | None:
    if doubt is None:
        return None
    return doubt.without.verdict if np.isnan(doubt.p_value) else f"{p_text(doubt.p_value)}, {doubt.without.verdict}"


def curve_table(found: AssessmentResult) -> FigureTable:
    """Return a table of the curves of velocity, torque and EMG compared with control's."""
    rows = []
    for each in found.certified:
        for curve in each.curves:
            own = curve.comparison
            at = "; ".join(f"{c.first} to {c.last} % ({p_text(c.p_value)})" for c in own.clusters if c.p_value <= 0.05)
            curve_verdict = each.certificate.said_of(f"{curve.quantity} curve") if curve.stated else None
            cells = curve.stated or None, p_text(own.p_within) if curve.stated else None, curve_verdict
            rows.append((each.condition, QUANTITY_NAMES[curve.quantity], _furthest(curve), at or "nowhere", *cells))
    heads = ("Condition", "Curve", "Furthest", "Differs at (p)", "Margin", "p within", "Said")
    return FigureTable("Curves over the time of a movement", heads, tuple(rows))


def _furthest(curve: CurveEndPoint) -> str:
    value, percent = curve.furthest
    return f"{value:+.3g} {curve.unit} at {percent} %"


def _interval_head(found: AssessmentResult) -> str:
    return f"{interval_level(found.certified[0].certificate.alpha)} interval"


def _scaled(point: EndPoint, spread: float) -> float:
    return 100.0 * spread if point.logs else point.shown(spread)


def _nearest_text(each: Certified) -> str:
    """Return the end point whose interval comes nearest to its margin, with its change, interval and margin; "" where
    curves alone are stated."""
    if not each.end_points:
        return ""

    def share(name: str) -> float:
        own, margin = each.certificate.end_points[name], each.end_points[name].margin
        return max(abs(own.interval[0] / margin.low), abs(own.interval[1] / margin.high))

    name = max(each.end_points, key=share)
    point, own = each.end_points[name], each.certificate.end_points[name]
    return (
        f"; nearest to its margin is {point.index.words.lower()}, {change_text(point, own)} ("
        f"{interval_level(own.alpha)} interval {interval_text(point, own)}, margin {point.stated})"
    )


def deciding_end_point(each: Certified) -> str:
    """Return the end point on which the verdict on a condition rests: the leading index where it is among them.

    "Not transparent" rests on changes beyond their margins, and "cannot say" on those that nobody can tell. Where a
    curve alone decides, it is the leading index or the first end point.
    """
    own, names = each.certificate, list(each.end_points)
    if own.verdict == FAIL:
        beyond = [n for n in names if own.said_of(n) == BEYOND_MARGIN]
        ranked = [n for n in beyond if own.beyond[n] <= own.alpha] or beyond
        ranked.sort(key=own.p_beyond)
    elif own.verdict == PASS:
        ranked = []
    else:
        alone = [n for n in names if own.end_points[n].verdict == BEYOND_MARGIN]
        ranked = alone or [n for n in names if own.said_of(n) == UNDECIDED]
        ranked.sort(key=lambda n: -own.end_points[n].p_within)
    ranked = ranked or names
    leading = leading_index().name
    return leading if leading in ranked else ranked[0]


def certificate_sentences(found: AssessmentResult) -> tuple[str, ...]:
    """Return the verdict on each condition, and its reason."""
    return tuple(
        f"{each.condition}: {each.certificate.statement}. {reason}"
        for each, reason in zip(found.certified, certificate_reasons(found), strict=True)
    )


def certificate_reasons(found: AssessmentResult) -> tuple[str, ...]:
    """Return the reason of the verdict on each condition, without the verdict."""
    return tuple(map(_reason, found.certified))


def certificate_remarks(found: AssessmentResult) -> tuple[str, ...]:
    """Return remarks on a certificate: disagreement of tests, and questions that could not be tested."""
    remarks = []
    for each in found.certified:
        remarks += [*_post_hoc(each), *_far(each), *_tipping(each)]
        remarks += [*_disagreeing(each), *_without_model(each), *_cut(each), *_failed(each), *_lost(each)]
    remarks += [text for each in found.certified for text in each.unknown]
    return tuple(dict.fromkeys(remarks))


def _reason(each: Certified) -> str:
    own, verdict = each.certificate, each.certificate.verdict
    words = {n: point.index.short for n, point in each.end_points.items()}
    words |= {name: name for name in each.certificate.curves}
    if verdict == PASS:
        whole = "The end point lies within its margin" if len(words) == 1 else (
            f"All {len(words)} end points lie within their margins"
        )
        return f"{whole}{_nearest_text(each)}. {_what_was_tested(each)} {_people_sentence(each)}"
    by = {word: [words[n] for n in words if each.certificate.said_of(n) == word]
          for word in (WITHIN_MARGIN, UNDECIDED, BEYOND_MARGIN)}  # fmt: skip
    if verdict == FAIL:
        beyond = [f"{words[n]}{own.far_note(n)}" for n in words if own.said_of(n) == BEYOND_MARGIN]
        return f"Beyond the margin: {', '.join(beyond)}." + (
            f" Within: {', '.join(by[WITHIN_MARGIN])}." if by[WITHIN_MARGIN] else ""
        )
    return _why_undecided(each, words, by[UNDECIDED])


def _why_undecided(each: Certified, words: Mapping[str, str], undecided: list[str]) -> str:
    """Return the reason of "cannot say" that a reader can act on first."""
    own = each.certificate
    lost = [(words[n], own.tested(n), [d for d in own.contradicted(n) if d.what in LOSS_DOUBTS]) for n in words]
    if any(doubts for *_, doubts in lost):
        return _doubts_text([lost_one for lost_one in lost if lost_one[2]], each)
    lacking = {n: own.share_test(n) for n in each.end_points if own.lacks_people(n)}
    if any(shares is not None and shares.answer == TOO_FEW for shares in lacking.values()):
        hidden = 100.0 * (1.0 - HIDDEN_SHARE) ** each.participants
        return (
            f"Too few participants: {each.participants} took part, and a claim needs at least {MIN_PEOPLE}. If the "
            f"robot slowed one person in five, {hidden:.0f} % of studies of {each.participants} people would contain "
            "none of them."
        )
    if lacking:
        shown = "; ".join(f"{words[n]}: {share_reason(shares)}" for n, shares in lacking.items() if shares)
        return f"The mean change is within its margin, but this is not shown for enough people. {shown}."
    doubted = [(words[n], own.tested(n), own.contradicted(n)) for n in words]
    doubted = [(name, tested, why) for name, tested, why in doubted if why]
    if doubted and len(doubted) == len(undecided):
        return _doubts_text(doubted, each)
    tests = own.end_points
    single = [n for n in tests if tests[n].verdict == BEYOND_MARGIN and own.tested(n) != BEYOND_MARGIN]
    if single:
        alone = [f"{words[n]}{own.far_note(n)}" for n in single]
        p = min(own.p_beyond(n) for n in single)
        return (
            f"Tested alone, {lowered(', '.join(alone))} would be beyond the margin. It is not significant after Holm's "
            f"correction for {len(words)} end points ({p_statement(p)}; {own.alpha:g} or less is required)."
        )
    cut = [words[n] for n in tests if tests[n].bounded]
    if cut:
        return (
            f"{_undecided_text(undecided)} Some movements had not ended when the next target came "
            f"({', '.join(cut)}): let movements settle before the next target."
        )
    more = (
        f"A study with about {each.needed} instead of {each.participants} people would show it with 90 % power, if the "
        "robot changes nothing and people vary as in this study."
        if each.needed is not None and each.needed > each.participants
        else "With this variation and no change, this number of people would probably have shown it: there may be a "
        "change."
        if each.needed is not None
        else f"With this variation among people, no study of up to {CERTIFICATE_SIZES[-1]} people would show it: "
        "it needs more movements of each person, or a more precise measurement."
    )
    return f"{_undecided_text(undecided)} {more}"


def _undecided_text(names: Sequence[str]) -> str:
    return f"The test shows neither within nor beyond the margin for {', '.join(names)}."


def _doubts_text(doubted: Sequence[tuple[str, str, Sequence[Doubt]]], each: Certified) -> str:
    """Return why end points are doubted, with the counts of losses and advice."""
    kinds = {d.what for *_, why in doubted for d in why}
    counts = f" {_lost_counts(each)}" if LOST_MOVEMENTS_DOUBT in kinds else ""
    if LOST_PEOPLE_DOUBT in kinds:
        counts += f" {_lost_people_counts(each)}"
    text = "; ".join(
        f"{name} is {tested} its margin, but this is not shown {' or '.join(DOUBT_DESCRIPTIONS[d.what] for d in why)}"
        for name, tested, why in doubted
    )
    return f"{text}.{counts} {_remedy(kinds)}"


def loss_remedy(each: Certified) -> str:
    """Return what to do about losses that keep a certificate from a claim; "" if none does."""
    own = each.certificate
    return _remedy({d.what for n in each.end_points for d in own.contradicted(n) if d.what in LOSS_DOUBTS})


def _post_hoc(each: Certified) -> list[str]:
    """Return how the analysis deviates from the registered one."""
    apart = each.certificate.post_hoc
    return [f"{each.condition}: post hoc, not as registered in {ANALYSIS_FILE}: {'; '.join(apart)}."] if apart else []


def _far(each: Certified) -> list[str]:
    """Name everybody who lies far beyond the margin of an end point, and say by how much."""
    remarks = []
    for name, point in each.end_points.items():
        test, count = each.certificate.end_points[name], each.certificate.rule.far_margins
        rows = test.far_people
        if rows:
            changes = [f"{signed_text(point, test.differences[i])} {point.unit}" for i in rows]
            who = ", ".join(f"{_person(each, i)} ({change})" for i, change in zip(rows, changes, strict=True))
            lie = "lies" if len(rows) == 1 else "lie"
            remarks.append(
                f"{each.condition}: {who} {lie} far beyond the margin in {point.index.short}, by more than {count:g} "
                f"margins ({point.stated}). Find the cause."
            )
    return remarks


def _person(each: Certified, row: int) -> str:
    return each.people[row] if each.people else f"person {row + 1}"


def _tipping(each: Certified) -> list[str]:
    """Say for which carry-over the verdict holds, and which one would overturn it."""
    points = {n: own for n in each.end_points if (own := each.certificate.tipping_point(n)) is not None}
    if not points:
        return []
    name = min(points, key=lambda n: points[n])
    declared = each.certificate.end_points[name].largest_carry_over
    least = f"more than {points[name]:.2f}" if points[name] < MAX_TIPPING_POINT - 0.1 else f"over {MAX_TIPPING_POINT:g}"
    return [
        f"{each.condition}: the analysis assumes a carry-over of up to {declared:g} margins between sessions. A "
        f"carry-over of {least} margins would overturn the verdict on {each.end_points[name].index.short}."
    ]


def _people_sentence(each: Certified) -> str:
    """Say which shares of people are shown, of the end point that shows least."""
    tests = [own for name in each.end_points if (own := each.certificate.share_test(name)) is not None]
    least = min(tests, key=lambda own: own.least_within)
    far, rule = max(own.most_far for own in tests), least.rule
    return (
        f"{least.within} of {least.people} people are within the margin{least.noise_note}. In the population, at least "
        f"{share_text(100.0 * least.least_within)} are within it and at most {share_text(100.0 * far)} beyond "
        f"{rule.far_margins:g} margins, each with {100.0 * (1.0 - rule.alpha):g} % confidence."
    )


LOSS_DOUBTS = (LEFT_OUT_DOUBT, LOST_MOVEMENTS_DOUBT, UNEVEN_LOSSES_DOUBT, LOST_PEOPLE_DOUBT)
"""Doubts about movements or people that gave no value."""

DOUBT_REMEDIES = {
    PERIOD_DOUBT: "Have as many people begin with the robot as without it.",
    LEARNING_DOUBT: "Let people get used to it until movements no longer change.",
    LEFT_OUT_DOUBT: "Find out why targets have no movement.",
    LOST_MOVEMENTS_DOUBT: "Find out why movements were excluded, and repeat the sessions.",
    UNEVEN_LOSSES_DOUBT: "Find out why more movements of one condition were excluded, and repeat the sessions.",
    LOST_PEOPLE_DOUBT: "Find out why people are missing, and repeat their sessions.",
}
"""Advice by doubt."""


def _what_was_tested(each: Certified) -> str:
    """State the tested quantity, and the assumption under which "transparent" errs in at most alpha of studies."""
    what = f"the {TEST_NAMES[each.test].partition(',')[0]}" + (" and the mean curve" if each.certificate.curves else "")
    kinds = (each.test, *(["curve"] if each.certificate.curves else []))
    assumed = " and ".join(TEST_ASSUMPTIONS[kind] for kind in kinds)
    level = f"{100.0 * each.certificate.alpha:.3g} %"
    said = (
        f"The test is of {what}: if it were beyond its margin, at most {level} of studies would claim otherwise, "
        f"provided that {assumed}."
    )
    if each.test == "signed_rank":
        return f"{said} The pseudo-median is not the mean, which may lie beyond its margin if changes are skewed."
    hidden = 100.0 * (1.0 - HIDDEN_SHARE) ** each.participants
    if hidden < 0.1:
        return said
    return f"{said} A group of 20 % of people is absent from {hidden:.2g} % of studies of {each.participants} people."


def _lost_people_counts(each: Certified) -> str:
    """Name the participants who take no part, more than the study allows."""
    total = each.participants + len(each.lost_people)
    return (
        f"{len(each.lost_people)} of {total} participants are excluded ({', '.join(each.lost_people)}), more than the "
        f"{100.0 * each.max_left_out:g} % that max_left_out allows."
    )


def _lost_counts(each: Certified) -> str:
    """State the conditions that lost more movements than the study allows, with their counts."""
    counts_text = _counted(too_many_lost(_most_lost(each), each.max_left_out))
    return f"{counts_text} were excluded, more than the {100.0 * each.max_left_out:g} % that max_left_out allows."


def _lost(each: Certified) -> list[str]:
    lost = {condition: counts for condition, counts in _most_lost(each).items() if counts[0]}
    return [f"{each.condition}: {_counted(lost)} were excluded; their values are unknown."] if lost else []


def _most_lost(each: Certified) -> dict[str, tuple[int, int]]:
    """Return the counts of the end point that lost most movements, by condition."""
    most: dict[str, tuple[int, int]] = {}
    for lost in each.lost.values():
        for condition, counts in lost.items():
            most[condition] = max(most.get(condition, (0, 0)), counts)
    return most


def _counted(lost: Mapping[str, tuple[int, int]]) -> str:
    return " and ".join(f"{gone} of {of} movements in {condition}" for condition, (gone, of) in lost.items())


def _remedy(kinds: set[str]) -> str:
    return " ".join(text for kind, text in DOUBT_REMEDIES.items() if kind in kinds)


def _disagreeing(each: Certified) -> list[str]:
    primary = each.certificate.end_points
    apart = [
        f"{each.end_points[n].index.short} is {own.verdict} by the {TEST_NAMES[test]} and {primary[n].verdict} by the "
        f"{TEST_NAMES[each.test]}"
        for test, results in each.beside.items()
        for n, own in results.items()
        if not (test == "mixed_model" and each.models[n].trouble) and own.verdict != primary[n].verdict
    ]
    if not apart:
        return []
    return [f"{each.condition}: sensitivity analyses disagree: {'; '.join(apart)}. The verdict rests on the latter."]


def _without_model(each: Certified) -> list[str]:
    return [
        f"{each.condition}: the mixed model of {each.end_points[n].index.short} has no answer: {model.trouble}."
        for n, model in each.models.items()
        if model.trouble and model.movements
    ]


def _cut(each: Certified) -> list[str]:
    return [
        f"{each.condition}: only a bound of {point.index.short} is known for {own.bounded} of {own.pairs} people, "
        "because movements were cut off before they settled. The test assumes the worst possible values."
        for n, point in each.end_points.items()
        if (own := each.certificate.end_points[n]).bounded
    ]


def _failed(each: Certified) -> list[str]:
    if not any(count for count, _ in each.failed.values()):
        return []
    counts_text = ", ".join(f"{count} of {of} in {condition}" for condition, (count, of) in each.failed.items())
    return [
        f"{each.condition}: targets without a movement: {counts_text}. Median durations are tested again with these "
        "counted as longer than all others; other indices have no value for them."
    ]


def certificate_verdicts(found: AssessmentResult) -> tuple[Verdict, ...]:
    """Return the sentences as verdicts; failures become warnings."""
    kinds = ("warning" if each.certificate.verdict == FAIL else "note" for each in found.certified)
    said = tuple(Verdict(kind, said) for kind, said in zip(kinds, certificate_sentences(found), strict=True))
    return said + tuple(Verdict("note", text) for text in certificate_remarks(found))


def certificate_rows(found: AssessmentResult, digest: str | None) -> tuple[ResultRow, ...]:
    """Return the rows ``<study>.certificate.<condition>.…``: 1 transparent, 0 not, 0.5 undecided; then end points."""
    rows = []
    for each in found.certified:
        head, own = f"{found.study}.certificate.{each.condition.lower()}", each.certificate

        def add(name: str, value: float | None, unit: str, note: str = "", head=head) -> None:
            known = value if value is not None and np.isfinite(value) else None
            rows.append(ResultRow(f"{head}.{name}", known, unit, "assess", "fitted", digest, note))

        add("transparent", {PASS: 1.0, FAIL: 0.0}.get(own.verdict, 0.5), "1", own.statement)
        if found.is_registered:
            add("post_hoc", float(bool(own.post_hoc)), "1", "; ".join(own.post_hoc) or "as registered")
        add("p", own.p_value, "1", f"that all end points lie within: {TEST_NAMES[each.test]}")
        add("participants", each.participants, "1")
        add("needed", each.needed, "1", "for 90 %, if nothing changes; none: more than 128")
        for name, point in each.end_points.items():
            part = own.end_points[name]
            level = f"{interval_level(own.alpha)} interval"
            _test_rows(name, point, part, add, TEST_NAMES[each.test], level, f"margin {point.stated}")
            add(f"{name}.p_beyond", own.beyond[name], "1", "after Holm")
            add(f"{name}.p_far", own.far.get(name), "1", "more people far beyond than 5 %, after Holm")
            shares = part.share_test(own.rule)
            add(f"{name}.people_within", shares.within, "1", f"of {shares.people}: {shares.answer}")
            bound = f"bound at {100.0 * (1.0 - own.rule.alpha):.4g} % confidence"
            add(f"{name}.share_within", 100.0 * shares.least_within, "%", f"lower {bound}")
            add(f"{name}.noise_share", 100.0 * shares.noise_share, "%", "of the variance of changes: single movements")
            add(f"{name}.share_far", 100.0 * shares.most_far, "%", f"upper {bound}")
            if part.sessions is not None:
                add(f"{name}.largest_carry_over", part.largest_carry_over, "1", "assumed, in margins")
                add(f"{name}.tipping_point", own.tipping_point(name), "1", "carry-over that overturns it, in margins")
            for rank, row in enumerate(part.far_people, start=1):
                add(f"{name}.far.{rank}", point.shown(part.differences[row]), point.unit, _person(each, row))
            factor, most = part.bayes_factor, MAX_BAYES_FACTOR
            more = "; at least this" if factor >= most else "; at most this" if factor <= 1.0 / most else ""
            add(f"{name}.bayes_factor", factor, "1", f"of within against beyond{more}")
            for condition, (gone, of) in each.lost[name].items():
                share = 100.0 * gone / of if of else 0.0
                add(f"{name}.left_out.{condition.lower()}", share, "%", f"{gone} of {of} movements")
            _more_rows(each, name, point, add)
        for curve in each.curves:
            _curve_rows(curve, add)
    return tuple(rows)


def _test_rows(
    head: str, point: EndPoint, test: Equivalence, add, note: str, level: str = "", margin: str = ""
) -> None:
    """Add the rows of one test of an end point: its change, the interval's ends, and p; each with its note."""
    add(f"{head}.change", point.shown(test.estimate), point.unit, note)
    add(f"{head}.low", point.shown(test.interval[0]), point.unit, level)
    add(f"{head}.high", point.shown(test.interval[1]), point.unit)
    add(f"{head}.p_within", test.p_within, "1", margin)


def _more_rows(each: Certified, name: str, point: EndPoint, add) -> None:
    model = each.models[name]
    for test, results in each.beside.items():
        other = results.get(name)
        if other is not None and not (test == "mixed_model" and model.trouble):
            _test_rows(f"{name}.{test}", point, other, add, f"sensitivity analysis: {TEST_NAMES[test]}")
    if model.movements:
        spread = _scaled(point, model.spread)
        add(f"{name}.model.spread", spread, point.unit, model.trouble or "of people's changes")
    for covariate, coefficient in model.covariates.items():
        if covariate in ("trial", "trial x condition", "period"):
            add(f"{name}.model.{covariate.replace(' x ', '_by_')}.p", coefficient.p_value, "1", "mixed model")
    if name in each.trends:
        drift = _scaled(point, each.trends[name][0])
        add(f"{name}.learning.drift", drift, point.unit, "last third less first, condition less control, median")
    for doubt in each.certificate.doubts.get(name, ()):
        key = doubt.what.replace("-", "_").replace(" ", "_")
        add(f"{name}.{key}.p", doubt.p_value, "1", "" if np.isfinite(doubt.p_value) else "not of chance")
        change = point.shown(doubt.without.estimate)
        add(f"{name}.{key}.change_without", change, point.unit, doubt.without.verdict)
        add(f"{name}.{key}.p_within_without", doubt.without.p_within, "1")


def _curve_rows(curve: CurveEndPoint, add) -> None:
    own, head = curve.comparison, f"curve.{curve.quantity}"
    value, percent = curve.furthest
    add(f"{head}.furthest", value, curve.unit, f"at {percent} %")
    add(f"{head}.cluster_p", min((c.p_value for c in own.clusters), default=1.0), "1", "signs of curves")
    if curve.stated:
        add(f"{head}.p_within", own.p_within, "1", f"all along, margin {curve.stated}")
        add(f"{head}.p_beyond", own.p_beyond, "1", "somewhere")
