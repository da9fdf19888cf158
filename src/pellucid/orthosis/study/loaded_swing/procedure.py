"""An exoskeleton's swings, empty and with relaxed legs in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .loaded_swing_table import LoadedSwingTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
    from .identify_loaded_swing import LoadedSwingResult


class LoadedSwingProcedure(Procedure[LoadedSwingTable, "LoadedSwingResult"]):
    """An exoskeleton's swings, empty and with relaxed legs in it."""

    name, command = "loaded_swing", "identify"
    table = LoadedSwingTable

    def faults(self, study: Study, table: LoadedSwingTable) -> list[Fault]:
        from .identify_loaded_swing import faults

        return faults(study)

    def run(self, study: Study, table: LoadedSwingTable, tell: Progress = quiet) -> LoadedSwingResult:
        from .identify_loaded_swing import identify_loaded_swing

        return identify_loaded_swing(study, tell)

    def page(self, study: Study, found: LoadedSwingResult) -> Page:
        from .loaded_swing_page import page

        return page(study, found)
