"""Read text tables: comma, semicolon, tab or blanks between columns, any or no header, decimal point or comma.

A column is named by its header, without its unit, or numbered from 0. With groups above the names it is GROUP.NAME. If
each row is about one joint, motor or signal, a column is ``position.knee``. Lists in cells are numbered, or named by
another list.

The first lines show the layout. A table of plain numbers is then read in blocks by a library (`_number_blocks.py`), any
other field by field. Both go through the file in blocks, so that a file of any size needs little memory in addition
to its numbers.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..._errors import RecordingError
from ..name_evidence import read_name
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
from ._labelled_rows import plain_table, table_without_units
from ._last_row import cut_row
from ._lost_rows import LostRows, RowWidths
from ._number_blocks import (
    COMMENT_MARKS,
    MISSING_WORDS,
    data_lines,
    is_comment,
    line_blocks,
    read_numbers,
    text_of,
)
from ._row_streams import MAX_LABELS, ListCell, Words, parse_list, split_streams
from ._spike2_text import CHANNEL_LINE, waveform_table
from ._table_header import INDEX_NAME, TableHeader, counted_units, find_header, folded_key, stated_rate
from ._wall_clock import is_stamp, stamp_seconds

ENDINGS = (".csv", ".tsv", ".txt", ".dat", ".log", ".asc")

MAX_HEADER_LINES = 200
"""The first row of numbers is searched among this many lines that are neither empty nor comments."""

MAX_NUL_SHARE = 0.05
"""Text holds at most this share of NUL bytes in its beginning, as a logger leaves them that lost its power."""

MIN_ROW_SHARE = 0.2
"""At least this share of the first rows has as many fields as the table has columns."""

MAX_SAMPLED_ROWS = 200
"""The first rows of a table, at most so many, tell its decimal mark."""

LABELLED_SAMPLE_BYTES = 65_536
"""So much of a file tells whether its rows repeat labels."""

COMMON_UNIT_KEYS = frozenset({"measureunit", "measurementunit", "unitofmeasure", "unitofmeasurement", "signalunit"})
"""Keys, folded, of the line that states one unit of all signals."""

COLUMN_KEYS = ("column", "columns", "columnnames", "channels", "channelnames", "labels", "names")
"""Keys, folded, under which a description in JSON lists a name for each column."""

MIN_TABLE_LINES = 3
"""Fewest lines of such a table, with its header."""

MAX_REPEATED_TABLES = 1000
"""Most tables that one file holds below each other."""

_CLOCK_UNITS = {
    "min": "min", "minutes": "min", "sec": "s", "seconds": "s", "s": "s", "msec": "ms", "ms": "ms", "us": "us",
    "hours": "h",
}  # fmt: skip
"""Units of time by the name of a first column that is nothing but a unit."""

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_STATED_STEP = re.compile(r"\s*([\d.,]+)\s*([^\W\d]+)\s*")
_NUMBER_WORDS = {"true": 1.0, "false": 0.0, "inf": np.inf, "-inf": -np.inf}
_FACT_IN_COMMENT = re.compile(r"\s*(?:[#%!]|//)[\s#%!/]*([A-Za-z][A-Za-z _-]{1,60}?)\s+(\d.*?)[\s;,]*")
"""A label and its number without a mark between them, as in "# torque constant 0.12 Nm/A"."""

_LABELLED_FACT = re.compile(r"[\s#%!/\"]*([^:=;,\t\"]{1,60}?)\"?\s*(?::|=|;|,|\t)\s*\"?(.*?)[\s\";,]*")
_QUOTED_OR_PLAIN = re.compile(r'"[^"]*"|\S+')
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
    above: list[str]  # comments, and lines above the first row that state no names and units
    paired: bool = False  # whether each channel has a column of its own times before it
    facts: dict[str, str] = field(default_factory=dict)  # what lines without a label state

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
    label and a value are the file's `facts`; those that identify the recorded person are excluded, and `personal` lists
    them. An incomplete last row is excluded, too. Columns may also be named on one line each, ``Channel 1: 'RF'``, as
    Biometrics' DataLOG does. Titles without a delimiter name no columns.
    """
    cut = cut_row(path)
    end = None if cut is None else cut.start
    with path.open("rb") as file:
        start = file.read(4096)
        if (encoding := _wide_encoding(start)) is not None:
            text = path.read_bytes().decode(encoding, errors="replace")
            return _whole_or_parts(path, io.BytesIO(text.encode()), None)
        if start.count(b"\0") > MAX_NUL_SHARE * len(start):
            raise RecordingError(f"{path.name}: found binary content, expected text")
        file.seek(0)
        return _whole_or_parts(path, file, end)


