"""Figures of optimisers: parameters over iterations, and a comparison of the errors of many estimators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from pellucid.study.drawing.drawing import Drawing, Head, heads, key, one_panel, tidy
from pellucid.study.drawing.style import FIGURE_WIDTH, colour

LINE_COLOUR_ROLES = ("fitted", "heldout", "good", "load", "combined")
"""Colour roles of a panel's lines, in the order of the lines."""

MAX_LINE_POINTS = 400
"""A line is thinned to at most this many points."""


@dataclass(frozen=True)
class Paths:
    """One panel of `paths`."""

    head: str  # Name of the panel
    rest: str  # Further text above the panel
    lines: Mapping[str, np.ndarray]  # (k,) Values by label, one for each iteration
    unit: str  # Label of the vertical axis
    level: Mapping[str, float] | None = None  # True final value of lines, drawn dashed, by label
    logarithmic: bool = False


def paths(panels: Sequence[Paths], name: str, *, caption: str, columns: int = 2) -> Drawing:
    """Draw numbers over the iterations of a descent."""
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(FIGURE_WIDTH, 2.9 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    heads(axes[: len(panels)], [Head(p.head, p.rest, colour("muted")) for p in panels])
    for i, (axis, panel) in enumerate(zip(axes, panels, strict=False)):
        entries = []
        for tone, (label, values) in zip(LINE_COLOUR_ROLES, panel.lines.items(), strict=False):
            at = np.unique(np.linspace(0, len(values) - 1, min(MAX_LINE_POINTS, len(values))).astype(int))
            axis.plot(at, np.asarray(values)[at], color=colour(tone), linewidth=1.3)
            if panel.level and label in panel.level:
                axis.axhline(panel.level[label], color=colour(tone), linewidth=0.9, linestyle=(0, (5, 3)))
            entries.append((label, colour(tone)))
        if panel.logarithmic:
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter(lambda x, _: f"{x:g}")
            axis.yaxis.set_minor_formatter(lambda x, _: "")
            axis.tick_params(length=3, width=0.7, pad=3)
            axis.set_ylabel(panel.unit)
        else:
            tidy(axis, first=True, text=panel.unit)
        if i >= len(panels) - columns:
            axis.set_xlabel("Iteration")
        key(axis, entries)
    return Drawing(name, figure, caption)


@dataclass(frozen=True)
class Compared:
    """One row of `compared`: a label, errors of every subject, and what is printed."""

    label: str
    errors: Sequence[float]
    printed: float | None = None
    strong: bool = False


def compared(rows: Sequence[Compared], name: str, *, text: str, caption: str) -> Drawing:
    """Draw errors of estimators: a dot per subject, a bar at their mean, and an open mark for the printed value."""
    figure, axis = one_panel(0.9 + 0.34 * len(rows))
    for i, row in enumerate(rows):
        tone = colour("fitted" if row.strong else "measured")
        axis.barh(i, float(np.mean(row.errors)), height=0.62, color=tone, alpha=0.25, linewidth=0.0)
        axis.plot(
            row.errors, np.full(len(row.errors), i), "o", color=tone, markersize=4.0, markeredgewidth=0.0, alpha=0.8
        )
        if row.printed is not None:
            axis.plot(row.printed, i, "D", color=colour("heldout"), markersize=5.5, markerfacecolor="none")
    axis.set_yticks(range(len(rows)), [row.label for row in rows])
    axis.tick_params(axis="y", length=0.0)
    axis.tick_params(axis="x", length=3, width=0.7, pad=3)
    axis.grid(axis="y", visible=False)
    axis.invert_yaxis()
    axis.set_xlim(left=0.0)
    axis.set_xlabel(text)
    return Drawing(name, figure, caption)
