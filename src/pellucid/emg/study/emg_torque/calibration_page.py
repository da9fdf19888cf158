"""The report of torque maps: each estimator's error on held-out recordings, and the features that it chose.

Figures of torque maps: predicted torque over time, and the error of each estimator.

Figures of calibrated muscles: departures of parameters from anatomy, activations and torques.

Figure of a joint's stiffness along a movement.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from ....models.estimates import Verdict, rank_verdicts
from ....study.drawing.drawing import Drawing, draw, key, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.forest import Estimate, Row, Table, forest
from ....study.pages.page import Page, Section, Tile
from ....study.pages.quantities import number, typeset_sentence
from ....study.procedures.posterior_figures import posterior_figure
from ....study.procedures.result import ParameterTable
from ....study.procedures.study_page import figure_tables, study_page
from ....study.study import Study
from ...estimators.condition_choice import ERROR_BAND
from ...estimators.cross_validation import covered_share
from ...estimators.families import ESTIMATOR_FAMILIES, STACKED, STACKED_FAMILY, named_family
from ...estimators.joint_stiffness import STIFFNESS_KINDS, JointStiffness
from ...signals.emg_chain import emg_chain
from .calibrate import INVALID_BANDS_FINDING, CalibrationResult
from .emg_torque_table import EmgTorqueTable
from .together import FIT_WORDS
from .torque_findings import (
    BASELINE_ESTIMATOR,
    DRAWN_MUSCLES_S,
    FORMULA_KIND,
    MuscleSummary,
    RecommendedEstimator,
    RecordingWorth,
    TorqueTrace,
)

CHOSEN_TONE = "heldout"
"""Colour of the recommended estimator's torque."""

BASELINE_TONE = "muted"
"""Colour of the torque by angles alone."""

MUSCLE_TONE = "good"
"""Colour of the torque by muscles, if they are not the recommended estimator."""

DRAWN_STRETCH_S = 8.0
"""Duration of the drawn stretch of a recording [s]."""

MAX_SHOWN_CLOCK_S = 1e6
"""Times beyond this are dates, such as seconds since 1970, and are drawn from the first sample on [s]."""


