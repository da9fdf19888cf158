"""Procedure that computes indices of co-contraction from envelopes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .cocontraction_table import CocontractionTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
    from .find_cocontraction import CocontractionResult


class CocontractionProcedure(Procedure[CocontractionTable, "CocontractionResult"]):
    """Co-contraction of antagonists."""

    name, command = "cocontraction", "cocontraction"
    table = CocontractionTable
    whole = True

    def faults(self, study: Study, table: CocontractionTable) -> list[Fault]:
        from ..muscle_channels import envelope_faults
        from .find_cocontraction import require_pairs

        return envelope_faults(study, table, lambda made: require_pairs(study, table, made), "antagonists")

    def run(self, study: Study, table: CocontractionTable, tell: Progress = quiet) -> CocontractionResult:
        from .find_cocontraction import find_cocontraction

        return find_cocontraction(study, table, tell)

    def page(self, study: Study, found: CocontractionResult) -> Page:
        from .cocontraction_page import page

        return page(study, found)
