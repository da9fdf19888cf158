"""The report of co-contraction: indices with intervals, and envelopes of each pair.

Figures of co-contraction: envelopes of antagonists, and indices.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, draw, key, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.page import Page, Section
from ....study.procedures.study_page import figure_tables, study_page
from ....study.study import Study
from .find_cocontraction import CocontractionResult, PairActivity


def overlap(each: PairActivity, name: str, caption: str) -> Drawing:
    """Draw two envelopes over time, with their common part shaded."""
    figure = Figure(figsize=(FIGURE_WIDTH, 2.5), layout="constrained")
    axis = figure.subplots()
    common = np.minimum(each.first, each.second)
    axis.fill_between(each.time, 0.0, common, color=colour("load"), alpha=0.3, linewidth=0.0)
    line(axis, each.time, each.first, color=colour("fitted"))
    line(axis, each.time, each.second, color=colour("heldout"))
    axis.set_ylim(0.0, 1.15 * max(float(np.max(each.first)), float(np.max(each.second)), 1e-3))
    tidy(axis, first=True, text="Envelope (1)")
    axis.set_xlabel("Time (s)")
    names = [muscle.replace("_", " ") for muscle in each.pair]
    key(axis, [(names[0], colour("fitted")), (names[1], colour("heldout")), ("common", colour("load"))])
    return Drawing(name, figure, caption)


def indices(found: Sequence[PairActivity], name: str, caption: str) -> Drawing:
    """Draw both indices of every recording with their intervals, a panel for each index."""
    recordings = list(dict.fromkeys(each.recording for each in found))
    pairs = list(dict.fromkeys(each.pair for each in found))
    tones = [colour(role) for role in ("fitted", "heldout", "good", "load", "stribeck", "combined")]
    figure = Figure(figsize=(FIGURE_WIDTH, 1.2 + 0.28 * len(recordings) * max(1.0, 0.5 * len(pairs))))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(1, 2, sharey=True)
    heads = {"common": "common (Falconer and Winter)", "weighed": "weighed (Rudolph)"}
    for axis, (of, head) in zip(axes, heads.items(), strict=True):
        for i, pair in enumerate(pairs):
            for each in (e for e in found if e.pair == pair):
                index = getattr(each.found, of)
                row = recordings.index(each.recording) + 0.7 * ((i + 0.5) / len(pairs) - 0.5)
                if index.interval is not None:
                    axis.plot(index.interval, (row, row), color=tones[i % len(tones)], linewidth=2.0, alpha=0.5)
                axis.plot([index.value], [row], marker="o", color=tones[i % len(tones)], markersize=5.0)
        tidy(axis, first=axis is axes[0])
        axis.set_title(head, fontweight="bold")
        axis.set_xlabel("Co-contraction (%)")
        axis.set_xlim(left=0.0)
    axes[0].set_yticks(range(len(recordings)), [r.replace("_", " ") for r in recordings])
    axes[0].set_ylim(len(recordings) - 0.4, -0.9)
    for i, pair in enumerate(pairs if len(pairs) > 1 else ()):
        text, tone = " and ".join(pair).replace("_", " "), tones[i % len(tones)]
        figure.text(0.995, 0.995 - 0.16 * i / figure.get_figheight(), text, ha="right", va="top", color=tone)
    return Drawing(name, figure, caption)


MAX_DRAWN_PAIRS = 6
"""Largest number of pairs whose envelopes are drawn."""


def page(study: Study, found: CocontractionResult) -> Page:
    """Return the page with the indices of all pairs and the envelopes of the first ones."""
    level = f"{100 * found.confidence:g} %"
    caption = f"Indices of every recording with {level} intervals (jackknife over blocks of time)."
    drawings = [draw(indices, found.pairs, "cocontraction", caption)]
    for i, each in enumerate(found.pairs[:MAX_DRAWN_PAIRS], start=1):
        name = each.recording.replace("_", " ")
        caption = f"{name}: envelopes relative to each muscle's maximum; the common activity is shaded."
        drawings.append(draw(overlap, each, f"pair_{i}", caption))
    method_text = (
        "Common activity (Falconer and Winter) is twice the lower envelope divided by the sum of both: 100 % if both "
        "are equal, whatever their level. The weighed index (Rudolph) is the ratio of the lower to the higher envelope "
        "times their sum, so that the level counts as well."
    )
    return study_page(
        title=f"{found.study}: co-contraction",
        answer=found.answer,
        tiles=(),
        sections=(Section("cocontraction", "Co-contraction", (method_text,), figure_tables(found), tuple(drawings)),),
        verdicts=found.verdicts,
    )
