"""An assessment's figures as the tables that a paper would print, and as rows of results.json."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from ...study.pages.quantities import MINUS_SIGN
from ...study.procedures.result import FigureTable
from ...study.results import ResultRow, combined_checksum
from ..certificate_text import change_figure
from ..equivalence import BEYOND_MARGIN, UNDECIDED, WITHIN_MARGIN
from ..indices import PERCENTAGE_POINTS, index_names
from ..power import CANDIDATE_SIZES
from .certified_rows import beside_table, certificate_rows, certificate_table, curve_table, doubt_table
from .primary_change import ESTIMAND_WORDS, PrimaryChange, primary_change

if TYPE_CHECKING:
    from .assessment_result import Assessed, AssessmentResult, Needed, Sensitivity

RANK_TEST_WORDS = {True: "ranks differ", False: "not in ranks"}
"""What a test of ranks says where the interval of the change does not agree, by whether the test finds a difference."""

COMMAND_NAME = "assess"
"""Name of the command that writes these results."""


def result_rows(found: AssessmentResult) -> tuple[ResultRow, ...]:
    """Return the result rows of an assessment.

    ``<study>.transparency.<index>.<condition>`` is the primary change from control in % (SPARC, LDLJ and the signed
    end-point error: in their own unit; interaction: the mean itself); ``<study>.assess.<index>.<condition>.<what>`` the
    rest, with other estimates of the change as sensitivity analyses.
    """
    # All recordings share one checksum, because every value comes from all of them.
    digest = combined_checksum(found.checksums.values())
    rows: list[ResultRow] = []

    def add(name: str, value: float | None, unit: str, note: str = "") -> None:
        rows.append(ResultRow(f"{found.study}.{name}", value, unit, COMMAND_NAME, "fitted", digest, note))

    add("assess.participants", len(found.participants), "1", _without(found))
    add(
        "assess.movements", found.movements, "1", ", ".join(f"{n} excluded: {why}" for why, n in found.left_out.items())
    )
    for each in found.assessed.values():
        _index_rows(found, each, add)
    for each in found.settling:
        head = f"assess.settling.{each.condition.lower()}"
        note = "Kaplan and Meier, all participants together"
        add(f"{head}.median", each.curve.median, "s", note)
        add(f"{head}.never", 100.0 * each.curve.cut, "%", "not at rest when the next target came")
    for line in found.isochrony:
        head = f"assess.isochrony.{line.condition.lower()}.{line.direction}"
        for what, r2 in (("velocity", line.velocity_r2), ("duration", line.duration_r2)):
            for name, value in _describe(np.array(r2)).items():
                add(f"{head}.{what}.r2.{name}", value, "1", "each participant's own line")
        add(f"{head}.velocity.slope", line.velocity_slope, "1/s", "mean velocity over amplitude, means of participants")
        add(f"{head}.velocity.intercept", line.velocity_intercept, f"{found.unit}/s")
        add(
            f"{head}.duration.slope",
            line.duration_slope,
            f"s/{found.unit}",
            "duration over amplitude, means of participants",
        )
        add(f"{head}.duration.intercept", line.duration_intercept, "s")
    for s in found.sensitivity:
        rule = re.sub(r"[^a-z0-9]+", "_", s.words.replace(" Hz", "hz").replace("%", "percent").lower())
        change = 100.0 * s.change if np.isfinite(s.change) else None
        add(f"assess.sensitivity.{rule}.{s.index}.{s.condition.lower()}", change, "%", s.words)
    for condition, people in found.needed_as_seen.items():
        note = "Friedman's and Nemenyi's tests, power 0.8, if the change is as seen"
        note += "" if people else "; more than were tried"
        add(f"assess.needed_as_seen.{condition.lower()}", people, "1", note)
    for each in found.needed:
        note = f"signed ranks against control, power 0.8, d of pairs {each.effect:.3g}"
        note += "" if each.participants else "; more than were tried"
        what = f"d_{each.effect:g}" if each.change is None else f"{each.index}.{100 * each.change:g}_percent"
        add(f"assess.needed.{what.replace('.', '_') if each.change is None else what}", each.participants, "1", note)
    return (*rows, *certificate_rows(found, digest))


def _index_rows(found: AssessmentResult, each: Assessed, add) -> None:
    index, compared = each.table.index, each.comparison
    against = {a.condition: a for a in compared.against_control}
    for condition in each.table.conditions:
        low = condition.lower()
        column = each.table.column(condition)
        for name, value in _describe(column).items():
            add(f"assess.{index.name}.{low}.{name}", value, index.unit)
        headline = f"transparency.{index.name}.{low}"
        own = against.get(condition)
        change = primary_change(found, index.name, condition)
        if change is not None:
            value = change.value if np.isfinite(change.value) else None
            least = "at least; " if change.at_least else ""
            add(headline, value, change.unit or "1", least + ESTIMAND_WORDS[found.estimand])
        elif condition != found.control:
            add(headline, float(column.mean()), index.unit, "mean of participants; control has none")
        if own is not None:
            head = f"assess.{index.name}.{low}"
            add(f"{head}.change", own.change, index.unit, "sensitivity analysis: difference of means")
            if own.relative is not None and index.scaled:
                add(f"{head}.change_of_mean", 100.0 * own.relative, "%", "sensitivity analysis: difference of means")
            add(f"{head}.change.low", own.interval[0], index.unit, "bootstrap over participants")
            add(f"{head}.change.high", own.interval[1], index.unit, "bootstrap over participants")
            add(f"{head}.p", own.p_value, "1", "signed ranks, counted")
            add(f"{head}.p_holm", own.holm, "1")
            add(f"{head}.rank_biserial", own.rank_biserial, "1")
            add(f"{head}.cliff", own.cliff, "1")
            add(f"{head}.dz", own.standardised, "1")
    if compared.friedman is not None:
        add(f"assess.{index.name}.friedman.chi2", compared.friedman.statistic, "1")
        add(f"assess.{index.name}.friedman.p", compared.friedman.p_value, "1", "chi-squared")
        add(f"assess.{index.name}.friedman.p_exact", compared.friedman.exact_p_value, "1", "counted")
        add(f"assess.{index.name}.kendall_w", compared.kendall, "1")
        for i, one in enumerate(compared.conditions):
            for other in compared.conditions[i + 1 :]:
                add(f"assess.{index.name}.nemenyi.{one.lower()}_{other.lower()}", compared.pair(one, other), "1")


def _describe(column: np.ndarray) -> dict[str, float]:
    """Return mean, standard deviation (n - 1), minimum, median and maximum."""
    return {
        "mean": float(np.mean(column)),
        "sd": float(np.std(column, ddof=1)) if len(column) > 1 else float("nan"),
        "min": float(np.min(column)),
        "median": float(np.median(column)),
        "max": float(np.max(column)),
    }


def _without(found: AssessmentResult) -> str:
    return "; ".join(f"{person} excluded: {why}" for person, why in found.without.items())


PRINTED_UNITS = {"rad/s^2": "rad/s²", "m/s^2": "m/s²", "N*m": "N·m", "1": ""}
"""Printed form of units that differ from their plain text."""


def tables(found: AssessmentResult) -> tuple[FigureTable, ...]:
    """Tables of an assessment, the answer first: certificate, changes, means, tests, and the rest."""
    certificate, changes = certificate_tables(found), change_table(found)
    tested = any(each.comparison.nemenyi is not None for each in found.assessed.values())
    made = [*certificate[:1], *([changes] if changes.rows else []), *certificate[1:], summary_table(found)]
    made += [test_table(found)] if tested else []
    if found.settling:
        made.append(settling_table(found))
    made += [description_table(found, each) for each in found.assessed.values() if each.table.index.has_table]
    made += [pair_table(found)] if tested else []
    if found.isochrony:
        made.append(isochrony_table(found))
    if found.sensitivity:
        made.append(range_table(found))
    made += [table for table in (needed_table(found), effect_size_table(found)) if table.rows]
    return tuple(made)


def certificate_tables(found: AssessmentResult) -> list[FigureTable]:
    """The certificate, the other test, what else could have changed it, and curves; none without margins."""
    if not found.certified:
        return []
    made = (each(found) for each in (certificate_table, beside_table, doubt_table, curve_table))
    return [table for table in made if table.rows]


def change_table(found: AssessmentResult) -> FigureTable:
    """How the indices of the paragraph change from control in each condition, and what their test says.

    Of an index with a margin that is the certificate's test; of others it is whether the condition differs from control
    (`Assessed.differs`).
    """
    rows = []
    for name in index_names(lambda index: index.paragraph_place):
        each = found.assessed.get(name)
        if each is None:
            continue
        for own in each.comparison.against_control:
            change = primary_change(found, name, own.condition)
            if change is None or not np.isfinite(change.value):
                continue
            interval = f" ({change.interval})" if change.interval else ""
            cell = f"{change.figure}{interval} {change.unit}".rstrip().replace("-", MINUS_SIGN)
            rows.append((each.table.index.short, own.condition, cell, _test_text(found, each, change, own.condition)))
    level = f"{100 * found.confidence:g} % interval"
    title = f"Changes from {found.control}: {ESTIMAND_WORDS[found.estimand]} ({level})"
    if any(row[-1] in RANK_TEST_WORDS.values() for row in rows):
        title += "; tests compare ranks, which may differ where the interval includes no change, or the reverse"
    return FigureTable(title, ("Index", "Condition", "Change", "Test result"), tuple(rows))


def _test_text(found: AssessmentResult, each: Assessed, change: PrimaryChange, condition: str) -> str | None:
    """Say what the test of an index says of a condition: the certificate's, or whether it differs from control.

    A test of ranks that the interval of the change does not agree with is named.
    """
    said = found.said_of(each.name, condition)
    if said is not None:
        return {WITHIN_MARGIN: "within margin", BEYOND_MARGIN: "beyond margin", UNDECIDED: "undecided"}[said]
    differs = each.differs(condition, found.control, 1.0 - found.confidence)
    if differs is None:
        return None
    if change.excludes_zero is not None and change.excludes_zero != differs:
        return RANK_TEST_WORDS[differs]
    return "differs" if differs else "not shown"


def summary_table(found: AssessmentResult) -> FigureTable:
    """Every index: mean ± SD in each condition, with an asterisk where it differs from control."""
    rows = []
    for each in found.assessed.values():
        decimals = _row_decimals(each)
        cells = (_mean_cell(found, each, condition, decimals) for condition in found.conditions)
        rows.append((words(each, short=True), *cells))
    n = len(found.participants)
    marked = f"* differs from {found.control} (Friedman and Nemenyi)"
    title = f"Mean ± standard deviation over {n} participants; {marked}" if n > 1 else "One participant"
    return FigureTable(title, ("Index", *found.conditions), tuple(rows))


def _mean_cell(found: AssessmentResult, each: Assessed, condition: str, decimals: int) -> str | None:
    if condition not in each.table.conditions:
        return None
    column = each.table.index.shown[0] * each.table.column(condition)
    shown = _fixed(float(column.mean()), decimals)
    if len(column) > 1:
        shown += f"±{_fixed(float(np.std(column, ddof=1)), decimals)}"
    differs = each.differs(condition, found.control, 1.0 - found.confidence)
    return shown + ("*" if differs else "")


def _row_decimals(each: Assessed) -> int:
    """Three digits of the largest mean, or standard deviation, are what a reader compares along a row."""
    values = each.table.index.shown[0] * each.table.values
    largest = np.abs(values.mean(axis=0)).max()
    if len(values) > 1:
        largest = max(largest, values.std(axis=0, ddof=1).max())
    return min(max(2 - int(f"{largest:.2e}".split("e")[1]), 0), 3) if largest > 0.0 else 3


def words(each: Assessed, unit: str | None = None, *, short: bool = False) -> str:
    """An index with a unit, which is its own unless it is given, as tables call it."""
    index = each.table.index
    unit = index.shown[1] if unit is None else unit
    unit = PRINTED_UNITS.get(unit, unit)
    return (index.short if short else index.words) + (f" ({unit})" if unit else "")


def p_text(p: float | None) -> str | None:
    """A p value as tables print it."""
    if p is None or np.isnan(p):
        return None
    return "<0.001" if p < 1e-3 else f"{p:.3f}"


def test_table(found: AssessmentResult) -> FigureTable:
    """Friedman's test of every index."""
    rows = []
    for each in found.assessed.values():
        test = each.comparison.friedman
        if test is not None:
            kendall = each.comparison.kendall
            test_cells = test.degrees_of_freedom, p_text(test.p_value), p_text(test.exact_p_value), kendall
            rows.append((each.table.index.short, test.statistic, *test_cells))
    heads = ("Index", "χ²", "Degrees of freedom", "p", "Exact p", "Kendall's W")
    return FigureTable("Do conditions differ at all (Friedman)", heads, tuple(rows))


