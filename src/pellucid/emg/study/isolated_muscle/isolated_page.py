"""The report of a muscle whose length was imposed: its errors, amplitude by amplitude."""

from __future__ import annotations

from ....study.drawing.drawing import draw
from ....study.pages.moving import Traces, over_time
from ....study.pages.page import Page, Section
from ....study.procedures.posterior_beside import pair_with_posterior
from ....study.procedures.posterior_figures import posterior_figure
from ....study.procedures.study_page import figure_tables, parameter_tables
from ....study.study import Study
from .isolated_muscle import IsolatedMuscleResult


def page(study: Study, found: IsolatedMuscleResult) -> Page:
    """The page of an isolated muscle."""
    sections = [Section("force", "Force over imposed length", (), figure_tables(found, "Force"))]
    if found.posterior is not None:
        drawing = draw(posterior_figure, pair_with_posterior((found.interval,), found.posterior), found.confidence)
        tables = (*parameter_tables(found), *figure_tables(found, "Posterior"))
        posterior_text = (
            f"Posterior of the muscle's offset, with uncertain model constants. {found.posterior.settled}."
        )
        sections.append(Section("posterior", "Posterior", (posterior_text,), tables, (drawing,)))
    verdict_texts = tuple((v.kind, v.said) for v in found.verdicts)
    trial = next((t for t in found.fit.trials if t.use == "validate"), found.fit.trials[0])
    use = "held out" if trial.use == "validate" else "fitted"
    known = "digitised" if study.config.digitised else "measured"
    traces = Traces(
        trial.name, f"{use}, amplitude {1e3 * trial.amplitude:g} mm", trial.time,
        {known: trial.measured, "predicted": trial.predicted}, "Force (N)",
    )  # fmt: skip
    figure = draw(
        over_time, [traces], "answer", roles={known: "measured", "predicted": "heldout"},
        caption=f"Force over time at one amplitude of the imposed length: {known}, and by Hill's model.",
    )  # fmt: skip
    return Page(
        f"{study.name}: isolated muscle",
        "Pellucid report",
        answer=found.answer,
        figure=figure,
        sections=tuple(sections),
        footer=study.config.citation,
        verdicts=verdict_texts,
    )
