"""Read text tables: comma, semicolon, tab or blanks between columns, any or no header, decimal point or comma.

The first lines tell the layout. A table of plain numbers is then read in blocks by a library (`_number_blocks.py`), any
other field by field. Both go through the file in blocks, so that a file of any size needs little beside its numbers.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..._errors import RecordingError
from ..personal_fields import find_personal_columns, find_personal_lines, searched_part
from ..stated_units import is_unit_row, unit_from_text
from ._caps import require_few_columns, require_narrow_lines
from ._columns import Columns
from ._comma import (
    CommaEvidence,
    decimal_marks,
    has_whole_numbers,
    may_hold_thousands,
    plain_numbers,
    read_number,
    two_readings,
)
from ._last_row import cut_row
from ._number_blocks import (
    MIN_ARROW_FILE_BYTES,
    MISSING_WORDS,
    data_lines,
    is_comment,
    line_blocks,
    read_numbers,
    text_of,
)
from ._wall_clock import is_stamp, stamp_seconds

ENDINGS = (".csv", ".tsv", ".txt", ".dat")

MAX_HEADER_LINES = 40
"""The first row of numbers is searched among this many lines that are neither empty nor comments."""

MAX_SAMPLED_ROWS = 200
"""The first rows of a table, at most so many, tell its decimal mark."""

_NUMBER_WORDS = {"true": 1.0, "false": 0.0, "inf": np.inf, "-inf": -np.inf}
_CHANNEL_LINE = re.compile(r"Channel \d+: '([^']+)'(?:.*engineering units: ([^,]+),)?")
_LABELLED_FACT = re.compile(r"[\s#%!/\"]*([^:=;,\t\"]{1,60}?)\"?\s*(?::|=|;|,|\t)\s*\"?(.*?)[\s\";,]*")
_COMMA_NUMBER = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class _Layout:
    """What the first lines of a file tell about its table."""

    delimiter: str | None  # None: blanks
    skipped: int  # lines above the first row
    width: int  # fields of the first row
    decimal: str | None  # None if only all rows can tell it
    header: list[str] | None
    unit_texts: list[str] | None
    above: list[str]  # comments, and lines above the first row

    @property
    def is_last_named(self) -> bool:
        """Whether the last column has a name; one without may be a surplus delimiter."""
        return self.header is not None and len(self.header) == self.width and bool(self.header[-1])


def read(path: Path) -> Columns:
    """Return the columns of a text table, each shape (n,) float64; a column with text is a str that says which text.

    The header names the columns; without a header they are ``"0"``, ``"1"``, .... Lines that begin with ``#``, ``%``,
    ``//`` or ``!`` are comments. An empty field, ``NaN``, ``NA`` or ``null`` is a missing sample (NaN); ``true`` and
    ``false`` are 1 and 0. Stamps of a wall clock, such as ``2026-05-03 14:22:31.5`` or ``14:22:31.5``, become seconds
    since 1970 or since midnight. A row of units below the header gives the columns' `units`. Lines above it that have a
    label and a value are the file's `facts`; those that tell who was recorded are left out, and `personal` says which.
    An incomplete last row is left out, too. Columns may also be named on one line each, ``Channel 1: 'RF'``, as
    Biometrics' DataLOG does. Titles without a delimiter name no columns.
    """
    cut = cut_row(path)
    end = None if cut is None else cut.start
    with path.open("rb") as file:
        start = file.read(4096)
        if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
            text = path.read_bytes().decode("utf-16", errors="replace")
            return read_table(path, io.BytesIO(text.encode()))
        if b"\0" in start:
            raise RecordingError(f"{path.name}: found binary content, expected text")
        return read_table(path, file, end, arrow=path.stat().st_size >= MIN_ARROW_FILE_BYTES)


def read_table(
    path: Path, file: BinaryIO, end: int | None = None, delimiter: str | None = None, *, arrow: bool = False
) -> Columns:
    """Return the columns of the table in an open file up to its byte `end`; without a `delimiter`, it is found."""
    layout = _find_layout(path, line_blocks(file, end), delimiter)
    columns: Sequence[np.ndarray | _Cells] | None = _plain_columns(layout, file, end, arrow=arrow)
    if columns is None:
        columns = _cell_columns(path, layout, file, end)
    names = _names(path, layout.header, len(columns))
    values: dict[str, np.ndarray | str] = {}
    units = _units(names, layout.unit_texts)
    personal = find_personal_lines(layout.above)
    for name, column in zip(names, columns, strict=True):
        if isinstance(column, np.ndarray):
            values[name] = column
        elif (times := column.times()) is not None:
            values[name], units[name] = times, "s"
        elif column.text and column.decimal and (found := find_personal_columns([(name, column.text[1])])):
            personal += found
            values[name] = f"a column of text that tells who was recorded ({found[0].kind}), which is not shown"
        else:
            values[name] = column.numbers() if column.text is None else column.complaint()
    return Columns(path, values, units=units, facts=_facts(layout.above, names), personal=tuple(personal))


def _find_layout(path: Path, blocks: Iterator[bytes], delimiter: str | None) -> _Layout:
    """Return the layout of a table, from as many blocks as hold the lines that tell it."""
    comments: list[str] = []
    lines: list[tuple[int, str]] = []
    read = 0
    for block in blocks:
        texts = text_of(block).splitlines()
        found = data_lines(texts, read)
        if len(found) < len(texts):
            comments += filter(is_comment, texts)
        lines += found
        read += len(texts)
        if len(lines) >= MAX_HEADER_LINES:
            break
    if not lines:
        raise RecordingError(f"{path.name}: found no row of data")
    require_narrow_lines(path, (line for _, line in lines[:20]))
    delimiter = delimiter or _delimiter(_body([line for _, line in lines]))
    first = _first_row([_split(line, delimiter) for _, line in lines[:MAX_HEADER_LINES]])
    if first is None:
        raise RecordingError(f'{path.name}: found no row of numbers; the first line is "{lines[0][1][:60]}"')
    width = len(_split(lines[first][1], delimiter))
    header, unit_texts = _header(lines[:first], comments, delimiter, width)
    if header is None and (
        numbers := _numbered_names([_split(line, delimiter) for _, line in lines[first : first + 2]])
    ):
        header, first = numbers, first + 1
    return _Layout(
        delimiter,
        skipped=lines[first][0] - 1,
        width=len(_split(lines[first][1], delimiter)),
        decimal=_certain_mark([_split(line, delimiter) for _, line in lines[first : first + MAX_SAMPLED_ROWS]]),
        header=header,
        unit_texts=unit_texts,
        above=[*comments, *(line for _, line in lines[:first])],
    )


def _certain_mark(rows: list[list[str]]) -> str | None:
    """Return the decimal mark of the first rows of a table; None if only all of its rows can tell it."""
    texts = [text for fields in rows for text in fields]
    if not any("," in text for text in texts):
        return "."
    evidence = CommaEvidence()
    evidence.add(texts)
    if evidence.comma:
        return None if evidence.point else ","
    return None if "," in evidence.either else "."


def _plain_columns(layout: _Layout, file: BinaryIO, end: int | None, *, arrow: bool) -> list[np.ndarray] | None:
    """Return the columns of a table of plain numbers, shape (n,) each; None if it is not certain that it is one."""
    if layout.decimal is None:
        return None
    columns = read_numbers(
        file, end, layout.skipped, layout.width, layout.delimiter, decimal=layout.decimal, arrow=arrow
    )
    if columns is None:
        return None
    if layout.width > 1 and not layout.is_last_named and np.isnan(columns[-1]).all():
        return None  # perhaps only a surplus delimiter
    if layout.decimal == ".":
        return None if may_hold_thousands(columns) else columns
    return None if any(may_hold_thousands([x]) and has_whole_numbers(x) for x in columns) else columns


def _split_rows(layout: _Layout, file: BinaryIO, end: int | None) -> Iterator[tuple[list[int], list[list[str]]]]:
    """Yield the numbers of the lines of a table, and the fields of each, block by block."""
    before = 0
    for block in line_blocks(file, end):
        texts = text_of(block).splitlines()
        lines = [(number, line) for number, line in data_lines(texts, before) if number > layout.skipped]
        before += len(texts)
        yield [number for number, _ in lines], [_split(line, layout.delimiter) for _, line in lines]


@dataclass
class _Cells:
    """A column that is read field by field: its numbers, and what is known of its texts.

    Attributes
    ----------
    evidence : CommaEvidence
        What all fields tell of their commas and full stops.
    decimal : str or None
        Decimal mark of the column; None if its numbers have two readings.
    text : tuple of int and str, or None
        First field that is no number, after the number of its line.
    """

    evidence: CommaEvidence
    decimal: str | None
    text: tuple[int, str] | None = None
    _parts: list[np.ndarray] = field(default_factory=list)
    _stamps: dict[int, str] | None = field(default_factory=dict)  # by row; None once a text is no stamp
    _row_count: int = 0

    def add(self, lines: Sequence[int], fields: Sequence[str]) -> None:
        """Take more fields of the column, each of a line."""
        if self.decimal is None:
            doubtful = self.evidence.either or self.evidence.comma
            if self.text is None and doubtful in fields:
                self.text = lines[fields.index(doubtful)], two_readings(self.evidence)
            return
        numbers = plain_numbers(fields) if self.decimal == "." else None
        if numbers is None:
            number_by_text = {text: _marked_number(text, self.decimal) for text in set(fields)}
            numbers = np.array([number_by_text[text] for text in fields], dtype=np.float64)
            self._add_texts([(i, text) for i, text in enumerate(fields) if number_by_text[text] is None], lines)
        self._parts.append(numbers)
        self._row_count += len(fields)

    def _add_texts(self, texts: Sequence[tuple[int, str]], lines: Sequence[int]) -> None:
        """Take texts with their places in a block whose rows have the numbers `lines`."""
        for i, text in texts:
            self.text = self.text or (lines[i], text)
            if self._stamps is None or not is_stamp(text):
                self._stamps = None
                return
            self._stamps[self._row_count + i] = text

    def numbers(self) -> np.ndarray:
        """Return the column, shape (n,), NaN where it has no number."""
        return np.concatenate(self._parts)

    def times(self) -> np.ndarray | None:
        """Return the column's stamps of a wall clock in seconds, shape (n,); None if its texts are no stamps."""
        seconds = stamp_seconds(list(self._stamps.values())) if self._stamps else None
        if seconds is None or self._stamps is None:
            return None
        # An empty cell among the stamps stays a missing sample.
        times = self.numbers()
        times[list(self._stamps)] = seconds
        return times

    def complaint(self) -> str:
        """Return what is wrong with the column, for a message.

        Labels beside numbers are common; they matter only if a channel uses the column.
        """
        number, text = self.text or (0, "")
        if self.decimal is None:
            return f"line {number} {text}"
        return f'line {number} holds the text "{text}" where a number is expected'


