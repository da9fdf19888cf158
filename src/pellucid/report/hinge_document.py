"""The report of a hinge between two IMUs: its angle and how far it is off, axis and centre, what was done."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from ..identification.findings import FigureTable, ParameterTable
from ..identification.hinge.identify_hinge import PROCESSING, HingeFindings, HingeTrial
from ..recordings.study import Study
from . import hinge_figures as figures
from .drawing import draw
from .page import Page, Section, Tile
from .quantities import cell_text, number, parameter_interval, prose, unit_text
from .tables import Row, Table


def page(study: Study, findings: HingeFindings) -> Page:
    """Everything that was found, as a page.

    Parameters
    ----------
    study : Study
    findings : HingeFindings

    Returns
    -------
    Page
    """
    judged = tuple(t for t in findings.trials if t.scores)
    return Page(
        title=f"{findings.study}: angle of a hinge",
        kicker="Pellucid report",
        headline=findings.headline,
        tiles=tuple(_tile(t) for t in judged),
        sections=(
            _found(study, findings),
            *([_angles(study, judged)] if judged else []),
            _hinges(findings),
            Section(
                "hinge_method", "How", paragraphs=(f"{PROCESSING[0].upper()}{PROCESSING[1:]}.",), notes=study.notes
            ),
        ),
        footer=f"Written by pellucid {version('pellucid')}. Every figure is beside this page as SVG and PDF, every "
        "number in results.json.",
    )


def _tile(trial: HingeTrial) -> Tile:
    scores = trial.scores
    return Tile(
        f"Angle error, {trial.name}",
        f"{np.degrees(scores['offline'].rms):.2f}",
        "deg RMS",
        f"{np.degrees(scores['causal'].rms):.2f} without later samples",
    )


def _found(study: Study, findings: HingeFindings) -> Section:
    tables = tuple(_figures(t) for t in findings.tables if isinstance(t, FigureTable))
    return Section("hinge_found", "What was found", tuple(prose(v.text) for v in findings.verdicts), tables)


def _angles(study: Study, judged: tuple[HingeTrial, ...]) -> Section:
    drawings = []
    for i, trial in enumerate(judged):
        start = float(trial.reference.time[0]) + study.config.hinge.score_from
        drawings.append(draw(figures.angle_figure, trial, start, f"angle_{i + 1}"))
        drawings.append(draw(figures.error_figure, trial, start, f"error_{i + 1}"))
    return Section("hinge_angle", "Angle and error", drawings=tuple(drawings))


def _hinges(findings: HingeFindings) -> Section:
    tables = tuple(_parameters(t, findings.confidence) for t in findings.tables if isinstance(t, ParameterTable))
    drawing = draw(figures.axes_figure, findings.trials, "axes")
    return Section("hinge", "Axis and centre", tables=tables, drawings=(drawing,))


def _figures(table: FigureTable) -> Table:
    rows = tuple(Row(tuple(cell_text(cell) for cell in row)) for row in table.rows)
    return Table(table.heads, rows, numeric=frozenset(range(1, len(table.heads))), caption=table.title, wide=True)


def _parameters(table: ParameterTable, level: float) -> Table:
    rows = tuple(
        Row(
            (
                p.name.replace("_", " "),
                number(p.value, p.standard_error),
                parameter_interval(p, level),
                unit_text(p.unit),
            )
        )
        for p in table.parameters
    )
    heads = ("Parameter", "Value", f"{100 * level:g} % interval", "Unit")
    return Table(heads, rows, numeric=frozenset({1, 2}), caption=table.title)
