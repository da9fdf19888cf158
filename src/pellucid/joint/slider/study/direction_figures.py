"""Figures of a joint whose friction depends on direction, each a function from plain arrays to a drawing.

Models are named by the caller and keep one colour each; what was measured, or is true, is dark grey. SI in; angles and
small lengths are drawn in degrees and millimetres. A `caption` replaces the figure's own.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ....study.drawing.drawing import Drawing, line, one_panel, origin, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.quantities import number

FREE_COLOUR_ROLES = ("heldout", "fitted", "load", "directional", "stribeck", "combined", "good")
"""Colour roles that models take in turn where the caller names none; the first two serve the usual comparison."""

NAMED_COLOUR_ROLES: Mapping[str, str] = {
    "truth": "measured",
    "measured": "measured",
    "up": "heldout",
    "down": "load",
    "static": "directional",
    "consistent": "fitted",
}
"""Colour roles of names that mean the same in every figure."""

MARKER_SHAPES: Mapping[str, tuple[str, str]] = {"sweep": ("o", "●"), "constant": ("^", "▲"), "slow": ("s", "■")}
"""Matplotlib marker of each protocol's trials, and the same shape as a character for legends."""
DEFAULT_MARKER_SHAPE = ("D", "◆")
"""Marker, and its character, of any other protocol."""

PANEL_POINTS = 72.0 * FIGURE_WIDTH - 70.0
"""Width of a panel that fills the page, in points."""
NAME_POINTS = 6.4
"""Width of a character of a name, in points."""


def paired_errors(
    errors: Mapping[str, np.ndarray],
    protocols: Sequence[str],
    name: str = "paired-errors",
    *,
    roles: Mapping[str, str] | None = None,
    caption: str = "",
    ids: Mapping[str, str] | None = None,
) -> Drawing:
    """Draw the mean absolute current error of several models over the same trials, and the mean over trials.

    `errors` are of shape (k,) each [A]; `ids` are the ids of their means' rows in results.json, by model.
    """
    tones = _tones(errors, roles)
    table = np.column_stack([np.asarray(e, float) for e in errors.values()])
    figure, axis = one_panel(3.7)
    # Trials stand apart within a column, in their own order, so that none hides another.
    shift = 0.13 * np.linspace(-1.0, 1.0, len(table)) if len(table) > 1 else np.zeros(1)
    columns = np.arange(table.shape[1], dtype=float)
    for row, off in zip(table, shift, strict=True):
        axis.plot(columns + off, row, color=colour("faint"), linewidth=0.7, zorder=2)
    for column, (model, tone) in enumerate(tones.items()):
        values = table[:, column]
        known = values[np.isfinite(values)]
        if not len(known):
            continue
        for protocol in dict.fromkeys(protocols):
            chosen = np.array([p == protocol for p in protocols])
            axis.plot(
                (column + shift)[chosen], values[chosen], color=tone, marker=_shape(protocol)[0], markersize=4.6,
                markeredgewidth=0.0, linestyle="none", alpha=0.75, zorder=4,
            )  # fmt: skip
        mean = float(np.mean(known))
        axis.plot((column - 0.21, column + 0.21), (mean, mean), color=tone, linewidth=2.6, zorder=5)
        written = axis.annotate(
            f"{number(mean, digits=3)} A", (column + 0.21, mean), xytext=(6, 0), textcoords="offset points",
            va="center", color=tone, fontsize=9.5, fontweight="bold", zorder=6,
            bbox={"boxstyle": "square,pad=0.12", "facecolor": colour("paper"), "alpha": 0.8, "linewidth": 0},
        )  # fmt: skip
        if ids and model in ids:
            written.set_gid(f"value:{ids[model]}")
    tidy(axis, first=True, text="Mean absolute current error (A)")
    axis.set_xlim(-0.5, table.shape[1] - 0.5)
    axis.set_ylim(0.0, 1.06 * float(np.nanmax(table)))
    _categories(axis.xaxis, tones)
    _names(axis, [(f"{_shape(p)[1]} {p}", colour("muted")) for p in dict.fromkeys(protocols)])
    return Drawing(
        name,
        figure,
        caption
        or f"Mean absolute error of the predicted current over {len(table)} trials, by model. Each dot is a trial, "
        "its shape the protocol, and a thin line joins the same trial under different models. The bar and the number "
        "are the mean over trials.",
    )


