"""The report of onsets: raw EMG with its bursts, and a table of them.

Figure of raw EMG with its bursts, by muscle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, draw, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.page import Page, Section, Tile
from ....study.procedures.study_page import figure_tables, study_page
from ....study.study import Study
from .find_onsets import MAX_DRAWN_RECORDINGS, MuscleBursts, OnsetResult
from .onset_table import OnsetTable

AXIS_SHARE = 0.9
"""Share of a figure's width that its axes have."""

MARKER_SIZES = (2.0, 6.0)
"""Smallest and largest width of a triangle [points]."""


def marker_size(each: MuscleBursts) -> float:
    """Return the width of triangles [points] at which those of neighbouring bursts do not overlap."""
    points = 72.0 * FIGURE_WIDTH * AXIS_SHARE / float(each.time[-1] - each.time[0])
    gaps = [np.diff([t.time for t in own]) for own in zip(*((b.onset, b.end) for b in each.bursts), strict=True)]
    least = min((float(gap.min()) for gap in gaps if len(gap)), default=np.inf)
    return float(np.clip(points * least, *MARKER_SIZES))


def burst_traces(muscles: Sequence[MuscleBursts], name: str, caption: str) -> Drawing:
    """Draw raw EMG of one recording: activity shaded, the interval of each onset and end darker, rest underlined."""
    figure = Figure(figsize=(FIGURE_WIDTH, 0.6 + 1.15 * len(muscles)), layout="constrained")
    axes = figure.subplots(len(muscles), 1, sharex=True, squeeze=False)[:, 0]
    for axis, each in zip(axes, muscles, strict=True):
        line(axis, each.time, 1e3 * each.samples, color=colour("measured"), linewidth=0.6)
        size = marker_size(each)
        for burst in each.bursts:
            axis.axvspan(burst.onset.time, burst.end.time, color=colour("fitted"), alpha=0.12, linewidth=0.0)
            for point, role, (bottom, top), marker in (
                (burst.onset, "heldout", (0.5, 1.0), "v"), (burst.end, "stribeck", (0.0, 0.5), "^")
            ):  # fmt: skip
                # Onsets take the upper half and ends the lower one, so that wide intervals hide neither.
                axis.axvspan(point.low, point.high, bottom, top, color=colour(role), alpha=0.4, linewidth=0.0)
                axis.axvline(point.time, bottom, top, color=colour(role), linewidth=1.2)
                axis.plot(
                    [point.time], [top if role == "heldout" else bottom], transform=axis.get_xaxis_transform(),
                    marker=marker, markersize=size, markeredgewidth=0.0, color=colour(role), clip_on=False, zorder=5,
                )  # fmt: skip
        low, _ = axis.get_ylim()
        axis.plot(each.rest, (low, low), color=colour("good"), linewidth=3.0, clip_on=False, solid_capstyle="butt")
        tidy(axis, first=True, text="EMG (mV)", ticks=3)
        axis.set_title(each.muscle.replace("_", " "))
    axes[-1].set_xlabel("Time (s)")
    return Drawing(name, figure, caption)


def page(study: Study, found: OnsetResult) -> Page:
    """Return the page with the bursts of all recordings, and drawings of the first ones."""
    names = list(dict.fromkeys(each.recording for each in found.muscles))
    drawings = tuple(
        draw(
            burst_traces, [each for each in found.muscles if each.recording == name], f"bursts_{i}",
            f"{name.replace('_', ' ')}: raw EMG. Blue: activity. Triangles above: onsets; triangles below: ends; "
            f"each with its {100 * found.confidence:g} % interval. Green: the rest period used as reference.",
        )
        for i, name in enumerate(names[:MAX_DRAWN_RECORDINGS], start=1)
    )  # fmt: skip
    count = sum(len(each.bursts) for each in found.muscles)
    notes = (
        ()
        if len(names) <= MAX_DRAWN_RECORDINGS
        else (f"{len(names) - MAX_DRAWN_RECORDINGS} more recordings are in tables/onsets.csv.",)
    )
    table = study.table(OnsetTable)
    method_text = (
        f"A burst is detected where the Teager-Kaiser energy exceeds {table.height:g} standard deviations of rest for "
        f"at least {1e3 * table.shortest:g} ms. Its onset is the change point at which the variance begins to rise."
    )
    return study_page(
        title=f"{found.study}: muscle onset",
        answer=found.answer,
        tiles=(Tile("Bursts", str(count), "", f"{len(names)} recording{'s' if len(names) != 1 else ''}"),),
        sections=(
            Section(
                "onset_bursts", "When muscles become active", (method_text,), figure_tables(found), drawings, notes
            ),
        ),
        verdicts=found.verdicts,
    )
