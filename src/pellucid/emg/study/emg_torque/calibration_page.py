"""The report of torque maps: each estimator's error on held-out recordings, and the features that it chose."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...._printed_command import printed_command
from ....models.parameter import Verdict, rank_verdicts
from ....study.drawing.drawing import draw
from ....study.pages.page import Answer, AnswerVerdict, Page, Section, Tile, without_drawing
from ....study.pages.quantities import number, typeset_sentence
from ....study.pages.tables import Row, Table
from ....study.procedures.posterior_figures import posterior_figure
from ....study.procedures.result import ParameterTable
from ....study.procedures.study_page import figure_tables, study_page
from ....study.study import Study
from ...estimators.condition_choice import ERROR_BAND_SHARE
from ...estimators.families import ESTIMATOR_FAMILIES
from ...signals.emg_chain import emg_chain
from . import calibration_figures as figures
from . import muscle_figures, stiffness_figures
from .calibrate import INVALID_BANDS_FINDING, CalibrationResult
from .chosen import BASELINE_ESTIMATOR, RecommendedEstimator
from .emg_torque_table import EmgTorqueTable
from .evaluated import TorqueTrace
from .together import FIT_WORDS

SHORT_ESTIMATOR_NAMES = {name: family.short for name, family in ESTIMATOR_FAMILIES.items() if family.short}
"""Short names of estimators for legends."""


def page(study: Study, findings: CalibrationResult) -> Page:
    """Return the page of a calibration's result."""
    sections = tuple(
        filter(
            None,
            (
                _errors_section(findings), _torque_section(findings), _verdicts_section(findings),
                _choices_section(findings),
                _together_section(findings), _muscles_section(findings), _stiffness_section(findings),
                _method_section(study),
            ),
        )
    )  # fmt: skip
    answer = _answer(findings, sections)
    answer = replace(answer, next=(_next_step(study, answer),))
    if answer.figure is not None:
        sections = without_drawing(sections, answer.figure.name)
    return study_page(
        title=f"{findings.study}: torque from EMG",
        headline=typeset_sentence(findings.headline),
        tiles=_tiles(findings),
        sections=sections,
        # Verdicts that invalidate results stand above all results. The others follow below the first section.
        verdicts=[v for v in findings.verdicts if _invalidates_results(v)],
        answer=answer,
    )


def _next_step(study: Study, answer: Answer) -> str:
    """Return what to do next: use the torque, or record movements in which EMG could show its worth."""
    if answer.verdict == "yes":
        return f"Take the torque live on a controller: `{printed_command('export', study.folder)}`."
    return (
        "EMG can tell more than angles where torque does not follow the motion: record other loads and speeds, and "
        'judge on them (`use = "validate"`).'
    )


def _answer(findings: CalibrationResult, sections: Sequence[Section]) -> Answer:
    """Return whether EMG is worth it beside angles, with the first torque over time."""
    void = any(_invalidates_results(v) for v in findings.verdicts)
    answers = {each.worth.answer for each in findings.worth}
    verdict: AnswerVerdict = "yes" if answers == {"worth it"} else "no" if answers == {"not worth it"} else "unsure"
    drawn = [drawing for section in sections for drawing in section.drawings]
    first = next((drawing for drawing in drawn if drawing.name.startswith("torque_")), drawn[0] if drawn else None)
    if not answers:
        return Answer("May this torque be used?", "no" if void else "unsure", first)
    # The gain is that of predictions; a band that is not known to hold says nothing against it.
    wrong = any(v.kind == "wrong" for v in findings.verdicts)
    return Answer("Is EMG worth it beside joint angles alone?", "unsure" if wrong else verdict, first)


def _invalidates_results(verdict: Verdict) -> bool:
    """Return whether a verdict invalidates results or their error bands."""
    return verdict.kind == "wrong" or verdict.finding == INVALID_BANDS_FINDING


def _tiles(findings: CalibrationResult) -> tuple[Tile, ...]:
    """Return tiles: what EMG is worth, then the recommended estimator's worst error for each joint or person."""
    tiles = [_worth_tile(findings)] if findings.worth else []
    for each in findings.chosen:
        judged = sorted(each.by_condition(), key=lambda one: -one.score.rmse)
        worst, others = judged[0], judged[1:4]
        more = [ESTIMATOR_FAMILIES[worst.estimator].description, f"R² {worst.score.r2:.3f}"]
        if worst.bare is not None:
            more.append(f"angles alone, without EMG: {number(worst.bare.rmse, digits=3)}")
        more += [f"{one.name.replace('_', ' ')} {number(one.score.rmse, digits=3)}" for one in others]
        unit = (
            "of the leg's weight, RMS"
            if each.judged[0].kind == "normalised"
            else f"{each.judged[0].unit.replace('*', '·')} RMS"
        )
        unit += ", the worst" if others else ""
        where = f"{each.what}, {worst.name.replace('_', ' ')}" if others else each.what
        tiles.append(Tile(f"Torque error, {where}", number(worst.score.rmse, digits=3), unit, "; ".join(more)))
    return tuple(tiles)


