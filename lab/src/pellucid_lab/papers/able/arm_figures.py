"""Figure of the cost of directional parameter sets over the number of joints, compared with one body with load
friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from pellucid.study.drawing.drawing import Drawing
from pellucid.study.drawing.style import FIGURE_WIDTH, colour

from .directional_sets import DirectionalRow

PANEL_TITLES = {
    "parameters": "Parameters",
    "mean": "Torque error, held out (%)",
    "condition": "Condition, median over sets",
    "least": "Energy lost on the worst closed path, over one body's",
}
"""Title of each panel, by the field of `DirectionalRow` that it draws."""

MODEL_COLOUR_ROLES = {
    "load": "load",
    "plain": "symmetric",
    "sets_own": "fitted",
    "sets_printed": "heldout",
    "sets_errata": "ink",
}
"""Colour role of each model, by its id."""


def cost_by_joints(
    compared: Mapping[int, Mapping[str, DirectionalRow]], words: Mapping[str, str], caption: str
) -> Drawing:
    """Draw parameters, error, condition and energy over the number of moving joints; `words` describes each model."""
    figure = Figure(figsize=(FIGURE_WIDTH, 4.6), layout="constrained")
    axes: Sequence = figure.subplots(2, 2).ravel()
    counts = sorted(compared)
    for axis, (quantity, title) in zip(axes, PANEL_TITLES.items(), strict=True):
        for name, word in words.items():
            known = [n for n in counts if name in compared[n]]
            values = [getattr(compared[n][name], quantity) for n in known]
            axis.plot(
                known,
                values,
                color=colour(MODEL_COLOUR_ROLES[name]),
                marker="o",
                markersize=4.0,
                linewidth=1.5,
                label=word,
            )
        if quantity == "parameters":
            axis.set_yscale("log")
            axis.yaxis.set_minor_locator(NullLocator())
            axis.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
        else:
            axis.set_ylim(bottom=0.0)
        axis.set_xticks(counts)
        axis.set_xlabel("Joints that move")
        axis.set_title(title, fontsize=9, loc="left")
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8.5, frameon=False
    )
    return Drawing("arm-cost-by-joints", figure, caption)
