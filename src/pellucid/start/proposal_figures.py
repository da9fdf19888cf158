"""Figures of a proposal: every column beside its proposed role, and the spectrum that the processing comes from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ..study.drawing.drawing import Drawing, Head, draw, heads, key, line, one_panel, tidy
from ..study.drawing.style import FIGURE_WIDTH, colour
from .given_files import GivenTable
from .inference.assign_roles import ColumnRole
from .inference.processing_choice import ProcessingChoice
from .propose_study import Layout

MAX_PANELS_IN_FIGURE = 12
"""A figure has at most so many panels; further columns get a figure of their own."""

MAX_PANELS = 60
"""At most so many columns of a layout are drawn."""

MAX_DRAWN_ROWS = 100_000
"""At most so many rows of a column are drawn, evenly spread."""


def channel_figures(layout: Layout, table: GivenTable, name: str, marks: dict[str, str]) -> list[Drawing]:
    """Draw every column of a table beside its role; `marks` say which roles are guesses, by column."""
    roles = [role for role in layout.roles.roles if role.column in table.columns][:MAX_PANELS]
    figures = []
    for start in range(0, len(roles), MAX_PANELS_IN_FIGURE):
        part = roles[start : start + MAX_PANELS_IN_FIGURE]
        part_name = f"{name}_{start // MAX_PANELS_IN_FIGURE + 1}"
        figures.append(draw(_panels, layout, table, part, name=part_name, marks=marks))
    return figures


def _panels(
    layout: Layout, table: GivenTable, roles: Sequence[ColumnRole], *, name: str, marks: dict[str, str]
) -> Drawing:
    rows = (len(roles) + 1) // 2
    figure = Figure(figsize=(FIGURE_WIDTH, 1.0 + 1.35 * rows), layout="constrained")
    grid = figure.subplots(rows, 2, squeeze=False, sharex=True)
    time, label = _times(layout, table)
    stride = max(1, len(time) // MAX_DRAWN_ROWS)
    for k in range(rows):
        texts = []
        pair = [axis for axis, i in zip(grid[k], (2 * k, 2 * k + 1), strict=True) if i < len(roles)]
        for axis, role in zip(pair, roles[2 * k : 2 * k + 2], strict=True):
            mark = marks.get(role.column, "")
            tone = colour("muted" if role.quantity is None else "heldout" if mark else "fitted")
            line(axis, time[::stride], table.columns[role.column][::stride], color=tone, linewidth=1.0)
            tidy(axis, first=True, ticks=3)
            texts.append(Head(_short(role.column, 30), _role_text(role, mark), tone))
        heads(pair, texts)
    for axis in grid[-1]:
        axis.set_xlabel(label)
    if len(roles) % 2:
        grid[-1][1].set_visible(False)
    return Drawing(
        name,
        figure,
        f"Columns of {table.path.name}, in the file's own numbers, beside what they are taken for. Blue: by evidence. "
        "Orange: a guess, or it hangs on a question. Grey: left out.",
    )


def spectrum_figure(choice: ProcessingChoice, rate: float, name: str) -> Drawing:
    """Draw the power of the position's second derivative, with the proposed low-pass."""
    figure, axis = one_panel(3.0)
    axis.loglog(
        choice.frequency, np.maximum(choice.acceleration_power, 1e-300), color=colour("measured"), linewidth=1.0
    )
    axis.axvline(choice.lowpass, color=colour("fitted"), linewidth=1.4)
    axis.axvline(0.5 * rate / choice.decimate, color=colour("muted"), linewidth=0.9, linestyle=(0, (4, 3)))
    axis.set_xlabel("Frequency (Hz)")
    axis.set_ylabel("Power of the acceleration")
    key(
        axis,
        [(f"low-pass {choice.lowpass:g} Hz", colour("fitted")), ("half the rate after decimation", colour("muted"))],
    )
    return Drawing(
        name,
        figure,
        "Spectrum of the acceleration that follows from the position. It falls while motion ends and rises again where "
        "quanta and noise, differentiated twice, outweigh it. The proposed low-pass stands where the fall ends.",
    )


def _times(layout: Layout, table: GivenTable) -> tuple[np.ndarray, str]:
    from .inference.clocks import UNIT_SECONDS

    clock, rate = layout.roles.clock, layout.roles.rate
    if clock.column is not None and clock.column in table.columns:
        times = table.columns[clock.column] * UNIT_SECONDS[clock.unit]
        return times - np.nanmin(times), "Time (s)"
    rows = np.arange(table.rows)
    return (rows / rate, "Time (s)") if rate else (rows, "Row")


def _role_text(role: ColumnRole, mark: str) -> str:
    if role.quantity is None:
        return "left out"
    name = f"{role.quantity}.{role.label}" if role.label else role.quantity
    return _short(f"{name} [{role.unit}]" + (f"  {mark}" if mark else ""), 44)


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"