def _worth_tile(findings: CalibrationResult) -> Tile:
    """Return the tile that says for how many joints and recordings EMG is worth it, and the largest gain."""
    counts = Counter(each.worth.answer for each in findings.worth)
    best = max(findings.worth, key=lambda each: each.worth.gain)
    several = len(findings.worth) > 1
    answers = "; ".join(f"{answer}: {count}" if several else answer for answer, count in counts.most_common())
    interval = ""
    if np.isfinite(best.worth.low):
        interval = f", {best.worth.low:+.2f} to {best.worth.high:+.2f}"
    note = typeset_sentence(f"{best.words}{interval}; {answers}")
    unit = "at most" if several else ""
    return Tile("R² that EMG adds to angles", typeset_sentence(f"{best.worth.gain:+.2f}"), unit, note)


def _errors_section(findings: CalibrationResult) -> Section:
    """Return the section with the errors of all estimators."""
    tables = figure_tables(findings)
    first = tuple(t for t in tables if t.caption.startswith(("What EMG is worth", "Named first")))
    rest = tuple(
        t for t in tables if t not in first and not t.caption.startswith(("What chose", "Stiffness", "Posterior"))
    )
    shown = {each.what: _worst_recording(findings, each) for each in findings.chosen}
    several = len({recording for recording in shown.values() if recording}) > 1
    head = {w: f"{w}, {r.replace('_', ' ')}" if several else w for w, r in shown.items()}
    plain = [
        e for e in findings.evaluated
        if not e.causal and e.recording == shown[e.what] and not ESTIMATOR_FAMILIES[e.estimator].sees_measured_torque
    ]  # fmt: skip
    where = next(iter(shown.values()))
    on = " on what was not fitted" + ("" if several or not where else f" ({where.replace('_', ' ')}, the worst)")
    drawing = draw(
        figures.error_by_estimator,
        [(head[e.what], e.estimator, ESTIMATOR_FAMILIES[e.estimator].description, e.score.rmse) for e in plain],
        "errors",
        heads=list(dict.fromkeys(head[e.what] for e in plain)),
        chosen={head[each.what]: each.judged[0].estimator for each in findings.chosen},
        bare=BASELINE_ESTIMATOR,
        unit=plain[0].torque_unit if plain[0].kind != "normalised" else "of the leg's weight",
        caption=f"RMS error of the torque{on}. The dashed line is what angles alone tell, without EMG; the figure in "
        "bold is what is named first, which tests within what was fitted chose.",
    )
    gains = (draw(figures.gain_over_angles, findings.worth, "worth"),) if findings.worth else ()
    return Section("emg_found", "What was found", (), (*first, *rest), (*gains, drawing))


def _worst_recording(findings: CalibrationResult, chosen: RecommendedEstimator) -> str:
    """Return the recording with the largest error among those with valid estimates, or of all if none is valid."""
    void = {v.said.partition(":")[0] for v in findings.verdicts if v.finding == "another_condition"}
    return next((e.recording for e in chosen.judged if e.recording not in void), chosen.judged[0].recording)


def _torque_section(findings: CalibrationResult) -> Section:
    """Return the section with held-out torque over time."""
    words = {name: family.description for name, family in ESTIMATOR_FAMILIES.items()}
    by = {each.what: each for each in findings.chosen}
    drawings = []
    for i, trace in enumerate(findings.traces, start=1):
        each = by[trace.what]
        chosen = each.by.get(trace.recording, each.judged[0].estimator)
        bands = {chosen: trace.half_width[chosen]} if chosen in trace.half_width else {}
        drawings.append(
            draw(
                figures.torque_trace, trace.time, trace.reference, trace.predicted, f"torque_{i}", chosen=chosen,
                bare=BASELINE_ESTIMATOR, words=words | SHORT_ESTIMATOR_NAMES, half_width=bands,
                unit=findings.evaluated[0].torque_unit,
                caption=f"Torque of {trace.what}, {trace.recording.replace('_', ' ')}: the reference (grey), what "
                "was made of EMG and motion that were not fitted, what angles alone make (dashed), and their errors"
                f"{coverage_text(replace(trace, half_width=bands))}.",
            )
        )  # fmt: skip
    return Section("emg_torque", "Torque over time", drawings=tuple(drawings))


def _verdicts_section(findings: CalibrationResult) -> Section | None:
    """Return the section with the remaining verdicts, the worst first; None if there are none."""
    verdict_texts = tuple(
        (v.kind, typeset_sentence(v.said))
        for v in rank_verdicts(v for v in findings.verdicts if not _invalidates_results(v))
    )
    return Section("emg_known", "What is to be known", verdicts=verdict_texts) if verdict_texts else None


def coverage_text(trace: TorqueTrace) -> str:
    """Return words that state each band's level and the share of the torque that it holds; empty without bands."""
    sentences = []
    for name, half in trace.half_width.items():
        share = 100.0 * float(np.mean(np.abs(trace.reference - trace.predicted[name]) <= half))
        words, level = ESTIMATOR_FAMILIES[name].description, 100.0 * trace.level
        sentences.append(f"; the band of {words}, meant for {level:g} %, holds {share:.0f} % of this torque")
    return "".join(sentences)