def _cell_columns(path: Path, layout: _Layout, file: BinaryIO, end: int | None) -> list[_Cells]:
    """Return the columns of a table of any fields, which is gone through twice."""
    evidence = [CommaEvidence() for _ in range(layout.width)]
    lines_by_width: dict[int, int] = {}
    is_surplus = layout.width > 1 and not layout.is_last_named
    for numbers, rows in _split_rows(layout, file, end):
        for number, fields in zip(numbers, rows, strict=True):
            lines_by_width.setdefault(len(fields), number)
        is_surplus = is_surplus and not any(fields[-1] for fields in rows if len(fields) == layout.width)
        for each, column in zip(evidence, zip_longest(*rows, fillvalue=""), strict=False):
            each.add(column)
    width = layout.width - is_surplus
    wrong = [(number, found) for found, number in lines_by_width.items() if found not in (width, width + is_surplus)]
    if wrong:
        number, found = min(wrong)
        raise RecordingError(f"{path.name}: line {number} has {found} fields, expected {width}")
    marks = decimal_marks(evidence[:width])
    columns = [_Cells(each, mark) for each, mark in zip(evidence, marks, strict=False)]
    for numbers, rows in _split_rows(layout, file, end):
        for cells, column in zip(columns, zip_longest(*rows, fillvalue=""), strict=False):
            cells.add(numbers, column)
    return columns


