"""Comparison of a published paper's figures with ours: one folder with results.json, reproduction.json and a page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pellucid._given import require_folder
from pellucid.study.answer import Answer
from pellucid.study.pages.page import write_page
from pellucid.study.results import require_own_page

from .figure import Figures, Reproduced, write_figures
from .paper import Paper
from .paper import paper as paper_named


@dataclass(frozen=True)
class Reproduction:
    """What was written."""

    page: Path
    lines: tuple[str, ...]  # The main figures, a sentence each
    figures: Figures = field(repr=False)  # All of them
    answer: Answer  # Whether the paper's claims hold here


def reproduce(
    paper: str | Paper, out: str | Path, *, on_progress: Callable[[str, float], None] | None = None
) -> Reproduction:
    """Reproduce a paper.

    Parameters
    ----------
    paper : str or Paper
        A folder of ``papers/``: ``"able"``, ``"knee"``, ``"hill"``; or such a paper with settings of its own.
    out : path-like
        Folder, made if it is not there.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Reproduction

    Raises
    ------
    PellucidError
        If the paper is not known.

    Examples
    --------
    >>> import pellucid as pl
    >>> made = pl.reproduce("able", "able-again")                            # doctest: +SKIP
    """
    out = require_folder(Path(out), "a folder for the page and its files")
    made = paper_named(paper)() if isinstance(paper, str) else paper
    command = f"reproduce {made.name}"
    require_own_page(out, command)
    figures = Figures(made.figures(on_progress or (lambda text, share: None)))
    write_figures(out, command, tuple(figures.values()), made.split)
    made.write_more(out)
    page = write_page(out, made.page(figures))
    lines = tuple(_sentence(row) for row in figures.values() if made.is_main(row.id))
    return Reproduction(page, lines, figures, made.answer(figures))


def _sentence(row: Reproduced) -> str:
    ours = "none" if row.ours is None else f"{row.ours:.4g}"
    between = "" if row.lower is None else f" ({row.lower:.4g} to {row.upper:.4g})"
    beside = "" if row.published is None else f", published {row.published:.4g}"
    unit = "" if row.unit == "1" else f" {row.unit.replace('*', '·')}"
    return f"{row.quantity}: {ours}{between}{unit}{beside}"
