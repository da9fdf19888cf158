"""Common parts of the pages of studies: frame, result tables and provenance."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from importlib.metadata import version

from ...models.estimates import Verdict, rank_verdicts
from ..answer import Answer, answer_of_findings
from ..drawing.drawing import Drawing
from ..pages.forest import Row, Table
from ..pages.page import Page, Section, Tile, without_drawing
from ..pages.quantities import (
    MINUS_SIGN,
    cell_text,
    number,
    parameter_interval,
    parameter_note,
    typeset_sentence,
    unit_text,
)
from ..study import Study
from .result import FigureTable, ParameterTable, Result


def study_page(
    title: str,
    answer: Answer | str,
    tiles: Iterable[Tile],
    sections: Iterable[Section],
    verdicts: Iterable[Verdict] = (),
    figure: Drawing | None = None,
) -> Page:
    """Build a page of a study in the common frame, with its answer first and the worst verdicts on top.

    Without a `figure`, the first one of the sections is shown with the answer. If `answer` is a sentence, the verdicts
    answer it, as in `Result.answer`.
    """
    ranked = rank_verdicts(verdicts)
    shown = tuple((v.kind, typeset_sentence(v.said)) for v in ranked)
    if isinstance(answer, str):
        answer = answer_of_findings(answer, ((v.kind, v.said) for v in ranked))
    sections = tuple(sections)
    if figure is None:
        figure = next((drawing for section in sections for drawing in section.drawings), None)
    return Page(
        title,
        "Pellucid report",
        "",
        tuple(tiles),
        sections if figure is None else without_drawing(sections, figure.name),
        f"Written by pellucid {version('pellucid')}. Every figure is a file in this page's folder; every number is in "
        "results.json.",
        shown,
        answer,
        figure,
    )


def figure_tables(found: Result, part: str = "") -> tuple[Table, ...]:
    """Return the tables of figures, or those whose title contains `part`; columns without words are set as numbers."""
    return tuple(_figures(table) for table in found.tables if isinstance(table, FigureTable) and part in table.title)


def parameter_tables(found: Result, part: str = "") -> tuple[Table, ...]:
    """Return the tables of parameters, or those whose title contains `part`."""
    return tuple(
        _parameters(table, found.confidence)
        for table in found.tables
        if isinstance(table, ParameterTable) and part in table.title
    )


def made_with(study: Study) -> list[tuple[str, str]]:
    """Return the notes, source of the data and versions at the end of a page, as pairs of name and text."""
    entries = [("Note", note) for note in study.notes]
    if study.config.citation:
        entries.append(("Data", study.config.citation))
    versions = ", ".join(f"{n} {version(n)}" for n in ("pellucid", "numpy", "scipy", "matplotlib"))
    return [*entries, ("Made with", f"{versions}, Python {platform.python_version()}")]


def provenance(study: Study, entries: Iterable[tuple[str, str]], sums: Table) -> Section:
    """Return the section on the provenance of a page."""
    rows = tuple(Row(pair) for pair in (*entries, *made_with(study)))
    return Section("provenance", "Where this comes from", tables=(Table(("What", "How"), rows, wide=True), sums))


def _figures(table: FigureTable) -> Table:
    rows = tuple(Row(tuple(cell_text(cell).replace("_", " ") for cell in row)) for row in table.rows)
    numeric = {i for i in range(1, len(table.heads)) if not any(isinstance(row[i], str) for row in table.rows)}
    heads = tuple(typeset_sentence(head).replace(" - ", f" {MINUS_SIGN} ") for head in table.heads)
    return Table(heads, rows, frozenset(numeric), f"{table.title}.", True)


def _parameters(table: ParameterTable, level: float) -> Table:
    rows = tuple(
        Row(
            (
                p.name.replace("_", " "),
                number(p.value, p.standard_error),
                unit_text(p.unit) or "–",
                parameter_interval(p, level),
                parameter_note(p, level),
            )
        )
        for p in table.parameters
    )
    heads = ("Parameter", "Value", "Unit", f"{100 * level:g} % interval", "Notes")
    return Table(heads, rows, frozenset({1, 3}), f"{table.title}.")
