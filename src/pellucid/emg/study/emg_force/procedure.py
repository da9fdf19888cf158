"""Procedure that finds what EMG tells of force."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from .emg_force_table import EmgForceTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from ....study.study import Study
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
        from ....study.drawing.drawing import draw
        from ....study.pages.forest import MAX_FOREST_ROWS, Estimate, forest
        from ....study.pages.page import Answer, AnswerVerdict, Section
        from ....study.pages.quantities import typeset_sentence
        from ....study.procedures.study_page import figure_tables, study_page

        text = (
            "Correlation of each envelope with the force, both as smooth. The mean over people and its interval are "
            "those of Fisher's z."
        )
        section = Section("emg_force", "What EMG tells of force", (text,), figure_tables(found))
        title = f"{found.study}: EMG against force"
        follows = next((each.follows for each in found.found), 1.0)
        own = [each for each in found.found if each.agonist]
        answers = {each.answer for each in own}
        follow, little = answers == {"follows the force"}, answers == {"tells little of the force"}
        verdict: AnswerVerdict = "yes" if follow else "no" if little else "unsure"
        estimates = [
            Estimate(
                f"{each.muscle.replace('_', ' ')}, {each.task.replace('_', ' ')}", each.mean, each.low, each.high,
                "fitted" if each.agonist else "muted", f"{each.mean:.2f}",
            )
            for each in [*own, *(each for each in found.found if not each.agonist)][:MAX_FOREST_ROWS]
        ]  # fmt: skip
        figure = draw(
            forest, estimates, "correlations", "Correlation with the force", margin=(follows, 1.0),
            caption="Mean correlation over people with its interval; shaded is what counts as following the force. "
            "Blue: the muscle that the study names for the task.",
        )  # fmt: skip
        answer = Answer(
            "Does the named muscle's EMG follow the force?", verdict, figure
        )
        return study_page(title, typeset_sentence(found.headline), (), (section,), found.verdicts, answer)