def torque_trace(
    time: np.ndarray,
    reference: np.ndarray,
    predicted: Mapping[str, np.ndarray],
    name: str,
    *,
    chosen: str,
    bare: str,
    words: Mapping[str, str],
    caption: str,
    half_width: Mapping[str, np.ndarray] | None = None,
    unit: str = "N*m",
) -> Drawing:
    """Draw held-out torque over time: the reference, the `chosen` estimator with its band, muscles, and angles alone.

    Their errors are drawn beneath. `time` [s] and `reference` [`unit`] have shape (n,). `predicted` and `half_width`
    hold the torque and half its band by estimator, shape (n,) [`unit`]. `bare` is the estimator of angles alone.
    """
    unit = unit.replace("*", "·")
    muscles = ((name, MUSCLE_TONE) for name, family in ESTIMATOR_FAMILIES.items() if family.shows_muscles)
    shown = {e: c for e, c in ((bare, BASELINE_TONE), *muscles, (chosen, CHOSEN_TONE)) if e in predicted}
    middle = 0.5 * (time[0] + time[-1])
    within = np.abs(time - middle) <= 0.5 * DRAWN_STRETCH_S
    since = float(time[0]) if time[0] > MAX_SHOWN_CLOCK_S else 0.0
    time = time - since
    figure = Figure(figsize=(FIGURE_WIDTH, 4.2), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
    line(top, time[within], reference[within], color=colour("measured"), linewidth=2.2)
    for estimator, name_of_tone in shown.items():
        torque, tone, style = predicted[estimator], colour(name_of_tone), "--" if estimator == bare else "-"
        if half_width and estimator == chosen and estimator in half_width:
            low, high = torque - half_width[estimator], torque + half_width[estimator]
            top.fill_between(time[within], low[within], high[within], color=tone, alpha=0.14, linewidth=0.0, zorder=1)
        line(top, time[within], torque[within], color=tone, linewidth=1.2, linestyle=style)
        line(bottom, time[within], (torque - reference)[within], color=tone, linewidth=1.0, linestyle=style)
    bottom.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    tidy(top, first=True, text=f"Torque ({unit})")
    tidy(bottom, first=True, text=f"Error ({unit})", ticks=4)
    bottom.set_xlabel("Time since the first sample (s)" if since else "Time (s)")
    key(top, [("reference", colour("measured")), *((words[e], colour(tone)) for e, tone in shown.items())])
    return Drawing(name, figure, caption)


def error_by_estimator(
    errors: Sequence[tuple[str, str, str, float]],
    name: str,
    *,
    heads: Sequence[str],
    chosen: Mapping[str, str],
    bare: str,
    caption: str,
    unit: str = "N*m",
) -> Drawing:
    """Draw the RMSE of every estimator, one panel for each joint or person.

    `errors` holds panel, estimator, its description and its RMSE [`unit`]. A line marks angles alone (`bare`). The
    `chosen` estimator of each panel is set in bold.
    """
    unit = unit.replace("*", "·")
    rows = list(dict.fromkeys((estimator, words) for _, estimator, words, _ in errors))
    figure = Figure(figsize=(FIGURE_WIDTH, 1.2 + 0.3 * len(rows)), layout="constrained")
    axes = figure.subplots(1, len(heads), sharey=True, squeeze=False)[0]
    for axis, head in zip(axes, heads, strict=True):
        found = {estimator: rmse for panel, estimator, _, rmse in errors if panel == head}
        for row, (estimator, _) in enumerate(rows):
            if estimator not in found:
                continue
            family = named_family(estimator) if estimator in {*ESTIMATOR_FAMILIES, STACKED} else None
            tone = colour("ink" if family is None else family.colour)
            bold = "bold" if chosen.get(head) == estimator else "normal"
            axis.plot((0.0, found[estimator]), (row, row), color=tone, linewidth=2.0, alpha=0.4, zorder=2)
            axis.plot([found[estimator]], [row], color=tone, marker="o", markersize=6.0, markeredgewidth=0.0, zorder=3)
            axis.annotate(
                number(found[estimator], digits=3), (found[estimator], row), xytext=(7, -0.5),
                textcoords="offset points", va="center", color=tone, fontsize=8.5, fontweight=bold,
            )  # fmt: skip
        if bare in found:
            axis.axvline(found[bare], color=colour("faint"), linewidth=1.0, linestyle="--", zorder=1)
        tidy(axis, first=axis is axes[0])
        axis.set_title(head, fontweight="bold")
        axis.set_xlim(0.0, 1.18 * max(found.values()))
        axis.set_xlabel(f"RMSE ({unit})")
    axes[0].set_yticks(range(len(rows)), [words for _, words in rows])
    axes[0].set_ylim(len(rows) - 0.4, -0.6)
    return Drawing(name, figure, caption)


def gain_over_angles(worth: Sequence[RecordingWorth], name: str) -> Drawing:
    """Draw the gain from EMG over angles alone, one interval per row, and the required gain."""
    tones = {"worth it": "good", "not worth it": "wrong", "cannot say": "muted"}
    estimates = [
        Estimate(each.words, made.gain, made.low, made.high, tones[made.answer], f"{made.gain:+.2f}, {made.answer}")
        for each in worth
        for made in (each.worth,)
    ]
    margin = worth[0].worth.margin
    reach = max(max(each.gain, each.high if np.isfinite(each.high) else each.gain) for each in (w.worth for w in worth))
    caption = (
        "Gain in R² from EMG over joint angles alone on held-out movements, with 95 % intervals over strides or "
        f"trials. The shaded area shows gains of {margin:g} or more, which count as worth recording EMG."
    )
    ends = margin, max(margin, reach)
    return forest(estimates, name, "R² with EMG minus R² of angles alone", caption=caption, margin=ends)


SHARED_PARAMETER_PREFIX = "joint"
"""Prefix of the names of parameters that belong to the joint, not to one muscle."""


def departures(found: MuscleSummary, name: str, *, caption: str) -> Drawing:
    """Draw every parameter's departure from anatomy with its interval: a panel per quantity, a row per muscle."""
    split = [_split_parameter_name(p) for p in found.parameters]
    quantities = list(dict.fromkeys(quantity for quantity, _ in split))
    rows = list(found.muscles)
    own = [q for q in quantities if any(s == q and m in rows for s, m in split)]
    figure = Figure(figsize=(FIGURE_WIDTH, 1.2 + 0.28 * len(rows)), layout="constrained")
    axes = figure.subplots(1, len(own), sharey=True, squeeze=False)[0]
    for axis, quantity in zip(axes, own, strict=True):
        axis.axvspan(-1.0, 1.0, color=colour("rule"), alpha=0.5, linewidth=0.0, zorder=0)
        for (each, muscle), x, half, bound in zip(
            split, found.deviation, found.half_width, found.at_bound, strict=True
        ):
            if each != quantity or muscle not in rows:
                continue
            y, tone = rows.index(muscle), colour("heldout" if bound else "fitted")
            if not bound:
                axis.plot((x - half, x + half), (y, y), color=tone, linewidth=1.6, alpha=0.5)
            axis.plot([x], [y], color=tone, marker="D" if bound else "o", markersize=5.0, markeredgewidth=0.0)
        tidy(axis, first=axis is axes[0], ticks=4)
        axis.set_title(quantity.replace("_", " "), fontsize=9.0, fontweight="bold")
        axis.set_xlim(-4.5, 4.5)
    axes[len(axes) // 2].set_xlabel("Deviation from the anatomical model (standard deviations among people)")
    axes[0].set_yticks(range(len(rows)), [m.replace("_", " ") for m in rows])
    axes[0].set_ylim(len(rows) - 0.4, -0.6)
    return Drawing(name, figure, caption)


def muscle_work(found: MuscleSummary, name: str, *, caption: str) -> Drawing:
    """Draw the activation of every muscle over a stretch of time, and its torque on the joint."""
    time, count = np.array(found.time), len(found.muscles)
    figure = Figure(figsize=(FIGURE_WIDTH, 0.9 + 0.55 * count), layout="constrained")
    axes = figure.subplots(count, 2, sharex=True, sharey="col", squeeze=False)
    for row, muscle in enumerate(found.muscles):
        left, right = axes[row]
        line(left, time, np.array(found.activation[row]), color=colour("fitted"), linewidth=1.2)
        line(right, time, np.array(found.torque[row]), color=colour("heldout"), linewidth=1.2)
        for axis in (left, right):
            tidy(axis, first=True, ticks=2)
        left.set_ylabel(muscle.replace("_", " "), rotation=0, ha="right", va="center", fontsize=8.5)
    axes[0][0].set_title("Activation", fontweight="bold")
    axes[0][1].set_title("Torque (N·m)", fontweight="bold")
    for axis in axes[-1]:
        axis.set_xlabel("Time (s)")
    return Drawing(name, figure, caption)


def _split_parameter_name(parameter: str) -> tuple[str, str]:
    """Return a parameter's quantity and muscle; the muscle is empty if several share the parameter."""
    quantity, _, muscle = parameter.partition(".")
    return (parameter, "") if quantity == SHARED_PARAMETER_PREFIX or not muscle else (quantity, muscle)


def joints_together(
    traces: Sequence[TorqueTrace], words: Mapping[str, str], name: str, *, caption: str, seconds: float = 5.0
) -> Drawing:
    """Draw the torque of every joint over the middle `seconds` of a recording, a panel each.

    Beside the reference it draws the prediction of every fit that `words` describes, the first with its band.
    """
    tones = dict(zip(words, ("good", "heldout"), strict=True))
    figure = Figure(figsize=(FIGURE_WIDTH, 0.8 + 1.9 * len(traces)), layout="constrained")
    axes = figure.subplots(len(traces), 1, sharex=True, squeeze=False)[:, 0]
    for axis, trace in zip(axes, traces, strict=True):
        near = np.abs(trace.time - 0.5 * (trace.time[0] + trace.time[-1])) <= 0.5 * seconds
        line(axis, trace.time[near], trace.reference[near], color=colour("measured"), linewidth=2.2)
        for i, how in enumerate(words):
            made, tone = trace.predicted[how], colour(tones[how])
            if i == 0:
                low, high = made - trace.half_width[how], made + trace.half_width[how]
                axis.fill_between(
                    trace.time[near], low[near], high[near], color=tone, alpha=0.12, linewidth=0.0, zorder=1
                )
            line(axis, trace.time[near], made[near], color=tone, linewidth=1.2)
        tidy(axis, first=True, text=f"{trace.what.capitalize()} (N·m)", ticks=4)
    axes[-1].set_xlabel("Time (s)")
    key(axes[0], [("reference", colour("measured")), *((words[h], colour(tones[h])) for h in words)])
    return Drawing(name, figure, caption)


PANEL_TITLES = {"short_range": "Short-range stiffness", "slope": "Slope of the modelled torque"}
"""Title of the panel of each kind of stiffness."""


def stiffness_over_time(found: JointStiffness, name: str, *, caption: str) -> Drawing:
    """Draw both kinds of stiffness with their intervals, and the torque below."""
    shown = found.time <= DRAWN_MUSCLES_S
    time = found.time[shown]
    figure = Figure(figsize=(FIGURE_WIDTH, 5.2), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    for axis, kind, tone in zip(axes, STIFFNESS_KINDS, ("fitted", "heldout"), strict=False):
        value, half = found.value[kind][shown], 1.96 * found.error[kind][shown]
        axis.fill_between(time, value - half, value + half, color=colour(tone), alpha=0.15, linewidth=0.0)
        line(axis, time, value, color=colour(tone), linewidth=1.4)
        axis.axhline(0.0, color=colour("rule"), linewidth=0.8, zorder=0)
        axis.set_title(PANEL_TITLES[kind], fontsize=9.5, fontweight="bold", loc="left")
        tidy(axis, first=True, text="N·m/rad", ticks=4)
    line(axes[2], time, np.asarray(found.torque)[shown], color=colour("measured"), linewidth=1.4)
    axes[2].set_title("Torque by the muscles", fontsize=9.5, fontweight="bold", loc="left")
    tidy(axes[2], first=True, text="N·m", ticks=4)
    axes[2].set_xlabel("Time (s)")
    return Drawing(name, figure, caption)


SHORT_ESTIMATOR_NAMES = {
    name: family.short for name, family in {**ESTIMATOR_FAMILIES, STACKED: STACKED_FAMILY}.items() if family.short
}
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
    drawn = [drawing for section in sections for drawing in section.drawings]
    return study_page(
        title=f"{findings.study}: torque from EMG",
        answer=findings.answer,
        tiles=_tiles(findings),
        sections=sections,
        # Verdicts that invalidate results stand above all results. The others follow below the first section.
        verdicts=[v for v in findings.verdicts if _invalidates_results(v)],
        figure=next((drawing for drawing in drawn if drawing.name.startswith("torque_")), None),
    )


def _invalidates_results(verdict: Verdict) -> bool:
    """Return whether a verdict invalidates results or their error bands."""
    return verdict.kind == "wrong" or verdict.finding == INVALID_BANDS_FINDING


def _tiles(findings: CalibrationResult) -> tuple[Tile, ...]:
    """Return tiles: what EMG is worth, then the recommended estimator's worst error for each joint or person."""
    tiles = [_worth_tile(findings)] if findings.worth else []
    for each in findings.chosen:
        judged = sorted(each.by_condition(), key=lambda one: -one.score.rmse)
        worst, others = judged[0], judged[1:4]
        more = [named_family(worst.estimator).description, f"R² {worst.score.r2:.3f}"]
        if worst.bare is not None:
            more.append(f"angles alone, without EMG: {number(worst.bare.rmse, digits=3)}")
        more += [f"{one.name.replace('_', ' ')} {number(one.score.rmse, digits=3)}" for one in others]
        unit = (
            "of the leg's weight, RMS"
            if each.judged[0].kind == FORMULA_KIND
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
    return Tile("Gain in R² from EMG", typeset_sentence(f"{best.worth.gain:+.2f}"), unit, note)


def _errors_section(findings: CalibrationResult) -> Section:
    """Return the section with the errors of all estimators."""
    tables = figure_tables(findings)
    first = tuple(t for t in tables if t.caption.startswith(("Gain from EMG", "Recommended estimators")))
    rest = tuple(
        t for t in tables if t not in first and not t.caption.startswith(("Estimator choice", "Stiffness", "Posterior"))
    )
    shown = {each.what: _worst_recording(findings, each) for each in findings.chosen}
    several = len({recording for recording in shown.values() if recording}) > 1
    head = {w: f"{w}, {r.replace('_', ' ')}" if several else w for w, r in shown.items()}
    plain = [
        e for e in findings.evaluated
        if not e.causal and e.recording == shown[e.what] and not e.family.sees_measured_torque
    ]  # fmt: skip
    where = next(iter(shown.values()))
    on = " on held-out data" + ("" if several or not where else f" ({where.replace('_', ' ')}, the worst recording)")
    drawing = draw(
        error_by_estimator,
        [(head[e.what], e.estimator, e.family.description, e.score.rmse) for e in plain],
        "errors",
        heads=list(dict.fromkeys(head[e.what] for e in plain)),
        chosen={head[each.what]: each.judged[0].estimator for each in findings.chosen},
        bare=BASELINE_ESTIMATOR,
        unit=plain[0].torque_unit if plain[0].kind != FORMULA_KIND else "of the leg's weight",
        caption=f"RMS error of the torque{on}. Dashed: joint angles alone, without EMG. Bold: the recommended "
        "estimator, chosen by tests within the fitted recordings.",
    )
    gains = (draw(gain_over_angles, findings.worth, "worth"),) if findings.worth else ()
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
        of = {e.recording: e.estimator for e in each.judged} | dict(each.by)
        chosen = of.get(trace.recording, each.judged[0].estimator)
        bands = {chosen: trace.half_width[chosen]} if chosen in trace.half_width else {}
        drawings.append(
            draw(
                torque_trace, trace.time, trace.reference, trace.predicted, f"torque_{i}", chosen=chosen,
                bare=BASELINE_ESTIMATOR, words=words | SHORT_ESTIMATOR_NAMES, half_width=bands,
                unit=findings.evaluated[0].torque_unit,
                caption=f"Torque of {trace.what}, {trace.recording.replace('_', ' ')}: the reference "
                "(black; white on a dark page), the estimates from held-out EMG and motion, the estimate from angles "
                f"alone (dashed), and their errors{coverage_text(replace(trace, half_width=bands))}.",
            )
        )  # fmt: skip
    return Section("emg_torque", "Torque over time", drawings=tuple(drawings))


def _verdicts_section(findings: CalibrationResult) -> Section | None:
    """Return the section with the remaining verdicts, the worst first; None if there are none."""
    verdict_texts = tuple(
        (v.kind, typeset_sentence(v.said))
        for v in rank_verdicts(v for v in findings.verdicts if not _invalidates_results(v))
    )
    return Section("emg_known", "Remarks", verdicts=verdict_texts) if verdict_texts else None


def coverage_text(trace: TorqueTrace) -> str:
    """Return words that state each band's level and the share of the torque that it holds; empty without bands."""
    sentences = []
    for name, half in trace.half_width.items():
        share = 100.0 * covered_share(trace.reference, trace.predicted[name], half)
        words, level = named_family(name).description, 100.0 * trace.level
        sentences.append(f"; the {level:g} % prediction band of {words} covers {share:.0f} % of this torque")
    return "".join(sentences)


def _muscles_section(findings: CalibrationResult) -> Section | None:
    """Return the section with muscle parameters, activations and torques; None if muscles were not fitted."""
    if not findings.muscles:
        return None
    drawings = []
    for i, found in enumerate(findings.muscles, start=1):
        caption = (
            f"Muscles of {found.what}: deviation of each parameter from the anatomical model, with its 95 % interval. "
            "The band shows the usual range among people; diamonds mark parameters on a physiological bound."
        )
        drawings.append(draw(departures, found, f"muscles_{i}", caption=caption))
        recording = found.recording.replace("_", " ")
        caption = f"Activation of each muscle of {found.what} and its torque about the joint, {recording}."
        drawings.append(draw(muscle_work, found, f"muscle_work_{i}", caption=caption))
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
            f"{table.title}. Parameters with unit 1 are factors of the anatomical value.",
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
            joints_together, traces, FIT_WORDS, "joints_together",
            caption=f"Torques of {over} from one set of muscles on held-out data, {where}: with a delay of 10 to "
            f"100 ms from envelope to force (and its {100.0 * ERROR_BAND.share:g} % band), and with an additional "
            "time offset of the EMG stream.",
        ),
        draw(
            departures, summary, "muscles_together",
            caption=f"Muscles of {over} together: deviation of each parameter from the anatomical model, with its 95 % "
            "interval. Diamonds mark parameters on a bound, which are not identifiable.",
        ),
    )  # fmt: skip
    posterior_text = ()
    posterior, determined = findings.together.posterior, findings.together.told
    if posterior is not None:
        posterior_text = (
            "Posterior of these muscles, with physiological bounds and the variation of anatomy among people as the "
            f"prior. {posterior.settled}. The figure shows the parameters that the recording determines best.",
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
            stiffness_over_time, found, f"stiffness_{found.joint}",
            caption=f"Stiffness of the {found.joint}, {found.recording.replace('_', ' ')}, from calibrated muscles and "
            "tissue. The 95 % intervals include the covariance of the calibration and the variation of muscles and "
            "tendons. No perturbation was applied, so that the intervals do not include errors of the model itself.",
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
                each.words,
                each.choice,
                "–" if each.within is None else f"{each.within.r2:.3f}",
            )
        )
        for each in findings.evaluated
        if each.recording == first
    )
    heads = ("Torque of", "Estimator", "Inputs; settings", "R² in cross-validation")
    caption = "Inputs and settings chosen by cross-validation within the fitted recordings."
    tables = (*figure_tables(findings, "Estimator choice"), Table(heads, rows, frozenset({3}), caption, True))
    return Section("emg_choices", "Inputs of each estimator, and choice of the recommended one", tables=tables)


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
        "Features and settings are chosen by cross-validation over whole repetitions, or over blocks of time with gaps "
        "as long as the memory of the features. Held-out recordings are not used for this choice. The recommended "
        "estimator is the weighted mean of all candidates with the smallest error in tests within the fitted "
        "recordings. Each of several recordings or repetitions is a test set once. With fewer than three, blocks of "
        "time are test sets, too. A candidate with nearly all of the weight is recommended alone. Muscles held by "
        "anatomy are recommended for recordings that are unlike all fitted ones. The 90 % prediction band is derived "
        "from the errors in these recordings or repetitions, or in the thirds of a single recording. The estimators "
        "are refitted to the others, and their weights follow from the errors in the others, so that the band includes "
        "the cost of choosing weights. Features and settings are those that all fitted recordings chose."
    )
    return Section("emg_method", "How", (" ".join(paragraphs),), notes=study.notes)
