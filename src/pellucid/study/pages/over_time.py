"""Draw signals over time, one panel beneath another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from ..drawing.drawing import Drawing, Head, heads, key, line, tidy
from ..drawing.style import FIGURE_WIDTH, colour


@dataclass(frozen=True)
class Traces:
    """One panel of `over_time`."""

    head: str  # name of the panel
    rest: str  # further text above the panel
    time: np.ndarray  # times, shape (n,) [s]
    lines: Mapping[str, np.ndarray]  # signals by label, shape (n,) each
    unit: str  # label of the vertical axis, with its unit


def over_time(
    panels: Sequence[Traces], name: str, *, roles: Mapping[str, str], caption: str, height: float = 2.6
) -> Drawing:
    """Draw signals over time, one panel beneath another."""
    figure = Figure(figsize=(FIGURE_WIDTH, height * len(panels) + 0.3), layout="constrained")
    axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    for axis, panel in zip(axes, panels, strict=True):
        for i, (label, values) in enumerate(panel.lines.items()):
            width = {"linewidth": 2.6, "alpha": 0.55} if i == 0 else {"linewidth": 1.3}
            line(axis, panel.time, values, color=colour(roles[label]), **width)
        axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        tidy(axis, first=True, text=panel.unit, ticks=5)
        low, high = axis.get_ylim()
        axis.set_ylim(low, high + 0.16 * (high - low))  # room for the key
        key(axis, [(label, colour(roles[label])) for label in panel.lines])
        axis.set_title(" ", fontsize=9.5)
        heads([axis], [Head(panel.head, panel.rest, colour("muted"))])
    axes[-1].set_xlabel("Time (s)")
    return Drawing(name, figure, caption)
