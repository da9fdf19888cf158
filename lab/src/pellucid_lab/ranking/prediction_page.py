"""Page of `predict`: effects of controllers on movement in simulated studies, the leading index first."""

from __future__ import annotations

from importlib.metadata import version
from math import isfinite
from pathlib import Path

from pellucid.study.drawing.drawing import Drawing, draw
from pellucid.study.pages.forest import Estimate, Row, Table, forest
from pellucid.study.pages.page import Page, Section, write_page
from pellucid.study.pages.quantities import cell_text, number
from pellucid.study.procedures.result_tables import FigureTable

from ..pointing.predicted_indices import PREDICTED_INDICES, PredictedIndex, leading_predicted_index
from ..pointing.prediction import NOTHING_CARRIED, condition_words
from ..predict import Predicted, row_id

PREDICTION_PAGE_FOLDER = Path("lab") / "prediction"
"""Folder of the page, relative to the study's folder."""


def write_prediction_page(folder: Path, found: Predicted) -> Path:
    """Write the page of a prediction into a study's `folder` and return its path."""
    leading = leading_predicted_index()
    others = [index for index in PREDICTED_INDICES if index is not leading]
    share = f"{100.0 * found.confidence:.0f} % of simulated studies"
    table = next(one for one in found.tables if isinstance(one, FigureTable))
    rows = tuple(Row(tuple(cell_text(cell) for cell in row)) for row in table.rows)
    page = Page(
        title=f"{found.study}: predicted effects",
        kicker="pellucid predict",
        answer=found.answer,
        figure=_figure(found, leading, share),
        sections=(
            Section(
                "indices", "Other indices", drawings=tuple(_figure(found, index, share) for index in others[:3]),
                tables=(Table(table.heads, rows, frozenset(range(2, len(table.heads))), f"{table.title}.", True),),
            ),
            Section(
                "method",
                "Simulated studies",
                (
                    f"{found.headline.replace(' x ', ' × ').rstrip('.')}.",
                    "Every sampled robot is identified, its controllers are built from the identification, and every "
                    "simulated person wears it. Studies are sampled from these pairs as a lab would run them. All "
                    "results are simulated; a prediction is not a measurement of people.",
                    *_carried_paragraph(found),
                ),
            ),
        ),
        footer=f"Written by pellucid {version('pellucid')}. Every number is in lab/prediction.json.",
    )  # fmt: skip
    return write_page(Path(folder) / PREDICTION_PAGE_FOLDER, page)


def _carried_paragraph(found: Predicted) -> tuple[str, ...]:
    """Return what was carried in words, if anything was."""
    if found.carried == NOTHING_CARRIED:
        return ()
    return (
        f"Carried: {found.carried}. Each controller was also worn without carrying it, for comparison (not carrying). "
        "People hold a load in the hand without a robot, too, so that changes are effects of the robot.",
    )


def _figure(found: Predicted, index: PredictedIndex, share: str) -> Drawing:
    """Return the changes of an index under each controller with their intervals."""
    estimates = []
    for law in found.prediction.laws:
        low, middle, high = found.studies.interval(index.name, law)
        if isfinite(middle):
            row, text = row_id(found, index, law), number(middle, digits=3)
            estimates.append(Estimate(condition_words(law), middle, low, high, text=text, id=row))
    return draw(
        forest, estimates, f"predicted-{index.name.replace('_', '-')}", f"{index.words}: change from no robot (%)",
        caption=f"Median change from no robot ({index.words}), and the interval of {share}. Simulated.",
    )  # fmt: skip
