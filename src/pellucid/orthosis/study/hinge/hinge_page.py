"""The report of a hinge between two IMUs: its angle and how far it is off, axis and centre, what was done."""

from __future__ import annotations

import numpy as np

from ....study.drawing.drawing import draw
from ....study.pages.page import Page, Section, Tile
from ....study.procedures.study_page import figure_tables, paper_step, parameter_tables, study_page
from ....study.study import Study
from . import hinge_figures as figures
from .hinge_table import HingeTable
from .identify_hinge import PROCESSING_NOTE, HingeResult, HingeTrial


def page(study: Study, findings: HingeResult) -> Page:
    """Everything that was found, as a page."""
    evaluated = tuple(t for t in findings.trials if t.scores)
    return study_page(
        title=f"{findings.study}: angle of a hinge",
        headline=findings.headline,
        verdicts=findings.verdicts,
        following=(paper_step(study),),
        tiles=tuple(_tile(t) for t in evaluated),
        sections=(
            _found(findings),
            *([_angles(study, evaluated)] if evaluated else []),
            _hinges(findings),
            Section(
                "hinge_method",
                "How",
                paragraphs=(f"{PROCESSING_NOTE[0].upper()}{PROCESSING_NOTE[1:]}.",),
                notes=study.notes,
            ),
        ),
    )


def _tile(trial: HingeTrial) -> Tile:
    scores = trial.scores
    return Tile(
        f"Angle error, {trial.name}",
        f"{np.degrees(scores['offline'].rms):.2f}",
        "deg RMS",
        f"{np.degrees(scores['causal'].rms):.2f} without later samples",
    )


def _found(findings: HingeResult) -> Section:
    return Section("hinge_found", "What was found", (), figure_tables(findings))


def _angles(study: Study, evaluated: tuple[HingeTrial, ...]) -> Section:
    drawings = []
    for i, trial in enumerate(evaluated):
        start = float(trial.reference.time[0]) + study.table(HingeTable).score_from
        drawings.append(draw(figures.angle_figure, trial, start, f"angle_{i + 1}"))
        drawings.append(draw(figures.error_figure, trial, start, f"error_{i + 1}"))
    return Section("hinge_angle", "Angle and error", drawings=tuple(drawings))


def _hinges(findings: HingeResult) -> Section:
    drawing = draw(figures.axes_figure, findings.trials, "axes")
    return Section("hinge", "Axis and centre", tables=parameter_tables(findings), drawings=(drawing,))
