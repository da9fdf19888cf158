"""Tables of results: as text, as HTML for notebooks, and as pandas data frames where pandas is installed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ._errors import missing_package

if TYPE_CHECKING:
    import numpy as np
    import pandas


def data_frame(
    columns: Mapping[str, Sequence[Any] | np.ndarray], index: Sequence[Any] | None = None
) -> pandas.DataFrame:
    """Return columns of equal length as a data frame; a PellucidError says what to install if pandas is missing."""
    try:
        import pandas
    except ModuleNotFoundError:
        raise missing_package("a table as a data frame", "pandas", "tables") from None
    return pandas.DataFrame(dict(columns), index=None if index is None else list(index))


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as lines of text, its columns aligned."""
    table = [tuple(head), *map(tuple, rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in table]
    return "\n".join(lines)


def html_table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], facts: Sequence[str] = ()) -> str:
    """Return a table as HTML, with a caption above it and sentences below it."""

    from html import escape

    def row(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    body = row(head, "th") + "".join(row(cells, "td") for cells in rows)
    below = "".join(f"<p>{escape(fact)}</p>" for fact in facts)
    return f"<table><caption>{escape(caption)}</caption>{body}</table>{below}"


def columns_of(frame: object, caller: str) -> dict[str, list[Any]]:
    """Return the columns of a data frame (pandas, Polars, PyArrow) or of a mapping, by name, as lists.

    Raise a PellucidError that names the function `caller` if the object has no columns or they differ in length.
    """
    from ._errors import PellucidError

    names, column = getattr(frame, "columns", None), getattr(frame, "column", None)
    if isinstance(frame, Mapping):
        found = {str(name): list(values) for name, values in frame.items()}
    elif column is not None and hasattr(frame, "column_names"):  # PyArrow
        found = {str(name): column(name).to_pylist() for name in frame.column_names}
    elif names is not None and hasattr(frame, "__getitem__"):
        found = {str(name): list(frame[name]) for name in names}
    else:
        raise PellucidError(
            f"{caller}: found {type(frame).__name__}, expected a data frame or a mapping of columns by name"
        )
    lengths = {name: len(values) for name, values in found.items()}
    if len(set(lengths.values())) > 1:
        raise PellucidError(f"{caller}: found columns of different lengths {lengths}, expected one length")
    return found
