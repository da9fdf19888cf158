"""Figures of torque maps: predicted torque over time, and the error of each estimator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, key, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.quantities import number
from ...estimators.families import ESTIMATOR_FAMILIES
from .worth_findings import RecordingWorth

CHOSEN_TONE = "heldout"
"""Colour of the recommended estimator's torque."""

BASELINE_TONE = "muted"
"""Colour of the torque by angles alone."""

MUSCLE_TONE = "good"
"""Colour of the torque by muscles, if they are not the recommended estimator."""

DRAWN_STRETCH_S = 8.0
"""Duration of the drawn stretch of a recording [s]."""

MAX_SHOWN_CLOCK_S = 1e6
"""Times beyond this are dates, such as seconds since 1970, and are drawn from the first sample on [s]."""


def torque_trace(
    time: np.ndarray,
    reference: np.ndarray,
    predicted: Mapping[str, np.ndarray],
    name: str,
    *,
    chosen: str,
    bare: str,
    words: Mapping[str, str],
    caption: str,
    half_width: Mapping[str, np.ndarray] | None = None,
    unit: str = "N*m",
) -> Drawing:
    """Draw held-out torque over time: the reference, the `chosen` estimator with its band, muscles, and angles alone.

    Their errors are drawn beneath. `time` [s] and `reference` [`unit`] have shape (n,). `predicted` and `half_width`
    hold the torque and half its band by estimator, shape (n,) [`unit`]. `bare` is the estimator of angles alone.
    """
    unit = unit.replace("*", "·")
    muscles = ((name, MUSCLE_TONE) for name, family in ESTIMATOR_FAMILIES.items() if family.shows_muscles)
    shown = {e: c for e, c in ((bare, BASELINE_TONE), *muscles, (chosen, CHOSEN_TONE)) if e in predicted}
    middle = 0.5 * (time[0] + time[-1])
    within = np.abs(time - middle) <= 0.5 * DRAWN_STRETCH_S
    since = float(time[0]) if time[0] > MAX_SHOWN_CLOCK_S else 0.0
    time = time - since
    figure = Figure(figsize=(FIGURE_WIDTH, 4.2), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
    line(top, time[within], reference[within], color=colour("measured"), linewidth=2.2, alpha=0.6)
    for estimator, name_of_tone in shown.items():
        torque, tone, style = predicted[estimator], colour(name_of_tone), "--" if estimator == bare else "-"
        if half_width and estimator == chosen and estimator in half_width:
            low, high = torque - half_width[estimator], torque + half_width[estimator]
            top.fill_between(time[within], low[within], high[within], color=tone, alpha=0.14, linewidth=0.0, zorder=1)
        line(top, time[within], torque[within], color=tone, linewidth=1.2, linestyle=style)
        line(bottom, time[within], (torque - reference)[within], color=tone, linewidth=1.0, linestyle=style)
    bottom.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    tidy(top, first=True, text=f"Torque ({unit})")
    tidy(bottom, first=True, text=f"Error ({unit})", ticks=4)
    bottom.set_xlabel("Time since the first sample (s)" if since else "Time (s)")
    key(top, [("reference", colour("measured")), *((words[e], colour(tone)) for e, tone in shown.items())])
    return Drawing(name, figure, caption)


def error_by_estimator(
    errors: Sequence[tuple[str, str, str, float]],
    name: str,
    *,
    heads: Sequence[str],
    chosen: Mapping[str, str],
    bare: str,
    caption: str,
    unit: str = "N*m",
) -> Drawing:
    """Draw the RMSE of every estimator, one panel for each joint or person.

    `errors` holds panel, estimator, its description and its RMSE [`unit`]. A line marks angles alone (`bare`). The
    `chosen` estimator of each panel is set in bold.
    """
    unit = unit.replace("*", "·")
    rows = list(dict.fromkeys((estimator, words) for _, estimator, words, _ in errors))
    figure = Figure(figsize=(FIGURE_WIDTH, 1.2 + 0.3 * len(rows)), layout="constrained")
    axes = figure.subplots(1, len(heads), sharey=True, squeeze=False)[0]
    for axis, head in zip(axes, heads, strict=True):
        found = {estimator: rmse for panel, estimator, _, rmse in errors if panel == head}
        for row, (estimator, _) in enumerate(rows):
            if estimator not in found:
                continue
            family = ESTIMATOR_FAMILIES.get(estimator)
            tone = colour("ink" if family is None else family.colour)
            bold = "bold" if chosen.get(head) == estimator else "normal"
            axis.plot((0.0, found[estimator]), (row, row), color=tone, linewidth=2.0, alpha=0.4, zorder=2)
            axis.plot([found[estimator]], [row], color=tone, marker="o", markersize=6.0, markeredgewidth=0.0, zorder=3)
            axis.annotate(
                number(found[estimator], digits=3), (found[estimator], row), xytext=(7, -0.5),
                textcoords="offset points", va="center", color=tone, fontsize=8.5, fontweight=bold,
            )  # fmt: skip
        if bare in found:
            axis.axvline(found[bare], color=colour("faint"), linewidth=1.0, linestyle="--", zorder=1)
        tidy(axis, first=axis is axes[0])
        axis.set_title(head, fontweight="bold")
        axis.set_xlim(0.0, 1.18 * max(found.values()))
        axis.set_xlabel(f"RMSE ({unit})")
    axes[0].set_yticks(range(len(rows)), [words for _, words in rows])
    axes[0].set_ylim(len(rows) - 0.4, -0.6)
    return Drawing(name, figure, caption)


def gain_over_angles(worth: Sequence[RecordingWorth], name: str) -> Drawing:
    """Draw what EMG adds to angles alone, an interval a row, beside 0 and the margin that makes it worth it."""
    margin = worth[0].worth.margin
    tones = {"worth it": "good", "not worth it": "wrong", "cannot say": "muted"}
    figure = Figure(figsize=(FIGURE_WIDTH, 1.0 + 0.36 * len(worth)), layout="constrained")
    axis = figure.subplots()
    for row, each in enumerate(worth):
        made, tone = each.worth, colour(tones[each.worth.answer])
        ends = (made.low, made.high) if np.isfinite(made.low) else (made.gain, made.gain)
        axis.plot(ends, (row, row), color=tone, linewidth=2.4, alpha=0.55, zorder=2)
        axis.plot([made.gain], [row], color=tone, marker="o", markersize=7.0, markeredgewidth=0.0, zorder=3)
        axis.annotate(
            f"{made.gain:+.2f}, {made.answer}".replace("-", "\u2212"), (ends[1], row), xytext=(8, -0.5),
            textcoords="offset points", va="center", color=tone, fontsize=8.5,
        )  # fmt: skip
    axis.axvline(0.0, color=colour("ink"), linewidth=0.9, zorder=1)
    axis.axvline(margin, color=colour("faint"), linewidth=1.0, linestyle="--", zorder=1)
    tidy(axis, first=True)
    axis.set_yticks(range(len(worth)), [each.words for each in worth])
    axis.set_ylim(len(worth) - 0.4, -0.6)
    low, high = axis.get_xlim()
    axis.set_xlim(low, high + 0.3 * (high - low))
    axis.set_xlabel("R² with EMG minus R² of angles alone")
    caption = (
        "What EMG adds to joint angles on movements that were not fitted, with 95 % intervals over strides or trials. "
        f"Right of 0 it adds something; the dashed line at {margin:g} is the gain from which it counts as worth it."
    )
    return Drawing(name, figure, caption)