def _muscles_section(findings: CalibrationResult) -> Section | None:
    """Return the section with muscle parameters, activations and torques; None if muscles were not fitted."""
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
                        typeset_sentence(p.name.replace("_", " ")), number(p.value, digits=3),
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


def _together_section(findings: CalibrationResult) -> Section | None:
    """Return the section on muscles calibrated over all joints at once; None if there are none."""
    if findings.together is None:
        return None
    summary, traces = findings.together.summary, findings.together.traces
    over, where = summary.what.removesuffix(" together"), summary.recording.replace("_", " ")
    drawings = (
        draw(
            muscle_figures.joints_together, traces, FIT_WORDS, "joints_together",
            caption=f"Torques of {over} by one set of muscles, {where}, which was not fitted: with 10 to 100 ms from "
            "every envelope to its force (and its "
            f"{100.0 * ERROR_BAND_SHARE:g} % band), and with the offset of the EMG's stream found too.",
        ),
        draw(
            muscle_figures.departures, summary, "muscles_together",
            caption=f"Muscles of {over} together: how far each number moved from the anatomical model, with its 95 % "
            "interval. A diamond ended on a bound and is undetermined.",
        ),
    )  # fmt: skip
    posterior_text = ()
    posterior, determined = findings.together.posterior, findings.together.told
    if posterior is not None:
        posterior_text = (
            "A posterior of these muscles: bounds hold, and anatomy counts for what people differ by. "
            f"{posterior.settled}. Drawn are those numbers that the recording tells most of.",
        )
        if determined:
            drawings += (draw(posterior_figure, determined, posterior.confidence, "posterior_together"),)
    tables = figure_tables(findings, "Posterior of muscles together")
    return Section("emg_together", "Muscles across joints", posterior_text, tables, drawings)


def _stiffness_section(findings: CalibrationResult) -> Section | None:
    """Return the section with joint stiffness along a movement; None if muscles were not fitted."""
    if not findings.stiffness:
        return None
    drawings = tuple(
        draw(
            stiffness_figures.stiffness_over_time, found, f"stiffness_{found.joint}",
            caption=f"Stiffness of the {found.joint}, {found.recording.replace('_', ' ')}, by calibrated muscles and "
            "tissue, with 95 % intervals: the calibration's covariance and what muscles and tendons differ by. Nothing "
            "was perturbed: a band cannot say whether the model is right.",
        )
        for found in findings.stiffness
    )  # fmt: skip
    tables = figure_tables(findings, "Stiffness")
    return Section("emg_stiffness", "Joint stiffness", tables=tables, drawings=drawings)


def _choices_section(findings: CalibrationResult) -> Section:
    """Return the section with the chosen features and settings, and the tests that chose the estimator."""
    first = findings.evaluated[0].recording
    rows = tuple(
        Row(
            (
                each.what,
                ESTIMATOR_FAMILIES[each.estimator].description + (", causal" if each.causal else ""),
                each.choice,
                "–" if each.within is None else f"{each.within.r2:.3f}",
            )
        )
        for each in findings.evaluated
        if each.recording == first
    )
    heads = ("Torque of", "Estimator", "Sees; settings", "R² within what was fitted")
    caption = "What cross-validation chose, within what was fitted alone."
    tables = (*figure_tables(findings, "What chose"), Table(heads, rows, frozenset({3}), caption, True))
    return Section("emg_choices", "What each map sees, and which is named first", tables=tables)


def _method_section(study: Study) -> Section:
    """Return the section that describes the method."""
    spec = study.table(EmgTorqueTable)
    paragraphs = []
    if spec.chain == "none":
        paragraphs.append("Envelopes are used as they were recorded.")
    else:
        changed = [key for key in ("mains", "band", "lowpass", "rms_window") if getattr(spec, key) is not None]
        own = f" The study changes its {', '.join(changed)}." if changed else ""
        paragraphs.append(f"Envelopes by the chain “{spec.chain}”. {emg_chain(spec.chain).source}{own}")
    if spec.reference_lowpass is not None:
        paragraphs.append(
            f"The reference torque passes a zero-phase low-pass at {spec.reference_lowpass:g} Hz (order 4)."
        )
    paragraphs.append(
        "Features and settings are chosen by cross-validation that leaves out whole repetitions, or blocks of time "
        "with gaps as long as the features remember; what is judged takes no part in it. Which estimator is named "
        "first is chosen where it will be used, away from what it is fitted to: by leaving out whole recordings or "
        "repetitions where there are several, else by slow strides that judge fast ones, the reverse, and the fifth of "
        "the samples with the most effort and speed. Where these tests cannot tell two apart, muscles come before "
        "what is linear and that before trees. The 90 % band is as wide as errors were there."
    )
    return Section("emg_method", "How", (" ".join(paragraphs),), notes=study.notes)
