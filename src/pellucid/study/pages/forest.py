"""Draw a forest plot: estimates with their intervals, one beneath another, and a margin.

`Table` is a table of a page, as text.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes

from ...models.estimates import Parameter
from ..drawing.drawing import Drawing, draw, one_panel, tidy
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
    """Draw estimates on an axis, in their order from above; the `margin` is shaded.

    Their numbers are in a column at the right, where no line crosses them.
    """
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
                one.text.replace("-", MINUS_SIGN), (1.0, row), xycoords=("axes fraction", "data"), xytext=(6, 0),
                textcoords="offset points", va="center", fontsize=8.5, fontweight="bold", color=tone,
                annotation_clip=False,
            )  # fmt: skip
            if one.id:
                written.set_gid(f"value:{one.id}")
    tidy(axis, first=True, text="")
    axis.set_yticks(range(len(estimates)), [one.words for one in estimates])
    axis.tick_params(axis="y", length=0, labelcolor=colour("ink"))
    axis.set_ylim(len(estimates) - 0.4, -0.6)
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


MAX_RELATIVE_INTERVAL = 2.0
"""Intervals are drawn up to this multiple of the value; wider ones end in an arrow."""


class FitWithIntervals(Protocol):
    """Members of a fit that its figure shows."""

    @property
    def every(self) -> Sequence[Parameter]:
        """Every parameter, also those that are not free."""

    @property
    def confidence(self) -> float:
        """Confidence level of the intervals."""

    def interval(self, name: str) -> tuple[float, float]:
        """Return the confidence interval of a parameter."""


def parameters(fit: FitWithIntervals) -> Drawing:
    """Draw each parameter's confidence interval divided by its value, with its value and unit."""
    return draw(_forest, fit)


def _forest(fit: FitWithIntervals) -> Drawing:
    shown = [p for p in fit.every if np.isfinite(p.value)]
    figure, axis = one_panel(0.9 + 0.32 * max(len(shown), 1))
    for row, parameter in enumerate(reversed(shown)):
        size = abs(parameter.value) or 1.0
        low, high = (np.clip((end - parameter.value) / size, -MAX_RELATIVE_INTERVAL, MAX_RELATIVE_INTERVAL)
                     for end in fit.interval(parameter.name))  # fmt: skip
        told = parameter.trusted and parameter.identifiable
        tone = colour("fitted" if told else "muted")
        if np.isfinite(low) and np.isfinite(high) and parameter.trusted:
            axis.plot([100.0 * low, 100.0 * high], [row, row], color=tone, linewidth=2.2)
        axis.plot([0.0], [row], "o", color=tone, markersize=5, markerfacecolor=tone if told else "none")
    axis.axvline(0.0, color=colour("rule"), linewidth=0.8, zorder=0)
    axis.set_yticks(range(len(shown)), [f"{p.name}  {p.value:.4g} {p.unit}" for p in reversed(shown)])
    axis.set_ylim(-0.6, len(shown) - 0.4)
    axis.set_xlabel(f"{100.0 * fit.confidence:g} % interval, relative to the value (%)")
    return Drawing(
        "parameters",
        figure,
        f"Parameters with their {100.0 * fit.confidence:g} % confidence intervals, each divided by its value. Open "
        "marks: parameters that are not identifiable or have no valid interval.",
    )


@dataclass(frozen=True)
class Row:
    """Cells of a table's row, as text; `strong` marks an important row."""

    cells: tuple[str, ...]
    strong: bool = False


@dataclass(frozen=True)
class Table:
    """A table as text. The `numeric` columns are right-aligned; a `wide` table fills the page."""

    heads: tuple[str, ...]
    rows: tuple[Row, ...]
    numeric: frozenset[int] = frozenset()
    caption: str = ""
    wide: bool = False


def number_table(
    heads: Sequence[str], rows: Iterable[Row | Sequence[str]], caption: str = "", *, words: int = 1, wide: bool = True
) -> Table:
    """Return a table whose first `words` columns are text and whose other columns are numbers."""
    made = tuple(row if isinstance(row, Row) else Row(tuple(row)) for row in rows)
    return Table(tuple(heads), made, frozenset(range(words, len(heads))), caption, wide)
