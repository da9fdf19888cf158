"""Figures of how much control laws change a movement, against movement without a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from pellucid.study.drawing.drawing import Drawing, tidy
from pellucid.study.drawing.style import FIGURE_WIDTH, colour

RATIO_TICKS = (0.5, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0, 3.0, 5.0, 8.0)
"""Candidate ticks of axes that show a ratio to control; those within the axis are drawn, as far as there is room."""


@dataclass(frozen=True)
class LawChange:
    """Ratio of one index under one law to its value in control, with a mark for each variant of the evaluation."""

    law: str
    # Median, smallest and largest ratio over studies [1], by name of the variant
    marks: Mapping[str, tuple[float, float, float]]


def change_figure(
    panels: Mapping[str, Sequence[LawChange]], name: str, *, roles: Mapping[str, str], caption: str
) -> Drawing:
    """Draw every index under every law as a multiple of control, a panel for each index."""
    figure = Figure(
        figsize=(FIGURE_WIDTH, 1.2 + 0.7 * max(len(laws) for laws in panels.values())), layout="constrained"
    )
    axes = figure.subplots(1, len(panels))
    for i, (axis, (title, laws)) in enumerate(zip(axes, panels.items(), strict=True)):
        for place, one in enumerate(laws):
            for j, (kind, tone) in enumerate(roles.items()):
                if kind in one.marks:
                    _mark(axis, one.marks[kind], place + 0.17 * (j - 0.5 * (len(roles) - 1)), colour(tone))
        axis.set_xscale("log")
        axis.axvline(1.0, color=colour("muted"), linewidth=1.0, zorder=1)
        tidy(axis, first=True, text="")
        reached = [value for one in laws for marks in one.marks.values() for value in marks]
        low, high = min(*reached, 0.95), max(*reached, 1.05)
        margin = (high / low) ** 0.06
        axis.set_xlim(low / margin, high * margin)
        axis.xaxis.set_major_locator(FixedLocator(some_ticks([t for t in RATIO_TICKS if low <= t <= high])))
        axis.xaxis.set_minor_locator(NullLocator())
        axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axis.set_yticks(range(len(laws)), [one.law for one in laws] if i == 0 else [""] * len(laws))
        axis.set_ylim(len(laws) - 0.5, -0.9)
        axis.set_title(title, fontweight="bold")
        axis.set_xlabel("times control")
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 1.0 - 0.3 / figure.get_figheight()))
    name_marks(axes[0], roles)
    return Drawing(name, figure, caption)


def name_marks(axis, roles: Mapping[str, str]) -> None:
    """Write names in their colours, in a row above all panels."""
    at = {"xycoords": "axes fraction", "xy": (0.0, 1.0), "xytext": (0.0, 24.0)}
    for kind, tone in roles.items():
        shown = axis.annotate(
            kind, **at, textcoords="offset points", color=colour(tone), fontweight="bold", va="bottom"
        )
        shown.set_in_layout(False)
        at = {"xycoords": shown, "xy": (1.0, 0.0), "xytext": (14.0, 0.0)}


def _mark(axis, values: tuple[float, float, float], height: float, tone: str) -> None:
    middle, low, high = values
    if high > low:
        axis.plot([low, high], [height, height], color=tone, linewidth=1.6, zorder=3)
    axis.plot([middle], [height], color=tone, marker="o", markersize=6.0, markeredgewidth=0.0, zorder=4)


def some_ticks(ticks: Sequence[float]) -> list[float]:
    """Return at most five of the ticks, 1 among them, as evenly spaced on a log axis as they come."""
    ticks = list(ticks)
    while len(ticks) > 5:
        gaps = np.diff(np.log(ticks))
        tight = int(np.argmin(gaps))
        ticks.pop(tight if ticks[tight] != 1.0 and (tight > 0 or ticks[tight + 1] == 1.0) else tight + 1)
    return ticks