def needed_table(found: AssessmentResult) -> FigureTable:
    """Participants needed to find changes from control, by index."""
    changes = sorted({each.change for each in found.needed if each.change is not None})
    cells = {(each.index, each.change): each for each in found.needed}
    rows = []
    for name in dict.fromkeys(each.index for each in found.needed if each.index):
        # What people differ by is the same behind every change.
        spread = 100.0 * changes[0] / cells[name, changes[0]].effect
        rows.append((found.indices[name].short, _short(spread), *(_people(cells[name, change]) for change in changes)))
    heads = ("Index", "Standard deviation of changes %", *(f"{100 * change:g} %" for change in changes))
    return FigureTable(
        f"Participants who would show a change from {found.control} in 8 of 10 studies", heads, tuple(rows)
    )


def effect_size_table(found: AssessmentResult) -> FigureTable:
    """Participants needed against effect size, whatever the index."""
    generic = [each for each in found.needed if each.change is None]
    m = len(found.conditions) - 1
    title = (
        f"Participants needed against effect size: signed ranks, {m} comparison{'s' if m != 1 else ''} with "
        f"{found.control}, power 0.8"
    )
    row = ("Participants", *(_people(each) for each in generic))
    heads = ("Cohen's d of pairs", *(f"{each.effect:g}" for each in generic))
    return FigureTable(title, heads, (row,) if generic else ())


