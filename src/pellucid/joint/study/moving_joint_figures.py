"""The figure of a joint that moves as it was recorded, beside its effort as measured and as predicted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...study.drawing.drawing import Head, heads, key, line, tidy
from ...study.drawing.line_points import broken
from ...study.drawing.style import FIGURE_WIDTH, colour
from ...study.pages.moving import MovingDrawing, Way, cursor, strokes
from ...study.pages.values import Value
from ..fit.evaluation import Prediction
from .series import busiest, by_recording, join_arrays, pooled_error

FRAME_COUNT = 60
"""Number of frames of the movement."""

MAX_SHOWN_S = 10.0
"""Longest stretch of a recording that moves [s]."""

LINK_LENGTH = 1.0
"""Drawn length of a turning link; lengths are not known."""


def moving_joint(
    parts: Sequence[Prediction],
    name: str,
    *,
    rotary: bool,
    upright: float,
    unit: str,
    error: Value,
    use: str,
    caption: str,
) -> MovingDrawing:
    """Draw a joint along the busiest seconds of a recording, beside its effort, measured and predicted.

    Parameters
    ----------
    parts : sequence of Prediction
        Predictions of which one recording is drawn: the one whose error is nearest to the pooled one.
    name : str
        Name of the figure.
    rotary : bool
        Whether the joint turns; else it slides.
    upright : float
        Angle at which the link hangs along gravity [rad].
    unit : str
        Unit of the effort, as it is shown.
    error : Value
        Error of the prediction over all `parts` [%].
    use : str
        Use of the recordings in words, such as "held out".
    caption : str
        Text below the figure.
    """
    groups = by_recording(parts)
    group = min(groups, key=lambda g: abs(pooled_error(g) - error.number))
    time, position, measured, predicted = join_arrays(
        group, lambda p: p.time, lambda p: p.position, lambda p: p.effort, lambda p: p.predicted
    )
    start, stop = busiest(
        time, measured, share=min(1.0, MAX_SHOWN_S / max(float(np.nanmax(time) - np.nanmin(time)), 1e-9))
    )
    shown = (time >= start) & (time <= stop) | np.isnan(time)
    time, position, measured, predicted = (x[shown] for x in (time, position, measured, predicted))
    figure = Figure(figsize=(FIGURE_WIDTH, 3.1), layout="constrained")
    stick, traces = figure.subplots(1, 2, width_ratios=(1.0, 2.6))
    role = group[0].split
    half = group[0].half_width
    bt, bp = broken(time, predicted)
    if np.isfinite(half):
        traces.fill_between(bt, bp - half, bp + half, color=colour(role), alpha=0.18, linewidth=0)
    line(traces, time, measured, color=colour("measured"), linewidth=2.4)
    line(traces, time, predicted, color=colour(role), linewidth=1.5, linestyle=(0, (5, 1.6)))
    tidy(traces, first=True, text=f"Effort ({unit})", ticks=5)
    traces.set_xlim(start, stop)
    traces.set_xlabel("Time (s)")
    key(traces, [("measured", colour("measured")), ("predicted (dashed)", colour(role))], room=0.14)
    heads([traces], [Head(group[0].recording, use, colour(role))])
    known = np.isfinite(time) & np.isfinite(position)
    frames = np.linspace(start, stop, FRAME_COUNT)
    moved = np.interp(frames, time[known], position[known])
    ways = _turning(stick, moved - upright) if rotary else _sliding(stick, moved)
    ways["cursor"] = cursor(traces, frames)
    return MovingDrawing(name, figure, caption, ways, float(stop - start))


def _turning(axis: Axes, angle: np.ndarray) -> dict[str, Way]:
    """Draw a link that turns about its axis by `angle`, (n,) [rad] from hanging."""
    ends = LINK_LENGTH * np.column_stack([np.sin(angle), -np.cos(angle)])
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_xlim(-1.25, 1.25)
    axis.set_ylim(-1.3, 1.3)
    axis.plot(*ends.T, color=colour("fitted"), linewidth=1.0, alpha=0.5)
    axis.plot((0.0, 0.0), (0.0, -1.2), color=colour("rule"), linewidth=1.0, dashes=(4, 3))
    link = np.stack([np.zeros_like(ends), ends], axis=1)
    weight = np.stack([ends, ends + np.array([1e-3, 0.0])], axis=1)
    hub = np.zeros((len(ends), 2, 2)) + np.array([[0.0, 0.0], [1e-3, 0.0]])
    strokes(axis, link[0], "link", edgecolor=colour("measured"), linewidth=7.0, zorder=4)
    strokes(axis, weight[0], "weight", edgecolor=colour("measured"), linewidth=17.0, zorder=5)
    strokes(axis, hub[0], "hub", edgecolor=colour("fitted"), linewidth=13.0, zorder=6)
    return {"link": Way(axis, link), "weight": Way(axis, weight)}


def _sliding(axis: Axes, place: np.ndarray) -> dict[str, Way]:
    """Draw a carriage that slides along its rail to `place`, (n,) [m]."""
    span = max(float(np.ptp(place)), 1e-9)
    at = 2.0 * (place - place.min()) / span - 1.0
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_xlim(-1.5, 1.5)
    axis.set_ylim(-1.0, 1.0)
    axis.plot((-1.4, 1.4), (-0.2, -0.2), color=colour("muted"), linewidth=3.0)
    block = np.stack([np.column_stack([at + d, np.zeros_like(at)]) for d in (-0.2, 0.2)], axis=1)
    strokes(axis, block[0], "carriage", edgecolor=colour("measured"), linewidth=20.0, zorder=4)
    return {"carriage": Way(axis, block)}
