"""Procedure that finds what EMG tells of force."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..procedure import Procedure, Progress, quiet
from .emg_force_table import EmgForceTable

if TYPE_CHECKING:
    from ...pages.page import Page
    from ...recordings.fault import Fault
    from ...studies.study import Study
    from .find_emg_force import EmgForceResult


class EmgForceProcedure(Procedure[EmgForceTable, "EmgForceResult"]):
    """What EMG tells of force."""

    name, command = "emg_force", "emg-force"
    table = EmgForceTable
    whole = True

    def faults(self, study: Study, table: EmgForceTable) -> list[Fault]:
        from ..muscle_channels import envelope_faults
        from .find_emg_force import require_tasks

        return envelope_faults(
            study, table, lambda made: require_tasks(study, table, made), "force and EMG of each task"
        )

    def run(self, study: Study, table: EmgForceTable, tell: Progress = quiet) -> EmgForceResult:
        from .find_emg_force import find_emg_force

        return find_emg_force(study, table, tell)

    def page(self, study: Study, found: EmgForceResult) -> Page:
        from ...pages.page import Section
        from ...pages.quantities import typeset_sentence
        from ..study_page import figure_tables, study_page

        text = (
            "Correlation of each envelope with the force, both as smooth. The mean over people and its interval are "
            "those of Fisher's z."
        )
        section = Section("emg_force", "What EMG tells of force", (text,), figure_tables(found))
        title = f"{found.study}: EMG against force"
        return study_page(title, typeset_sentence(found.headline), (), (section,), found.verdicts)