def current_trace(
    time: np.ndarray,
    measured: np.ndarray,
    predictions: Mapping[str, np.ndarray],
    velocity: np.ndarray | None = None,
    name: str = "current",
    *,
    roles: Mapping[str, str] | None = None,
    caption: str = "",
) -> Drawing:
    """Motor current against time, measured and by several models, with the velocity in a small panel beneath.
    `time`, `measured` (n,) [s], [A]; `predictions` (n,) [A]; `velocity` (n,) [rad/s]."""
    tones = _tones(predictions, roles)
    figure = Figure(figsize=(FIGURE_WIDTH, 3.4 if velocity is None else 4.6), layout="constrained")
    if velocity is None:
        top = bottom = figure.subplots()
    else:
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 1.0))
        line(bottom, time, np.degrees(velocity), color=colour("measured"), linewidth=1.1)
        bottom.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        tidy(bottom, first=True, text="Velocity (deg/s)", ticks=4)
    top.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    line(top, time, measured, color=colour("measured"), linewidth=1.8, alpha=0.75)
    for model, values in predictions.items():
        line(top, time, values, color=tones[model], linewidth=1.3)
    tidy(top, first=True, text="Motor current (A)")
    bottom.set_xlabel("Time (s)")
    _names(top, [("measured", colour("measured")), *tones.items()])
    return Drawing(
        name,
        figure,
        caption
        or "Motor current during one trial: measured (grey) and predicted by each model (colour)"
        + ("." if velocity is None else ", with the joint's velocity beneath."),
    )


def gravity_by_direction(
    angle_deg: np.ndarray,
    torques: Mapping[str, np.ndarray],
    name: str = "gravity",
    *,
    roles: Mapping[str, str] | None = None,
    caption: str = "",
) -> Drawing:
    """Gravity torque against the joint's angle, by the way it was found. `angle_deg` (n,) [deg]; `torques` (n,) [N
    m]."""
    figure, axis = _curves(angle_deg, torques, roles, 3.9, "Gravity torque (N·m)", "Joint angle (deg)")
    axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    axis.xaxis.set_major_locator(MaxNLocator(10, steps=[1, 1.5, 3, 4.5, 6, 9, 10]))
    return Drawing(
        name,
        figure,
        caption
        or "Gravity torque against the joint's angle. Curves from moving one way alone carry that way's friction; "
        "where they part, friction was taken for gravity.",
    )


def inertia_by_slider(
    x: np.ndarray,
    inertias: Mapping[str, np.ndarray],
    truth: np.ndarray | None = None,
    name: str = "inertia",
    *,
    roles: Mapping[str, str] | None = None,
    caption: str = "",
) -> Drawing:
    """Inertia against the position of the slider. `x` (n,) [m]; `inertias` (n,) [kg m^2]; `truth` (n,) [kg m^2]."""
    curves = {**inertias, **({} if truth is None else {"truth": truth})}
    figure, _ = _curves(1e3 * np.asarray(x, float), curves, roles, 3.7, "Inertia (kg·m²)", "Slider position (mm)")
    return Drawing(
        name,
        figure,
        caption
        or "Inertia about the joint's axis against the slider's position"
        + ("." if truth is None else "; dashed is the true one."),
    )


def friction_by_load(
    load: np.ndarray,
    frictions: Mapping[str, np.ndarray],
    name: str = "friction-load",
    *,
    roles: Mapping[str, str] | None = None,
    caption: str = "",
) -> Drawing:
    """Friction against the load that the drive transmits. `load` (n,) [N m]; `frictions` (n,) [N m]."""
    figure, axis = _curves(load, frictions, roles, 3.7, "Friction (N·m)", "Transmitted load (N·m)")
    origin(axis)
    return Drawing(name, figure, caption or "Friction torque against the load that the drive transmits, by model.")


def error_by_trial(
    labels: Sequence[str],
    errors: Mapping[str, np.ndarray],
    name: str = "error-by-trial",
    *,
    unit: str = "A",
    roles: Mapping[str, str] | None = None,
    caption: str = "",
) -> Drawing:
    """Error of every trial by every model, a row a trial. `errors` (k,) [`unit`]."""
    tones = _tones(errors, roles)
    table = np.column_stack([np.asarray(e, float) for e in errors.values()])
    figure, axis = one_panel(1.0 + 0.24 * len(labels))
    for row, values in enumerate(table):
        known = values[np.isfinite(values)]
        if len(known):
            axis.plot((known.min(), known.max()), (row, row), color=colour("faint"), linewidth=1.4, zorder=2)
    for column, tone in enumerate(tones.values()):
        axis.plot(
            table[:, column], np.arange(len(table)), color=tone, marker="o", markersize=5.6, markeredgewidth=0.0,
            linestyle="none", zorder=3,
        )  # fmt: skip
    axis.set_xlim(0.0, 1.05 * float(np.nanmax(table)))
    _rows(axis, labels)
    axis.set_xlabel(f"Error e ({unit})")
    _names(axis, list(tones.items()))
    return Drawing(
        name, figure, caption or "Error of every trial by every model; a grey line spans the models of one trial."
    )


