"""What was found, as tables and sentences for a terminal or a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from io import StringIO
from textwrap import wrap
from typing import TYPE_CHECKING

from rich import markup
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..pages.quantities import cell_text, number, parameter_note, relative_sd, unit_text, units_in
from .result import ParameterTable

if TYPE_CHECKING:
    from ..fit.parameter import Parameter
    from .result import Result

MARKS = {"good": ("+", "green"), "note": ("·", "dim"), "warning": ("!", "yellow"), "wrong": ("✗", "bold red")}
WIDTH = 100


def print_result(out: Console, result: Result) -> None:
    """Headline, every table, every verdict."""
    say(out, f"\n{result.study}: {units_in(result.headline)}")
    for title, heads, rows in _tables(result):
        say(out, f"\n{title}")
        table = plain_table(*heads)
        for row in rows:
            table.add_row(*map(markup.escape, row))
        out.print(table)
    print_sentences(out, [(v.kind, units_in(v.said)) for v in result.verdicts])
    out.print()
    if result.prose:
        out.print(result.prose, markup=False)
        out.print()


def printed(result: Result) -> str:
    """`print_result` as a text."""
    text = StringIO()
    print_result(Console(file=text, width=WIDTH, highlight=False, no_color=True), result)
    return text.getvalue().strip("\n")


def html_tables(result: Result) -> str:
    """Every table as HTML."""
    made = []
    for title, heads, rows in _tables(result):
        head = "".join(f"<th>{escape(h.strip('>~'))}</th>" for h in heads)
        body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        made.append(f"<table><caption>{escape(title)}</caption><tr>{head}</tr>{body}</table>")
    return "".join(made)


def say(out: Console, text: str) -> None:
    """A line as it is: paths are neither wrapped nor read as markup."""
    out.print(text, markup=False, soft_wrap=True)


def plain_table(*heads: str) -> Table:
    """A table without frames; a head that begins with > sets its column to the right, one that ends with ~ may wrap."""
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1), header_style="dim", safe_box=True)
    for head in heads:
        table.add_column(
            markup.escape(head.removeprefix(">").removesuffix("~")),  # a unit in brackets is no markup
            justify="right" if head.startswith(">") else "left",
            no_wrap=not head.endswith("~"),
        )
    return table


def print_sentences(out: Console, items: Sequence[tuple[str, str]]) -> None:
    """Sentences with a mark in front, wrapped and indented."""
    grid = Table.grid(padding=(0, 1))
    for kind, text in items:
        mark, style = MARKS.get(kind, ("·", "dim"))
        # Folded, not cut: a message may hold an address longer than a line.
        grid.add_row(Text(mark, style=style), Text(text, overflow="fold"))
    if items:
        out.print(Padding(grid, 0))


def _tables(result: Result) -> list[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]:
    """Title, heads and cells of each table."""
    made = []
    for shown in result.tables:
        if isinstance(shown, ParameterTable):
            heads = ("parameter", ">value", f">± ({100.0 * result.confidence:.4g} %)", "unit", ">SD %", "")
            made.append((shown.title, heads, [_parameter(p, result.confidence) for p in shown.parameters]))
            continue
        rows = [tuple(cell_text(cell) for cell in row) for row in shown.rows]
        heads = tuple(_folded(head, [r[i] for r in rows], shown.rows, i) for i, head in enumerate(shown.heads))
        made.append((shown.title, heads, rows))
    return made


def _parameter(p: Parameter, level: float) -> tuple[str, ...]:
    low, high = p.interval(level)
    return (
        p.name,
        number(p.value, p.standard_error),
        number(0.5 * (high - low), p.standard_error) if high > low else "–",
        unit_text(p.unit),
        relative_sd(p),
        parameter_note(p, level),
    )


def _folded(head: str, cells: Sequence[str], rows: Sequence[Sequence[object]], column: int) -> str:
    """A head on as many lines as keep it no wider than what stands below; figures stand to the right."""
    head = units_in(head)
    width = max(map(len, [*head.split(), *cells]))
    head = "\n".join(wrap(head, width, break_long_words=False, break_on_hyphens=False))
    # Words may wrap where a terminal is narrow; a figure that is cut is none.
    return f"{head}~" if any(isinstance(row[column], str) for row in rows) else f">{head}"