def _units(names: list[str], texts: list[str] | None) -> dict[str | int, str]:
    """Return the units that a row below the header states, by column; one that is not known as it is written."""
    if texts is None:
        return {}
    return {name: unit_from_text(text) or text for name, text in zip(names, texts, strict=False) if text}


def _facts(lines: list[str], names: list[str]) -> dict[str, str]:
    """Return the values of the lines above a table by their labels, without what tells who was recorded."""
    facts: dict[str, str] = {}
    for line in lines:
        match = _LABELLED_FACT.fullmatch(searched_part(line))
        if match is None or not match[2] or find_personal_lines([line]):
            continue
        label = match[1].strip()
        if label and label not in names and len(match[2]) <= 200:
            facts.setdefault(label, match[2])
    return facts


def lost_end(path: Path) -> str:
    """Return the incomplete row at the end of a file whose writer was killed; "" for a whole file."""
    cut = cut_row(path)
    if cut is None:
        return ""
    return f'an incomplete last row, "{cut.text if len(cut.text) <= 40 else f"{cut.text[:37]}..."}"'


def _body(lines: list[str]) -> list[str]:
    """Return lines from the middle of a table; a long preamble has no delimiter."""
    start = max(0, len(lines) // 2 - 10) if len(lines) > 40 else 0
    return lines[start : start + 20]


def _delimiter(lines: list[str]) -> str | None:
    for delimiter in ("\t", ";", ","):
        # Titles above the header and an incomplete last line may lack the delimiter.
        divided = [line for line in lines if delimiter in line]
        if 2 * len(divided) > len(lines):
            fields = divided[-1].split()
            decimal = delimiter == "," and len(fields) > 1 and all(_COMMA_NUMBER.fullmatch(f) for f in fields)
            return None if decimal else delimiter
    return None


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    if '"' in line:
        # A quoted name may contain the delimiter.
        return [field.strip() for field in next(csv.reader([line.strip("\r\n ")], delimiter=delimiter))]
    return [field.strip() for field in line.strip("\r\n ").split(delimiter)]


def _number(text: str) -> float | None:
    """Return a number that a field may be, NaN for a missing one; None if it is a word with any decimal mark."""
    return next((x for mark in ".," if (x := _marked_number(text, mark)) is not None), None)


def _is_data(fields: list[str]) -> bool:
    numbers = [_number(f) for f in fields]
    return any(n is not None and not np.isnan(n) for n in numbers)


def _first_row(lines: list[list[str]]) -> int | None:
    """Return the index of the table's first row among lines split into fields; None if there is no table.

    Settings above the table, each a name and a value, do not belong to it. They are followed by a line of names and by
    rows of another width.
    """
    first = next((i for i, fields in enumerate(lines) if _is_data(fields)), None)
    if first is None:
        return None
    widths = {len(fields) for fields in lines[first:] if _is_data(fields)}
    for i in range(first + 1, len(lines) - 1 if len(widths) > 1 else 0):
        names, below = lines[i], lines[i + 1]
        named = len(names) > 1 and all(name and _number(name) is None for name in names)
        if named and len(below) == len(names) and _is_data(below):
            return first if any(len(fields) == len(names) for fields in lines[first:i]) else i + 1
    return first


def _header(
    above: list[tuple[int, str]], comments: list[str], delimiter: str | None, width: int
) -> tuple[list[str] | None, list[str] | None]:
    """Return the names of the columns and the texts of their units; None for what no line gives.

    Titles and settings may stand above the header. The header is the first line with a name for every column, or the
    line above a row of units.
    """
    split = [_split(line, delimiter) for _, line in above]
    whole = [fields for fields in split if len(fields) == width or (len(fields) == width + 1 and not fields[-1])]
    for names, units in pairwise(whole):
        if width > 1 and is_unit_row(units) and not is_unit_row(names):
            return names, units
    for fields in whole:
        return fields, None
    listed = [match for _, line in above if (match := _CHANNEL_LINE.match(line))]
    if len(listed) == width:
        return [match[1] for match in listed], [match[2] or "" for match in listed]
    if delimiter is not None and above and all(delimiter not in line for _, line in above):
        return None, None
    if above and not _is_prose(above, split, width):
        return split[0], None
    for line in reversed(comments):
        fields = _split(line.lstrip().lstrip("#%!/ "), delimiter)
        if width > 1 and len(fields) == width and not any(" " in f.strip() and "[" not in f for f in fields):
            return fields, None
    return None, None


def _numbered_names(rows: list[list[str]]) -> list[str] | None:
    """Return the names of columns that a first row of numbers gives: 0, 1, 2, ..., perhaps after an unnamed index.

    None if the first row is one of samples, which are no consecutive whole numbers as the next row would be, too.
    """
    if len(rows) < 2 or len(rows[0]) < 3:
        return None
    fields, below = rows
    named = fields[1:] if not fields[0] else fields
    for begin in (0, 1):
        wanted = [str(begin + i) for i in range(len(named))]
        if named == wanted and below[len(fields) - len(named) :] != wanted:
            return ["index", *named] if not fields[0] else fields
    return None


def _is_prose(above: list[tuple[int, str]], split: list[list[str]], width: int) -> bool:
    """Whether the lines above a table of one or two columns are sentences or settings, which name no columns."""
    return len(split[0]) != width and any(re.search(r"[A-Za-z]{2,}\s*[:=]|[.!?]\s*$", line) for _, line in above[:1])


def _names(path: Path, header: list[str] | None, width: int) -> list[str]:
    require_few_columns(path, width)
    if header is None:
        return [str(i) for i in range(width)]
    require_few_columns(path, len(header))
    names = [name if name else str(i) for i, name in enumerate(header)]
    while len(names) > width and not header[len(names) - 1]:
        names.pop()
    if len(names) != width:
        raise RecordingError(f"{path.name}: the header names {len(names)} columns, the rows hold {width}")
    repeated = {name for name in names if names.count(name) > 1}
    return [f"{name}.{i}" if name in repeated else name for i, name in enumerate(names)]


def _marked_number(text: str, decimal: str) -> float | None:
    """Return the number of a field with the decimal mark of its column, NaN for a missing one; None if it is a word."""
    folded = text.strip().casefold()
    if folded in MISSING_WORDS:
        return float("nan")
    return _NUMBER_WORDS[folded] if folded in _NUMBER_WORDS else read_number(folded, decimal)
