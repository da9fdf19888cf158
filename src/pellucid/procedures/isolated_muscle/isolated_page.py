"""The report of a muscle whose length was imposed: its errors, amplitude by amplitude."""

from __future__ import annotations

from ...pages.page import Page, Section
from ...recordings.study import Study
from ..result import Result
from ..study_page import figure_tables


def page(study: Study, found: Result) -> Page:
    """The page of an isolated muscle."""
    section = Section("force", "Force over imposed length", (), figure_tables(found))
    told = tuple((v.kind, v.said) for v in found.verdicts)
    return Page(
        study.name, "Isolated muscle", found.headline, sections=(section,), footer=study.config.citation, verdicts=told
    )
