"""Find the names and units of a text table's columns in the lines above it.

Loggers write them in a few ways, each told by its form and by how many columns the table has:

- a row of names, perhaps with groups above it (a joint over its channels) and units below it;
- rows that begin with a word such as ``ChannelTitle=`` or ``Unit`` and have a value for each column;
- pairs of a word and a value over each channel's own times and samples;
- a line for each channel, such as ``Channel 1: 'RF'``, or two, its name and its unit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from ..stated_units import is_unit_row, split_unit, unit_from_text

AXIS_NAMES = ("x", "y", "z")
"""Names of a point's coordinates, in the order in which every program writes them."""

INDEX_NAME = "index"
"""Name of a column without one that counts the rows."""

_NAME_KEYS = frozenset({
    "name", "names", "channel", "channels", "channelname", "channelnames", "channeltitle", "channeltitles", "title",
    "titles", "label", "labels", "signal", "signals", "signalname", "signalnames", "variable", "variables",
    "variablename", "identifier", "tracename", "tracenames", "markername", "markernames", "bodyname", "bodynames",
    "dataname", "itemname", "kanal", "kanalname", "kanalnamen", "kanäle", "bezeichnung", "signalbezeichnung", "nom",
    "nombre", "nome", "名称", "信号名", "データ名", "チャンネル名", "項目",
})  # fmt: skip
"""First words, folded, of rows with a name for each channel."""

_UNIT_KEYS = frozenset({
    "unit", "units", "unitname", "unitnames", "unitlabel", "yunitlabel", "engineeringunit", "engineeringunits",
    "eu", "vunit", "yunit", "dimension", "einheit", "einheiten", "unité", "unités", "unidad", "unidades", "unità",
    "単位",
})  # fmt: skip
"""First words, folded, of rows with a unit for each channel."""

_RANGE_KEYS = frozenset({"range", "ranges", "inputrange"})
"""First words, folded, of rows with the end of each channel's range, whose unit is the channel's."""

_PERIOD_KEYS = frozenset({"sampletime", "samplingtime", "samplingperiod", "sampleperiod", "deltax", "interval"})
"""First words, folded, of rows with the time between samples for each channel."""

_CHANNEL_LINE = re.compile(r"Channel \d+: '([^']+)'(?:.*engineering units: ([^,]+),)?")
_NUMBERED_LINE = re.compile(
    r"[\s\"]*(?:channel|chan|ch|column|col|signal|kanal|trace)?[\s_.#-]*(\d{1,4})\s*[:=;,\t]\s*[\"']?(.+?)[\"']?[\s;,]*",
    re.IGNORECASE,
)
_COUNT_OF_CHANNELS = re.compile(
    r"\s*(\d{1,4})\s*channels?\s*|\s*(?:number of )?channels?\s*[:=]\s*(\d{1,4})\s*", re.IGNORECASE
)
_PLACEHOLDER = re.compile(r"(?:ch|chan|channel|col|column|kanal|var|signal|y|data)?[\s_.#-]*\d{1,4}", re.IGNORECASE)
_PERIOD_PER_SAMPLE = re.compile(r"\s*([\d.,]+)\s*(s|sec|msec|ms|usec|us|µs)\s*(?:/|per)\s*sample\s*", re.IGNORECASE)
_RATE_LINE = re.compile(r"\s*([\d.,]+)\s*(Hz|kHz|samples?\s*(?:/|per)\s*s(?:ec(?:ond)?)?)\s*", re.IGNORECASE)


@dataclass(frozen=True)
class TableHeader:
    """Names and units of a table's columns, as the lines above it state them.

    Attributes
    ----------
    names : list of str or None
        A name for each column, "" for one without; None if nothing names them.
    units : list of str or None
        A unit's text for each column, "" for one without.
    used : frozenset of int
        Places, among the lines above, of those that state names and units.
    paired : bool
        Whether each channel has a column of its own times before it; `names` then repeats the channel's name.
    """

    names: list[str] | None = None
    units: list[str] | None = None
    used: frozenset[int] = frozenset()
    paired: bool = False
    facts: dict[str, str] = field(default_factory=dict)


