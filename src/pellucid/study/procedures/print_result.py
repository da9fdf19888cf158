"""Print results as tables and sentences for a terminal or a notebook.

`latex` makes a table for a paper.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from io import StringIO
from itertools import accumulate
from textwrap import shorten, wrap
from typing import TYPE_CHECKING, Protocol

from rich import markup
from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..._given import visible_text
from ..answer import answer_lines
from ..pages.quantities import MINUS_SIGN, cell_text, number, parameter_note, relative_sd, typeset_quantities, unit_text
from .result_tables import FigureTable, ParameterTable

if TYPE_CHECKING:
    from ...models.estimates import Parameter, Verdict
    from ..answer import Answer

VERDICT_MARKS = {"good": ("+", "green"), "note": ("·", "dim"), "warning": ("!", "yellow"), "wrong": ("✗", "bold red")}
"""Mark and style of each kind of verdict."""

VERDICT_ORDER = ("wrong", "warning", "note", "good")
"""Kinds of verdicts, worst first."""

@dataclass(frozen=True)
class ScreenLayout:
    """Sizes of a result on a terminal."""

    # Largest number of lines of a result on one screen of 45; the command's own lines below it take the others
    max_screen_lines: int = 40
    max_brief_sentences: int = 4  # Largest number of verdicts on a result that is shortened to one screen
    max_brief_sentence_length: int = 150  # Largest number of characters of such a verdict
    max_brief_headline_length: int = 700  # Largest number of characters of the first sentence of such a result
    # A table of such a result is left out if fewer of its rows than these would fit, unless it has fewer or its
    # chosen rows fit
    min_brief_rows: int = 3
    default_width: int = 100  # Width of a printed result without a terminal, in characters
    column_gap: int = 3  # Number of characters between a table's columns
    table_edge_width: int = 2  # Number of characters on both sides of a table together


SCREEN_LAYOUT = ScreenLayout()


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
    def answers(self) -> Sequence[Answer]:
        """Answers of the single procedures, which stand first."""

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

    @property
    def each(self) -> Sequence[PrintableResult]:
        """Results of the single procedures, whose tables share a screen."""


def print_result(out: Console, result: PrintableResult, *, brief: bool = False) -> None:
    """Print the answers, every table and every verdict.

    With `brief`, a result that is longer than one screen, or whose tables state a `max_brief_rows`, is shortened to
    one: the answers, the worst verdicts, and of the tables what fits, in their order. The last line says what was left
    out.
    """
    headline = _answers_text(result)
    tables, sentences = result.tables, [(v.kind, typeset_quantities(v.said)) for v in result.verdicts]
    prose, left_out = result.prose, list[str]()
    if brief and (any(t.max_brief_rows is not None for t in tables) or _is_longer_than_a_screen(out, result)):
        headline = _answers_text(result, SCREEN_LAYOUT.max_brief_headline_length // len(result.each))
        every, wanted = sentences, sum(bool(_chosen_rows(t)) for t in tables if t.max_brief_rows != 0)
        # Fewer verdicts make room for a table with a chosen row.
        for most in (*range(SCREEN_LAYOUT.max_brief_sentences, 0, -1), SCREEN_LAYOUT.max_brief_sentences):
            sentences, omitted = _shorten_sentences(every, most)
            # Three lines are the empty one at the end and the two that say what was left out.
            taken = _line_count(out, Text(headline)) + sentence_lines(out, sentences) + 3
            room = SCREEN_LAYOUT.max_screen_lines - taken
            tables, cut = _shorten_tables(out, result, room)
            if sum(bool(_chosen_rows(t)) for t in tables) == wanted:
                break
        left_out += [*cut, *omitted, *(["the paragraph for a paper"] if prose else [])]
        left_out += ["the whole answer"] if headline != _answers_text(result) else []
        prose = ""
    out.print(headline, markup=False)
    for table in tables:
        for each in _printed_table(out, table, result.confidence):
            out.print(each)
    print_sentences(out, sentences)
    if left_out:
        out.print(f"  -v prints {', '.join(left_out)} as well; the page shows them.", markup=False)
    out.print()
    if prose:
        out.print(prose, markup=False)
        out.print()


def _answers_text(result: PrintableResult, most: int | None = None) -> str:
    """Return the answers as they are printed; the sentence of each has at most `most` characters."""
    blocks = []
    for answer in result.answers:
        question, said, *based_on = answer_lines(answer)
        blocks.append([question, said if most is None else shorten_text(said, most), *based_on])
    return "".join(f"\n{result.study}: " + "\n".join(block) for block in blocks)


def shorten_text(text: str, length: int) -> str:
    """Return a text, or its beginning and " …" if it has more than `length` characters; line breaks stay."""
    return text if len(text) <= length else f"{text[: length - 1].rsplit(maxsplit=1)[0]} …"


def _printed_table(out: Console, table: ParameterTable | FigureTable, confidence: float) -> list[Text | Table]:
    """Return a title and the tables below it as they are printed."""
    ((title, heads, rows),) = _tables((table,), confidence)
    return [Text(f"\n{title}"), *fitting_tables(heads, rows, out.width)]


def _line_count(out: Console, *printed: RenderableType) -> int:
    """Return the number of lines that something takes on a terminal."""
    return sum(len(out.render_lines(each, pad=False)) for each in printed)


def _is_longer_than_a_screen(out: Console, result: PrintableResult) -> bool:
    """Return whether a whole result takes more lines than `max_screen_lines`."""
    if sum(len(_rows(table)) for table in result.tables) > SCREEN_LAYOUT.max_screen_lines:
        return True  # a row takes a line at least, so that nothing needs to be laid out
    tables = [each for table in result.tables for each in _printed_table(out, table, result.confidence)]
    sentences = [(v.kind, typeset_quantities(v.said)) for v in result.verdicts]
    text = [
        Text(_answers_text(result)),
        *([Text(result.prose)] if result.prose else []),
    ]
    return _line_count(out, *text, *tables) + sentence_lines(out, sentences) + 1 > SCREEN_LAYOUT.max_screen_lines


def _shorten_tables(
    out: Console, result: PrintableResult, room: int
) -> tuple[list[ParameterTable | FigureTable], list[str]]:
    """Return the tables with as many rows as fit into `room` lines, and sentences about the omissions.

    The first table of each procedure is fitted before the second of any, and none after one that does not fit. No table
    has more rows than it states for one screen.
    """
    order = sorted((place, i) for i, part in enumerate(result.each) for place in range(len(part.tables)))
    firsts = list(accumulate((len(part.tables) for part in result.each), initial=0))
    shown: dict[int, ParameterTable | FigureTable] = {}
    omitted_tables, omitted_rows, full = 0, 0, set[int]()
    for place, i in order:
        table = result.each[i].tables[place]
        count = len(_rows(table))
        short, lines = _fitting_rows(out, table, result.confidence, room) if i not in full else (None, 0)
        if short is None:
            omitted_tables += 1
            full |= {i} if table.max_brief_rows != 0 else set()
            continue
        shown[firsts[i] + place], room = short, room - lines
        omitted_rows += count - len(_rows(short))
    return [shown[i] for i in sorted(shown)], [
        f"{count} {noun}{'' if count == 1 else 's'}"
        for count, noun in ((omitted_rows, "further row"), (omitted_tables, "further table"))
        if count
    ]


def _fitting_rows(
    out: Console, table: ParameterTable | FigureTable, confidence: float, room: int
) -> tuple[ParameterTable | FigureTable | None, int]:
    """Return a table with its first rows that fit into `room` lines, and their lines; None if too few of them fit."""
    count = len(_rows(table))
    most = count if table.max_brief_rows is None else min(table.max_brief_rows, count)
    if table.max_brief_rows == 0:
        return None, 0
    least = min(len(_chosen_rows(table)) or SCREEN_LAYOUT.min_brief_rows, count)
    # A row takes a line at least, so that no more rows than lines need be tried.
    for rows in range(min(most, max(room, 0)), least - 1, -1):
        short = table if rows == count else _first_rows(table, rows)
        lines = _line_count(out, *_printed_table(out, short, confidence))
        if lines <= room:
            return short, lines
    return None, 0


def _rows(table: ParameterTable | FigureTable) -> Sequence[object]:
    return table.rows if isinstance(table, FigureTable) else table.parameters


def _chosen_rows(table: ParameterTable | FigureTable) -> tuple[int, ...]:
    return table.chosen_rows if isinstance(table, FigureTable) else ()


def _first_rows(table: ParameterTable | FigureTable, count: int) -> ParameterTable | FigureTable:
    """Return a table with `count` of its rows: those that were chosen, and of the others the first."""
    if not isinstance(table, FigureTable):
        return replace(table, parameters=table.parameters[:count])
    chosen = set(table.chosen_rows)
    others = [i for i in range(len(table.rows)) if i not in chosen]
    kept = sorted([*chosen, *others[: count - len(chosen)]])
    return replace(
        table, rows=tuple(table.rows[i] for i in kept), chosen_rows=tuple(kept.index(i) for i in table.chosen_rows)
    )


def _shorten_before_remedy(kind: str, text: str, length: int) -> str:
    """Return a text of at most `length` characters, where a warning keeps its last sentence, which says what to do."""
    said, _, remedy = text.rpartition(". ")
    kept = f" {remedy}" if kind in ("wrong", "warning") and len(remedy) < 0.7 * length < len(text) and said else ""
    return shorten(said if kept else text, length - len(kept), placeholder=" …") + kept


def _shorten_sentences(items: Sequence[tuple[str, str]], most: int) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the worst sentences, at most `most`, each cut to about a line and a half, and a sentence about the number
    omitted.
    """
    worst_first = sorted(items, key=lambda item: VERDICT_ORDER.index(item[0]) if item[0] in VERDICT_ORDER else 1)
    kept = worst_first[:most]
    shown = [(kind, _shorten_before_remedy(kind, text, SCREEN_LAYOUT.max_brief_sentence_length)) for kind, text in kept]
    omitted = len(items) - len(kept)
    left_out = [f"{omitted} further remark{'' if omitted == 1 else 's'}"] if omitted else []
    if any(short != text for (_, short), (_, text) in zip(shown, kept, strict=True)):
        left_out.append("whole sentences")
    return shown, left_out


