"""Page of the report on the correlation of EMG with force."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.drawing.drawing import draw
from ....study.pages.forest import MAX_FOREST_ROWS, Estimate, forest
from ....study.pages.page import Page, Section
from ....study.procedures.study_page import figure_tables, study_page

if TYPE_CHECKING:
    from ....study.study import Study
    from .find_emg_force import EmgForceResult


def page(study: Study, found: EmgForceResult) -> Page:
    """Return the part of the report: the correlations, drawn and as tables."""
    text = (
        "Correlation of each envelope with the force, both smoothed alike. The mean over people and its interval are "
        "computed from Fisher's z."
    )
    section = Section("emg_force", "Correlation of EMG and force", (text,), figure_tables(found))
    title = f"{found.study}: EMG and force"
    follows = next((each.follows for each in found.found), 1.0)
    own = [each for each in found.found if each.agonist]
    estimates = [
        Estimate(
            f"{each.muscle.replace('_', ' ')}, {each.task.replace('_', ' ')}", each.mean, each.low, each.high,
            "fitted" if each.agonist else "muted", f"{each.mean:.2f}",
        )
        for each in [*own, *(each for each in found.found if not each.agonist)][:MAX_FOREST_ROWS]
    ]  # fmt: skip
    figure = draw(
        forest, estimates, "correlations", "Correlation with the force", margin=(follows, 1.0),
        caption="Mean correlation over people with its interval. The shaded range counts as following the force. Blue: "
        "the muscle that the study names for the task.",
    )  # fmt: skip
    return study_page(title, found.answer, (), (section,), found.verdicts, figure)
