"""The figure of a joint with a carriage that moves as it was recorded, beside its current, measured and predicted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Head, heads, key, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.moving import MovingDrawing, Way, cursor, strokes
from ...study.series import busiest
from ..slider_fit import SliderFit
from .identify_slider import predicted

FRAME_COUNT = 60
"""Number of frames of the movement."""

MAX_SHOWN_S = 12.0
"""Longest stretch of a recording that moves [s]."""

LINE_WIDTHS = (1.6, 1.1)
"""Line widths of the predictions, in their order."""

DASH_PATTERNS = ((0, ()), (0, (4, 2)))
"""Dashes of the predictions, in their order."""


def moving_slider(fit: SliderFit, methods: Mapping[str, str], roles: Mapping[str, str]) -> MovingDrawing:
    """Draw the joint along the busiest seconds of a recording, beside its current and what models predict of it.

    `methods` are one or two names of methods by what they are called here, `roles` the colours' roles by the same.
    """
    held = [m for m in fit.motions if m.split == "heldout"] or list(fit.motions)
    motion = next((m for m in held if m.protocol == "constant_velocity"), held[0])
    time, measured = motion.time, motion.effort / fit.gain
    start, stop = busiest(time, measured, share=min(1.0, MAX_SHOWN_S / max(float(np.ptp(time)), 1e-9)))
    shown = (time >= start) & (time <= stop)
    figure = Figure(figsize=(FIGURE_WIDTH, 3.1), layout="constrained")
    arm, traces = figure.subplots(1, 2, width_ratios=(1.0, 2.6))
    line(traces, time[shown], measured[shown], color=colour("measured"), linewidth=2.4, alpha=0.8)
    for (words, method), width, dashes in zip(methods.items(), LINE_WIDTHS, DASH_PATTERNS, strict=False):
        # No model predicts the current at rest, because friction may then have any value up to its level.
        values = np.where(motion.scored, predicted(fit[method], motion) / fit.gain, np.nan)
        line(traces, time[shown], values[shown], color=colour(roles[words]), linewidth=width, linestyle=dashes)
    tidy(traces, first=True, text="Current (A)", ticks=5)
    traces.set_xlim(start, stop)
    traces.set_xlabel("Time (s)")
    key(traces, [("measured", colour("measured")), *((words, colour(roles[words])) for words in methods)], room=0.14)
    use = "held out" if motion.split == "heldout" else "fitted"
    heads([traces], [Head(motion.recording.replace("_", " "), use, colour(motion.split))])
    frames = np.linspace(start, stop, FRAME_COUNT)
    angle = np.interp(frames, time, motion.position)
    arm.set_aspect("equal")
    arm.set_axis_off()
    arm.set_xlim(-1.25, 1.25)
    arm.set_ylim(-1.25, 1.25)
    arm.plot((0.0, 0.0), (0.0, -1.15), color=colour("rule"), linewidth=1.0, dashes=(4, 3))
    ends = np.column_stack([np.sin(angle), -np.cos(angle)])
    along = motion.slider / max(max(m.slider for m in fit.motions), 1e-9)
    # The carriage is a short stroke across the link, at its place between the axis and the farthest one.
    places = 0.85 * along * ends
    link = np.stack([np.zeros_like(ends), ends], axis=1)
    carriage = np.stack([places - 0.09 * ends, places + 0.09 * ends], axis=1)
    strokes(arm, link[0], "link", edgecolor=colour("measured"), linewidth=6.0, zorder=4)
    strokes(arm, carriage[0], "carriage", edgecolor=colour("heldout"), linewidth=15.0, zorder=5)
    arm.plot([0.0], [0.0], "o", color=colour("fitted"), markersize=12.0, zorder=6)
    ways = {"link": Way(arm, link), "carriage": Way(arm, carriage), "cursor": cursor(traces, frames)}
    caption = (
        f"The joint as it was recorded, its carriage at {1e3 * motion.slider:.0f} mm (lengths are not to scale), and "
        f"its current: measured, and as {' and '.join(methods)} predict it where the joint moves."
    )
    return MovingDrawing("answer", figure, caption, ways, float(stop - start))
