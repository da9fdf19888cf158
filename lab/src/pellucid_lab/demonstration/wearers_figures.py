"""Animated arms of simulated people in their mean movement, without the robot and with each controller."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pellucid.people.study.assessment_figures import FRAME_COUNT, REST_S, START_ANGLE_RAD, tones
from pellucid.people.study.assessment_result import Profile
from pellucid.study.drawing.drawing import line, tidy
from pellucid.study.drawing.style import FIGURE_WIDTH, colour
from pellucid.study.pages.moving import MovingDrawing, Way, cursor, strokes

ELBOW_PLACE = np.array([0.0, 0.0])
"""Drawn place of the elbow."""

SHOULDER_PLACE = np.array([-0.35, 0.95])
"""Drawn place of the shoulder; lengths are not to scale."""


def wearers_figure(profiles: Sequence[Profile], conditions: Sequence[str], what: str) -> MovingDrawing:
    """Draw the mean movement of each condition by an arm that moves, above its angle over time."""
    tone = tones(conditions)
    figure = Figure(figsize=(FIGURE_WIDTH, 3.3), layout="constrained")
    count = len(profiles)
    grid = figure.add_gridspec(1, count + 1, width_ratios=(*([1.0] * count), 2.0))
    lasting = max(float(profile.time[-1]) for profile in profiles)
    frames = np.linspace(0.0, lasting, FRAME_COUNT)
    ways = {}
    curves = figure.add_subplot(grid[0, count])
    for i, profile in enumerate(profiles):
        axis = figure.add_subplot(grid[0, i])
        axis.set_aspect("equal")
        axis.set_axis_off()
        axis.set_xlim(-0.75, 1.25)
        axis.set_ylim(-0.85, 1.15)
        known = np.isfinite(profile.time) & np.isfinite(profile.angle)
        angle = START_ANGLE_RAD + np.interp(frames, profile.time[known], profile.angle[known])
        hand = ELBOW_PLACE + 1.05 * np.column_stack([np.cos(angle), np.sin(angle)])
        forearm = np.stack([np.broadcast_to(ELBOW_PLACE, hand.shape), hand], axis=1)
        upper = np.stack([SHOULDER_PLACE, ELBOW_PLACE]).T
        axis.plot(*upper, color=colour("faint"), linewidth=13.0, solid_capstyle="round")
        axis.plot(*hand.T, color=tone[profile.condition], linewidth=1.0, alpha=0.6)
        strokes(axis, forearm[0], f"forearm-{i}", edgecolor=tone[profile.condition], linewidth=9.0, zorder=4)
        axis.plot([0.0], [0.0], "o", color=colour("ink"), markersize=8.0, zorder=6)
        axis.set_title(profile.condition.replace("_", " "), color=tone[profile.condition], fontweight="bold")
        ways[f"forearm-{i}"] = Way(axis, forearm)
        line(curves, profile.time, np.degrees(profile.angle), color=tone[profile.condition], linewidth=1.7)
    tidy(curves, first=True, text="Angle from the start (deg)", ticks=5)
    curves.set_xlabel("Time from the start (s)")
    ways["cursor"] = cursor(curves, frames)
    caption = f"Virtual people's mean movements ({what}), without the robot and under each controller."
    return MovingDrawing("wearers", figure, caption, ways, lasting + REST_S)
