"""Figure of a joint's stiffness along a movement."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ...estimators.joint_stiffness import STIFFNESS_KINDS, JointStiffness
from .muscle_findings import DRAWN_STRETCH_S

PANEL_TITLES = {"short_range": "At once: short-range stiffness", "slope": "Slope of the model's torque"}
"""Title of the panel of each kind of stiffness."""


def stiffness_over_time(found: JointStiffness, name: str, *, caption: str) -> Drawing:
    """Draw both kinds of stiffness with their intervals, and the torque below."""
    shown = found.time <= DRAWN_STRETCH_S
    time = found.time[shown]
    figure = Figure(figsize=(FIGURE_WIDTH, 5.2), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    for axis, kind, tone in zip(axes, STIFFNESS_KINDS, ("fitted", "heldout"), strict=False):
        value, half = found.value[kind][shown], 1.96 * found.error[kind][shown]
        axis.fill_between(time, value - half, value + half, color=colour(tone), alpha=0.15, linewidth=0.0)
        line(axis, time, value, color=colour(tone), linewidth=1.4)
        axis.axhline(0.0, color=colour("rule"), linewidth=0.8, zorder=0)
        axis.set_title(PANEL_TITLES[kind], fontsize=9.5, fontweight="bold", loc="left")
        tidy(axis, first=True, text="N·m/rad", ticks=4)
    line(axes[2], time, np.asarray(found.torque)[shown], color=colour("measured"), linewidth=1.4)
    axes[2].set_title("Torque by the muscles", fontsize=9.5, fontweight="bold", loc="left")
    tidy(axes[2], first=True, text="N·m", ticks=4)
    axes[2].set_xlabel("Time (s)")
    return Drawing(name, figure, caption)
