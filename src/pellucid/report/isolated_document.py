"""The report of a muscle whose length was imposed: its errors, amplitude by amplitude."""

from __future__ import annotations

from ..identification.findings import FigureTable, Findings
from ..recordings.study import Study
from .page import Page, Section
from .quantities import cell_text
from .tables import Row, Table


def page(study: Study, found: Findings) -> Page:
    """The page of an isolated muscle.

    Parameters
    ----------
    study : Study
    found : Findings
        From `calibrate`.

    Returns
    -------
    Page
    """
    shown = [table for table in found.tables if isinstance(table, FigureTable)]
    tables = tuple(
        Table(
            heads=table.heads,
            rows=tuple(Row(tuple(map(cell_text, row))) for row in table.rows),
            numeric=frozenset(range(1, len(table.heads) - 1)),
            caption=table.title,
        )
        for table in shown
    )
    section = Section("force", "Force over imposed length", tuple(v.text for v in found.verdicts), tables)
    return Page(study.name, "Isolated muscle", found.headline, sections=(section,), footer=study.config.citation)
