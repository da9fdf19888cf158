"""Tables of a result as LaTeX, for a paper."""

from __future__ import annotations

import re

from ..._given import visible_text
from ..pages.quantities import MINUS_SIGN
from .result_tables import FigureTable

LATEX_REPLACEMENTS = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", '"': "''", "±": r"$\pm$", MINUS_SIGN: "$-$",
    "χ²": r"$\chi^2$", "²": "$^2$", "·": r"$\cdot$", "δ": r"$\delta$", "Δ": r"$\Delta$", "<": "$<$", ">": "$>$",
    "×": r"$\times$", "–": "--",
}  # fmt: skip
"""Replacements of characters that LaTeX does not accept."""


def latex(table: FigureTable) -> str:
    """A table for a paper; it needs the package booktabs."""
    words = [i for i in range(len(table.heads)) if all(_is_words(row[i]) for row in table.rows)]
    columns = "".join("l" if i in words else "r" for i in range(len(table.heads)))
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{latex_text(table.title)}}}"]
    lines.append(rf"\begin{{tabular}}{{{columns}}}")
    lines += [r"\toprule", " & ".join(map(latex_text, table.heads)) + r" \\", r"\midrule"]
    lines += [" & ".join(latex_text(cell) for cell in row) + r" \\" for row in table.rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


def _is_words(cell) -> bool:
    return isinstance(cell, str) and cell[:1].isalpha()


def latex_text(cell) -> str:
    """Return a cell's text as LaTeX; a dash where there is none."""
    if cell is None:
        return "--"
    text = f"{cell:.3g}" if isinstance(cell, float) else str(cell)
    text = text.replace("-", MINUS_SIGN) if isinstance(cell, float) else text
    # One pass replaces all characters, so that a replacement is not replaced again.
    return re.sub(
        "|".join(map(re.escape, LATEX_REPLACEMENTS)), lambda found: LATEX_REPLACEMENTS[found[0]], visible_text(text)
    )
