"""Print results as tables and sentences for a terminal or a notebook."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from io import StringIO
from textwrap import shorten, wrap
from typing import TYPE_CHECKING, Protocol

from rich import markup
from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..pages.quantities import cell_text, number, parameter_note, relative_sd, typeset_units, unit_text
from .result_tables import FigureTable, ParameterTable

if TYPE_CHECKING:
    from ..fit.parameter import Parameter, Verdict

VERDICT_MARKS = {"good": ("+", "green"), "note": ("·", "dim"), "warning": ("!", "yellow"), "wrong": ("✗", "bold red")}
"""Mark and style of each kind of verdict."""

VERDICT_ORDER = ("wrong", "warning", "note", "good")
"""Kinds of verdicts, worst first."""

MAX_BRIEF_SENTENCES = 4
"""Largest number of verdicts on a result that is shortened to one screen."""

MAX_BRIEF_SENTENCE_LENGTH = 150
"""Largest number of characters of such a verdict."""

DEFAULT_WIDTH = 100
"""Width of a printed result without a terminal, in characters."""

COLUMN_GAP = 3
"""Number of characters between a table's columns."""

TABLE_EDGE_WIDTH = 2
"""Number of characters on both sides of a table together."""

_NUMBER_START = re.compile(r"[<>+−-]?\.?\d")
"""Beginning of a cell that holds a number."""

_BREAK_PLACES = re.compile(r"(?<=[._])")
"""Places at which a name may be broken."""


class PrintableResult(Protocol):
    """Members of a result that are printed."""

    @property
    def study(self) -> str:
        """Name of the study."""

    @property
    def headline(self) -> str:
        """First sentence."""

    @property
    def tables(self) -> Sequence[ParameterTable | FigureTable]:
        """Tables, in their order."""

    @property
    def verdicts(self) -> Sequence[Verdict]:
        """Verdicts, worst first."""

    @property
    def prose(self) -> str:
        """A paragraph below the verdicts, "" without one."""

    @property
    def confidence(self) -> float:
        """Confidence level of the intervals."""


def print_result(out: Console, result: PrintableResult, *, brief: bool = False) -> None:
    """Print the headline, every table and every verdict.

    With `brief`, a result whose tables state a `max_brief_rows` is shortened to about one screen, and the last line
    says what was left out. Other results are printed whole.
    """
    out.print(f"\n{result.study}: {typeset_units(result.headline)}", markup=False)
    tables, sentences = result.tables, [(v.kind, typeset_units(v.said)) for v in result.verdicts]
    left_out: list[str] = []
    if brief and any(t.max_brief_rows is not None for t in tables):
        tables, left_out = _shorten_tables(tables)
        sentences, omitted = _shorten_sentences(sentences)
        left_out += omitted
    for title, heads, rows in _tables(tables, result.confidence):
        out.print(f"\n{title}", markup=False)
        for table in fitting_tables(heads, rows, out.width):
            out.print(table)
    print_sentences(out, sentences)
    if left_out:
        out.print(f"  -v prints {', '.join(left_out)} as well.", markup=False)
    out.print()
    if result.prose:
        out.print(result.prose, markup=False)
        out.print()


def _shorten_tables(
    tables: Sequence[ParameterTable | FigureTable],
) -> tuple[list[ParameterTable | FigureTable], list[str]]:
    """Return the tables with no more rows than each states for one screen, and in words what was left out."""
    shown: list[ParameterTable | FigureTable] = []
    omitted_tables, omitted_rows = 0, 0
    for table in tables:
        most = table.max_brief_rows
        count = len(table.rows if isinstance(table, FigureTable) else table.parameters)
        if most is None or count <= most:
            shown.append(table)
        elif not most:
            omitted_tables += 1
        else:
            omitted_rows += count - most
            if isinstance(table, FigureTable):
                shown.append(replace(table, rows=table.rows[:most]))
            else:
                shown.append(replace(table, parameters=table.parameters[:most]))
    return shown, [
        f"{count} {noun}{'' if count == 1 else 's'}"
        for count, noun in ((omitted_rows, "further row"), (omitted_tables, "further table"))
        if count
    ]


