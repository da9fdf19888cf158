"""The page of a tried log on one screen: identified parameters, their error on held-out data, and assumptions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .._errors import listed_names
from ..models.estimates import Parameter
from ..study.answer import WORN_TOGETHER, Answer
from ..study.drawing.drawing import (
    SHADED_GAPS_WORDS,
    Drawing,
    Head,
    draw,
    heads,
    key,
    measured_and_predicted,
    shade_gaps,
    tidy,
)
from ..study.drawing.style import FIGURE_WIDTH, colour
from ..study.pages.forest import Row, Table, number_table
from ..study.pages.page import Page, Section
from ..study.pages.quantities import (
    effort_label,
    number,
    parameter_interval,
    parameter_label,
    parameter_note,
    percent,
    typeset_quantities,
    typeset_sentence,
    unit_text,
    value_and_half_interval,
)
from ..study.procedures.study_page import figure_tables, parameter_tables
from ..study.recorded_motions import recorded_word
from .proposal_page import layout_tables
from .study_text import channel_name

if TYPE_CHECKING:
    from .proposal import Layout
    from .tried_log import TriedJoint, TriedLog

MAX_LISTED_COLUMNS = 12
"""At most so many columns are listed in a line; a table has all."""

MAX_FIRST_COLUMNS = 6
"""At most so many columns stand above the figure."""

MAX_DRAWN_JOINTS = 8
"""At most so many joints are drawn."""

FIRST_PARAMETERS = ("inertia", "gravity", "viscous", "coulomb")
"""Parameters of which a table of several joints has a column each."""

FURTHER_FRICTION_TERMS = frozenset({"load", "square_root", "stribeck", "directional"})
"""Friction terms that take a part of viscous and Coulomb friction where a joint has one."""

MAX_PARAMETER_COLUMNS = 3
"""Number of the most frequent parameters in such a table where no joint has one of the first ones."""

MAX_DETAILED_JOINTS = 1
"""Largest number of joints for which each parameter has a row of its own."""

MAX_ASSUMPTIONS_OF_JOINTS = 4
"""Largest number of assumptions on the first screen if it shows a table of several joints."""

MAX_SHOWN_ASSUMPTIONS = 8
"""Largest number of assumptions on the first screen; the section below lists all."""


def try_page(tried: TriedLog) -> Page:
    """Return the page of a tried log."""
    result = tried.result
    verdicts = tuple((v.kind, typeset_sentence(v.said)) for v in tried.verdicts)
    held = _held_out_joints(tried)
    computed = tried.answer.basis.computed if tried.answer.basis else ""
    sections = [_assumed(tried)]
    # A table of several joints leaves no room for a figure above the assumptions.
    is_first = len(held) == 1 and len(tried.joints) <= MAX_DETAILED_JOINTS
    if held and not is_first:
        drawing = draw(_efforts, held, computed)
        sections.insert(0, Section("held-out", "Prediction of held-out data", drawings=(drawing,)))
    tables = (*parameter_tables(result), *figure_tables(result))
    sections.append(Section("result", "Parameters and comparisons", (), tables))
    for layout in tried.proposal.layouts:
        name = layout.stream or "main"
        clock, table = layout_tables(layout, tried.proposal)
        heading = f"Columns of the stream {layout.stream}" if layout.stream else "Columns"
        sections.append(Section(f"columns-{name}", heading, (clock,), (table,)))
    if tried.proposal.remarks:
        sections.append(Section("remarks", "Remarks", tuple(typeset_sentence(f"{r}.") for r in tried.proposal.remarks)))
    return Page(
        f"{result.study}: {', '.join(joint.name for joint in tried.joints) or result.command}",
        "Pellucid try",
        "",
        (),
        tuple(sections),
        f"Written by pellucid {version('pellucid')}. The study is in {tried.study.folder}.",
        verdicts,
        _with_columns(tried),
        figure=draw(_efforts, held, computed) if is_first else None,
        summary=(_parameters(tried), _assumed(tried, MAX_SHOWN_ASSUMPTIONS)),
    )


def column_roles(layout: Layout, arrow: str, most: int = MAX_LISTED_COLUMNS) -> list[str]:
    """Return the columns of a layout and their roles in a line, and those that are not used in another one.

    A line has at most `most` columns.
    """
    clock = layout.roles.clock
    used = [f"{clock.column} {arrow} time [{clock.unit}]"] if clock.column else []
    used += [f"{role.column} {arrow} {channel_name(role)} [{role.scaled_unit(4)}]" for role in layout.channels]
    idle = [role.column for role in layout.roles.roles if role.quantity is None]
    lines = [listed_names(used, most)]
    return [*lines, f"not used: {listed_names(idle, most)}"] if idle else lines


def _with_columns(tried: TriedLog) -> Answer:
    """Return the answer with the roles of the columns in its basis."""
    answer = tried.answer
    if answer.basis is None:
        return answer
    layouts = tried.proposal.layouts
    roles = "; ".join(line for layout in layouts for line in column_roles(layout, "as", MAX_FIRST_COLUMNS))
    return replace(answer, basis=replace(answer.basis, more=(*answer.basis.more, f"Columns used: {roles}.")))


def parameter_rows(tried: TriedLog) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heads and rows of the joints' parameters with their intervals."""
    level, joints = tried.result.confidence, tried.joints
    of_both = f", {WORN_TOGETHER}" if tried.study.config.worn else ""
    share = f"{100.0 * level:g} %"
    if len(joints) <= MAX_DETAILED_JOINTS:
        heads = (f"Parameter{of_both}", "Value", "Unit", f"{share} interval", "Note")
        return heads, [_row(p, level) for joint in joints for p in joint.parameters]
    counts = Counter((p.name, p.unit) for joint in joints for p in joint.parameters)
    wanted = [which for name in FIRST_PARAMETERS for which in counts if which[0] == name]
    shown = wanted or [which for which, _ in counts.most_common(MAX_PARAMETER_COLUMNS)]
    units = (f" ({unit_text(unit)})" if unit_text(unit) else "" for _, unit in shown)
    parameters = (f"{parameter_label(name, si)}{unit}" for (name, si), unit in zip(shown, units, strict=True))
    heads = (f"Joint{of_both}", "Held-out error (%)", "Constant effort (%)", *parameters)
    rows = [_joint_row(joint, shown, level) for joint in joints]
    # Viscous and Coulomb friction mean little where a further term takes a part of them.
    further = [_further_friction(joint, level) for joint in joints]
    if any(further):
        heads, rows = (*heads, "Further friction"), [(*row, more) for row, more in zip(rows, further, strict=True)]
    return heads, rows


