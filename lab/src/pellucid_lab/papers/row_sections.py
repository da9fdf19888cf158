"""Last sections of a reproduction's page: contradictions in print, and every figure with its printed value."""

from __future__ import annotations

from collections.abc import Sequence

from pellucid.study.pages.forest import Row, Table
from pellucid.study.pages.page import Section
from pellucid.study.pages.quantities import MINUS_SIGN, typeset_quantities, unit_text

from .figure import Reproduced

VERDICTS_FROM_PRINT = ("recomputed", "cannot be")
"""Verdicts of rows that come from print alone."""


def cell(value: float | None) -> str:
    """Return a number of a table, "–" where there is none."""
    if value is None:
        return "–"
    text = f"{value:.4g}" if value == 0.0 or abs(value) >= 1e-4 else f"{value:.1e}"
    return text.replace("-", MINUS_SIGN)


def bracketed(ours: str, printed: str | None) -> str:
    """Return a number with the printed one behind it, in angular brackets."""
    return ours if printed is None else f"{ours} ⟨{printed}⟩"


def _said(text: str) -> str:
    """Plain text with units and differences as they are set; a difference keeps to its line."""
    return typeset_quantities(text).replace(" - ", f"\N{NO-BREAK SPACE}{MINUS_SIGN}\N{NO-BREAK SPACE}")


def row_sections(
    rows: Sequence[Reproduced], *, over: str, remarks: bool, printed_of: str, ours_of: str
) -> tuple[Section, Section]:
    """Both sections; `printed_of` and `ours_of` are whom or what either column is about."""
    printed = [r for r in rows if r.verdict in VERDICTS_FROM_PRINT]
    recomputed = (
        Row(
            (_said(r.quantity), cell(r.published), cell(r.ours), unit_text(r.unit) or "–", r.verdict, _said(r.note)),
            r.verdict == "cannot be",
        )
        for r in printed
    )
    every = (
        Row(
            (
                r.id,
                cell(r.published),
                cell(r.ours),
                "" if r.lower is None else f"{cell(r.lower)} to {cell(r.upper)}",
                unit_text(r.unit) or "–",
                _said(r.note) if remarks else r.verdict,
            )
        )
        for r in rows
        if r not in printed
    )
    numbers = frozenset({1, 2})
    checked = ("What", "Printed", "Recomputed", "Unit", "Verdict", "Why")
    heads = ("Figure", f"Published, {printed_of}", f"Ours, {ours_of}", over, "Unit", "Remark" if remarks else "Verdict")
    return (
        Section(
            "print",
            "What can be recomputed from print",
            tables=(Table(checked, tuple(recomputed), numbers, wide=True),),
        ),
        Section("rows", "Every figure", tables=(Table(heads, tuple(every), numbers, wide=True),)),
    )
