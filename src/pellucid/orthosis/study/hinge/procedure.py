"""A hinge between two segments, each with an inertial sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .hinge_table import HingeTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
    from .identify_hinge import HingeResult


class HingeProcedure(Procedure[HingeTable, "HingeResult"]):
    """A hinge between two segments, each with an inertial sensor."""

    name, command = "hinge", "identify"
    table = HingeTable

    def faults(self, study: Study, table: HingeTable) -> list[Fault]:
        from .identify_hinge import faults

        return faults(study)

    def run(self, study: Study, table: HingeTable, tell: Progress = quiet) -> HingeResult:
        from .identify_hinge import identify_hinge

        return identify_hinge(study, tell)

    def page(self, study: Study, found: HingeResult) -> Page:
        from .hinge_page import page

        return page(study, found)
