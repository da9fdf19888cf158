"""The report of activations: first the scores of removed electrodes, then torques and activations.

Figures of activations: by EMG, by the measured torque, and of removed electrodes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, draw, key, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.page import Page, Section
from ....study.pages.quantities import typeset_sentence
from ....study.procedures.study_page import figure_tables, study_page
from ....study.study import Study
from ...estimators.unrecorded import FILLING_METHODS, TORQUE_INFORMED_METHODS, FillingScore
from .find_activations import ActivationsResult, AssistedRecording

DRAWN_STRETCH_S = 5.0
"""Duration of the drawn stretch of a recording [s]."""

FILLING_METHOD_TONES = {"synergies": "good", "linear": "fitted", "assisted": "heldout"}
"""Colour of each filling method that is drawn over time."""

MIN_DRAWN_R2 = -1.5
"""Smallest R2 in a figure. A smaller one is drawn at the edge."""


def _drawn_stretch(count: int, fs: float) -> slice:
    """Return the drawn stretch in the middle of `count` samples."""
    half = int(0.5 * DRAWN_STRETCH_S * fs)
    return slice(max(0, count // 2 - half), count // 2 + half)


def torque_and_activations(each: AssistedRecording, name: str, caption: str) -> Drawing:
    """Draw the torque, and each muscle's activation by EMG alone and EMG-assisted."""
    fs = (len(each.time) - 1) / (each.time[-1] - each.time[0])
    part = _drawn_stretch(len(each.time), fs)
    time, count = each.time[part], len(each.muscles)
    rows = (count + 1) // 2
    tops, joints = len(each.torque), tuple(each.torque)
    figure = Figure(figsize=(FIGURE_WIDTH, 0.5 + 2.1 * tops + 0.95 * rows), layout="constrained")
    grid = figure.add_gridspec(rows + tops, 2, height_ratios=(*([2.2] * tops), *([1.0] * rows)))
    top = None
    for k, joint in reversed(list(enumerate(joints))):
        top = figure.add_subplot(grid[k, :], sharex=top)
        line(top, time, each.torque[joint][part], color=colour("measured"), linewidth=2.2)
        line(top, time, each.driven[joint][part], color=colour("fitted"), linewidth=1.2)
        line(top, time, each.followed[joint][part], color=colour("heldout"), linewidth=1.2)
        tidy(top, first=True, text="Torque (N·m)" if tops == 1 else f"{joint.replace('_', ' ').capitalize()} (N·m)")
        top.tick_params(labelbottom=False)
    names = (("measured", "measured"), ("EMG-driven", "fitted"), ("assisted: told it", "heldout"))
    key(top, [(text, colour(tone)) for text, tone in names])
    for i, muscle in enumerate(each.muscles):
        axis = figure.add_subplot(grid[tops + i // 2, i % 2], sharex=top)
        line(axis, time, each.by_emg[i, part], color=colour("fitted"), linewidth=1.2)
        line(axis, time, each.activation[i, part], color=colour("heldout"), linewidth=1.0)
        tidy(axis, first=True, ticks=3)
        axis.set_ylim(bottom=0.0)
        axis.set_title(muscle.replace("_", " ") + (" (no EMG)" if muscle in each.filled else ""))
        if i >= count - 2:
            axis.set_xlabel("Time (s)")
        else:
            axis.tick_params(labelbottom=False)
    return Drawing(name, figure, caption)


def filling_methods_compared(found: Sequence[FillingScore], name: str, caption: str) -> Drawing:
    """Draw R2 and correlation of every removed electrode by filling method, with medians."""
    ways = [way for way in FILLING_METHODS if any(each.way == way for each in found)]
    figure = Figure(figsize=(FIGURE_WIDTH, 1.0 + 0.32 * len(ways)), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for axis, of, head, low in (
        (axes[0], "r2", "R² of its activation", MIN_DRAWN_R2), (axes[1], "correlation", "Correlation", -1.0)
    ):  # fmt: skip
        for row, way in enumerate(ways):
            values = np.maximum([getattr(each, of) for each in found if each.way == way], low)
            tone = colour("heldout" if way in TORQUE_INFORMED_METHODS else "fitted")
            axis.plot(values, np.full(len(values), row), linestyle="", marker="o", color=tone, alpha=0.3, markersize=5)
            axis.plot([np.median(values)] * 2, (row - 0.3, row + 0.3), color=tone, linewidth=2.5)
        axis.axvline(0.0, color=colour("faint"), linewidth=0.8)
        tidy(axis, first=axis is axes[0])
        axis.set_title(head, fontweight="bold")
        axis.set_xlim(low - 0.05, 1.05)
    axes[0].set_yticks(range(len(ways)), [FILLING_METHODS[way] for way in ways])
    axes[0].set_ylim(len(ways) - 0.4, -0.6)
    return Drawing(name, figure, caption)


def removed_electrodes(found: Sequence[FillingScore], fs: float, name: str, caption: str) -> Drawing:
    """Draw the activation by each removed electrode of one recording, and the filled activation."""
    channels = list(dict.fromkeys(each.channel for each in found))
    rows = (len(channels) + 1) // 2
    figure = Figure(figsize=(FIGURE_WIDTH, 0.7 + 1.15 * rows), layout="constrained")
    axes = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for i, axis in enumerate(axes.flat):
        if i >= len(channels):
            axis.set_axis_off()
            continue
        own = {each.way: each for each in found if each.channel == channels[i]}
        truth = next(iter(own.values())).recorded
        part = _drawn_stretch(len(truth), fs)
        time = np.arange(len(truth))[part] / fs
        line(axis, time, truth[part], color=colour("measured"), linewidth=2.2)
        for way, role in FILLING_METHOD_TONES.items():
            if way in own:
                line(axis, time, own[way].filled[part], color=colour(role), linewidth=1.1)
        tidy(axis, first=True, ticks=3)
        axis.set_ylim(bottom=0.0)
        axis.set_title(channels[i].replace("_", " "))
    words = [("electrode", colour("measured")), *((w, colour(r)) for w, r in FILLING_METHOD_TONES.items())]
    key(axes[0, 1 if len(channels) > 1 else 0], words)
    for axis in axes[-1]:
        axis.set_xlabel("Time (s)")
    return Drawing(name, figure, caption)


MAX_DRAWN_RECORDINGS = 4
"""Largest number of recordings that are drawn."""


def page(study: Study, found: ActivationsResult) -> Page:
    """Return the page with the scores of removed electrodes, and torques and activations of the first recordings."""
    judged = []
    for i, joint in enumerate(dict.fromkeys(joint for joint, _ in found.left_out), start=1):
        own = [each for j, each in found.left_out if j == joint]
        first = next(each for each in found.recordings if each.what == joint)
        fs = (len(first.time) - 1) / (first.time[-1] - first.time[0])
        name = typeset_sentence(joint)
        judged += [
            draw(
                filling_methods_compared, own, f"ways_{i}",
                f"{name}: each electrode of the test recordings is removed in turn, and its muscle's activation is "
                "filled in. Lines: medians. Orange: methods that use the measured torque. Marks at the left edge are "
                "beyond it.",
            ),
            draw(
                removed_electrodes, [each for each in own if each.recording == first.recording], fs, f"taken_away_{i}",
                f"{name}, {first.recording.replace('_', ' ')}: activation from the removed electrode (black; white on "
                "a dark page) and filled in.",
            ),
        ]  # fmt: skip
    shown = tuple(
        draw(
            torque_and_activations, each, f"activations_{i}",
            f"{typeset_sentence(each.what)}, {each.recording.replace('_', ' ')}: torque, and muscle activations from "
            "EMG (blue) and EMG-assisted (orange), which reproduce the torque.",
        )
        for i, each in enumerate(found.recordings[:MAX_DRAWN_RECORDINGS], start=1)
    )  # fmt: skip
    sections = []
    if judged:
        method_text = (
            "EMG-assisted activations are computed from the measured torque, so that reproducing it is not a test. The "
            "test is to remove a recorded electrode and to predict its activation. For methods that use EMG and angles "
            "alone, the resulting torque is tested as well."
        )
        tables = figure_tables(found, "Removed electrode")
        sections.append(Section("taken_away", "Removed electrodes", (method_text,), tables, tuple(judged)))
    tables = figure_tables(found, "Torque from EMG")
    sections.append(Section("activations", "Torque and activations", (), tables, shown))
    return study_page(
        title=f"{found.study}: activations",
        answer=found.answer,
        tiles=(),
        sections=sections,
        verdicts=found.verdicts,
    )
