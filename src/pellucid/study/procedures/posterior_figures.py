"""Figure of a posterior and the intervals of a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..drawing.drawing import Drawing
from ..drawing.style import FIGURE_WIDTH, colour
from ..pages.quantities import capitalised, parameter_label, unit_text
from .posterior_beside import ComparedPosterior

HISTOGRAM_BAR_COUNT = 25
"""Number of bars in a histogram."""

DRAWN_QUANTILES = (0.002, 0.998)
"""Quantiles between which the draws are drawn."""


def posterior_figure(compared: Sequence[ComparedPosterior], level: float, file: str = "posterior") -> Drawing:
    """Draw a histogram of every parameter, with the posterior's interval and the fit's below it."""
    columns = min(len(compared), {4: 4, 8: 4}.get(len(compared), 3))
    rows = -(-len(compared) // columns)
    figure = Figure(figsize=(FIGURE_WIDTH, 1.75 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    for axis in axes.flat[len(compared) :]:
        axis.set_visible(False)
    for axis, one in zip(axes.flat, compared, strict=False):
        draws = one.drawn.draws
        ends = np.quantile(draws, DRAWN_QUANTILES)
        counts, edges = (
            np.histogram(draws, HISTOGRAM_BAR_COUNT, tuple(ends)) if ends[1] > ends[0] else (np.ones(1), ends)
        )
        height = counts / max(counts.max(), 1)
        axis.stairs(height, edges, fill=True, color=colour("fitted"), alpha=0.3, linewidth=0)
        axis.plot(one.drawn.interval(level), (-0.16, -0.16), color=colour("fitted"), linewidth=2.2)
        axis.plot([one.drawn.value], [-0.16], color=colour("fitted"), marker="o", markersize=4.6)
        if not one.fitted.refused and not one.fitted.at_bound and one.fitted.standard_error > 0.0:
            axis.plot(one.fitted.interval(level), (-0.36, -0.36), color=colour("measured"), linewidth=2.2)
        axis.plot([one.fitted.value], [-0.36], color=colour("measured"), marker="o", markersize=4.6)
        axis.set_ylim(-0.55, 1.05)
        axis.set_yticks([])
        axis.spines["left"].set_visible(False)
        axis.grid(axis="y", visible=False)
        axis.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
        unit = unit_text(one.drawn.unit)
        name = parameter_label(one.drawn.name).replace(".", ", ")
        axis.set_title(capitalised(name) + (f" ({unit})" if unit else ""), fontsize=8.5)
    return Drawing(
        file,
        figure,
        f"Draws of each parameter; below them, in blue, median and {100.0 * level:.4g} % interval of the posterior, in "
        "black (white on a dark page) those of the fit: no bar where the value is not identifiable or at a bound.",
    )
