"""Draw estimates with their intervals, one beneath another, beside a margin: a forest plot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from matplotlib.axes import Axes

from ..drawing.drawing import Drawing, one_panel, tidy
from ..drawing.style import colour
from .quantities import MINUS_SIGN

ROW_HEIGHT_IN = 0.34
"""Height of one estimate in a figure [in]."""

MAX_FOREST_ROWS = 9
"""Largest number of estimates in a figure that stands on a page's first screen."""


@dataclass(frozen=True)
class Estimate:
    """One line of a forest plot: its words, its value, its interval (not finite where there is none), its colour."""

    words: str
    value: float
    low: float
    high: float
    role: str = "fitted"
    text: str = ""  # the number as it is told elsewhere on the page
    id: str = ""  # id of the number's row in results.json


def forest_panel(
    axis: Axes, estimates: Sequence[Estimate], label: str, *, margin: tuple[float, float] | None = None
) -> None:
    """Draw estimates on an axis, in their order from above; the `margin` is shaded."""
    if margin is not None:
        axis.axvspan(*margin, color=colour("good"), alpha=0.12, linewidth=0.0, zorder=0)
    axis.axvline(0.0, color=colour("muted"), linewidth=0.9, zorder=1)
    for row, one in enumerate(estimates):
        tone = colour(one.role)
        if isfinite(one.low) and isfinite(one.high):
            axis.plot((one.low, one.high), (row, row), color=tone, linewidth=2.4, solid_capstyle="butt", zorder=3)
        axis.plot([one.value], [row], color=tone, marker="o", markersize=6.0, zorder=4)
        if one.text and isfinite(one.value):
            written = axis.annotate(
                one.text.replace("-", MINUS_SIGN), (one.value, row), xytext=(0, 6), textcoords="offset points",
                ha="center", va="bottom", fontsize=8.5, fontweight="bold", color=tone, zorder=5,
            )  # fmt: skip
            if one.id:
                written.set_gid(f"value:{one.id}")
    tidy(axis, first=True, text="")
    axis.set_yticks(range(len(estimates)), [one.words for one in estimates])
    axis.tick_params(axis="y", length=0, labelcolor=colour("ink"))
    axis.set_ylim(len(estimates) - 0.4, -0.85)
    axis.grid(visible=False, axis="y")
    axis.margins(x=0.06)
    axis.set_xlabel(label)


def forest(
    estimates: Sequence[Estimate], name: str, label: str, *, caption: str, margin: tuple[float, float] | None = None
) -> Drawing:
    """Return a figure of estimates with their intervals."""
    figure, axis = one_panel(0.8 + ROW_HEIGHT_IN * len(estimates))
    forest_panel(axis, estimates, label, margin=margin)
    return Drawing(name, figure, caption)
