"""Procedure that finds muscle synergies, their number, and their similarity between people and conditions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .synergies_table import SynergiesTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
    from .find_synergies import SynergiesResult


class SynergiesProcedure(Procedure[SynergiesTable, "SynergiesResult"]):
    """Muscle synergies."""

    name, command = "synergies", "synergies"
    table = SynergiesTable
    whole = True

    def faults(self, study: Study, table: SynergiesTable) -> list[Fault]:
        from .find_synergies import faults

        return faults(study, table)

    def run(self, study: Study, table: SynergiesTable, tell: Progress = quiet) -> SynergiesResult:
        from .find_synergies import run

        return run(study, table, tell)

    def page(self, study: Study, found: SynergiesResult) -> Page:
        from .synergies_page import page

        return page(study, found)