def print_to_text(result: PrintableResult) -> str:
    """Return the output of `print_result` as text."""
    text = StringIO()
    print_result(Console(file=text, width=SCREEN_LAYOUT.default_width, highlight=False, no_color=True), result)
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
    width -= SCREEN_LAYOUT.table_edge_width
    words = max(
        next((i for i, column in enumerate(zip(*rows, strict=True)) if any(map(_NUMBER_START.match, column))), 1), 1
    )
    columns = [(head, [row[i] for row in rows]) for i, head in enumerate(heads)]
    least = [_widths(head, cells)[0] + SCREEN_LAYOUT.column_gap for head, cells in columns]
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
    free = max(width - sum(least + SCREEN_LAYOUT.column_gap for least, _ in widths), 0)
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
    if items:
        out.print(Padding(_sentence_grid(items), 0))


def sentence_lines(out: Console, items: Sequence[tuple[str, str]]) -> int:
    """Return the number of lines that `print_sentences` would print."""
    return _line_count(out, _sentence_grid(items)) if items else 0


def _sentence_grid(items: Sequence[tuple[str, str]]) -> Table:
    """Return sentences with a mark in front of each."""
    grid = Table.grid(padding=(0, 1))
    for kind, text in items:
        mark, style = VERDICT_MARKS.get(kind, ("·", "dim"))
        # Long words are folded and not cut, because a message may contain an address longer than a line.
        grid.add_row(Text(mark, style=style), Text(text, overflow="fold"))
    return grid


