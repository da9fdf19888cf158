"""Read text tables: comma, semicolon, tab or blanks between columns, any or no header, decimal point or comma."""

from __future__ import annotations

import csv
import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..._errors import RecordingError
from ..personal_fields import find_personal_columns, find_personal_lines, searched_part
from ..stated_units import is_unit_row, unit_from_text
from ._caps import require_few_columns, require_narrow_lines
from ._columns import Columns
from ._comma import comma_evidence, decimal_marks, may_hold_thousands, read_number, two_readings
from ._last_row import cut_row
from ._number_table import MIN_LONG_FILE_BYTES, number_table
from ._wall_clock import stamp_seconds

ENDINGS = (".csv", ".tsv", ".txt", ".dat")

MAX_HEADER_LINES = 40
"""The first row of numbers is searched among this many lines that are neither empty nor comments."""

MAX_HEADER_BYTES = 1 << 16
"""In a long file, everything above the numbers lies within this many bytes."""

_COMMENT_MARKS = ("#", "%", "//", "!")
_MISSING_WORDS = {"", "nan", "na", "n/a", "null", "none", "-", "--", "missing"}
_NUMBER_WORDS = {"true": 1.0, "false": 0.0, "inf": np.inf, "-inf": -np.inf}
_CHANNEL_LINE = re.compile(r"Channel \d+: '([^']+)'(?:.*engineering units: ([^,]+),)?")
_LABELLED_FACT = re.compile(r"[\s#%!/\"]*([^:=;,\t\"]{1,60}?)\"?\s*(?::|=|;|,|\t)\s*\"?(.*?)[\s\";,]*")
_COMMA_NUMBER = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")


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
    if path.stat().st_size >= MIN_LONG_FILE_BYTES and (columns := _read_long(path)) is not None:
        return columns
    # A byte order mark may also stand within the text of a file that was put together.
    lines = [(number, line) for number, line in enumerate(_decode(path).splitlines(), 1) if line.strip("\ufeff \t\r")]
    return read_lines(path, lines)


def read_lines(path: Path, lines: list[tuple[int, str]], delimiter: str | None = None) -> Columns:
    """Return the columns of a table's numbered lines that are not empty; without a `delimiter`, it is found."""
    comments = [line for _, line in lines if line.lstrip().startswith(_COMMENT_MARKS)]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith(_COMMENT_MARKS)]
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
    rows = lines[first:]
    # A last column with a name may be empty throughout; one without a name is only a surplus delimiter.
    named = header is not None and len(header) == len(_split(rows[0][1], delimiter)) and bool(header[-1])
    try:
        table = np.loadtxt([line for _, line in rows], delimiter=delimiter, comments=None, ndmin=2, dtype=np.float64)
        texts, unclear = None, set[int]()
    except ValueError:
        table, texts, unclear = _read_with_empty_cells(rows, delimiter, named) or _read_fields(
            path, rows, delimiter, named
        )
    if texts is None and may_hold_thousands(table.T):
        table, texts, unclear = _read_fields(path, rows, delimiter, named)
    names = _names(path, header, table.shape[1])
    values: dict[str, np.ndarray | str] = {}
    units = _units(names, unit_texts)
    above = [*comments, *(line for _, line in lines[:first])]
    personal = find_personal_lines(above)
    for i, name in enumerate(names):
        if i in unclear and texts is not None:
            number, text = texts[i][0]
            values[name] = f"line {number} {text}"
            continue
        times = stamp_seconds([text for _, text in texts[i]]) if texts is not None and texts[i] else None
        if texts is not None and times is not None:
            # An empty cell among the stamps stays a missing sample.
            table[np.isin([number for number, _ in rows], [number for number, _ in texts[i]]), i] = times
            values[name], units[name] = np.ascontiguousarray(table[:, i]), "s"
        elif texts is not None and texts[i] and (found := find_personal_columns([(name, texts[i][0][1])])):
            personal += found
            values[name] = f"a column of text that tells who was recorded ({found[0].kind}), which is not shown"
        elif texts is not None and texts[i]:
            number, text = texts[i][0]
            # Labels beside numbers are common; they matter only if a channel uses the column.
            values[name] = f'line {number} holds the text "{text}" where a number is expected'
        else:
            values[name] = np.ascontiguousarray(table[:, i])
    return Columns(path, values, units=units, facts=_facts(above, names), personal=tuple(personal))


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


