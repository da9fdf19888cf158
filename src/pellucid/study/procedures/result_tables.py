"""Tables of a result: parameters with their intervals, and figures."""

from __future__ import annotations

from dataclasses import dataclass

from ...models.estimates import Parameter


@dataclass(frozen=True)
class ParameterTable:
    """Parameters with their intervals, under a title."""

    title: str
    parameters: tuple[Parameter, ...]
    max_brief_rows: int | None = None  # Largest number of rows on a terminal without ``-v``; 0: no table; None: all


@dataclass(frozen=True)
class FigureTable:
    """Figures under a title: `heads` name the columns with their units; None marks a missing figure."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str | float | int | None, ...], ...]
    max_brief_rows: int | None = None  # Largest number of rows on a terminal without ``-v``; 0: no table; None: all
    chosen_rows: tuple[int, ...] = ()  # Places of the rows that were chosen; a shortened table keeps them
