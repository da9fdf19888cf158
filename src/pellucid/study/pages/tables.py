"""Tables as text, for pages of any content."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """Cells of a table's row, as text; `strong` marks an important row."""

    cells: tuple[str, ...]
    strong: bool = False


@dataclass(frozen=True)
class Table:
    """A table as text. The `numeric` columns are right-aligned; a `wide` table fills the page."""

    heads: tuple[str, ...]
    rows: tuple[Row, ...]
    numeric: frozenset[int] = frozenset()
    caption: str = ""
    wide: bool = False


def number_table(
    heads: Sequence[str], rows: Iterable[Row | Sequence[str]], caption: str = "", *, words: int = 1, wide: bool = True
) -> Table:
    """Return a table whose first `words` columns are text and whose other columns are numbers."""
    made = tuple(row if isinstance(row, Row) else Row(tuple(row)) for row in rows)
    return Table(tuple(heads), made, frozenset(range(words, len(heads))), caption, wide)
