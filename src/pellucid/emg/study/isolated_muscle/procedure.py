"""One muscle, fully active, whose free end is moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .isolated_muscle_table import IsolatedMuscleTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
    from .isolated_muscle import IsolatedMuscleResult


class IsolatedMuscleProcedure(Procedure[IsolatedMuscleTable, "IsolatedMuscleResult"]):
    """One muscle, fully active, whose free end is moved."""

    name, command = "isolated_muscle", "calibrate"
    table = IsolatedMuscleTable

    def faults(self, study: Study, table: IsolatedMuscleTable) -> list[Fault]:
        from .isolated_muscle import faults

        return faults(study)

    def run(self, study: Study, table: IsolatedMuscleTable, tell: Progress = quiet) -> IsolatedMuscleResult:
        from .isolated_muscle import isolated_result

        return isolated_result(study, tell)

    def page(self, study: Study, found: IsolatedMuscleResult) -> Page:
        from .isolated_page import page

        return page(study, found)