def _row(p: Parameter, level: float) -> tuple[str, ...]:
    interval = parameter_interval(p, level)
    value, unit = number(p.value, p.standard_error), unit_text(p.unit) or "–"
    return parameter_label(p.name, p.unit), value, unit, interval, parameter_note(p, level)


def _joint_row(joint: TriedJoint, shown: Sequence[tuple[str, str]], level: float) -> tuple[str, ...]:
    own = {(p.name, p.unit): p for p in joint.parameters}
    cells = [_cell(own[which], level) if which in own else "–" for which in shown]
    held = joint.held_out
    errors = ("–", "–") if held is None else (percent(held.error), percent(held.constant_error))
    return joint.name, *errors, *cells


def _further_friction(joint: TriedJoint, level: float) -> str:
    """Return a joint's friction terms other than viscous and Coulomb friction, each with its value."""
    terms = [p for p in joint.parameters if p.name in FURTHER_FRICTION_TERMS]
    return "; ".join(f"{parameter_label(p.name, p.unit)}: {_cell(p, level)} {unit_text(p.unit)}".strip() for p in terms)


def _cell(p: Parameter, level: float) -> str:
    if p.at_bound:
        return f"{number(p.value, digits=3)}, at its bound"
    return value_and_half_interval(p, level)


def _parameters(tried: TriedLog) -> Section:
    """Return the part of the first screen with the parameters, or with the result's first tables."""
    if not tried.joints:
        return Section("parameters", "Result", (), (*parameter_tables(tried.result), *figure_tables(tried.result))[:1])
    heads, rows = parameter_rows(tried)
    if len(tried.joints) <= MAX_DETAILED_JOINTS:
        return Section("parameters", "Parameters", (), (Table(heads, tuple(map(Row, rows)), frozenset({1, 3})),))
    title = f"Parameters, each with the half-width of its {100.0 * tried.result.confidence:g} % confidence interval"
    advice = (tried.robot_advice,) if tried.robot_advice else ()
    return Section("parameters", title, advice, (number_table(heads, rows),))


