"""Figure of raw EMG with its bursts, by muscle."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from .find_onsets import MuscleBursts


def burst_traces(muscles: Sequence[MuscleBursts], name: str, caption: str) -> Drawing:
    """Draw raw EMG of one recording: activity shaded, the interval of each onset and end darker, rest underlined."""
    figure = Figure(figsize=(FIGURE_WIDTH, 0.6 + 1.15 * len(muscles)), layout="constrained")
    axes = figure.subplots(len(muscles), 1, sharex=True, squeeze=False)[:, 0]
    for axis, each in zip(axes, muscles, strict=True):
        line(axis, each.time, 1e3 * each.samples, color=colour("measured"), linewidth=0.6)
        for burst in each.bursts:
            axis.axvspan(burst.onset.time, burst.end.time, color=colour("fitted"), alpha=0.12, linewidth=0.0)
            for point in (burst.onset, burst.end):
                axis.axvspan(point.low, point.high, color=colour("heldout"), alpha=0.45, linewidth=0.0)
                axis.axvline(point.time, color=colour("heldout"), linewidth=0.9)
        low, _ = axis.get_ylim()
        axis.plot(each.rest, (low, low), color=colour("good"), linewidth=3.0, clip_on=False, solid_capstyle="butt")
        tidy(axis, first=True, text="mV", ticks=3)
        axis.set_title(each.muscle.replace("_", " "))
    axes[-1].set_xlabel("Time (s)")
    return Drawing(name, figure, caption)
