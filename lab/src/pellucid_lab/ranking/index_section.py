"""The ranking's section on indices: every index of transparency on the same sessions, and how far they agree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pellucid.study.drawing.drawing import draw
from pellucid.study.pages.forest import Row, number_table
from pellucid.study.pages.page import Section
from pellucid.study.results import ResultRow

from .index_figures import agreement_map
from .strategies import controller_words
from .task_ranking import TaskRanking
from .transparency_indices import TRANSPARENCY_INDICES, IndexComparison

CHOSEN_INDEX = "torque_rms"
"""Index by which the ranking orders controllers."""

MIN_COMPARED_CONTROLLERS = 3
"""Fewest controllers between which orders are compared."""


def compare_indices(ranking: TaskRanking) -> IndexComparison | None:
    """Return the comparison of all indices on a task's sessions; None if they were not computed for enough of them."""
    names = tuple(name for name in ranking.controllers if all(one.indices for one in ranking.tried[name]))
    if len(names) < MIN_COMPARED_CONTROLLERS:
        return None
    values = {
        index.name: np.array([[(one.indices or {})[index.name] for one in ranking.tried[name]] for name in names]).T
        for index in TRANSPARENCY_INDICES
    }
    return IndexComparison(names, values)


def index_rows(compared: IndexComparison, command: str) -> list[ResultRow]:
    """Return the rows of results.json on the agreement of indices."""
    rows = []
    for i in TRANSPARENCY_INDICES:
        figures = {
            "with_chosen": (compared.agreement(i.name, CHOSEN_INDEX), f"Kendall's tau with {CHOSEN_INDEX}"),
            "agreement": (compared.mean_agreement(i.name), "mean of Kendall's tau with indices of other kinds"),
            "concordance": (compared.concordance(i.name), "Kendall's W over pairs of a person and a robot"),
        }
        rows += [
            ResultRow(f"ranking.index.{i.name}.{name}", float(value), "1", command, "simulated", note=note)
            for name, (value, note) in figures.items()
            if np.isfinite(value)
        ]
    return rows


def index_section(ranking: TaskRanking) -> tuple[Section, ...]:
    """Return the section on indices of a task, or none if they were not computed."""
    compared = compare_indices(ranking)
    if compared is None:
        return ()
    first = {i.name: compared.order(i.name)[0] for i in TRANSPARENCY_INDICES}
    rows = [
        Row(
            (
                i.words, i.kind, i.source, controller_words(ranking.task, first[i.name]),
                _signed(compared.agreement(i.name, CHOSEN_INDEX)), _signed(compared.mean_agreement(i.name)),
                f"{compared.concordance(i.name):.2f}",
            ),
            i.name == CHOSEN_INDEX,
        )
        for i in TRANSPARENCY_INDICES
    ]  # fmt: skip
    heads = ("index", "kind", "source", "first by it", "tau with the torque", "tau with other kinds", "W of pairs")
    caption = (
        "Larger is less transparent by every index; changes are absolute and against the same person without a robot. "
        "Tau: Kendall's, of controllers' mean ranks; 1 is the same order, 0 no relation. W: Kendall's, how far pairs "
        "of a person and a robot agree on the order."
    )
    pairs, count = ranking.torque.shape[0], len(compared.controllers)
    best = max(first.values(), key=list(first.values()).count)
    agreed = sum(name == best for name in first.values())
    drawing = draw(
        agreement_map, compared, f"index_agreement_{ranking.task.replace(' ', '_')}",
        caption="Kendall's tau of the orders by two indices, by kind. Dark: alike; pale: not related or opposite.",
    )  # fmt: skip
    return (
        Section(
            "indices", f"{len(rows)} indices of transparency, one set of recordings",
            (
                f"The papers on these robots and this toolkit call a robot transparent by {len(rows)} indices. All are "
                f"computed here on the same movements of {pairs} people under {count} controllers of {ranking.task}; "
                f"{agreed} of them put {controller_words(ranking.task, best)} first.",
                *_argument(compared),
            ),
            (number_table(heads, rows, caption, words=4),), (drawing,),
        ),
    )  # fmt: skip


def _argument(compared: IndexComparison) -> Sequence[str]:
    """Return why the ranking orders by one index, and what speaks against it, with this comparison's figures."""
    places = {
        what: 1 + sum(of(i.name) > of(CHOSEN_INDEX) for i in TRANSPARENCY_INDICES)
        for what, of in (("agreement", compared.mean_agreement), ("concordance", compared.concordance))
    }
    count = len(TRANSPARENCY_INDICES)
    return (
        "The ranking orders by the RMS of the interaction torque. It is what the robot does to the person, it is 0 "
        "without a robot, so that it needs no second recording, and it has a unit. "
        f"Among these {count} indices it ranks number {places['agreement']} in agreement with indices of other kinds, "
        f"and number {places['concordance']} in concordance of the order over people and robots.",
        "Its weakness: a person who slows down, or who lets the robot lead, feels less torque. It does not measure "
        "people's movement, and it requires a sensor between person and robot. Duration, peak velocity and EMG are "
        "therefore shown too. The certificate, which tests people's movement, decides whether a robot is transparent.",
    )


def _signed(value: float) -> str:
    return f"{value:+.2f}" if np.isfinite(value) else "–"