def people_words(needed: int | None) -> str:
    """Return a number of participants needed in words."""
    return f"more than {CANDIDATE_SIZES[-1]}" if needed is None else f"about {needed}"


def _people(needed: Needed) -> str | int:
    return f">{CANDIDATE_SIZES[-1]}" if needed.participants is None else needed.participants


def description_table(found: AssessmentResult, each: Assessed) -> FigureTable:
    """One index: what describes it in each condition, and how it changes from control."""
    index = each.table.index
    against = {a.condition: a for a in each.comparison.against_control}
    changes = {c: primary_change(found, index.name, c) for c in against}
    factor = index.shown[0]
    decimals = _decimals(factor * each.table.values)
    rows = []
    for condition in each.table.conditions:
        column = factor * each.table.column(condition)
        sd = float(np.std(column, ddof=1)) if len(column) > 1 else None
        row: list = [column.mean(), sd, column.min(), np.median(column), column.max()]
        row = [None if x is None else _fixed(float(x), decimals) for x in row]
        own = against.get(condition)
        if own is not None:
            change = changes[condition]
            known = change is not None and np.isfinite(change.value)
            value = change_figure(change.value, change.unit) if known else None
            row += [text.replace("-", MINUS_SIGN) if text else None for text in (value, known and change.interval)]
            row.append(p_text(own.holm))
        elif against:
            row += [None, None, None]
        rows.append((condition, *row))
    heads = ("", "Mean", "Standard deviation", "Smallest", "Median", "Largest")
    if against:
        unit = next((c.unit for c in changes.values() if c is not None and c.unit in ("%", PERCENTAGE_POINTS)), "")
        heads += (f"Change {unit}".rstrip(), f"{100 * found.confidence:g} % interval", "p")
    return FigureTable(words(each), heads, tuple(rows))


