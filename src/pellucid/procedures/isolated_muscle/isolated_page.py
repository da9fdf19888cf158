"""The report of a muscle whose length was imposed: its errors, amplitude by amplitude."""

from __future__ import annotations

from ...drawing.drawing import draw
from ...pages.page import Page, Section
from ...studies.study import Study
from ..posterior_beside import pair_with_posterior
from ..posterior_figures import posterior_figure
from ..study_page import figure_tables, parameter_tables
from .isolated_muscle import IsolatedMuscleResult


def page(study: Study, found: IsolatedMuscleResult) -> Page:
    """The page of an isolated muscle."""
    sections = [Section("force", "Force over imposed length", (), figure_tables(found, "Force"))]
    if found.posterior is not None:
        drawing = draw(posterior_figure, pair_with_posterior((found.interval,), found.posterior), found.confidence)
        tables = (*parameter_tables(found), *figure_tables(found, "Posterior"))
        posterior_text = (
            f"Where the muscle was held, its constants being wrong by any share. {found.posterior.settled}."
        )
        sections.append(Section("posterior", "Posterior", (posterior_text,), tables, (drawing,)))
    verdict_texts = tuple((v.kind, v.said) for v in found.verdicts)
    return Page(
        study.name,
        "Isolated muscle",
        found.headline,
        sections=tuple(sections),
        footer=study.config.citation,
        verdicts=verdict_texts,
    )