def _whole_or_parts(path: Path, file: BinaryIO, end: int | None) -> Columns:
    """Return the columns of one table, or of the recordings that a file holds below each other under one header."""
    start = file.read(LABELLED_SAMPLE_BYTES)
    file.seek(0)
    whole = -1 if end is None else end
    if plain_table(start) is not None:
        plain = plain_table(file.read(whole))
        return read_table(path, io.BytesIO(start if plain is None else plain))
    rewrites = {
        table_without_units: table_without_units(start[: start.rfind(b"\n") + 1]) is not None,
        waveform_table: CHANNEL_LINE.encode() in start,
    }
    for rewrite in (each for each, is_likely in rewrites.items() if is_likely):
        plain = rewrite(file.read(whole))
        if plain is not None:
            return read_table(path, io.BytesIO(plain))
        file.seek(0)
    found = read_table(path, file, end)
    if not found.values or any(isinstance(x, np.ndarray) for x in found.values.values()):
        return found
    file.seek(0)
    parts = _repeated_tables(file.read(whole))
    if not parts:
        return found
    made: dict[str, np.ndarray | str] = {}
    units: dict[str | int, str] = {}
    for key, text in parts.items():
        part = read_table(path, io.BytesIO(text))
        made |= {f"{key}.{name}": x for name, x in part.values.items()}
        units |= {f"{key}.{name}": unit for name, unit in part.units.items()}
    return replace(found, values=made, units=units, recordings=tuple(parts))


def _repeated_tables(content: bytes) -> dict[str, bytes]:
    """Return the text of each table of a file in which one header stands again above each, by a name; {} without any.

    A line above a header that is none of numbers names the table; without one it is a part with its number.
    """
    lines = content.splitlines()
    places: dict[bytes, list[int]] = {line: [] for line in lines[:MAX_SAMPLED_ROWS] if re.search(rb"[A-Za-z]", line)}
    for i, line in enumerate(lines):
        if line in places:
            places[line].append(i)
    heads: list[int] = []
    for line, again in places.items():
        # Below a header there are rows.
        is_apart = len(again) > 1 and min(b - a for a, b in pairwise(again)) > MIN_TABLE_LINES
        if is_apart and _first_row([_split(line.decode(errors="replace"), None)]) is None:
            heads = again
            break
    if not heads or len(heads) > MAX_REPEATED_TABLES:
        return {}
    parts: dict[str, bytes] = {}
    for number, (head, after) in enumerate(zip(heads, [*heads[1:], len(lines)], strict=True), 1):
        rows = lines[head:after]
        title = lines[head - 1].decode(errors="replace").strip(" #%;,\t\"") if head else ""
        is_title = bool(re.fullmatch(r"[^\W\d][\w .-]{0,40}", title))
        name = re.sub(r"\W+", "_", title).casefold() if is_title else f"part_{number}"
        if after < len(lines):
            # The next table's title and blank lines stand at the end.
            while rows and not re.match(rb"[\s\"]*[-+.\d]", rows[-1]):
                rows.pop()
        parts[name if name not in parts else f"{name}_{number}"] = b"\n".join(rows) + b"\n"
    return parts


def read_table(path: Path, file: BinaryIO, end: int | None = None, delimiter: str | None = None) -> Columns:
    """Return the columns of the table in an open file up to its byte `end`; without a `delimiter`, it is found."""
    layout = _find_layout(path, line_blocks(file, end), delimiter)
    columns: Sequence[np.ndarray | _Cells] | None = _plain_columns(layout, file, end)
    lost = LostRows()
    if columns is None:
        columns = _cell_columns(path, layout, file, end, lost)
    if layout.paired:
        return _paired_columns(path, layout, columns, lost)
    columns, layout = _without_empty_first(columns, layout)
    names = _names(path, layout.header, len(columns))
    values: dict[str, np.ndarray | str] = {}
    units = _units(names, layout.unit_texts)
    personal = find_personal_lines(layout.above)
    words: dict[str, Words] = {}
    lists: dict[str, list[ListCell | None]] = {}
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
            if (own_words := column.words()) is not None:
                words[name] = own_words
            if (own_lists := column.lists()) is not None:
                lists[name] = own_lists
    facts = _facts(layout.above, names) | layout.facts
    values, units = _without_count_row(values, units, layout.header)
    if words or lists or len(values) > 2:
        values, units = split_streams(path, values, units, words, lists)
    values, units = _with_named_time(values, units, facts)
    units = _with_common_unit(values, units, facts)
    return Columns(path, values, units=units, facts=facts, personal=tuple(personal), damaged=lost.text)


