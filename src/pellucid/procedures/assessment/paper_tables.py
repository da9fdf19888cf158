"""Write an assessment's tables as CSV for a spreadsheet or R, and as LaTeX for a paper."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np

from ..._atomic import write_text_atomically
from ..._given import csv_cell, visible_text
from ..result import FigureTable
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

LATEX_REPLACEMENTS = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", '"': "''", "±": r"$\pm$", MINUS_SIGN: "$-$",
    "χ²": r"$\chi^2$", "²": "$^2$", "·": r"$\cdot$", "δ": r"$\delta$", "Δ": r"$\Delta$", "<": "$<$", ">": "$>$",
    "×": r"$\times$", "–": "--",
}  # fmt: skip
"""Replacements of characters that LaTeX does not accept."""


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


def latex(table: FigureTable) -> str:
    """A table for a paper; it needs the package booktabs."""
    words = [i for i in range(len(table.heads)) if all(_is_words(row[i]) for row in table.rows)]
    columns = "".join("l" if i in words else "r" for i in range(len(table.heads)))
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{_latex(table.title)}}}", rf"\begin{{tabular}}{{{columns}}}"]
    lines += [r"\toprule", " & ".join(map(_latex, table.heads)) + r" \\", r"\midrule"]
    lines += [" & ".join(_latex(cell) for cell in row) + r" \\" for row in table.rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


def _is_words(cell) -> bool:
    return isinstance(cell, str) and cell[:1].isalpha()


def _latex(cell) -> str:
    if cell is None:
        return "--"
    text = f"{cell:.3g}" if isinstance(cell, float) else str(cell)
    text = text.replace("-", MINUS_SIGN) if isinstance(cell, float) else text
    # One pass replaces all characters, so that a replacement is not replaced again.
    return re.sub(
        "|".join(map(re.escape, LATEX_REPLACEMENTS)), lambda found: LATEX_REPLACEMENTS[found[0]], visible_text(text)
    )