def _read_long(path: Path) -> Columns | None:
    """Return the columns of a file that has only numbers below its header; None if that is not certain."""
    with path.open("rb") as file:
        head = file.read(MAX_HEADER_BYTES).splitlines(keepends=True)[:-1]
    if any(b"\0" in line or not line.endswith(b"\n") for line in head):
        return None
    try:
        text = [line.decode("utf-8" if i else "utf-8-sig") for i, line in enumerate(head)]
    except UnicodeDecodeError:
        return None
    lines = [(i, line) for i, line in enumerate(text) if line.strip()]
    comments = [line for _, line in lines if line.lstrip().startswith(_COMMENT_MARKS)]
    lines = [(i, line) for i, line in lines if not line.lstrip().startswith(_COMMENT_MARKS)]
    delimiter = _delimiter(_body([line for _, line in lines]))
    first = _first_row([_split(line, delimiter) for _, line in lines[:MAX_HEADER_LINES]])
    if delimiter is None or first is None:
        return None
    at, row = lines[first]
    fields = _split(row, delimiter)
    header, unit_texts = _header(lines[:first], comments, delimiter, len(fields))
    numbers = _numbered_names([_split(line, delimiter) for _, line in lines[first : first + 2]])
    if header is None and numbers and first + 1 < len(lines):
        header, at = numbers, lines[first + 1][0]
    names = _names(path, header, len(fields))
    decimal = _certain_mark([_split(line, delimiter) for _, line in lines[first:]])
    if decimal is None:
        return None
    cut = cut_row(path)
    end = cut.start if cut is not None else None
    start = sum(map(len, head[:at]))
    columns = number_table(path, start, len(fields), delimiter=delimiter, decimal=decimal, end=end)
    if columns is None or (delimiter.isspace() and _has_empty_row(columns)):
        return None  # a line of tabs alone is no row, which Arrow does not tell from one of missing samples
    if decimal == "." and may_hold_thousands(columns):
        return None  # the texts tell
    above = [*comments, *(line for _, line in lines[:first])]
    return Columns(
        path,
        dict(zip(names, columns, strict=True)),
        units=_units(names, unit_texts),
        facts=_facts(above, names),
        personal=tuple(find_personal_lines(above)),
    )


def lost_end(path: Path) -> str:
    """Return the incomplete row at the end of a file whose writer was killed; "" for a whole file."""
    cut = cut_row(path)
    if cut is None:
        return ""
    return f'an incomplete last row, "{cut.text if len(cut.text) <= 40 else f"{cut.text[:37]}..."}"'


def _certain_mark(rows: list[list[str]]) -> str | None:
    """Return the decimal mark of the first rows of a table; None if only all of its rows can tell it."""
    evidence = comma_evidence(field for fields in rows for field in fields)
    if evidence.comma:
        return None if evidence.point else ","
    return None if "," in evidence.either else "."


def _has_empty_row(columns: list[np.ndarray]) -> bool:
    """Whether some row holds missing samples alone."""
    missing = np.isnan(columns[0])
    for column in columns[1:]:
        missing &= np.isnan(column)
    return bool(missing.any())


def _decode(path: Path) -> str:
    raw, cut = path.read_bytes(), cut_row(path)
    raw = raw if cut is None else raw[: cut.start]
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16", errors="replace")
    if b"\0" in raw[:4096]:
        raise RecordingError(f"{path.name}: found binary content, expected text")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        # A degree or micro sign in a header written on Windows.
        return raw.decode("latin-1")


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


def _read_with_empty_cells(rows, delimiter, named):
    """Return the table if it has only numbers and empty cells, as a lost marker leaves them; else None."""
    if delimiter in (None, "\t") or not (named or any(not line.rstrip().endswith(delimiter) for _, line in rows)):
        return None
    filled, nan = [], f"{delimiter}nan{delimiter}"
    for _, line in rows:
        # Neighbouring empty cells share a delimiter, so the replacement runs twice. A delimiter added at either end
        # makes every cell an inner one.
        text = f"{delimiter}{line.strip()}{delimiter}"
        if 2 * delimiter in text:
            text = text.replace(2 * delimiter, nan).replace(2 * delimiter, nan)
        filled.append(text[1:-1])
    try:
        table = np.loadtxt(filled, delimiter=delimiter, comments=None, ndmin=2, dtype=np.float64)
    except ValueError:
        return None
    return table, None, set()


def _read_fields(path, rows, delimiter, named):
    split = [(number, _split(line, delimiter)) for number, line in rows]
    width = len(split[0][1])
    if width > 1 and not named and all(not fields[-1] for _, fields in split if len(fields) == width):
        split = [(number, fields[:-1] if len(fields) == width else fields) for number, fields in split]
        width -= 1
    table = np.full((len(split), width), np.nan)
    texts: list[list[tuple[int, str]]] = [[] for _ in range(width)]
    for number, fields in split:
        if len(fields) != width:
            raise RecordingError(f"{path.name}: line {number} has {len(fields)} fields, expected {width}")
    evidence = [comma_evidence(fields[j] for _, fields in split) for j in range(width)]
    marks = decimal_marks(evidence)
    for j, mark in enumerate(marks):
        if mark is None:
            wanted = evidence[j].either or evidence[j].comma
            at = next(number for number, fields in split if fields[j] == wanted)
            texts[j].append((at, two_readings(evidence[j])))
            continue
        for i, (number, fields) in enumerate(split):
            value = _marked_number(fields[j], mark)
            if value is None:
                texts[j].append((number, fields[j]))
            else:
                table[i, j] = value
    return table, texts, {j for j, mark in enumerate(marks) if mark is None}


def _marked_number(text: str, decimal: str) -> float | None:
    """Return the number of a field with the decimal mark of its column, NaN for a missing one; None if it is a word."""
    folded = text.strip().casefold()
    if folded in _MISSING_WORDS:
        return float("nan")
    return _NUMBER_WORDS[folded] if folded in _NUMBER_WORDS else read_number(folded, decimal)
