"""A wearer strapped to an orthosis: both bodies, and what couples them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .coupling_table import CouplingTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
    from .coupling_result import CouplingResult


class CouplingProcedure(Procedure[CouplingTable, "CouplingResult"]):
    """A wearer strapped to an orthosis: both bodies, and what couples them."""

    name, command = "coupling", "identify"
    table = CouplingTable

    def faults(self, study: Study, table: CouplingTable) -> list[Fault]:
        from .identify_coupling import faults

        return faults(study)

    def run(self, study: Study, table: CouplingTable, tell: Progress = quiet) -> CouplingResult:
        from .identify_coupling import identify_coupling

        return identify_coupling(study, tell)

    def page(self, study: Study, found: CouplingResult) -> Page:
        from .coupling_page import page

        return page(study, found)