def find_header(
    lines: Sequence[str], above: Sequence[list[str]], body: Sequence[list[str]], width: int, *, is_last_empty: bool
) -> TableHeader | None:
    """Return the header of a table with `width` columns; None if no line states names.

    Parameters
    ----------
    lines : sequence of str
        Lines above the table.
    above : sequence of list of str
        The same, divided into fields.
    body : sequence of list of str
        Fields of the table's first rows.
    width : int
        Fields of a row.
    is_last_empty : bool
        Whether the last field of the first rows is empty, so that it may only follow a surplus delimiter.
    """
    header = (
        _paired_rows(above, width)
        or _keyed_rows(above, body, width)
        or _stacked_rows(above, body, width, is_last_empty=is_last_empty)
    )
    if header is not None and header.units is None:
        header = _with_keyed_units(header, above)
    wide = width - is_last_empty
    listed = _listed_channels(lines, wide) or _listed_channels(lines, width)
    if listed is not None and (header is None or header.names is None or _are_placeholders(header.names)):
        # A row of CH1, CH2, ... under a list of channels only numbers them.
        header = _with_listed(header, listed, wide if len(listed[0]) <= wide else width, width)
    return header


def counted_units(lines: Sequence[str]) -> dict[int, str]:
    """Return the lines with a unit below a number of channels, by their places; empty without such a number.

    Names and units stand there by turns, and a unit such as ``%`` is no comment.
    """
    for i, line in enumerate(lines):
        if (match := _COUNT_OF_CHANNELS.fullmatch(line[:100])) is not None:
            places = range(i + 2, min(i + 2 + 2 * int(match[1] or match[2]), len(lines)), 2)
            return {at: lines[at] for at in places if unit_from_text(lines[at].strip()[:20]) is not None}
    return {}


def stated_rate(lines: Sequence[str]) -> dict[str, str]:
    """Return the sampling period or rate that a line states without a label, as ``2 msec/sample`` or ``500 Hz``."""
    for line in lines:
        if (match := _PERIOD_PER_SAMPLE.fullmatch(line[:200])) is not None:
            return {"sampling period": f"{match[1]} {unit_from_text(match[2]) or match[2]}"}
        if (match := _RATE_LINE.fullmatch(line[:200])) is not None:
            return {"sampling rate": f"{match[1]} {'kHz' if match[2].lower() == 'khz' else 'Hz'}"}
    return {}


def folded_key(text: str) -> str:
    """Return a word before a row's values in lower case, without marks, and without a unit in brackets."""
    return re.sub(r"[\W_]+", "", re.sub(r"[\[(].*?[\])]", "", text[:100])).casefold()