def ratio_by_rig(
    names: Sequence[str],
    medians: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    published: float | None = None,
    name: str = "ratio-by-rig",
    *,
    caption: str = "",
) -> Drawing:
    """Error without over error with the directional model, rig by rig, with its spread over seeds. `medians`, `low`,
    `high` (r,)."""
    medians, low, high = (np.asarray(v, float) for v in (medians, low, high))
    figure, axis = one_panel(1.1 + 0.36 * len(names))
    tone = colour("fitted")
    for row, (middle, least, most) in enumerate(zip(medians, low, high, strict=True)):
        axis.plot((least, most), (row, row), color=tone, linewidth=2.0, alpha=0.45, zorder=2)
        axis.plot([middle], [row], color=tone, marker="o", markersize=6.5, markeredgewidth=0.0, zorder=3)
        axis.annotate(
            number(middle, digits=3), (max(most, middle), row), xytext=(8, -0.5), textcoords="offset points",
            va="center", color=tone, fontsize=9,
        )  # fmt: skip
    _rows(axis, names)
    reach = np.nanmax([*high, *medians, published or 1.0])
    axis.set_xlim(0.0, 1.12 * float(reach))
    entries = [("this work, median and spread over seeds", tone), *_published(axis.axvline, published)]
    axis.axvline(1.0, color=colour("muted"), linewidth=0.8, zorder=1)
    axis.set_xlabel("Error without / error with")
    _names(axis, entries)
    return Drawing(
        name,
        figure,
        caption
        or "How many times smaller the error becomes with the directional model: the median over seeds, and the spread "
        "as a line. At 1 nothing is gained."
        + _published_words(published),
    )


def ratio_by_friction(
    x: np.ndarray,
    ratio: np.ndarray,
    published: float | None,
    xlabel: str,
    name: str = "ratio-by-friction",
    *,
    low: np.ndarray | None = None,
    high: np.ndarray | None = None,
    caption: str = "",
) -> Drawing:
    """Error without over error with the directional model, against a parameter of friction. `x`, `ratio` (n,);
    `low`, `high` (n,)."""
    x, ratio = np.asarray(x, float), np.asarray(ratio, float)
    figure, axis = one_panel(3.5)
    tone = colour("fitted")
    if low is not None and high is not None:
        axis.fill_between(x, low, high, color=tone, alpha=0.16, linewidth=0)
    axis.plot(x, ratio, color=tone, linewidth=1.8, marker="o", markersize=4.6, markeredgewidth=0.0, zorder=3)
    entries = [("this work", tone), *_published(axis.axhline, published)]
    axis.axhline(1.0, color=colour("muted"), linewidth=0.8, zorder=1)
    tidy(axis, first=True, text="Error without / error with")
    axis.set_ylim(0.0, 1.08 * float(np.nanmax([*ratio, *([] if high is None else high), published or 1.0])))
    axis.set_xlabel(xlabel)
    _names(axis, entries)
    return Drawing(
        name,
        figure,
        caption
        or "How many times smaller the error becomes with the directional model, against a parameter of friction"
        + (". " if low is None else "; the band is the spread over seeds. ")
        + "At 1 nothing is gained."
        + _published_words(published),
    )


def cycle_energy(
    amplitude_deg: np.ndarray,
    energies: Mapping[str, np.ndarray],
    name: str = "cycle-energy",
    *,
    roles: Mapping[str, str] | None = None,
    caption: str = "",
) -> Drawing:
    """Net energy of one closed cycle against its amplitude. `amplitude_deg` (n,) [deg]; `energies` (n,) [J]."""
    figure, axis = _curves(amplitude_deg, energies, roles, 3.5, "Net energy per cycle (J)", "Amplitude (deg)")
    axis.axhline(0.0, color=colour("muted"), linewidth=0.8, zorder=1)
    return Drawing(
        name,
        figure,
        caption
        or "Net energy of one closed cycle against its amplitude. Gravity gives back what it takes, so a model of "
        "gravity that leaves zero is none.",
    )


