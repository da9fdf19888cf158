"""The report of onsets: raw EMG with its bursts, and a table of them."""

from __future__ import annotations

from ....study.drawing.drawing import draw
from ....study.pages.page import Page, Section, Tile
from ....study.pages.quantities import typeset_sentence
from ....study.procedures.study_page import figure_tables, paper_step, study_page
from ....study.study import Study
from .find_onsets import MAX_DRAWN_RECORDINGS, OnsetResult
from .onset_figures import burst_traces
from .onset_table import OnsetTable


def page(study: Study, found: OnsetResult) -> Page:
    """Return the page with the bursts of all recordings, and drawings of the first ones."""
    names = list(dict.fromkeys(each.recording for each in found.muscles))
    drawings = tuple(
        draw(
            burst_traces, [each for each in found.muscles if each.recording == name], f"bursts_{i}",
            f"{name.replace('_', ' ')}: raw EMG. Blue is activity; orange lines are where it begins and ends, with the "
            f"{100 * found.confidence:g} % interval; green underlines the rest that it is judged by.",
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
        f"Energy after Teager and Kaiser passes {table.height:g} standard deviations of rest for at least "
        f"{1e3 * table.shortest:g} ms; the onset itself is where the variance begins to rise, a change point with its "
        "interval."
    )
    return study_page(
        title=f"{found.study}: muscle onset",
        headline=typeset_sentence(found.headline),
        tiles=(Tile("Bursts", str(count), "", f"{len(names)} recording{'s' if len(names) != 1 else ''}"),),
        sections=(
            Section(
                "onset_bursts", "When muscles become active", (method_text,), figure_tables(found), drawings, notes
            ),
        ),
        verdicts=found.verdicts,
        following=(paper_step(study),),
    )