def effect_table(found: AssessmentResult) -> FigureTable:
    """How much every index changes from control: the change, its interval, effect sizes, p alone and corrected."""
    rows = []
    for each in found.assessed.values():
        for a in each.comparison.against_control:
            sizes = a.standardised, a.rank_biserial, a.cliff
            factor = each.table.index.shown[0]
            effect_cells = (
                _short(factor * a.change),
                _range(factor, a.interval),
                *sizes,
                p_text(a.p_value),
                p_text(a.holm),
            )
            rows.append((words(each, each.table.index.change_unit, short=True), a.condition, *effect_cells))
    level = f"{100 * found.confidence:g} % interval"
    heads = ("Index", "", "Change", level, "Cohen's d of pairs", "Rank-biserial", "Cliff's δ", "p", "p (Holm)")
    return FigureTable(f"Sensitivity: differences of means from {found.control}", heads, tuple(rows))


def settling_table(found: AssessmentResult) -> FigureTable:
    """How long movements of all participants together last: quartiles, and the share that never settled."""
    rows = []
    for each in found.settling:
        curve = each.curve
        at = [curve.time[curve.share <= 1.0 - share + 1e-12] for share in (0.25, 0.5, 0.75)]
        cells = (_fixed(float(t[0]), 3) if len(t) else f">{_fixed(curve.longest, 1)}" for t in at)
        rows.append((each.condition, *cells, _fixed(100.0 * curve.cut, 1)))
    heads = ("", "A quarter (s)", "Half (s)", "Three quarters (s)", "Never settled %")
    return FigureTable("When so many movements had ended (Kaplan and Meier)", heads, tuple(rows))