def print_table(
    out: Console, heads: Sequence[str], rows: Sequence[Sequence[str]], max_lines: int | None = None
) -> None:
    """Print a table that fits the terminal; of more than `max_lines` lines the first rows, and the others' number."""
    # A row takes a line at least, so that no more rows than lines need be tried.
    for count in range(min(len(rows), len(rows) if max_lines is None else max_lines), -1, -1):
        made = fitting_tables(heads, rows[:count], out.width)
        if max_lines is None or count <= SCREEN_LAYOUT.min_brief_rows or _line_count(out, *made) <= max_lines:
            break
    for table in made:
        out.print(table)
    if count < len(rows):
        left = len(rows) - count
        out.print(f"  and {left} further row{'' if left == 1 else 's'}, which -v prints", markup=False)


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
        half = "undetermined" if p.at_bound else "not identifiable"
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
    head = typeset_quantities(head)
    # A shortened table may have lost every cell of a column without a head.
    width = max([1, *map(len, [*head.split(), *cells])])
    head = "\n".join(wrap(head, width, break_long_words=False, break_on_hyphens=False))
    # Words may wrap in a narrow terminal; numbers must not be cut.
    return f"{head}~" if any(isinstance(row[column], str) for row in rows) else f">{head}"


LATEX_REPLACEMENTS = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", '"': "''", "±": r"$\pm$", MINUS_SIGN: "$-$",
    "χ²": r"$\chi^2$", "²": "$^2$", "·": r"$\cdot$", "δ": r"$\delta$", "Δ": r"$\Delta$", "<": "$<$", ">": "$>$",
    "×": r"$\times$", "–": "--",
}  # fmt: skip
"""Replacements of characters that LaTeX does not accept."""


def latex(table: FigureTable) -> str:
    """A table for a paper; it needs the package booktabs."""
    words = [i for i in range(len(table.heads)) if all(_is_words(row[i]) for row in table.rows)]
    columns = "".join("l" if i in words else "r" for i in range(len(table.heads)))
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{latex_text(table.title)}}}"]
    lines.append(rf"\begin{{tabular}}{{{columns}}}")
    lines += [r"\toprule", " & ".join(map(latex_text, table.heads)) + r" \\", r"\midrule"]
    lines += [" & ".join(latex_text(cell) for cell in row) + r" \\" for row in table.rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


def _is_words(cell) -> bool:
    return isinstance(cell, str) and cell[:1].isalpha()


def latex_text(cell) -> str:
    """Return a cell's text as LaTeX; a dash where there is none."""
    if cell is None:
        return "--"
    text = f"{cell:.3g}" if isinstance(cell, float) else str(cell)
    text = text.replace("-", MINUS_SIGN) if isinstance(cell, float) else text
    # One pass replaces all characters, so that a replacement is not replaced again.
    return re.sub(
        "|".join(map(re.escape, LATEX_REPLACEMENTS)), lambda found: LATEX_REPLACEMENTS[found[0]], visible_text(text)
    )
