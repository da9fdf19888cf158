"""Figures of the predicted experiment: simulated studies compared with the paper, and the deciding factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from scipy.stats import gaussian_kde

from pellucid.study.drawing.drawing import Drawing
from pellucid.study.drawing.style import FIGURE_WIDTH, colour

from ...pointing.sensitivity import CHANCE_FACTOR, Sensitivity
from .transparency_figures import RATIO_TICKS, name_marks, some_ticks

DENSITY_POINTS = 240
"""Number of points of a drawn density."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Distribution of one effect over simulated studies."""

    name: str  # Name of the law
    drawn: np.ndarray  # (n,) Ratio to control, or rank sum, of each study [1]
    interval: tuple[float, float, float]  # Lower end, median, upper end
    printed: float | None = None


def spread_figure(panels: Mapping[str, Sequence[Spread]], ranks: str, caption: str) -> Drawing:
    """Draw a panel for each index and in it a row for each law: distribution, interval and the paper's value.

    `ranks` is the title of the panel of rank sums; the others are ratios on a logarithmic axis.
    """
    figure = Figure(figsize=(FIGURE_WIDTH, 3.7), layout="constrained")
    axes = figure.subplots(1, len(panels))
    for i, (axis, (title, rows)) in enumerate(zip(axes, panels.items(), strict=True)):
        log = title != ranks
        drawn = np.concatenate([row.drawn[np.isfinite(row.drawn)] for row in rows])
        ends = [*(row.printed for row in rows if row.printed is not None), *np.quantile(drawn, [0.02, 0.98])]
        low, high = (min(*ends, 0.9), max(*ends, 1.1)) if log else (min(ends) - 0.5, max(ends) + 0.5)
        if log:
            low, high = low * (low / high) ** 0.04, high * (high / low) ** 0.04
            axis.set_xscale("log")
            axis.axvline(1.0, color=colour("muted"), linewidth=1.0, zorder=1)
        for place, row in enumerate(rows):
            _density(axis, row, place, (low, high), log)
            left, middle, right = row.interval
            axis.plot([left, right], [place, place], color=colour("fitted"), linewidth=2.4, zorder=4)
            axis.plot(
                [middle], [place], color=colour("fitted"), marker="o", markersize=6.0, markeredgewidth=0.0, zorder=5
            )
            if row.printed is not None:
                axis.plot([row.printed], [place], color=colour("measured"), marker="D", markersize=6.0,
                          markeredgewidth=0.0, zorder=6)  # fmt: skip
        axis.set_xlim(low, high)
        if log:
            axis.xaxis.set_major_locator(FixedLocator(some_ticks([t for t in RATIO_TICKS if low <= t <= high])))
            axis.xaxis.set_minor_locator(NullLocator())
            axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axis.set_yticks(range(len(rows)), [row.name for row in rows] if i == 0 else [""] * len(rows))
        axis.set_ylim(len(rows) - 0.55, -0.75)
        axis.grid(visible=False, axis="y")
        axis.set_title(title, fontweight="bold")
        axis.set_xlabel("times control" if log else "over six people")
    name_marks(axes[0], {"predicted, 80 %": "fitted", "the paper": "measured"})
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 1.0 - 0.3 / figure.get_figheight()))
    return Drawing("predicted", figure, caption)


def _density(axis, row: Spread, place: int, span: tuple[float, float], log: bool) -> None:
    """Draw the density of the simulated studies as a hill on the row's line."""
    drawn = row.drawn[np.isfinite(row.drawn)]
    if not log:
        values, counts = np.unique(drawn, return_counts=True)
        axis.bar(values, -0.6 * counts / counts.max(), 0.8, place, color=colour("fitted"), alpha=0.22, zorder=2)
        return
    scale = np.log(drawn)
    if np.ptp(scale) < 1e-9:
        return
    at = np.linspace(*np.log(span), DENSITY_POINTS)
    hill = gaussian_kde(scale)(at)
    x = np.exp(at)
    axis.fill_between(
        x, place, place - 0.6 * hill / hill.max(), color=colour("fitted"), alpha=0.22, linewidth=0, zorder=2
    )


def deciding_figure(screened: Sensitivity, titles: Mapping[str, str], caption: str) -> Drawing:
    """Draw mean elementary effects of every factor, a panel for each index, a bar for each law; chance is a line."""
    figure = Figure(figsize=(FIGURE_WIDTH, 1.0 + 0.42 * len(screened.factors)), layout="constrained")
    axes = figure.subplots(1, len(titles))
    tones = dict(zip(screened.laws, ("fitted", "heldout", "directional"), strict=False))
    shown = [i for i, f in enumerate(screened.factors) if f.name != CHANCE_FACTOR]
    chance = next(i for i, f in enumerate(screened.factors) if f.name == CHANCE_FACTOR)
    first = screened.indices.index(next(iter(titles)))
    order = sorted(shown, key=lambda i: -screened.strength[:, first, i].max())
    height = 0.8 / len(screened.laws)
    for k, (axis, (index, title)) in enumerate(zip(axes, titles.items(), strict=True)):
        j = screened.indices.index(index)
        for i, law in enumerate(screened.laws):
            at = np.arange(len(order)) + (i - 0.5 * (len(screened.laws) - 1)) * height
            strength, half = screened.strength[i, j, order], screened.half_width[i, j, order]
            axis.barh(at, strength, 0.85 * height, color=colour(tones[law]), zorder=3)
            axis.hlines(
                at, np.maximum(strength - half, 0.0), strength + half, color=colour("muted"), linewidth=0.8, zorder=4
            )
            axis.axvline(
                screened.strength[i, j, chance], color=colour(tones[law]), linewidth=1.2, linestyle=":", zorder=2
            )
        names = [screened.factors[i].name for i in order]
        axis.set_yticks(range(len(order)), names if k == 0 else [""] * len(order))
        axis.set_ylim(len(order) - 0.5, -0.5)
        axis.set_xlim(left=0.0)
        axis.grid(visible=False, axis="y")
        axis.set_title(title, fontweight="bold")
        axis.set_xlabel("100 ln(times control)")
    name_marks(axes[0], tones)
    figure.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 1.0 - 0.3 / figure.get_figheight()))
    return Drawing("predicted-deciding", figure, caption)
