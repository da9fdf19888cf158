"""Procedure that finds activations near EMG that reproduce a measured torque, and fills in muscles without EMG."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from ....study.study import Study
from ..emg_torque.emg_torque_table import EmgTorqueTable
from .activations_table import ActivationsTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from .find_activations import ActivationsResult


class ActivationsProcedure(Procedure[ActivationsTable, "ActivationsResult"]):
    """Activations of all muscles."""

    name, command = "activations", "activations"
    whole = True
    table = ActivationsTable

    def faults(self, study: Study, table: ActivationsTable) -> list[Fault]:
        from ..emg_torque.study_faults import study_faults

        return study_faults(study)

    def run(self, study: Study, table: ActivationsTable, tell: Progress = quiet) -> ActivationsResult:
        from .find_activations import find_activations

        return find_activations(study, tell)

    def page(self, study: Study, found: ActivationsResult) -> Page:
        from .activations_page import page

        return page(study, found)

    def inputs(self, study: Study) -> Iterable[Path]:
        """Yield the file of the muscles' constants."""
        constants = study.table(EmgTorqueTable).muscle_file
        if constants is not None:
            yield study.inside(constants, "[emg_torque] muscle_file")
