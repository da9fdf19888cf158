"""Figures of a joint whose friction depends on direction, each a function from plain arrays to a drawing.

The caller names the models, which keep one colour each; measured and true values are dark grey. Inputs are in SI;
angles and small lengths are drawn in degrees and millimetres.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
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
    tones = tones_of(errors, roles)
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
    write_names(axis, [(f"{_shape(p)[1]} {p}", colour("muted")) for p in dict.fromkeys(protocols)])
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
    velocity: np.ndarray,
    recorded: str,
    caption: str,
    *,
    roles: Mapping[str, str] | None = None,
) -> Drawing:
    """Motor current against time, measured and by several models, with the velocity in a small panel beneath.
    `time`, `measured` (n,) [s], [A]; `predictions` (n,) [A]; `velocity` (n,) [rad/s]; `recorded` the word for the
    recorded current, such as "measured"."""
    tones = tones_of(predictions, roles)
    figure = Figure(figsize=(FIGURE_WIDTH, 4.6), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 1.0))
    line(bottom, time, np.degrees(velocity), color=colour("measured"), linewidth=1.1)
    tidy(bottom, first=True, text="Velocity (deg/s)", ticks=4)
    bottom.set_xlabel("Time (s)")
    line(top, time, measured, color=colour("measured"), linewidth=1.8)
    for model, values in predictions.items():
        line(top, time, values, color=tones[model], linewidth=1.3)
    tidy(top, first=True, text="Motor current (A)")
    for axis in (top, bottom):
        axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    write_names(top, [(recorded, colour("measured")), *tones.items()])
    return Drawing("current", figure, caption)


def gravity_by_direction(
    angle_deg: np.ndarray,
    torques: Mapping[str, np.ndarray],
    caption: str,
    *,
    roles: Mapping[str, str] | None = None,
) -> Drawing:
    """Gravity torque against the joint's angle, by the way it was found. `angle_deg` (n,) [deg]; `torques` (n,) [N
    m]."""
    figure, axis = curves_panel(angle_deg, torques, roles, 3.9, "Gravity torque (N·m)", "Joint angle (deg)")
    axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    axis.xaxis.set_major_locator(MaxNLocator(10, steps=[1, 1.5, 3, 4.5, 6, 9, 10]))
    return Drawing("gravity", figure, caption)


def inertia_by_slider(
    x: np.ndarray, inertias: Mapping[str, np.ndarray], caption: str, *, roles: Mapping[str, str] | None = None
) -> Drawing:
    """Inertia against the position of the slider. `x` (n,) [m]; `inertias` (n,) [kg m^2]."""
    millimetres = 1e3 * np.asarray(x, float)
    figure, _ = curves_panel(millimetres, inertias, roles, 3.7, "Inertia (kg·m²)", "Slider position (mm)")
    return Drawing("inertia", figure, caption)


def friction_by_load(
    load: np.ndarray, frictions: Mapping[str, np.ndarray], caption: str, *, roles: Mapping[str, str] | None = None
) -> Drawing:
    """Friction against the load that the drive transmits. `load` (n,) [N m]; `frictions` (n,) [N m]."""
    figure, axis = curves_panel(load, frictions, roles, 3.7, "Friction (N·m)", "Transmitted load (N·m)")
    origin(axis)
    return Drawing("friction-load", figure, caption)


def error_by_trial(
    labels: Sequence[str], errors: Mapping[str, np.ndarray], *, roles: Mapping[str, str] | None = None
) -> Drawing:
    """Error of every trial by every model, a row a trial. `errors` (k,) [A]."""
    tones = tones_of(errors, roles)
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
    label_rows(axis, labels)
    axis.set_xlabel("Error e (A)")
    write_names(axis, list(tones.items()))
    caption = "Error of every trial by every model; a grey line spans the models of one trial."
    return Drawing("error-by-trial", figure, caption)


# --- common to several ----------------------------------------------------------------------------------------------


def tones_of(models: Mapping[str, object], roles: Mapping[str, str] | None) -> dict[str, str]:
    """Return the colour of each model: as `roles` says, as its name means in every figure, or the next free one."""
    fixed = {**NAMED_COLOUR_ROLES, **(roles or {})}
    taken = {fixed[m] for m in models if m in fixed}
    free = [r for r in FREE_COLOUR_ROLES if r not in taken] or list(FREE_COLOUR_ROLES)
    others = [m for m in models if m not in fixed]
    return {m: colour(fixed[m] if m in fixed else free[others.index(m) % len(free)]) for m in models}


def curves_panel(
    x: np.ndarray, curves: Mapping[str, np.ndarray], roles: Mapping[str, str] | None, height: float, y: str, below: str
) -> tuple[Figure, Axes]:
    """Draw curves over one `x`, with markers if there are at most 30 points; the truth is dashed, below the others."""
    figure, axis = one_panel(height)
    x, tones = np.asarray(x, float), tones_of(curves, roles)
    order = np.argsort(x, kind="stable")
    marker = {"marker": "o", "markersize": 4.2, "markeredgewidth": 0.0} if len(x) <= 30 else {}
    for model, values in curves.items():
        truth: dict[str, Any] = {"dashes": (5, 2), "linewidth": 2.4, "zorder": 2}
        style = truth if model == "truth" else {"zorder": 3, **marker}
        axis.plot(x[order], np.asarray(values, float)[order], color=tones[model], **style)
    write_names(axis, list(tones.items()))
    tidy(axis, first=True, text=y)
    axis.set_xlabel(below)
    return figure, axis


def write_names(axis: Axes, entries: Sequence[tuple[str, str]]) -> None:
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
        last: Annotation | None = None
        for text, tone in row:
            at, shift = ((0.0, 1.0), (0, 7 + 15 * k)) if last is None else ((1.0, 0.0), (14, 0))
            written = axis.annotate(
                text, at, xytext=shift, xycoords="axes fraction" if last is None else last,
                textcoords="offset points", va="bottom", color=tone, fontsize=9, fontweight="bold",
                annotation_clip=False,
            )  # fmt: skip
            written.set_in_layout(last is None)
            last = written


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


def label_rows(axis: Axes, labels: Sequence[str]) -> None:
    """Label the rows of a panel, first row at the top."""
    axis.set_ylim(len(labels) - 0.5, -0.6)
    axis.set_yticks(range(len(labels)), list(labels))
    axis.tick_params(axis="y", labelcolor=colour("ink"), length=0)
    axis.tick_params(axis="x", length=3, width=0.7, pad=3)
    axis.grid(axis="y", visible=False)
    axis.spines["left"].set_visible(False)
