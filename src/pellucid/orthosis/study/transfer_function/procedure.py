"""A linear model from one channel to another."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .transfer_function_table import TransferFunctionTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
    from .identify_transfer import TransferResult


class TransferFunctionProcedure(Procedure[TransferFunctionTable, "TransferResult"]):
    """A linear model from one channel to another."""

    name, command = "transfer_function", "identify"
    table = TransferFunctionTable

    def faults(self, study: Study, table: TransferFunctionTable) -> list[Fault]:
        from .identify_transfer import faults

        return faults(study)

    def run(self, study: Study, table: TransferFunctionTable, tell: Progress = quiet) -> TransferResult:
        from .identify_transfer import identify_transfer

        return identify_transfer(study, tell)

    def page(self, study: Study, found: TransferResult) -> Page:
        from .transfer_page import page

        return page(study, found)