def _without_empty_first(
    columns: Sequence[np.ndarray | _Cells], layout: _Layout
) -> tuple[Sequence[np.ndarray | _Cells], _Layout]:
    """Return a table without a first column that has neither a name nor a sample, only a word in the rows above."""
    if layout.header is None or layout.header[0] or len(columns) < 3:
        return columns, layout
    first = columns[0] if isinstance(columns[0], np.ndarray) else columns[0].numbers()
    if not np.isnan(first).all() or (not isinstance(columns[0], np.ndarray) and columns[0].text is not None):
        return columns, layout
    units = None if layout.unit_texts is None else layout.unit_texts[1:]
    return columns[1:], replace(layout, header=layout.header[1:], unit_texts=units)


def _wide_encoding(start: bytes) -> str | None:
    """Return the encoding of text with two bytes a letter, by its first bytes; None for other text."""
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    even, odd = start[0::2], start[1::2]
    if len(start) < 16 or b"\0" not in start:
        return None
    if odd.count(0) > 0.9 * len(odd) and 0 not in even:
        return "utf-16-le"
    return "utf-16-be" if even.count(0) > 0.9 * len(even) and 0 not in odd else None


def _paired_columns(path: Path, layout: _Layout, columns: Sequence[np.ndarray | _Cells], lost: LostRows) -> Columns:
    """Return the columns of a table whose channels each have times of their own before them.

    Channels that share their times share one column, ``time``; others have NAME.time.
    """
    numbers = [x if isinstance(x, np.ndarray) else x.numbers() if x.text is None else x.complaint() for x in columns]
    names, texts = layout.header or [], layout.unit_texts or []
    channels: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    values: dict[str, np.ndarray | str] = {}
    for name, time, x in zip(names[::2], numbers[::2], numbers[1::2], strict=True):
        if isinstance(time, str) or isinstance(x, str):
            values[name] = x if isinstance(x, str) else str(time)
            continue
        # A slower channel ends in empty cells.
        n = int(np.flatnonzero(np.isfinite(time))[-1]) + 1 if np.isfinite(time).any() else 0
        channels[name] = time[:n], x[:n]
    clocks = list({time.tobytes(): time for time, _ in channels.values()}.values())
    units = dict[str | int, str]()
    clock_unit = unit_from_text(texts[0]) if texts else None
    if len(clocks) == 1:
        values["time"] = clocks[0]
    for name, (time, x) in channels.items():
        if len(clocks) > 1:
            values[f"{name}.time"] = time
        values[name] = x
    if clock_unit:
        units |= {name: clock_unit for name in values if name == "time" or name.endswith(".time")}
    for name, text in zip(names[::2], texts[1::2], strict=False):
        if text and name in values:
            units[name] = unit_from_text(text) or text
    facts = _facts(layout.above, list(values)) | layout.facts
    return Columns(
        path, values, units=units, facts=facts, personal=tuple(find_personal_lines(layout.above)), damaged=lost.text
    )


def _without_count_row(
    values: dict[str, np.ndarray | str], units: dict[str | int, str], header: list[str] | None
) -> tuple[dict[str, np.ndarray | str], dict[str | int, str]]:
    """Return a table without a first row that counts the samples of each column but the first, as AcqKnowledge does."""
    arrays = [x for x in values.values() if not isinstance(x, str)]
    if header is None or len(arrays) < 2 or len(arrays) < len(values) or len(arrays[0]) < 3:
        return values, units
    first, others = arrays[0], arrays[1:]
    if not np.isnan(first[0]):
        return values, units
    counts = [int(np.isfinite(x[1:]).sum()) for x in others]
    if all(x[0] in (n, len(x) - 1) for x, n in zip(others, counts, strict=True)):
        return {name: x[1:] for name, x in values.items()}, units
    return values, units