# --- common to several ----------------------------------------------------------------------------------------------


def _tones(models: Mapping[str, object], roles: Mapping[str, str] | None) -> dict[str, str]:
    """Return the colour of each model: as `roles` says, as its name means in every figure, or the next free one."""
    fixed = {**NAMED_COLOUR_ROLES, **(roles or {})}
    taken = {fixed[m] for m in models if m in fixed}
    free = [r for r in FREE_COLOUR_ROLES if r not in taken] or list(FREE_COLOUR_ROLES)
    others = [m for m in models if m not in fixed]
    return {m: colour(fixed[m] if m in fixed else free[others.index(m) % len(free)]) for m in models}


def _curves(
    x: np.ndarray, curves: Mapping[str, np.ndarray], roles: Mapping[str, str] | None, height: float, y: str, below: str
) -> tuple[Figure, Axes]:
    """Draw curves over one `x`, with markers if there are at most 30 points; the truth is dashed, below the others."""
    figure, axis = one_panel(height)
    x, tones = np.asarray(x, float), _tones(curves, roles)
    order = np.argsort(x, kind="stable")
    marker = {"marker": "o", "markersize": 4.2, "markeredgewidth": 0.0} if len(x) <= 30 else {}
    for model, values in curves.items():
        style = {"dashes": (5, 2), "linewidth": 2.4, "zorder": 2} if model == "truth" else {"zorder": 3, **marker}
        axis.plot(x[order], np.asarray(values, float)[order], color=tones[model], **style)
    _names(axis, list(tones.items()))
    tidy(axis, first=True, text=y)
    axis.set_xlabel(below)
    return figure, axis


def _names(axis: Axes, entries: Sequence[tuple[str, str]]) -> None:
    """Write names in their colours above a panel, where they hide nothing, on as many lines as they need."""
    rows: list[list[tuple[str, str]]] = [[]]
    used = 0.0
    for text, tone in entries:
        width = NAME_POINTS * len(text) + 14.0
        if rows[-1] and used + width > PANEL_POINTS:
            rows.append([])
            used = 0.0
        rows[-1].append((text, tone))
        used += width
    # The first of each line makes room for it; the others must not widen the layout.
    for k, row in enumerate(reversed(rows)):
        last = None
        for text, tone in row:
            first = last is None
            last = axis.annotate(
                text, (0.0, 1.0) if first else (1.0, 0.0), xytext=(0, 7 + 15 * k) if first else (14, 0),
                xycoords="axes fraction" if first else last, textcoords="offset points",
                va="bottom", color=tone, fontsize=9, fontweight="bold",
                annotation_clip=False,
            )  # fmt: skip
            last.set_in_layout(first)


def _shape(protocol: str) -> tuple[str, str]:
    """Return a protocol's Matplotlib marker and its character."""
    return MARKER_SHAPES.get(protocol, DEFAULT_MARKER_SHAPE)


def _categories(axis, tones: Mapping[str, str]) -> None:
    """Write names of models as an axis's tick labels, in their colours."""
    most = max(int(PANEL_POINTS / len(tones) / NAME_POINTS) - 1, 8)
    axis.set_ticks(range(len(tones)), [textwrap.fill(model, most) for model in tones])
    for text, tone in zip(axis.get_ticklabels(), tones.values(), strict=True):
        text.set_color(tone)
        text.set_fontweight("bold")
    axis.set_tick_params(length=0)
    axis.grid(False)


def _rows(axis: Axes, labels: Sequence[str]) -> None:
    """Label the rows of a panel, first row at the top."""
    axis.set_ylim(len(labels) - 0.5, -0.6)
    axis.set_yticks(range(len(labels)), list(labels))
    axis.tick_params(axis="y", labelcolor=colour("ink"), length=0)
    axis.tick_params(axis="x", length=3, width=0.7, pad=3)
    axis.grid(axis="y", visible=False)
    axis.spines["left"].set_visible(False)


def _published(draw_line, published: float | None) -> list[tuple[str, str]]:
    """Draw the line of the published value; return its entry for the list of names."""
    if published is None:
        return []
    tone = colour("measured")
    draw_line(published, color=tone, linewidth=1.4, dashes=(4, 2), zorder=1.5)
    return [(f"published, {published:g}", tone)]


def _published_words(published: float | None) -> str:
    return "" if published is None else f" The dashed line is what was published, {published:g}."
