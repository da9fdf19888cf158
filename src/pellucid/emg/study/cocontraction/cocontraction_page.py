"""The report of co-contraction: indices with intervals, and envelopes of each pair."""

from __future__ import annotations

from ....study.drawing.drawing import draw
from ....study.pages.page import Page, Section
from ....study.pages.quantities import typeset_sentence
from ....study.procedures.study_page import figure_tables, paper_step, study_page
from ....study.study import Study
from .cocontraction_figures import indices, overlap
from .find_cocontraction import CocontractionResult

MAX_DRAWN_PAIRS = 6
"""Largest number of pairs whose envelopes are drawn."""


def page(study: Study, found: CocontractionResult) -> Page:
    """Return the page with the indices of all pairs and the envelopes of the first ones."""
    level = f"{100 * found.confidence:g} %"
    caption = f"Indices of every recording with {level} intervals, from leaving out one block of time after another."
    drawings = [draw(indices, found.pairs, "cocontraction", caption)]
    for i, each in enumerate(found.pairs[:MAX_DRAWN_PAIRS], start=1):
        name = each.recording.replace("_", " ")
        caption = f"{name}: envelopes over each muscle's maximum; what both have is shaded."
        drawings.append(draw(overlap, each, f"pair_{i}", caption))
    method_text = (
        "Common is twice the lower envelope over the sum of both: 100 % where both do the same, however little. "
        "Weighed is the lower over the higher, times their sum: how hard they work counts as well."
    )
    return study_page(
        title=f"{found.study}: co-contraction",
        headline=typeset_sentence(found.headline),
        tiles=(),
        sections=(Section("cocontraction", "Co-contraction", (method_text,), figure_tables(found), tuple(drawings)),),
        verdicts=found.verdicts,
        following=(paper_step(study),),
    )