def _with_common_unit(
    values: Mapping[str, np.ndarray | str], units: dict[str | int, str], facts: Mapping[str, str]
) -> dict[str | int, str]:
    """Return units with the one that a line above the table states of all its signals, as BTS's ``Measure unit: V``.

    Numbers of rows and times have no such unit, and no column does where a signal states its own.
    """
    stated = next((unit_from_text(text) for key, text in facts.items() if folded_key(key) in COMMON_UNIT_KEYS), None)
    first = next(iter(values), None)
    if stated is None or any(unit_from_text(text) for name, text in units.items() if name != first):
        return units
    common: dict[str | int, str] = {
        name: stated
        for name, x in values.items()
        if not isinstance(x, str) and name not in units and not (len(x) > 2 and np.all(np.diff(x) > 0.0))
    }
    return {**units, **common}


def _with_named_time(
    values: dict[str, np.ndarray | str], units: dict[str | int, str], facts: dict[str, str]
) -> tuple[dict[str, np.ndarray | str], dict[str | int, str]]:
    """Return a table whose first column, if it is the time, says so by its name or unit.

    A name such as ``min`` is that of a unit. A column without a name that rises is the time if a line above states its
    step.
    """
    first = next(iter(values), None)
    if first is None or isinstance(x := values[first], str) or len(x) < 3 or not np.all(np.diff(x) > 0.0):
        return values, units
    if first not in units and first in _CLOCK_UNITS:
        return values, units | {first: _CLOCK_UNITS[first]}
    if first != "0" or len(values) < 2 or all(str(i) == name for i, name in enumerate(values)):
        return values, units
    if np.all(np.diff(x) == 1.0) and any(read_name(name).quantity == "time" for name in list(values)[1:]):
        # A table library writes the number of each row before its columns.
        return {INDEX_NAME if name == first else name: column for name, column in values.items()}, units
    step = float(np.median(np.diff(x)))
    units = {"time" if name == first else name: unit for name, unit in units.items()}
    for label, text in facts.items():
        match = _STATED_STEP.fullmatch(text)
        if match is not None and "time" not in units and re.search("interval|period|step|sampl", label, re.IGNORECASE):
            stated, unit = float(match[1].replace(",", ".")), unit_from_text(match[2])
            if stated > 0.0 and unit in ("s", "ms", "us", "min") and abs(step / stated - 1.0) < 1e-3:
                units["time"] = unit
            elif stated > 0.0 and unit in _SECONDS and abs(step / (stated * _SECONDS[unit]) - 1.0) < 1e-3:
                units["time"] = "s"
    return {"time" if name == first else name: column for name, column in values.items()}, units


