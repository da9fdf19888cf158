"""An assessment's figures as the tables that a paper would print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..identification.findings import FigureTable
from .indices import INDICES, NEGATIVE

if TYPE_CHECKING:
    from .assessment_findings import Assessed, AssessmentFindings

MINUS = "\N{MINUS SIGN}"
UNITS = {"rad/s": "rad/s", "rad/s^2": "rad/s²", "N*m": "N·m", "1": ""}


SHOWN = ("duration", "vmax", "emg_level", "emgacc", "torque_rms")
"""Indices with a table of their own among an assessment's tables; a report has one for each."""


def tables(found: AssessmentFindings) -> tuple[FigureTable, ...]:
    """Tables of an assessment: a summary, the main indices, pairs, isochrony, other filters, participants needed.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    tuple of FigureTable
    """
    made = [summary_table(found)]
    made += [description_table(found, found.assessed[name]) for name in SHOWN if name in found.assessed]
    made.insert(1, test_table(found))
    if any(each.comparison.nemenyi is not None for each in found.assessed.values()):
        made.append(pair_table(found))
    if found.isochrony:
        made.append(isochrony_table(found))
    if found.sensitivity:
        made.append(sensitivity_table(found))
    if found.needed:
        made.append(needed_table(found))
    return tuple(made)


def summary_table(found: AssessmentFindings) -> FigureTable:
    """Every index: mean ± SD in each condition, with an asterisk where Nemenyi's test tells it from control.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    FigureTable
    """
    rows = []
    for each in found.assessed.values():
        rows.append((_words(each, short=True), *(_mean_cell(found, each, condition) for condition in found.conditions)))
    n = len(found.participants)
    title = f"Mean ± SD over {n} participant{'s' if n != 1 else ''}; * differs from {found.control} (Nemenyi)"
    return FigureTable(title, ("Index", *found.conditions), tuple(rows))


def _mean_cell(found: AssessmentFindings, each: Assessed, condition: str) -> str | None:
    if condition not in each.table.conditions:
        return None
    column = each.table.column(condition)
    # Three digits of a mean are what a reader compares; its SD has as many decimals.
    mean = float(column.mean())
    decimals = min(max(2 - int(f"{mean:.2e}".split("e")[1]), 0), 3) if mean else 3
    shown = _fixed(mean, decimals)
    if len(column) > 1:
        shown += f"±{_fixed(float(np.std(column, ddof=1)), decimals)}"
    known = found.control in each.table.conditions and condition != found.control
    differs = known and each.comparison.pair(found.control, condition) < 1.0 - found.confidence
    return shown + ("*" if differs else "")


def _words(each: Assessed, *, short: bool = False) -> str:
    index = each.table.index
    unit = UNITS.get(index.unit, index.unit)
    return (index.short if short else index.words) + (f" ({unit})" if unit else "")


def _p(p: float | None) -> str | None:
    if p is None or np.isnan(p):
        return None
    return "<0.001" if p < 1e-3 else f"{p:.3f}"


def test_table(found: AssessmentFindings) -> FigureTable:
    """Friedman's test of every index.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    FigureTable
    """
    rows = []
    for each in found.assessed.values():
        test = each.comparison.friedman
        if test is not None:
            kendall = each.comparison.kendall
            told = test.degrees_of_freedom, _p(test.p_value), _p(test.exact_p_value), kendall
            rows.append((each.table.index.short, test.statistic, *told))
    heads = ("Index", "χ²", "df", "p", "p counted", "Kendall W")
    return FigureTable("Do conditions differ at all (Friedman)", heads, tuple(rows))


def needed_table(found: AssessmentFindings) -> FigureTable:
    """Participants needed to find changes from control.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    FigureTable
    """
    rows = tuple(
        (INDICES[each.index].words, f"{100 * each.change:g} %", each.participants or "more than 96")
        for each in found.needed
    )
    heads = ("Index", "Change", "Participants")
    return FigureTable("Participants who would show a change in 8 of 10 studies", heads, rows)


def description_table(found: AssessmentFindings, each: Assessed) -> FigureTable:
    """One index: what describes it in each condition, and how it changes from control.

    Parameters
    ----------
    found : AssessmentFindings
    each : Assessed

    Returns
    -------
    FigureTable
    """
    index = each.table.index
    against = {a.condition: a for a in each.comparison.against_control}
    percent = index.name not in NEGATIVE
    decimals = _decimals(each.table.values)
    rows = []
    for condition in each.table.conditions:
        column = each.table.column(condition)
        sd = float(np.std(column, ddof=1)) if len(column) > 1 else None
        row: list = [column.mean(), sd, column.min(), np.median(column), column.max()]
        row = [None if x is None else _fixed(float(x), decimals) for x in row]
        own = against.get(condition)
        if own is not None:
            scale = 100.0 / float(each.table.column(found.control).mean()) if percent else 1.0
            row += [_short(scale * own.change), _range(scale, own.interval), _p(own.holm)]
        elif against:
            row += [None, None, None]
        rows.append((condition, *row))
    heads = ("", "Mean", "SD", "Min", "Median", "Max")
    if against:
        heads += ("Δ %" if percent else "Δ", f"{100 * found.confidence:g} %", "p")
    return FigureTable(_words(each), heads, tuple(rows))