def _assumed(tried: TriedLog, most: int | None = None) -> Section:
    """Return the assumptions; on the first screen, where at most `most` are shown, without their reasons."""
    assumed = tried.assumptions
    anchor = "assumed" if most is None else "assumed-first"
    if not assumed:
        return Section(anchor, "Assumed", ("Nothing: the files contain all information.",))
    if most is not None and len(tried.joints) > MAX_DETAILED_JOINTS:
        # A table of several joints leaves no room for another above the verdicts.
        most = MAX_ASSUMPTIONS_OF_JOINTS
        text = "; ".join(f"{_short(a.words)}: {_short(a.taken)}" for a in assumed[:most])
        more = len(assumed) - most
        return Section(anchor, "Assumed", (f"{text}{f'; and {more} more, listed below' * (more > 0)}.",))
    if most is not None:
        more = len(assumed) - most
        notes = (f"and {more} more, listed below",) if more > 0 else ()
        rows = tuple(Row((_short(a.words), _short(a.taken), "default" if a.is_question else "from the files"))
                     for a in assumed[:most])  # fmt: skip
        return Section(anchor, "Assumed", (), (Table(("Assumption", "Value", "Origin"), rows, wide=True),), notes=notes)
    rows = tuple(
        Row((a.subject, a.taken, "default" if a.is_question else "from the files", typeset_quantities(a.why)))
        for a in assumed
    )
    text = "Replace a default with `--answer KEY=VALUE`. Correct values from the files in study.toml."
    table = Table(("Assumption", "Value", "Origin", "Question or reason"), rows, wide=True)
    return Section(anchor, "Assumed", (text,), (table,))


def _short(text: str, most: int = 34) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _held_out_joints(tried: TriedLog) -> list[TriedJoint]:
    """Return the joints whose efforts are drawn on held-out data, the one with the largest error first."""
    held = [(joint.held_out.error, joint) for joint in tried.joints if joint.held_out is not None]
    return [joint for _, joint in sorted(held, key=lambda each: -each[0])][:MAX_DRAWN_JOINTS]


def _efforts(joints: Sequence[TriedJoint], computed: str = "") -> Drawing:
    """Draw recorded and predicted efforts on held-out data, a joint beneath another; `computed` as `recorded_word`."""
    figure = Figure(figsize=(FIGURE_WIDTH, 0.9 + 1.3 * len(joints)), layout="constrained")
    axes = figure.subplots(len(joints), 1, squeeze=False, sharex=False)[:, 0]
    has_gaps = several = False
    word = recorded_word(computed)
    for axis, joint in zip(axes, joints, strict=True):
        held = joint.held_out
        assert held is not None  # such joints alone are drawn
        # Recordings are drawn one after another.
        steps = np.diff(held.time, prepend=held.time[:1])
        usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
        time = np.cumsum(np.where(steps < 0.0, usual, steps))
        has_gaps = shade_gaps(axis, time) or has_gaps
        for begun in time[steps < 0.0]:
            axis.axvline(begun, color=colour("faint"), linewidth=0.9, zorder=1)
        several = several or bool((steps < 0.0).any())
        measured_and_predicted(axis, time, held.measured, held.predicted, colour("heldout"))
        axis.axhline(float(held.measured.mean()), color=colour("muted"), linewidth=0.9)
        tidy(axis, first=True, text=effort_label(held.unit), ticks=4)
        heads([axis], [Head(joint.name, f"error {percent(held.error)} %", colour("heldout"))])
    entries = [(word, colour("measured")), ("predicted (dashed)", colour("heldout")), ("mean", colour("muted"))]
    key(axes[0], entries)
    axes[-1].set_xlabel("Time (s)")
    return Drawing(
        "held_out",
        figure,
        f"Effort on held-out data: {word}, predicted by the model (dashed), and the mean as a baseline."
        + (" Vertical lines separate recordings." if several else "")
        + (f" {SHADED_GAPS_WORDS}" if has_gaps else ""),
    )
