"""What both screens of a live session show, drawn from its recording."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pellucid.study.drawing.drawing import Drawing, colour, key, line, tidy

from .replayed_session import TARGETS_RAD, ReplayedSession

SHOWN_MOMENT_S = 0.55
"""Time after the first target at which the participant's screen is drawn [s]."""


def screens_figure(made: ReplayedSession) -> Drawing:
    """Draw what both screens show of the recording: the participant's at one moment, the operator's traces."""
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    screen, traces, torques = figure.subplots(1, 3, width_ratios=(1.0, 1.6, 1.6))
    moment = min(int(np.searchsorted(made.time, SHOWN_MOMENT_S)), len(made.time) - 1)
    pointer, target = np.rad2deg(made.angle[moment]), np.rad2deg(made.target[moment])
    screen.axvline(0.0, color=colour("rule"), linewidth=1.5, zorder=1)
    screen.plot([0.0], [target], "o", markersize=16, markerfacecolor="none", markeredgecolor=colour("heldout"))
    screen.plot([-0.6, 0.6], [pointer, pointer], color=colour("fitted"), linewidth=2.0)
    screen.plot([0.0], [pointer], "o", markersize=6, color=colour("fitted"))
    low, high = np.rad2deg(min(TARGETS_RAD)) - 12.0, np.rad2deg(max(TARGETS_RAD)) + 12.0
    screen.set(xlim=(-1.0, 1.0), ylim=(low, high), xticks=[])
    tidy(screen, first=True, text=f"Participant, at {SHOWN_MOMENT_S:g} s (°)")
    line(traces, made.time, np.rad2deg(made.target), color=colour("heldout"), linewidth=1.2)
    line(traces, made.time, np.rad2deg(made.angle), color=colour("fitted"), linewidth=1.5)
    tidy(traces, first=True, text="Operator: angle (°)")
    key(traces, [("target", colour("heldout")), ("forearm", colour("fitted"))])
    line(torques, made.time, made.command, color=colour("ink"), linewidth=1.2)
    line(torques, made.time, made.interaction, color=colour("heldout"), linewidth=1.2)
    tidy(torques, first=True, text="Operator: torque (N·m)")
    key(torques, [("command", colour("ink")), ("on the person", colour("heldout"))])
    for axis in (traces, torques):
        axis.set_xlabel("Time (s)")
    return Drawing("screens", figure, "A live session as its two screens show it, drawn from its recording.")