def effect_table(found: AssessmentFindings) -> FigureTable:
    """How much every index changes from control: the change, its interval, effect sizes, p alone and corrected.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    FigureTable
    """
    rows = []
    for each in found.assessed.values():
        for a in each.comparison.against_control:
            sizes = a.standardised, a.rank_biserial, a.cliff
            told = _short(a.change), _range(1.0, a.interval), *sizes, _p(a.p_value), _p(a.holm)
            rows.append((_words(each, short=True), a.condition, *told))
    level = f"{100 * found.confidence:g} %"
    heads = ("Index", "", "Change", level, "d of pairs", "Rank-biserial", "Cliff's δ", "p", "p (Holm)")
    return FigureTable(f"Changes from {found.control}", heads, tuple(rows))


def _decimals(values: np.ndarray) -> int:
    """As many decimals as two digits of the largest standard deviation need, and one more; at most four."""
    sd = float(np.std(values, axis=0, ddof=1).max()) if len(values) > 1 else 0.0
    return min(max(2 - int(f"{sd:.1e}".split("e")[1]), 0), 4) if sd > 0.0 else 3


def _fixed(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}".replace("-", MINUS)


def _range(scale: float, interval: tuple[float, float]) -> str | None:
    low, high = (scale * end for end in interval)
    return None if np.isnan(low) else f"{_short(low, 2)} to {_short(high, 2)}"


def _short(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}g}".replace("-", MINUS)


def pair_table(found: AssessmentFindings, names: Sequence[str] = SHOWN) -> FigureTable:
    """Nemenyi's p of every pair of conditions.

    Parameters
    ----------
    found : AssessmentFindings
    names : sequence of str
        Indices.

    Returns
    -------
    FigureTable
    """
    tested = [found.assessed[name] for name in names if name in found.assessed]
    tested = [each for each in tested if each.comparison.nemenyi is not None]
    rows = []
    for i, one in enumerate(found.conditions):
        for other in found.conditions[i + 1 :]:
            has = [{one, other} <= set(each.table.conditions) for each in tested]
            cells = (_p(e.comparison.pair(one, other)) if h else None for e, h in zip(tested, has, strict=True))
            rows.append((f"{one}, {other}", *cells))
    heads = ("", *(each.table.index.short for each in tested))
    return FigureTable("Which conditions differ (Nemenyi's p)", heads, tuple(rows))


def isochrony_table(found: AssessmentFindings) -> FigureTable:
    """Straight lines of mean velocity over amplitude.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    FigureTable
    """
    rows = []
    for line in found.isochrony:
        r2 = np.array(line.velocity_r2)
        sd = float(np.std(r2, ddof=1)) if len(r2) > 1 else None
        described = float(r2.mean()), sd, float(r2.min()), float(np.median(r2)), float(r2.max())
        rows.append((line.condition, line.direction, *described, line.velocity_slope, line.velocity_intercept))
    heads = ("", "", "R²", "SD", "Min", "Median", "Max", "Slope", "Offset")
    title = "Isochrony: mean velocity (rad/s) = slope (1/s) × amplitude + offset; R² of each participant"
    return FigureTable(title, heads, tuple(rows))


def sensitivity_table(found: AssessmentFindings) -> FigureTable:
    """Changes from control by other filters and other ends of movements.

    Parameters
    ----------
    found : AssessmentFindings

    Returns
    -------
    FigureTable
    """
    conditions = found.conditions[1:]
    cells = {(s.words, s.index, s.condition): s for s in found.sensitivity}
    rows = []
    for words, index in dict.fromkeys((s.words, s.index) for s in found.sensitivity):
        own = [cells.get((words, index, condition)) for condition in conditions]
        first = next(s for s in own if s is not None)
        base = None if np.isnan(first.control) else first.control
        changes = (None if s is None else 100.0 * s.change for s in own)
        rows.append((INDICES[index].short, words, base, *changes, _p(first.p_value)))
    heads = ("Index", "Rule", found.control, *(f"{condition} %" for condition in conditions), "p")
    return FigureTable("What other filters and ends would say", heads, tuple(rows))
