"""The report of synergies: their number, weights, activations and similarity.

Figures of synergies: their number, their weights and their activations.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ....study.drawing.drawing import Drawing, draw, key, line, tidy
from ....study.drawing.style import FIGURE_WIDTH, colour
from ....study.pages.page import Page, Section
from ....study.procedures.study_page import figure_tables, study_page
from ....study.study import Study
from .find_synergies import GroupSynergies, SynergiesResult

SYNERGY_TONES = ("fitted", "heldout", "good", "load", "stribeck", "combined", "directional", "symmetric")
"""Colours of the synergies, in their order."""


def synergy_counts(group: GroupSynergies, name: str, caption: str) -> Drawing:
    """Draw the variance that each number of synergies accounts for, and R2 of muscles predicted from the others."""
    c = group.count
    figure = Figure(figsize=(FIGURE_WIDTH, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for values, tone in ((c.shuffled, "muted"), (c.least, "load"), (c.fitted, "fitted"), (c.heldout, "heldout")):
        left.plot(c.numbers, 100 * np.maximum(values, -0.02), color=colour(tone), marker="o", markersize=4.0)
    left.axhline(90.0, color=colour("muted"), linewidth=0.8)
    tidy(left, first=True, text="Variance accounted for (%)")
    left.set_ylim(min(40.0, left.get_ylim()[0]), 103.0)
    words = (("fitted", "fitted"), ("held out", "heldout"), ("worst muscle", "load"), ("shifted in time", "muted"))
    for i, (text, tone) in enumerate(words):
        left.annotate(
            text, (1.0, 0.0), xytext=(-6, 8 + 12 * (3 - i)), xycoords="axes fraction", textcoords="offset points",
            ha="right", color=colour(tone), fontsize=8.5,
        )  # fmt: skip
    right.plot(c.numbers, np.maximum(c.left_out, -1.0), color=colour("heldout"), marker="o", markersize=4.0)
    right.axhline(0.0, color=colour("muted"), linewidth=0.8)
    tidy(right, first=True, text="R² of a held-out muscle")
    right.set_ylim(min(0.0, right.get_ylim()[0]) - 0.05, 1.03)
    for axis in (left, right):
        axis.set_xlabel("Number of synergies")
        axis.set_xticks(c.numbers)
    return Drawing(name, figure, caption)


def weights_and_activations(group: GroupSynergies, name: str, caption: str) -> Drawing:
    """Draw the weights of each synergy, and its activation over time."""
    k = len(group.synergies)
    figure = Figure(figsize=(FIGURE_WIDTH, 0.9 + 1.15 * k), layout="constrained")
    axes = figure.subplots(k, 2, width_ratios=(1.0, 1.7), sharex="col", squeeze=False)
    places = range(len(group.synergies.muscles))
    for i in range(k):
        tone = colour(SYNERGY_TONES[i % len(SYNERGY_TONES)])
        axes[i, 0].bar(places, group.synergies.weights[i], color=tone, width=0.7)
        tidy(axes[i, 0], first=True, text=f"{i + 1}", ticks=3)
        axes[i, 0].set_ylim(0.0, 1.05)
        line(axes[i, 1], group.time, group.activations[:, i], color=tone)
        tidy(axes[i, 1], first=True, ticks=3)
        axes[i, 1].set_ylim(bottom=0.0)
    names = [muscle.replace("_", " ") for muscle in group.synergies.muscles]
    axes[-1, 0].set_xticks(places, names, rotation=60, ha="right")
    axes[-1, 1].set_xlabel("Time (s)")
    axes[0, 0].set_title("Weights")
    axes[0, 1].set_title("Activation")
    return Drawing(name, figure, caption)


def reconstructed_envelopes(group: GroupSynergies, name: str, caption: str) -> Drawing:
    """Draw envelopes, and their reconstruction by synergies."""
    made = group.activations @ group.synergies.weights
    count = len(group.synergies.muscles)
    rows = (count + 1) // 2
    figure = Figure(figsize=(FIGURE_WIDTH, 0.6 + 0.95 * rows), layout="constrained")
    axes = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for i, axis in enumerate(axes.flat):
        if i >= count:
            axis.set_axis_off()
            continue
        line(axis, group.time, group.envelopes[:, i], color=colour("measured"), linewidth=2.0)
        line(axis, group.time, made[:, i], color=colour("heldout"), linewidth=1.2)
        tidy(axis, first=True, ticks=3)
        axis.set_title(group.synergies.muscles[i].replace("_", " "))
    key(axes[0, 0], [("recorded", colour("measured")), ("by synergies", colour("heldout"))])
    for axis in axes[-1]:
        axis.set_xlabel("Time (s)")
    return Drawing(name, figure, caption)


MAX_DRAWN_GROUPS = 4
"""Largest number of groups that are drawn."""


def page(study: Study, found: SynergiesResult) -> Page:
    """Return the page with the number, weights, activations and similarity of synergies."""
    how_many, which = [], []
    for i, group in enumerate(found.groups[:MAX_DRAWN_GROUPS], start=1):
        of = f"{group.name.replace('_', ' ')}: " if group.name else ""
        caption = (
            f"{of}Held-out variance accounted for, by number of synergies ({group.judged_on.replace('_', ' ')}). Grey: "
            "the same envelopes with independent time shifts, which removes their relation. Right: each muscle held "
            "out in turn and predicted from the others; values below -1 are drawn at -1."
        )
        how_many.append(draw(synergy_counts, group, f"synergy_count_{i}", caption))
        caption = f"{of}Weights of each muscle, and how active each synergy is."
        which.append(draw(weights_and_activations, group, f"synergies_{i}", caption))
        caption = f"{of}Envelopes, and their reconstruction."
        which.append(draw(reconstructed_envelopes, group, f"synergies_rebuilt_{i}", caption))
    method_text = (
        "Weights are fitted on one part of the data, and the variance is computed on another. It always increases with "
        "the number of synergies. The prediction of a held-out muscle has a maximum, often at a smaller number."
    )
    sections = [
        Section(
            "synergy_count", "Number of synergies", (method_text,), figure_tables(found, "Number of"), tuple(how_many)
        ),
        Section("synergies", "Weights and activations", drawings=tuple(which)),
    ]
    if found.alike:
        method_text = (
            "Synergies are matched by the largest cosine similarity of their weights. By chance: the cosine that 5 % "
            "of random permutations exceed. VAF across: variance of the second group's envelopes accounted for by the "
            "weights of the first."
        )
        tables = figure_tables(found, "Similarity")
        sections.append(Section("synergies_alike", "Similarity of synergies", (method_text,), tables))
    return study_page(
        title=f"{found.study}: muscle synergies",
        answer=found.answer,
        tiles=(),
        sections=sections,
        verdicts=found.verdicts,
    )