def _decimals(values: np.ndarray) -> int:
    """Return the number of decimals: two digits of the largest standard deviation and one more, at most 3 or 4."""
    sd = float(np.std(values, axis=0, ddof=1).max()) if len(values) > 1 else 0.0
    most = 3 if np.abs(values).max() >= 0.05 else 4
    return min(max(2 - int(f"{sd:.1e}".split("e")[1]), 0), most) if sd > 0.0 else 3


def _fixed(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}".replace("-", MINUS_SIGN)


def _range(scale: float, interval: tuple[float, float]) -> str | None:
    low, high = (scale * end for end in interval)
    if np.isnan(low):
        return None
    largest = max(abs(low), abs(high))
    digits = 2 if largest >= 10.0 else 1
    decimals = min(max(digits - int(f"{largest:.1e}".split("e")[1]), 0), 5) if largest > 0.0 else 0
    # A reader needs to see on which side of 0 an end lies, so no end but 0 itself is rounded to 0.
    while decimals < 5 and any(end != 0.0 and round(end, decimals) == 0.0 for end in (low, high)):
        decimals += 1
    return f"{_fixed(low, decimals)} to {_fixed(high, decimals)}"


def _short(value: float, digits: int = 3) -> str:
    text = f"{value:.0f}" if abs(value) >= 10.0**digits else f"{value:.{digits}g}"
    return (f"{value:.0f}" if "e+" in text else text).replace("-", MINUS_SIGN)


