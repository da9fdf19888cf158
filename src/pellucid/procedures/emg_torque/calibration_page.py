"""The report of torque maps: how far each estimator is off on what it has not seen, and what it chose to look at."""

from __future__ import annotations

import numpy as np

from ...estimators.families import ESTIMATORS
from ...pages.drawing import draw
from ...pages.page import Page, Section, Tile
from ...pages.quantities import number, prose
from ...pages.tables import Row, Table
from ...recordings.study import Study
from ...signals.emg_chain import emg_chain
from ..result import ParameterTable
from ..study_page import figure_tables, study_page
from . import calibration_figures as figures
from . import muscle_figures
from .calibrate import CalibrationResult
from .evaluated import TorqueTrace


def page(study: Study, findings: CalibrationResult) -> Page:
    """Everything that calibration found, as a page."""
    return study_page(
        title=f"{findings.study}: torque from EMG",
        headline=prose(findings.headline),
        tiles=_tiles(findings),
        sections=tuple(
            filter(None, (_found(findings), _traces(findings), _muscles(findings), _choices(findings), _method(study)))
        ),
        verdicts=findings.verdicts,
    )


def _tiles(findings: CalibrationResult) -> tuple[Tile, ...]:
    tiles = []
    for each in findings.chosen:
        best = each.judged[0]
        others = [f"{e.recording.replace('_', ' ')} {number(e.score.rmse, digits=3)}" for e in each.judged[1:]]
        bare = [f"angles alone, without EMG: {number(each.bare[0].score.rmse, digits=3)}"] if each.bare else []
        more = "; ".join([each.words, f"R² {best.score.r2:.3f}", *others, *bare])
        unit = "of the leg's weight, RMS" if best.kind == "normalised" else f"{best.unit.replace('*', '·')} RMS"
        where = f", {best.recording.replace('_', ' ')}" if others else ""
        tiles.append(Tile(f"Torque error, {each.what}{where}", number(best.score.rmse, digits=3), unit, more))
    return tuple(tiles)


def _found(findings: CalibrationResult) -> Section:
    tables = figure_tables(findings)
    first = findings.evaluated[0].recording
    plain = [e for e in findings.evaluated if not e.causal and e.recording == first]
    drawing = draw(
        figures.error_by_estimator,
        [(e.what, e.estimator, ESTIMATORS[e.estimator].words, e.score.rmse) for e in plain],
        "errors",
        heads=list(dict.fromkeys(e.what for e in plain)),
        unit=plain[0].torque_unit,
        caption="RMS error of the torque on what was not fitted"
        + (f" ({first})." if first else ", each repetition left out in turn."),
    )
    return Section("emg_found", "What was found", (), tables, (drawing,))


def _traces(findings: CalibrationResult) -> Section:
    words = {name: family.words for name, family in ESTIMATORS.items()}
    drawings = tuple(
        draw(
            figures.torque_trace, trace.time, trace.reference, trace.predicted, f"torque_{i + 1}", words=words,
            half_width=trace.half_width, unit=findings.evaluated[0].torque_unit,
            caption=f"Torque of {trace.what}, {trace.recording.replace('_', ' ')}: the reference (grey), what maps "
            f"made of EMG and motion they were not fitted to, and their errors{coverage_text(trace)}.",
        )
        for i, trace in enumerate(findings.traces)
    )  # fmt: skip
    return Section("emg_torque", "Torque over time", drawings=drawings)


def coverage_text(trace: TorqueTrace) -> str:
    """What the bands of a trace are, and how much of its torque they hold; empty without one."""
    said = []
    for name, half in trace.half_width.items():
        share = 100.0 * float(np.mean(np.abs(trace.reference - trace.predicted[name]) <= half))
        said.append(f"; the band of {ESTIMATORS[name].words}, meant for 95 %, holds {share:.0f} % of this torque")
    return "".join(said)


def _muscles(findings: CalibrationResult) -> Section | None:
    """Parameters with intervals, and what every muscle does; None where muscles were passed over."""
    if not findings.muscles:
        return None
    drawings = []
    for i, found in enumerate(findings.muscles, start=1):
        drawings.append(
            draw(
                muscle_figures.departures, found, f"muscles_{i}",
                caption=f"Muscles of {found.what}: how far each number moved from the anatomical model, with its 95 % "
                "interval. Within the band people usually are; a diamond ended on a physiological bound.",
            )
        )  # fmt: skip
        drawings.append(
            draw(
                muscle_figures.muscle_work, found, f"muscle_work_{i}",
                caption=f"Activation of each muscle of {found.what} and the torque it gives the joint, "
                f"{found.recording.replace('_', ' ')}.",
            )
        )  # fmt: skip
    tables = tuple(
        Table(
            ("Parameter", "Value", "95 % interval", "Unit", "Known"),
            tuple(
                Row(
                    (
                        prose(p.name.replace("_", " ")), number(p.value, digits=3),
                        "–" if p.at_bound else " to ".join(number(x, digits=3) for x in p.interval()), p.unit,
                        "undetermined: on a bound" if p.at_bound else "yes" if p.identifiable else "no",
                    )
                )
                for p in table.parameters
            ),
            frozenset({1}),
            f"{table.title}. Factors of the anatomical value where the unit is 1.",
            True,
        )
        for table in findings.tables
        if isinstance(table, ParameterTable)
    )  # fmt: skip
    return Section("emg_muscles", "Muscles", tables=tables, drawings=tuple(drawings))


def _choices(findings: CalibrationResult) -> Section:
    first = findings.evaluated[0].recording
    rows = tuple(
        Row(
            (
                each.what,
                ESTIMATORS[each.estimator].words + (", causal" if each.causal else ""),
                each.choice,
                "–" if each.within is None else f"{each.within.r2:.3f}",
            )
        )
        for each in findings.evaluated
        if each.recording == first
    )
    heads = ("Torque of", "Estimator", "Sees; settings", "R² within what was fitted")
    caption = "What cross-validation chose, within what was fitted alone."
    return Section("emg_choices", "What each map sees", tables=(Table(heads, rows, frozenset({3}), caption, True),))


def _method(study: Study) -> Section:
    spec = study.config.emg_torque
    said = []
    if spec.chain == "none":
        said.append("Envelopes are used as they were recorded.")
    else:
        said.append(f"Envelopes by the chain “{spec.chain}”. {emg_chain(spec.chain).source}")
    if spec.reference_lowpass is not None:
        said.append(f"The reference torque passes a zero-phase low-pass at {spec.reference_lowpass:g} Hz (order 4).")
    said.append(
        "Features and settings are chosen by cross-validation that leaves out whole repetitions, or blocks of time "
        "with gaps as long as the features remember; what is judged takes no part in it."
    )
    return Section("emg_method", "How", (" ".join(said),), notes=study.notes)
