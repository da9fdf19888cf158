"""Write a page with tiles, sections, tables and figures in the report's style, as one self-contained file."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from .._atomic import remove_leftovers, write_text_atomically
from ..drawing.drawing import Drawing
from .tables import Table
from .templates import render

PAGE_FILE = "index.html"


@dataclass(frozen=True)
class Tile:
    """One number at the head of a page."""

    what: str  # name of the quantity
    figure: str  # number
    unit: str = ""
    more: str = ""  # short explanation


@dataclass(frozen=True)
class Section:
    """A part of a page: paragraphs, then drawings, then tables, then links, then muted notes; all text is plain.

    `id` is the anchor; the `heading` stands in the navigation too; `links` are words and where they lead; `folded` are
    tables below a line that opens them; `verdicts`, of a kind each, stand last.
    """

    id: str
    heading: str
    paragraphs: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    drawings: tuple[Drawing, ...] = ()
    notes: tuple[str, ...] = ()
    links: tuple[tuple[str, str], ...] = ()
    folded: tuple[tuple[str, Table], ...] = ()
    verdicts: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Page:
    """Contents of a page as plain text: `kicker` above the title, `headline` below it, then `verdicts` with a kind."""

    title: str
    kicker: str
    headline: str
    tiles: tuple[Tile, ...] = ()
    sections: tuple[Section, ...] = ()
    footer: str = ""
    verdicts: tuple[tuple[str, str], ...] = ()


def write_page(folder: Path, page: Page) -> Path:
    """Write a page: ``index.html`` without outside references, and every figure beside it as SVG and PDF."""
    folder = Path(folder)
    drawings = [drawing for section in page.sections for drawing in section.drawings]
    anchors = [section.id for section in page.sections] + [f"fig-{drawing.name}" for drawing in drawings]
    twice = [anchor for anchor, count in Counter(anchors).items() if count > 1]
    if twice:
        raise ValueError(f"more than one part of the page is called {', '.join(map(repr, twice))}")
    folder.mkdir(parents=True, exist_ok=True)
    remove_leftovers(folder)
    for drawing in drawings:
        drawing.save(folder)
    return write_text_atomically(folder / PAGE_FILE, render("page.html.j2", title=page.title, page=page))