def _shorten_sentences(items: Sequence[tuple[str, str]]) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the worst sentences, each cut to about a line and a half, and in words how many were left out."""
    worst_first = sorted(items, key=lambda item: VERDICT_ORDER.index(item[0]) if item[0] in VERDICT_ORDER else 1)
    kept = worst_first[:MAX_BRIEF_SENTENCES]
    shown = [(kind, shorten(text, MAX_BRIEF_SENTENCE_LENGTH, placeholder=" …")) for kind, text in kept]
    omitted = len(items) - len(kept)
    left_out = [f"{omitted} further remark{'' if omitted == 1 else 's'}"] if omitted else []
    if any(short != text for (_, short), (_, text) in zip(shown, kept, strict=True)):
        left_out.append("whole sentences")
    return shown, left_out


def print_to_text(result: PrintableResult) -> str:
    """Return the output of `print_result` as text."""
    text = StringIO()
    print_result(Console(file=text, width=DEFAULT_WIDTH, highlight=False, no_color=True), result)
    return text.getvalue().strip("\n")


def html_tables(result: PrintableResult) -> str:
    """Return every table as HTML."""
    made = []
    for title, heads, rows in _tables(result.tables, result.confidence):
        head = "".join(f"<th>{escape(h.strip('>~'))}</th>" for h in heads)
        body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        made.append(f"<table><caption>{escape(title)}</caption><tr>{head}</tr>{body}</table>")
    return "".join(made)


def plain_table(*heads: str) -> Table:
    """Return a table without frames.

    A head that begins with > aligns its column to the right. A column whose head ends with ~ may wrap.
    """
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1), header_style="dim", safe_box=True)
    for head in heads:
        table.add_column(
            markup.escape(head.removeprefix(">").removesuffix("~")),  # a unit in brackets is no markup
            justify="right" if head.startswith(">") else "left",
            no_wrap=not head.endswith("~"),
        )
    return table


def fitting_tables(heads: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[Table]:
    """Return a table that fits a terminal of `width` characters, or several tables with the same first columns.

    Words may wrap, but numbers are never cut.
    """
    width -= TABLE_EDGE_WIDTH
    words = max(
        next((i for i, column in enumerate(zip(*rows, strict=True)) if any(map(_NUMBER_START.match, column))), 1), 1
    )
    columns = [(head, [row[i] for row in rows]) for i, head in enumerate(heads)]
    least = [_widths(head, cells)[0] + COLUMN_GAP for head, cells in columns]
    own = min(sum(least[:words]), max(width // 2, width - max(least[words:], default=0)))
    parts: list[list[int]] = [[]]
    for i in range(words, len(columns)):
        if parts[-1] and own + sum(least[j] for j in parts[-1]) + least[i] > width:
            parts.append([])
        parts[-1].append(i)
    return [_fitted([columns[i] for i in (*range(words), *part)], width) for part in parts]


def _fitted(columns: Sequence[tuple[str, Sequence[str]]], width: int) -> Table:
    """Return a table whose columns share the available `width`."""
    table = plain_table(*(head for head, _ in columns))
    widths = [_widths(head, cells) for head, cells in columns]
    free = max(width - sum(least + COLUMN_GAP for least, _ in widths), 0)
    for column, (least, whole) in zip(table.columns, widths, strict=True):
        more = min(whole - least, free)
        column.width, column.no_wrap, column.overflow, free = least + more, False, "fold", free - more
    for cells in zip(*(cells for _, cells in columns), strict=True):
        fitted = (_broken(cell, column.width) for cell, column in zip(cells, table.columns, strict=True))
        table.add_row(*map(markup.escape, fitted))
    return table


def _broken(cell: str, width: int) -> str:
    """Break a name that is too long for its column into several lines, after a dot or an underscore."""
    if cell_len(cell) <= width or " " in cell or _NUMBER_START.match(cell):
        return cell
    lines = [""]
    for part in _BREAK_PLACES.split(cell):
        if lines[-1] and cell_len(lines[-1] + part) > width:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def _widths(head: str, cells: Sequence[str]) -> tuple[int, int]:
    """Return the smallest and the full width of a column in characters; a column of numbers needs its full width."""
    head = head.removeprefix(">").removesuffix("~")
    parts = [line for cell in (head, *cells) for line in cell.splitlines()]
    whole = max(map(cell_len, parts), default=0)
    words = [part for cell in cells for word in cell.split() for part in _BREAK_PLACES.split(word)]
    unbroken = [cell for cell in cells if _NUMBER_START.match(cell)] + head.split() + words
    return min(max(map(cell_len, unbroken), default=0), whole), whole


def print_sentences(out: Console, items: Sequence[tuple[str, str]]) -> None:
    """Print sentences with a mark in front, wrapped and indented."""
    grid = Table.grid(padding=(0, 1))
    for kind, text in items:
        mark, style = VERDICT_MARKS.get(kind, ("·", "dim"))
        # Long words are folded and not cut, because a message may contain an address longer than a line.
        grid.add_row(Text(mark, style=style), Text(text, overflow="fold"))
    if items:
        out.print(Padding(grid, 0))


def _tables(
    tables: Sequence[ParameterTable | FigureTable], confidence: float
) -> list[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]:
    """Return title, heads and cells of each table."""
    made = []
    for shown in tables:
        if isinstance(shown, ParameterTable):
            heads = ("parameter", ">value", f">± ({100.0 * confidence:.4g} %)", "unit", ">SD %", "")
            made.append((shown.title, heads, [_parameter(p, confidence) for p in shown.parameters]))
            continue
        rows = [tuple(cell_text(cell) for cell in row) for row in shown.rows]
        heads = tuple(_folded(head, [r[i] for r in rows], shown.rows, i) for i, head in enumerate(shown.heads))
        made.append((shown.title, heads, rows))
    return made


def _parameter(p: Parameter, level: float) -> tuple[str, ...]:
    low, high = p.interval(level)
    half = number(0.5 * (high - low), p.standard_error) if high > low else "–"
    if p.refused:
        half = "undetermined" if p.at_bound else "refused"
    return (
        p.name,
        number(p.value, p.standard_error),
        half,
        unit_text(p.unit),
        relative_sd(p),
        parameter_note(p, level),
    )


def _folded(head: str, cells: Sequence[str], rows: Sequence[Sequence[object]], column: int) -> str:
    """Break a head into lines no wider than its column; columns of numbers are aligned to the right."""
    head = typeset_units(head)
    width = max(map(len, [*head.split(), *cells]))
    head = "\n".join(wrap(head, width, break_long_words=False, break_on_hyphens=False))
    # Words may wrap in a narrow terminal; numbers must not be cut.
    return f"{head}~" if any(isinstance(row[column], str) for row in rows) else f">{head}"
