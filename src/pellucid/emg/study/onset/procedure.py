"""Procedure that finds the onsets and durations of muscle activity in raw EMG."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .onset_table import OnsetTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
    from .find_onsets import OnsetResult


class OnsetProcedure(Procedure[OnsetTable, "OnsetResult"]):
    """Onsets of muscle activity."""

    name, command = "onset", "onset"
    table = OnsetTable
    whole = True

    def faults(self, study: Study, table: OnsetTable) -> list[Fault]:
        from .find_onsets import faults

        return faults(study, table)

    def run(self, study: Study, table: OnsetTable, tell: Progress = quiet) -> OnsetResult:
        from .find_onsets import find_onsets

        return find_onsets(study, table, tell)

    def page(self, study: Study, found: OnsetResult) -> Page:
        from .onset_page import page

        return page(study, found)