def _paired_rows(above: Sequence[list[str]], width: int) -> TableHeader | None:
    """Return the header of a table whose channels each have times and samples, with a word and a value above both.

    TwinCAT Scope exports so: ``Name;position;Name;torque``, ``Unit;deg;Unit;Nm``, one such row for each property.
    """
    if width % 2 or width < 2:
        return None
    rows: dict[str, tuple[int, list[str], str]] = {}
    for i, found in enumerate(above):
        fields = [*found, *[""] * (width - len(found))][:width]
        keys = {folded_key(text) for text in fields[::2]}
        if len(keys) == 1 and len(found) >= width - 1 and (key := keys.pop()):
            rows.setdefault(key, (i, fields[1::2], fields[0]))
    named = next((rows[key] for key in rows if key in _NAME_KEYS or key == "symbolname"), None)
    # A word over each column is not enough: two properties are those of channels.
    if named is None or len(rows) < 2 or not all(named[1]) or len(set(named[1])) < len(named[1]):
        return None
    units = next((rows[key][1] for key in rows if key in _UNIT_KEYS), [""] * (width // 2))
    period = next((rows[key][2] for key in rows if key in _PERIOD_KEYS), "")
    clock = split_unit(period)[1] or ""
    # "V (Voltage)" is a unit and its quantity; "(None)" is none.
    plain = [re.sub(r"\s*\(.*?\)\s*$", "", text) for text in units]
    return TableHeader(
        [name for name in named[1] for _ in range(2)],
        [text for unit in plain for text in (clock, unit)],
        frozenset(i for i, _, _ in rows.values()),
        paired=True,
    )


def _keyed_rows(above: Sequence[list[str]], body: Sequence[list[str]], width: int) -> TableHeader | None:
    """Return the header that rows with a word and a value for each column give, as LabChart's ``ChannelTitle=``.

    The word stands over the first column, which is the time's, or before it. A program of motion capture gives a name
    for three columns each, the coordinates.
    """
    names = units = None
    used: set[int] = set()
    has_mark = False
    first = ""
    for i, fields in enumerate(above):
        key = folded_key(fields[0]) if fields else ""
        values = fields[1:]
        while values and not values[-1]:
            values = values[:-1]
        count = len(values)
        is_over_all = count in (width, width - 1) or (key in _UNIT_KEYS and 0 < count < width and units is None)
        if key in _NAME_KEYS and names is None and all(values):
            if is_over_all and count >= width - 1 and count > 0:
                names = values if count == width else ["", *values]
            elif count and 0 <= width - 3 * count <= 2:
                spare = ("frame", "time")[: width - 3 * count]
                names = [*spare, *(f"{name}_{axis}" for name in values for axis in AXIS_NAMES)]
            else:
                continue
            has_mark |= fields[0].rstrip().endswith(("=", ":")) or width - 3 * count >= 0
            used.add(i)
        elif key in _UNIT_KEYS and is_over_all and units is None and any(unit_from_text(text) for text in values):
            units = (values if count == width else ["", *values]) + [""] * max(0, width - 1 - count)
            used.add(i)
        elif key in _RANGE_KEYS and is_over_all and units is None and (stated := _units_of_ranges(values)):
            units = stated if count == width else ["", *stated]
            used.add(i)
        elif (
            names is not None
            and count == width - 1
            and len(set(values)) == count
            and _are_placeholders([fields[0], *values])
        ):
            first = fields[0]  # below the names the columns are numbered, beside the name of the time
            used.add(i)
    if names is None or not (has_mark or units is not None) or not _has_numbers_first(body):
        return None
    return TableHeader([names[0] or first, *names[1:width]], units[:width] if units else None, frozenset(used))


def _units_of_ranges(values: Sequence[str]) -> list[str] | None:
    """Return the unit of each range, such as ``10.000 mV``; None unless each has a unit that is known."""
    matches = [re.fullmatch(r"\s*[±+-]?[\d.,]+(?:[eE][-+]?\d+)?\s*(\S{1,12})\s*", text[:60]) for text in values]
    units = [match[1] for match in matches if match is not None and unit_from_text(match[1]) is not None]
    return units if values and len(units) == len(values) else None


def _with_keyed_units(header: TableHeader, above: Sequence[list[str]]) -> TableHeader:
    """Return a header with the units that a row such as ``UNITS`` states of the channels in a row of names above it.

    The table has more columns than those rows have channels, such as a number and a time before them.
    """
    rows = {folded_key(fields[0]): (i, [f for f in fields[1:] if f]) for i, fields in enumerate(above) if fields}
    named = next((rows[key] for key in rows if key in _NAME_KEYS), None)
    stated = next((rows[key] for key in rows if key in _UNIT_KEYS), None)
    if header.names is None or named is None or stated is None or len(named[1]) != len(stated[1]):
        return header
    count = len(named[1])
    if not count or header.names[-count:] != named[1] or not any(unit_from_text(text) for text in stated[1]):
        return header
    units = [""] * (len(header.names) - count) + stated[1]
    return TableHeader(header.names, units, header.used | {named[0], stated[0]}, header.paired, header.facts)


def _has_numbers_first(body: Sequence[list[str]]) -> bool:
    """Whether the first column holds numbers or stamps: over words, a word such as "name" is the column's own name."""
    return all(not fields or not fields[0] or fields[0].strip("\"'+-.,")[:1].isdigit() for fields in body[:20])


def _stacked_rows(
    above: Sequence[list[str]], body: Sequence[list[str]], width: int, *, is_last_empty: bool
) -> TableHeader | None:
    """Return the header of a row of names, with groups in a row above it and units in one below."""
    has_index = _counts_rows(body, width)
    for wide in dict.fromkeys((width, width - (is_last_empty or has_index), width - is_last_empty - has_index)):
        whole = [(i, _fitted(fields, wide)) for i, fields in enumerate(above)]
        rows = [(i, fields) for i, fields in whole if fields is not None]
        if not rows or (wide < width and wide < 2):
            continue
        found = _named_row(rows, wide)
        if found is None:
            continue
        names, units, used = found
        names, grouped = _with_groups(names, above, min(used), wide)
        if wide < width - is_last_empty:
            names, units = [INDEX_NAME, *names], None if units is None else ["", *units]
        return TableHeader(names, units, frozenset(used | grouped))
    return None


def _fitted(fields: list[str], width: int) -> list[str] | None:
    """Return a row's fields if there is one for each column; empty ones beyond the last column do not count."""
    if len(fields) > width and not any(fields[width:]):
        fields = fields[:width]
    return fields if len(fields) == width and any(fields) else None


def _named_row(
    rows: Sequence[tuple[int, list[str]]], width: int
) -> tuple[list[str], list[str] | None, set[int]] | None:
    """Return the names, the texts of the units and the places of their rows.

    The header is the row above one of units, else the first row with a name for every column, else the last row.
    """
    for (i, names), (j, units) in pairwise(rows):
        if width > 1 and is_unit_row(units) and not is_unit_row(names):
            return names, units, {i, j}
    first = next(((i, fields) for i, fields in rows if all(fields) and len(set(fields)) == width), None)
    i, names = first or rows[-1]
    if first is None and len(rows) > 1 and not all(rows[-1][1]) and all(rows[0][1]):
        i, names = rows[0]
    return names, None, {i}


def _with_groups(names: list[str], above: Sequence[list[str]], row: int, width: int) -> tuple[list[str], set[int]]:
    """Return names with the groups that the rows above them give, and the places of those rows.

    A group's name stands over its first column, as in a spreadsheet with merged cells, or over each of its columns.
    """
    used: set[int] = set()
    repeated = len({name for name in names if name}) < sum(1 for name in names if name)
    for i in range(row - 1, max(row - 4, -1), -1):
        groups = _groups(above[i], names, width, repeated=repeated)
        if groups is None:
            break
        names = [
            f"{group}.{name}" if group and name else group or name for group, name in zip(groups, names, strict=True)
        ]
        used.add(i)
        repeated = len(set(names)) < len(names)
    return names, used


def _groups(fields: list[str], names: list[str], width: int, *, repeated: bool) -> list[str] | None:
    """Return the group of each column, "" for none, if a row above the names gives groups; None if it is a title."""
    if len(fields) > width and any(fields[width:]):
        return None
    cells = [*fields, *[""] * (width - len(fields))][:width]
    filled = [i for i, cell in enumerate(cells) if cell]
    if not filled or width < 2 or any(_is_number(cells[i]) and repeated is False for i in filled):
        return None
    key = folded_key(cells[0])
    if len(filled) > 2 and key in _NAME_KEYS | _UNIT_KEYS and key != folded_key(names[0]):
        return None  # a row of names or units of the channels alone
    if len(filled) == width:
        # A name over each column is a group only if the names below need one.
        return cells if repeated and len(set(cells)) < width else None
    spans = {b - a for a, b in pairwise([*filled, width])}
    if filled[0] == 0 and names[0] and len(filled) < 3 and not (len(filled) == 2 and len(spans) == 1 and repeated):
        return None  # a title, or a setting and its value
    groups, group = [], ""
    for cell in cells:
        group = cell or group
        groups.append(group)
    # What stands over a first column without a name is its own name, and no group of the next ones.
    if filled[0] == 0 and not names[0]:
        second = filled[1] if len(filled) > 1 else width
        groups[1:second] = [""] * (second - 1)
    return groups


def _counts_rows(body: Sequence[list[str]], width: int) -> bool:
    """Return whether the first column is an index of the rows: whole numbers that rise by one, or words before
    numbers.
    """
    first = [fields[0].strip('"') for fields in body if len(fields) >= width - 1 > 0]
    if len(first) < 2:
        return False
    if all(text.isdigit() for text in first):
        return all(int(b) - int(a) == 1 for a, b in pairwise(first))
    return not any(text[:1].isdigit() or text[:1] in "+-." for text in first if text) and all(first)


def _listed_channels(lines: Sequence[str], width: int) -> tuple[list[tuple[str, str]], set[int]] | None:
    """Return the name and the unit's text of each channel that lines list, and the lines' places; None without a list.

    A list has as many channels as the table has columns, with or without the one of time.
    """
    matches = [match for line in lines if (match := _CHANNEL_LINE.match(line))]
    if len(matches) == width:
        # Such a line may state more, such as a rate, and stays among the settings.
        return [(match[1], match[2] or "") for match in matches], set()
    for counts in _numbered_runs(lines):
        if len(counts) in (width, width - 1) and len(counts) > 1:
            return [split_unit_text(text) for _, text in counts], set()
    for i, line in enumerate(lines):
        match = _COUNT_OF_CHANNELS.fullmatch(line[:100])
        n = int(match[1] or match[2]) if match else 0
        following = [text.strip() for text in lines[i + 1 : i + 1 + 2 * n]]
        if n in (width, width - 1) and n > 0 and len(following) == 2 * n:
            units = following[1::2]
            if 2 * sum(unit_from_text(text) is not None for text in units) >= n and all(following[::2]):
                return list(zip(following[::2], units, strict=True)), set(range(i, i + 1 + 2 * n))
    return None


def _numbered_runs(lines: Sequence[str]) -> Iterator[list[tuple[int, str]]]:
    """Yield runs of lines that number channels one after another, as ``CH1 = torque [Nm]``: places and texts."""
    run: list[tuple[int, str]] = []
    expected = None
    for i, line in enumerate(lines):
        match = _NUMBERED_LINE.fullmatch(line[:300])
        is_named = match is not None and not _is_number(match[2])
        if match is not None and is_named and expected is not None and int(match[1]) == expected:
            run.append((i, match[2]))
            expected += 1
            continue
        if run:
            yield run
        run, expected = [], None
        if match is not None and is_named and int(match[1]) in (0, 1):
            run, expected = [(i, match[2])], int(match[1]) + 1
    if run:
        yield run


def split_unit_text(text: str) -> tuple[str, str]:
    """Return a channel's name and the text of its unit, which may follow it in brackets or after a delimiter."""
    parts = [part.strip(" \"'") for part in re.split(r"[;\t]|,(?=\s*[^\s,]{1,12}\s*$)", text) if part.strip(" \"'")]
    if len(parts) > 1 and unit_from_text(parts[1]) is not None:
        return parts[0], parts[1]
    return text.strip(), ""


def _are_placeholders(names: Sequence[str]) -> bool:
    """Whether names only number the columns, all but the first one, which is the time's."""
    own = list(names)
    while own and not own[-1]:
        own.pop()  # a surplus delimiter
    return len(own) > 1 and all(_PLACEHOLDER.fullmatch(name) for name in own[1:])


def _with_listed(
    header: TableHeader | None, listed: tuple[list[tuple[str, str]], set[int]], wide: int, width: int
) -> TableHeader:
    """Return a header with the names and units of listed channels; one more column comes first, the time's.

    `wide` is the number of columns, and `width` that of the fields, of which a last one may be empty.
    """
    channels, used = listed
    spare = wide - len(channels)
    own = header.names[:spare] if header is not None and header.names is not None else [""] * spare
    kept = header.used if header is not None else frozenset()
    return TableHeader(
        [*own, *(name for name, _ in channels), *[""] * (width - wide)],
        [*[""] * spare, *(unit for _, unit in channels), *[""] * (width - wide)],
        kept | frozenset(used),
    )


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
