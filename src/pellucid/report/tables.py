"""Tables as text: what a page shows of numbers, whatever they are about."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """Cells of a table's row, as text; `strong` marks the one to look at."""

    cells: tuple[str, ...]
    strong: bool = False


@dataclass(frozen=True)
class Table:
    """A table as text. `numeric` are the columns set to the right; `wide` fills the page."""

    heads: tuple[str, ...]
    rows: tuple[Row, ...]
    numeric: frozenset[int] = frozenset()
    caption: str = ""
    wide: bool = False