def pair_table(found: AssessmentResult) -> FigureTable:
    """Nemenyi's p of every pair of conditions; the time of the peak is compared in each direction by itself."""
    pairs = [(one, other) for i, one in enumerate(found.conditions) for other in found.conditions[i + 1 :]]
    rows = []
    for each in found.assessed.values():
        if each.comparison.nemenyi is not None:
            has = ({*pair} <= set(each.table.conditions) for pair in pairs)
            cells = (p_text(each.comparison.pair(*pair)) if h else None for pair, h in zip(pairs, has, strict=True))
            rows.append((each.table.index.short, *cells))
    heads = ("Index", *(f"{one}, {other}" for one, other in pairs))
    return FigureTable("Which conditions differ (Nemenyi's p)", heads, tuple(rows))


def isochrony_table(found: AssessmentResult) -> FigureTable:
    """Straight lines of mean velocity over amplitude."""
    rows = []
    for line in found.isochrony:
        r2 = np.array(line.velocity_r2)
        sd = float(np.std(r2, ddof=1)) if len(r2) > 1 else None
        described = float(r2.mean()), sd, float(r2.min()), float(np.median(r2)), float(r2.max())
        way = line.direction if found.unit == "rad" else found.along.ways[line.direction]
        rows.append((line.condition, way, *described, line.velocity_slope, line.velocity_intercept))
    heads = ("", "", "R²", "Standard deviation", "Smallest", "Median", "Largest", "Slope", "Offset")
    title = f"Isochrony: mean velocity ({found.unit}/s) = slope (1/s) × amplitude + offset; R² of each participant"
    return FigureTable(title, heads, tuple(rows))


def sensitivity_table(found: AssessmentResult) -> FigureTable:
    """Changes from control, and Friedman's p, by other filters, thresholds and ends of movements."""
    rules = tuple(dict.fromkeys(s.words for s in found.sensitivity))
    cells = {(s.words, s.index, s.condition): s for s in found.sensitivity}
    rows: list[tuple] = []
    for index, condition in dict.fromkeys((s.index, s.condition) for s in found.sensitivity):
        own = [cells.get((rule, index, condition)) for rule in rules]
        changes = (None if s is None else _tried_change(s) for s in own)
        rows.append((found.indices[index].short, f"{condition} %", *changes))
        last = [c for i, c in dict.fromkeys((s.index, s.condition) for s in found.sensitivity) if i == index][-1]
        if condition == last:
            rows.append((found.indices[index].short, "p", *(None if s is None else p_text(s.p_value) for s in own)))
    title = f"Change from {found.control} by other filters, thresholds and ends of movements (first column: as chosen)"
    return FigureTable(title, ("Index", "", *rules), tuple(rows))


def _tried_change(tried: Sensitivity) -> str | None:
    """Return the change by one rule in %; None where it is not known."""
    if not np.isfinite(tried.change):
        return None
    return f"{'at least ' if tried.at_least else ''}{_fixed(100.0 * tried.change, 1)}"


def range_table(found: AssessmentResult) -> FigureTable:
    """How far changes from control move with filters, thresholds and ends of movements; `sensitivity_table` has all."""
    rows = []
    for index, condition in dict.fromkeys((s.index, s.condition) for s in found.sensitivity):
        tried = [s for s in found.sensitivity if (s.index, s.condition) == (index, condition)]
        known = sorted((s for s in tried if np.isfinite(s.change)), key=lambda s: s.change)
        if not known:
            continue
        p = [s.p_value for s in tried if np.isfinite(s.p_value)]
        p_cells = (p_text(min(p)), p_text(max(p))) if p else (None, None)
        cells = map(_tried_change, (tried[0], known[0], known[-1]))
        rows.append((found.indices[index].short, condition, *cells, *p_cells))
    title = f"Change from {found.control} (%) as chosen, and over all filters, thresholds and ends tried"
    return FigureTable(title, ("Index", "", "Chosen", "Least", "Most", "p from", "to"), tuple(rows))
