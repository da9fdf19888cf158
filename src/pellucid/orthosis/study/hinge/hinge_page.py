"""Report page of a hinge between two IMUs: angle and its error, axis, centre and method.

Figures of a hinge between two IMUs: its angle and the reference, the error over time, the position of the axis.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, Head, draw, heads, key, label_ends, line, one_panel, origin, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.page import Page, Section, Tile
from ....study.procedures.study_page import figure_tables, parameter_tables, study_page
from ....study.study import Study
from .hinge_table import HingeTable
from .identify_hinge import PROCESSING_NOTE, HingeResult, HingeTrial

ANGLE_FIGURE_SPAN_S = 20.0
"""The figure of the angle shows this long a stretch from the first sample that is scored."""


def angle_figure(trial: HingeTrial, score_from: float, name: str) -> Drawing:
    """Draw the estimated angle and the reference over the first scored seconds. `score_from` [s]."""
    reference, found = trial.reference, trial.scores["offline"]
    shown = (reference.time >= score_from) & (reference.time < score_from + ANGLE_FIGURE_SPAN_S)
    time = reference.time[shown]
    figure, axis = one_panel(3.2)
    true = np.where(reference.believable, reference.angle, np.nan)[shown]
    # Both are drawn about the reference, so that samples without a credible reference are gaps in both.
    level = 2.0 * np.pi * np.round(np.nanmedian(true) / (2.0 * np.pi))
    line(axis, time, np.degrees(true - level), color=colour("measured"), linewidth=2.4)
    line(axis, time, np.degrees(found.angle[shown] - level), color=colour("heldout"), linewidth=1.2)
    tidy(axis, first=True, text="Angle (deg)")
    axis.set_xlabel("Time (s)")
    heads([axis], [Head(trial.name, f"{np.degrees(found.rms):.2f}° RMS", colour("heldout"))])
    key(axis, [("optics", colour("measured")), ("IMUs", colour("heldout"))])
    return Drawing(
        name,
        figure,
        f"Angle of {trial.name}, by both IMUs and by the reference, over the first {ANGLE_FIGURE_SPAN_S:g} s of the "
        "evaluation. The reference has gaps where it jumps farther than the joint can move.",
    )


def error_figure(trial: HingeTrial, score_from: float, name: str) -> Drawing:
    """Draw the error over time of three estimates: reported, causal, and gyroscopes alone. `score_from` [s]."""
    figure, axis = one_panel(3.2)
    time = trial.reference.time
    tones = {"gyroscopes": "muted", "causal": "directional", "offline": "heldout"}
    words = {"gyroscopes": "gyroscopes alone", "causal": "causal", "offline": "whole recording"}
    for estimate, role in tones.items():
        error = np.where(trial.reference.believable, trial.scores[estimate].error, np.nan)
        line(axis, time, np.degrees(error), color=colour(role), linewidth=1.0)
    tidy(axis, first=True, text="Error (deg)")
    # Gyroscopes leave the frame: what is judged must stay readable.
    top = 1.3 * max(np.degrees(trial.scores[estimate].largest) for estimate in ("offline", "causal"))
    axis.set_ylim(-top, top)
    axis.axvline(score_from, color=colour("muted"), linewidth=0.8, linestyle=(0, (4, 3)))
    axis.set_xlabel("Time (s)")
    heads([axis], [Head(trial.name, "error against the reference", colour("muted"))])
    key(axis, [(words[estimate], colour(role)) for estimate, role in tones.items()])
    return Drawing(
        name,
        figure,
        f"Error of the angle of {trial.name}. The calibration, which gives axes, centre and offset, lies left of the "
        "dashed line; the evaluation lies right of it. Drifting gyroscopes may leave the frame.",
    )


def axes_figure(trials: tuple[HingeTrial, ...], name: str) -> Drawing:
    """Draw how far each recording's hinge axis tilts from the sensor's closest axis, with 95 % intervals."""
    figure = Figure(figsize=(FIGURE_WIDTH, 3.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for side, axis in enumerate(panels):
        main = int(np.argmax(np.abs(trials[0].hinge.axes[side])))
        others = [k for k in range(3) if k != main]
        origin(axis)
        ends = []
        for trial in trials:
            direction = trial.hinge.axes[side]
            tilt = np.degrees(direction[others] / direction[main])
            error = 1.96 * np.degrees(np.max(trial.hinge.standard_errors[2 * side : 2 * side + 2]))
            style = {"color": colour("fitted"), "marker": "o", "markersize": 4.5, "linewidth": 1.0}
            axis.errorbar(*tilt, xerr=error, yerr=error, **style)
            ends.append((float(tilt[1]), trial.name, colour("fitted")))
        tidy(axis, first=side == 0, text=f"Tilt towards {'xyz'[others[1]]} (deg)")
        axis.set_xlabel(f"Tilt towards {'xyz'[others[0]]} (deg)")
        label_ends(axis, ends)
    heads(panels, [Head(t, "axis of the hinge", colour("muted")) for t in ("Proximal IMU", "Distal IMU")])
    return Drawing(
        name,
        figure,
        "Where each IMU sees the hinge's axis: tilt away from the sensor's own axis that it is closest to, with 95 % "
        "intervals, from the first seconds of each recording. The same mounting gives the same tilt.",
    )


def page(study: Study, findings: HingeResult) -> Page:
    """Everything that was found, as a page."""
    evaluated = tuple(t for t in findings.trials if t.scores)
    return study_page(
        title=f"{findings.study}: angle of a hinge",
        answer=findings.answer,
        verdicts=findings.verdicts,
        tiles=tuple(_tile(t) for t in evaluated),
        sections=(
            Section("hinge_found", "What was found", tables=figure_tables(findings)),
            *([_angles(study, evaluated)] if evaluated else []),
            Section(
                "hinge", "Axis and centre", tables=parameter_tables(findings),
                drawings=(draw(axes_figure, findings.trials, "axes"),),
            ),
            Section(
                "hinge_method", "How", (f"{PROCESSING_NOTE[0].upper()}{PROCESSING_NOTE[1:]}.",), notes=study.notes
            ),
        ),
    )  # fmt: skip


def _tile(trial: HingeTrial) -> Tile:
    offline, causal = (f"{np.degrees(trial.scores[estimate].rms):.2f}" for estimate in ("offline", "causal"))
    return Tile(f"Angle error, {trial.name}", offline, "deg RMS", f"{causal} without later samples")


def _angles(study: Study, evaluated: tuple[HingeTrial, ...]) -> Section:
    drawings = []
    for i, trial in enumerate(evaluated):
        start = float(trial.reference.time[0]) + study.table(HingeTable).score_from
        drawings.append(draw(angle_figure, trial, start, f"angle_{i + 1}"))
        drawings.append(draw(error_figure, trial, start, f"error_{i + 1}"))
    return Section("hinge_angle", "Angle and error", drawings=tuple(drawings))
