"""Figures of calibrated muscles: departures of parameters from anatomy, activations and torques."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, key, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from .evaluated import TorqueTrace
from .muscle_findings import MuscleSummary

SHARED_PARAMETER_PREFIX = "joint"
"""Prefix of the names of parameters that belong to the joint, not to one muscle."""


def departures(found: MuscleSummary, name: str, *, caption: str) -> Drawing:
    """Draw every parameter's departure from anatomy with its interval: a panel per quantity, a row per muscle."""
    split = [_split_parameter_name(p) for p in found.parameters]
    quantities = list(dict.fromkeys(quantity for quantity, _ in split))
    rows = list(found.muscles)
    own = [q for q in quantities if any(s == q and m in rows for s, m in split)]
    figure = Figure(figsize=(FIGURE_WIDTH, 1.2 + 0.28 * len(rows)), layout="constrained")
    axes = figure.subplots(1, len(own), sharey=True, squeeze=False)[0]
    for axis, quantity in zip(axes, own, strict=True):
        axis.axvspan(-1.0, 1.0, color=colour("rule"), alpha=0.5, linewidth=0.0, zorder=0)
        for (each, muscle), x, half, bound in zip(
            split, found.deviation, found.half_width, found.at_bound, strict=True
        ):
            if each != quantity or muscle not in rows:
                continue
            y, tone = rows.index(muscle), colour("heldout" if bound else "fitted")
            if not bound:
                axis.plot((x - half, x + half), (y, y), color=tone, linewidth=1.6, alpha=0.5)
            axis.plot([x], [y], color=tone, marker="D" if bound else "o", markersize=5.0, markeredgewidth=0.0)
        tidy(axis, first=axis is axes[0], ticks=4)
        axis.set_title(quantity.replace("_", " "), fontsize=9.0, fontweight="bold")
        axis.set_xlim(-4.5, 4.5)
    axes[len(axes) // 2].set_xlabel("Departure from anatomy, in standard deviations among people")
    axes[0].set_yticks(range(len(rows)), [m.replace("_", " ") for m in rows])
    axes[0].set_ylim(len(rows) - 0.4, -0.6)
    return Drawing(name, figure, caption)


def muscle_work(found: MuscleSummary, name: str, *, caption: str) -> Drawing:
    """Draw the activation of every muscle over a stretch of time, and its torque on the joint."""
    time, count = np.array(found.time), len(found.muscles)
    figure = Figure(figsize=(FIGURE_WIDTH, 0.9 + 0.55 * count), layout="constrained")
    axes = figure.subplots(count, 2, sharex=True, sharey="col", squeeze=False)
    for row, muscle in enumerate(found.muscles):
        left, right = axes[row]
        line(left, time, np.array(found.activation[row]), color=colour("fitted"), linewidth=1.2)
        line(right, time, np.array(found.torque[row]), color=colour("heldout"), linewidth=1.2)
        for axis in (left, right):
            tidy(axis, first=True, ticks=2)
        left.set_ylabel(muscle.replace("_", " "), rotation=0, ha="right", va="center", fontsize=8.5)
    axes[0][0].set_title("Activation", fontweight="bold")
    axes[0][1].set_title("Torque (N·m)", fontweight="bold")
    for axis in axes[-1]:
        axis.set_xlabel("Time (s)")
    return Drawing(name, figure, caption)


def _split_parameter_name(parameter: str) -> tuple[str, str]:
    """Return a parameter's quantity and muscle; the muscle is empty if several share the parameter."""
    quantity, _, muscle = parameter.partition(".")
    return (parameter, "") if quantity == SHARED_PARAMETER_PREFIX or not muscle else (quantity, muscle)


def joints_together(
    traces: Sequence[TorqueTrace], words: Mapping[str, str], name: str, *, caption: str, seconds: float = 5.0
) -> Drawing:
    """Draw the torque of every joint over the middle `seconds` of a recording, a panel each.

    Beside the reference it draws the prediction of every fit that `words` describes, the first with its band.
    """
    tones = dict(zip(words, ("good", "heldout"), strict=True))
    figure = Figure(figsize=(FIGURE_WIDTH, 0.8 + 1.9 * len(traces)), layout="constrained")
    axes = figure.subplots(len(traces), 1, sharex=True, squeeze=False)[:, 0]
    for axis, trace in zip(axes, traces, strict=True):
        near = np.abs(trace.time - 0.5 * (trace.time[0] + trace.time[-1])) <= 0.5 * seconds
        line(axis, trace.time[near], trace.reference[near], color=colour("measured"), linewidth=2.2, alpha=0.6)
        for i, how in enumerate(words):
            made, tone = trace.predicted[how], colour(tones[how])
            if i == 0:
                low, high = made - trace.half_width[how], made + trace.half_width[how]
                axis.fill_between(
                    trace.time[near], low[near], high[near], color=tone, alpha=0.12, linewidth=0.0, zorder=1
                )
            line(axis, trace.time[near], made[near], color=tone, linewidth=1.2)
        tidy(axis, first=True, text=f"{trace.what.capitalize()} (N·m)", ticks=4)
    axes[-1].set_xlabel("Time (s)")
    key(axes[0], [("reference", colour("measured")), *((words[h], colour(tones[h])) for h in words)], room=0.12)
    return Drawing(name, figure, caption)
