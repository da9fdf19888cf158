"""The report of synergies: their number, weights, activations and similarity."""

from __future__ import annotations

from ....study.drawing.drawing import draw
from ....study.pages.page import Page, Section
from ....study.pages.quantities import typeset_sentence
from ....study.procedures.study_page import figure_tables, paper_step, study_page
from ....study.study import Study
from . import synergies_figures as figures
from .find_synergies import SynergiesResult

MAX_DRAWN_GROUPS = 4
"""Largest number of groups that are drawn."""


def page(study: Study, found: SynergiesResult) -> Page:
    """Return the page with the number, weights, activations and similarity of synergies."""
    how_many, which = [], []
    for i, group in enumerate(found.groups[:MAX_DRAWN_GROUPS], start=1):
        of = f"{group.name.replace('_', ' ')}: " if group.name else ""
        how_many.append(
            draw(
                figures.synergy_counts, group, f"synergy_count_{i}",
                f"{of}Variance that each number of synergies accounts for, held out: "
                f"{group.judged_on.replace('_', ' ')}. Grey: the same envelopes shifted apart in time, which share "
                "nothing. Right: each muscle left out in turn and predicted from the others; values below -1 are "
                "drawn at -1.",
            )
        )  # fmt: skip
        which.append(
            draw(
                figures.weights_and_activations, group, f"synergies_{i}",
                f"{of}Weights of each muscle, and how active each synergy is.",
            )
        )  # fmt: skip
        which.append(
            draw(
                figures.reconstructed_envelopes,
                group,
                f"synergies_rebuilt_{i}",
                f"{of}Envelopes, and their reconstruction.",
            )
        )
    method_text = (
        "Weights are fitted on one part, and the variance is computed on another. More synergies always account for "
        "more of it; a muscle left out is predicted best by a certain number, which may be smaller."
    )
    sections = [
        Section(
            "synergy_count", "How many synergies", (method_text,), figure_tables(found, "How many"), tuple(how_many)
        ),
        Section("synergies", "Which muscles, and when", drawings=tuple(which)),
    ]
    if found.alike:
        method_text = (
            "Synergies are matched by the largest cosines of their weights. By chance: the cosine that randomly "
            "permuted weights exceed once in twenty. VAF across: envelopes of the second by weights of the first."
        )
        sections.append(Section("synergies_alike", "How alike", (method_text,), figure_tables(found, "How alike")))
    return study_page(
        title=f"{found.study}: muscle synergies",
        headline=typeset_sentence(found.headline),
        tiles=(),
        sections=sections,
        verdicts=found.verdicts,
        following=(paper_step(study),),
    )
