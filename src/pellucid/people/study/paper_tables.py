"""Write an assessment's tables as CSV for a spreadsheet or R, and as LaTeX for a paper."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from ..._atomic import write_text_atomically
from ..._given import csv_cell
from ...study.procedures.latex_table import latex
from ...study.procedures.result import FigureTable
from .assessment_result import AssessmentResult
from .assessment_tables import (
    MINUS_SIGN,
    effect_size_table,
    effect_table,
    isochrony_table,
    needed_table,
    p_text,
    pair_table,
    sensitivity_table,
    summary_table,
)


def write_tables(folder: Path, found: AssessmentResult) -> tuple[Path, ...]:
    """Write every table for a paper as CSV and as LaTeX, and values of participants and movements as CSV."""
    folder.mkdir(parents=True, exist_ok=True)
    named = {
        "indices": paper_table(found),
        "changes": effect_table(found),
        "pairs": pair_table(found),
        "isochrony": isochrony_table(found),
        "filters": sensitivity_table(found),
        "participants_needed": needed_table(found),
        "participants_by_effect": effect_size_table(found),
    }
    texts: dict[str, str] = {}
    for name, table in named.items():
        if table.rows:
            texts[f"{name}.csv"] = csv_text(table.heads, table.rows)
            texts[f"{name}.tex"] = latex(table)
    texts["participants.csv"] = csv_text(*participant_values(found))
    texts["movements.csv"] = csv_text(*movement_values(found))
    for name, text in texts.items():
        write_text_atomically(folder / name, text)
    return tuple(folder / name for name in texts)


def paper_table(found: AssessmentResult) -> FigureTable:
    """The summary with Friedman's test of every index."""
    summary = summary_table(found)
    rows = []
    for row, each in zip(summary.rows, found.assessed.values(), strict=True):
        test = each.comparison.friedman
        test_cells = (None, None, None)
        if test is not None:
            test_cells = f"{test.statistic:.2f}", test.degrees_of_freedom, p_text(each.comparison.p_value)
        rows.append((*row, *test_cells))
    return FigureTable(summary.title, (*summary.heads, "χ²", "df", "p"), tuple(rows))


def participant_values(found: AssessmentResult) -> tuple[tuple[str, ...], list[tuple]]:
    """Every participant's value of every index in every condition, in SI, one a row."""
    rows = [
        (each.name, each.table.index.unit, person, condition, float(value))
        for each in found.assessed.values()
        for person, own in zip(each.table.participants, each.table.values, strict=True)
        for condition, value in zip(each.table.conditions, own, strict=True)
    ]
    return ("index", "unit", "participant", "condition", "value"), rows


def movement_values(found: AssessmentResult) -> tuple[tuple[str, ...], list[tuple]]:
    """Every movement that was used, one a row: whose it is, when, and all its values in SI."""
    names = tuple(dict.fromkeys(name for m in found.measured for name in m.values))
    heads = ("participant", "condition", "recording", "start", f"amplitude_{found.along.shown}", "direction", *names)
    rows = [
        (m.participant, m.condition, m.recording, round(m.movement.start, 4), *m.cell, *map(m.values.get, names))
        for m in found.measured
    ]
    return heads, rows


def csv_text(heads, rows) -> str:
    """A table as comma-separated text: figures as numbers, nothing where there is none."""
    made = io.StringIO()
    writer = csv.writer(made, lineterminator="\n")
    writer.writerow(map(_csv_cell, heads))
    for row in rows:
        writer.writerow([_csv_cell(cell) for cell in row])
    return made.getvalue()


def _csv_cell(cell) -> str:
    if cell is None or (isinstance(cell, float) and np.isnan(cell)):
        return ""
    return f"{cell:.7g}" if isinstance(cell, float) else csv_cell(str(cell).replace(MINUS_SIGN, "-"))