def _find_layout(path: Path, blocks: Iterator[bytes], delimiter: str | None) -> _Layout:
    """Return the layout of a table, from as many blocks as hold the lines that tell it."""
    comments: list[str] = []
    lines: list[tuple[int, str]] = []
    body: list[str] = []
    read = 0
    for block in blocks:
        texts, body = _telling_lines(text_of(block))
        found = data_lines(texts, read)
        if len(found) < len(texts):
            units = counted_units(texts) if read == 0 else {}
            comments += [line for i, line in enumerate(texts) if i not in units and is_comment(line)]
            found = sorted({*found, *((i + 1, text) for i, text in units.items())})
        lines += found
        read += len(texts)
        if len(lines) >= MAX_HEADER_LINES:
            break
    if not lines:
        raise RecordingError(f"{path.name}: found no row of data, expected rows of numbers below a header")
    require_narrow_lines(path, (line for _, line in lines[:20]))
    delimiter = delimiter or _delimiter(body or [line for _, line in _body(lines)])
    split = [_split(line, delimiter) for _, line in lines[: MAX_HEADER_LINES + MAX_SAMPLED_ROWS]]
    first = _first_row(split[:MAX_HEADER_LINES])
    if first is None:
        raise RecordingError(f'{path.name}: found no row of numbers; the first line is "{lines[0][1][:60]}"')
    header = _header(lines[:first], split[:first], comments, split[first:MAX_HEADER_LINES], delimiter)
    names = header.names or (_joint_state_names(split[first:]) if not comments and first == 0 else None)
    if names is None and (numbers := _numbered_names(split[first : first + 2])):
        names, first = numbers, first + 1
    above = [line for i, (_, line) in enumerate(lines[:first]) if i not in header.used]
    return _Layout(
        delimiter,
        skipped=lines[first][0] - 1,
        width=len(split[first]),
        decimal=_certain_mark(split[first : first + MAX_SAMPLED_ROWS]),
        header=names,
        unit_texts=header.units,
        above=[*comments, *above],
        paired=header.paired,
        facts=stated_rate([*comments, *above]) | _impersonal(header.facts),
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


def _plain_columns(layout: _Layout, file: BinaryIO, end: int | None) -> list[np.ndarray] | None:
    """Return the columns of a table of plain numbers, shape (n,) each; None if it is not certain that it is one."""
    if layout.decimal is None:
        return None
    columns = read_numbers(file, end, layout.skipped, layout.width, layout.delimiter, layout.decimal)
    if columns is None:
        return None
    if layout.width > 1 and not layout.is_last_named and np.isnan(columns[-1]).all():
        return None  # perhaps only a surplus delimiter
    if layout.decimal == ".":
        return None if may_hold_thousands(columns) else columns
    return None if any(may_hold_thousands([x]) and has_whole_numbers(x) for x in columns) else columns


def _split_rows(layout: _Layout, file: BinaryIO, end: int | None) -> Iterator[tuple[list[int], list[list[str]], bool]]:
    """Yield the numbers of the lines of a table, the fields of each, and whether a NUL byte is there, by blocks."""
    before = 0
    for block in line_blocks(file, end):
        texts = text_of(block).splitlines()
        lines = [(number, line) for number, line in data_lines(texts, before) if number > layout.skipped]
        before += len(texts)
        fields = [_split(line, layout.delimiter) for _, line in lines]
        yield [number for number, _ in lines], fields, b"\0" in block


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
    _lists: dict[int, ListCell] | None = field(default_factory=dict)  # by row; None once a text is no list
    _words: dict[str, int] | None = field(default_factory=dict)  # numbers of words; None once there are too many
    _codes: list[np.ndarray] = field(default_factory=list)
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
            self._add_words(fields, number_by_text)
        elif self._words is not None:
            self._codes.append(np.full(len(fields), -1, dtype=np.int8))
        self._parts.append(numbers)
        self._row_count += len(fields)

    def _add_texts(self, texts: Sequence[tuple[int, str]], lines: Sequence[int]) -> None:
        """Take texts with their places in a block whose rows have the numbers `lines`."""
        for i, text in texts:
            self.text = self.text or (lines[i], text)
            if self._stamps is not None and is_stamp(text):
                self._stamps[self._row_count + i] = text
                continue
            self._stamps = None
            if self._lists is None or (cell := parse_list(text)) is None:
                self._lists = None
                return
            self._lists[self._row_count + i] = cell

    def _add_words(self, fields: Sequence[str], number_by_text: dict[str, float | None]) -> None:
        """Take fields some of which are words, as long as few different ones are known."""
        if self._words is None:
            return
        for text in dict.fromkeys(fields):
            if number_by_text[text] is None:
                self._words.setdefault(text, len(self._words))
        if len(self._words) > MAX_LABELS:
            self._words, self._codes = None, []
            return
        self._codes.append(np.array([self._words.get(text, -1) for text in fields], dtype=np.int8))

    def words(self) -> Words | None:
        """Return the column's words; None if it has none, or too many."""
        return Words(np.concatenate(self._codes), tuple(self._words)) if self._words else None

    def lists(self) -> list[ListCell | None] | None:
        """Return the lists in the column's cells; None if its texts are no lists."""
        return [self._lists.get(i) for i in range(self._row_count)] if self._lists else None

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
        """Return the fault of the column, for a message.

        Columns of labels are common; they matter only if a channel uses them.
        """
        number, text = self.text or (0, "")
        if self.decimal is None:
            return f"line {number} {text}"
        return f'line {number} holds the text "{text}" where a number is expected'


def _cell_columns(path: Path, layout: _Layout, file: BinaryIO, end: int | None, lost: LostRows) -> list[_Cells]:
    """Return the columns of a table of any fields, which is gone through twice; rows of another width go to `lost`."""
    evidence = [CommaEvidence() for _ in range(layout.width)]
    widths = RowWidths()
    is_surplus = layout.width > 1 and not layout.is_last_named
    for numbers, rows, has_nul in _split_rows(layout, file, end):
        widths.add(numbers, rows, may_hold_nul=has_nul)
        rows = [fields for fields in rows if len(fields) in (layout.width, layout.width - 1)]
        is_surplus = is_surplus and not any(fields[-1] for fields in rows if len(fields) == layout.width)
        for each, column in zip(evidence, zip_longest(*rows, fillvalue=""), strict=False):
            each.add(column)
    width = layout.width - is_surplus
    accepted = widths.accepted(path, width, lost, may_be_longer=is_surplus)
    marks = decimal_marks(evidence[:width])
    columns = [_Cells(each, mark) for each, mark in zip(evidence, marks, strict=False)]
    for numbers, rows, _ in _split_rows(layout, file, end):
        if accepted is not None:
            kept = [i for i, fields in enumerate(rows) if accepted(fields)]
            numbers, rows = [numbers[i] for i in kept], [rows[i] for i in kept]
        table = list(zip_longest(*rows, fillvalue=""))[:width]
        # Rows that end early leave out the cells of the last columns.
        table += [("",) * len(rows)] * (width - len(table))
        for cells, column in zip(columns, table, strict=True):
            cells.add(numbers, column)
    return columns


def _units(names: list[str], texts: list[str] | None) -> dict[str | int, str]:
    """Return the units that a row below the header states, by column; one that is not known as it is written."""
    if texts is None:
        return {}
    return {name: unit_from_text(text) or text for name, text in zip(names, texts, strict=False) if text}


def _labelled_parts(line: str) -> list[str]:
    """Return the parts of a comment with several labelled values, as "# gear: 9, kt: 0.09 Nm/A"; else the line."""
    parts = re.split(r"[,;]\s+", line)
    if not is_comment(line) or sum(bool(re.search(r"[A-Za-z]\w{0,40}\s{0,8}[:=]\s*\S", part)) for part in parts) < 2:
        return [line]
    return [f"# {part.lstrip('#%!/ ')}" for part in parts]


def _facts(lines: list[str], names: list[str]) -> dict[str, str]:
    """Return the values of the lines above a table by their labels, without what tells who was recorded."""
    facts: dict[str, str] = {}
    for line in (part for whole in lines for part in _labelled_parts(whole)):
        searched = searched_part(line)
        match = _FACT_IN_COMMENT.fullmatch(searched) or _LABELLED_FACT.fullmatch(searched)
        if match is None or not match[2] or find_personal_lines([line]):
            continue
        label = match[1].strip()
        if label and label not in names and len(match[2]) <= 200:
            facts.setdefault(label, match[2])
    return facts


def _impersonal(facts: Mapping[str, str]) -> dict[str, str]:
    """Return facts without those that tell who was recorded."""
    return {key: text for key, text in facts.items() if not find_personal_lines([f"{key}: {text}"])}


def lost_end(path: Path) -> str:
    """Return the incomplete row at the end of a file whose writer was killed; "" for a whole file."""
    cut = cut_row(path)
    if cut is None:
        return ""
    return f'an incomplete last row, "{cut.text if len(cut.text) <= 40 else f"{cut.text[:37]}..."}"'


def _telling_lines(text: str) -> tuple[list[str], list[str]]:
    """Return the lines of a block that can tell the layout, and some of its middle; all and none of a short block."""
    begin, rest = text[:LABELLED_SAMPLE_BYTES], text[LABELLED_SAMPLE_BYTES:]
    first = begin.splitlines()[:-1]
    if any(mark[0] in rest for mark in COMMENT_MARKS) or len(data_lines(first)) < MAX_HEADER_LINES + MAX_SAMPLED_ROWS:
        return text.splitlines(), []
    return first, rest[len(rest) // 2 :][:LABELLED_SAMPLE_BYTES].splitlines()[1:21]


def _body(lines: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Return numbered lines from the middle of a table; a long preamble has no delimiter."""
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
        return [text.strip('"') for text in _QUOTED_OR_PLAIN.findall(line)] if '"' in line else line.split()
    if '"' in line:
        # A quoted name may contain the delimiter.
        return [field.strip() for field in next(csv.reader([line.strip("\r\n ")], delimiter=delimiter))]
    return [field.strip() for field in line.strip("\r\n ").split(delimiter)]


def _number(text: str) -> float | None:
    """Return a number that a field may be, NaN for a missing one; None if it is a word with any decimal mark."""
    try:
        return float(text)  # as below, for the many fields that are plain numbers
    except ValueError:
        return next((x for mark in ".," if (x := _marked_number(text, mark)) is not None), None)


def _is_data(fields: list[str]) -> bool:
    return any((n := _number(f)) is not None and not math.isnan(n) for f in fields)


def _first_row(lines: list[list[str]]) -> int | None:
    """Return the index of the table's first row among lines split into fields; None if there is no table.

    Settings above the table, each a name and a value, do not belong to it: they have another width than most rows, or
    fewer numbers, or are followed by a line of names.
    """
    data = [i for i, fields in enumerate(lines) if _is_data(fields)]
    if not data:
        return None
    counted = Counter(len(lines[i]) for i in data)
    # Columns of slower signals may end early, so that the widest rows are the table's, if they are no exceptions.
    width = max(found for found in counted if counted[found] >= MIN_ROW_SHARE * len(data))
    alike = [i for i in data if len(lines[i]) == width]
    counts = sorted(_count_numbers(lines[i]) for i in alike[len(alike) // 2 :])
    usual = counts[len(counts) // 10]
    first = next(i for i in data if len(lines[i]) == width and _count_numbers(lines[i]) >= usual)
    # The first rows may hold a word where others hold nothing.
    while first > 0 and len(lines[first - 1]) == width and 2 * _count_numbers(lines[first - 1]) >= usual:
        if not _is_data(lines[first - 1][:1]):
            break
        first -= 1
    widths = {len(fields) for fields in lines[first:] if _is_data(fields)}
    for i in range(first + 1, len(lines) - 1 if len(widths) > 1 else 0):
        names, below = lines[i], lines[i + 1]
        named = len(names) > 1 and all(name and _number(name) is None for name in names)
        if named and len(below) == len(names) and _is_data(below):
            return first if any(len(fields) == len(names) for fields in lines[first:i]) else i + 1
    return first


def _joint_state_names(rows: list[list[str]]) -> list[str] | None:
    """Return the names of the columns of ROS 2 joint states as ``ros2 topic echo --csv`` writes them, without a header.

    A row has the stamp's seconds and nanoseconds, the frame, the names of all joints, and then the numbers of each
    field in turn: positions, velocities, efforts. An empty field has no numbers. None for any other table.
    """
    fields = rows[0]
    count = next((i for i, text in enumerate(fields[3:]) if not text or _number(text) is not None), 0)
    names, numbers = fields[3 : 3 + count], fields[3 + count :]
    is_stamp = len(fields) > 4 and fields[0].isdigit() and fields[1].isdigit() and not fields[2].isdigit()
    if not is_stamp or not count or len(numbers) % count or len(numbers) // count > 3 or len(set(names)) < count:
        return None
    if any(row[3 : 3 + count] != names or len(row) != len(fields) for row in rows[:20]):
        return None
    quantities = ("position", "velocity", "effort")[: len(numbers) // count]
    return [
        "header.stamp.sec", "header.stamp.nanosec", "header.frame_id", *(f"name{i}" for i in range(count)),
        *(f"{quantity}{i}" for quantity in quantities for i in range(count)),
    ]  # fmt: skip


def _count_numbers(fields: list[str]) -> int:
    """Return how many fields are numbers, or missing ones."""
    return sum(_number(text) is not None for text in fields)


def _header(
    above: list[tuple[int, str]],
    split: list[list[str]],
    comments: list[str],
    body: list[list[str]],
    delimiter: str | None,
) -> TableHeader:
    """Return what the lines above a table and its comments state of its columns' names and units."""
    width = len(body[0])
    is_last_empty = width > 1 and all(not fields[-1] for fields in body if len(fields) == width)
    found = find_header([line for _, line in above], split, body, width, is_last_empty=is_last_empty)
    if found is not None:
        return found
    if delimiter is None and len(above) > 1 and (stacked := _spaced_units(above[-2][1], above[-1][1], width)):
        return TableHeader(*stacked, frozenset({len(above) - 2, len(above) - 1}))
    if delimiter is None and above and (spaced := _spaced_names(above[-1][1], width)):
        return TableHeader(spaced, None, frozenset({len(above) - 1}))
    has_names = above and not (delimiter is not None and all(delimiter not in line for _, line in above))
    if has_names and not _is_prose(above, split, width):
        return TableHeader(split[0], None, frozenset({0}))
    if (described := _described_columns(comments, width, is_last_empty)) is not None:
        return described
    if has_names or not above:
        for line in reversed(comments):
            bare = line.lstrip().lstrip("#%!/ ")
            for mark in (*([delimiter] if delimiter else []), ",", "\t", ";", None):
                fields = _split(bare, mark)
                if width > 1 and len(fields) == width and not any(map(_is_phrase, fields)):
                    comments.remove(line)
                    return TableHeader(fields)
    return TableHeader()


def _sensor_name(sensor: str, label: str) -> str:
    """Return a channel's label with the kind of its sensor before it, where the label does not contain it."""
    return label if sensor.casefold() in label.casefold() or sensor.casefold() in ("", "raw") else f"{sensor} {label}"


def _described_columns(comments: list[str], width: int, is_last_empty: bool) -> TableHeader | None:
    """Return the header that a comment in JSON states, as OpenSignals writes it; None without one.

    It lists a name for each column, units and sensors for the last ones, and settings such as the sampling rate. The
    rows may end with a surplus delimiter.
    """
    for line in comments:
        bare = line.lstrip().lstrip("#%!/ ")
        if not bare.startswith("{"):
            continue
        try:
            said = json.loads(bare)
        except ValueError:
            continue
        while len(said) == 1 and isinstance(inner := next(iter(said.values())), dict):
            said = inner
        lists = {folded_key(key): [str(x) for x in value] for key, value in said.items() if isinstance(value, list)}
        fits = {width, width - is_last_empty}
        names = next((value for key, value in lists.items() if key in COLUMN_KEYS and len(value) in fits), None)
        if names is None:
            continue
        own = len(names)
        units = next((value for key, value in lists.items() if key in ("unit", "units") and len(value) <= own), None)
        sensors = lists.get("sensor", [])
        if len(sensors) < own:
            # The last columns are the sensors'; a label such as A1 says nothing of what one of them measures.
            names = [*names[: own - len(sensors)], *map(_sensor_name, sensors, names[own - len(sensors) :])]
        facts = {key: str(value) for key, value in said.items() if isinstance(value, (int, float, str))}
        comments.remove(line)
        surplus = [""] * (width - own)
        texts = units and [*[""] * (own - len(units)), *units, *surplus]
        return TableHeader([*names, *surplus], texts, facts=facts)
    return None


def _is_phrase(field: str) -> bool:
    """Whether a field of a comment has several words that are no name with its unit."""
    return " " in re.sub(r"\s*[\[({][^\[\](){}]*[\])}]", "", field.strip())


def _spaced_units(line: str, below: str, width: int) -> tuple[list[str], list[str]] | None:
    """Return names between blanks and the units in the line below them; None without.

    The first column may have no unit there, as its name says it: mSec.
    """
    names, units = _spaced_names(line, width), re.split(r"\s{2,}|\t", below.strip())
    if names is None or len(units) not in (width, width - 1) or not is_unit_row(units):
        return None
    return names, [""] * (width - len(units)) + units


def _spaced_names(line: str, width: int) -> list[str] | None:
    """Return the names of columns between blanks, where a unit in brackets is apart from its name; None without."""
    names = re.split(r"\s{2,}|\t", line.strip())
    if len(names) != width:
        names = re.sub(r"\s+(?=[\[(])", "\0", line.strip()).split()
    return [name.replace("\0", " ") for name in names] if len(names) == width else None


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
        raise RecordingError(
            f"{path.name}: the header names {len(names)} columns, the rows hold {width}: correct the header"
        )
    repeated = {name for name in names if names.count(name) > 1}
    return [f"{name}.{i}" if name in repeated else name for i, name in enumerate(names)]


def _marked_number(text: str, decimal: str) -> float | None:
    """Return the number of a field with the decimal mark of its column, NaN for a missing one; None if it is a word."""
    folded = text.strip().casefold()
    if folded in MISSING_WORDS:
        return float("nan")
    return _NUMBER_WORDS[folded] if folded in _NUMBER_WORDS else read_number(folded, decimal)
