"""Rows that repeat a label before each number, or a unit behind it: ``t: 10, angle: 1.5`` and ``12.3 °,0.5 N·m``.

Serial monitors and plotters write the one, dashboards the other.
"""

from __future__ import annotations

import re
from collections import Counter
from functools import lru_cache

from ...units import to_si_factor
from ..stated_units import unit_from_text

MIN_LABELLED_SHARE = 0.9
"""Smallest share of the first rows that have the same labels."""

MIN_LABELLED_ROWS = 10
"""Fewest rows for this decision."""

SAMPLED_LINES = 200
"""So many lines are looked at."""

_PAIR = re.compile(
    r"\s*(?:[,;|]\s*)?\"?([^\W\d][\w ./%°\[\]()^*-]{0,40}?)\"?\s*[:=]\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan)"
    r"[ ]?([°%µA-Za-z/*·^²]{0,12})(?=\s*[,;|\t]|\s+[^\W\d]|\s*$)",
    re.IGNORECASE,
)
"""A label, its number, and perhaps a unit behind it."""


def plain_table(content: bytes) -> bytes | None:
    """Return the content of a file of labelled rows as a table with one header; None of any other file.

    Lines that are no such rows become comments.

    >>> plain_table(b"Ready\\n" + 20 * b"t_ms: 10 angle: 1.5 deg\\n").splitlines()[:3]
    [b'# Ready', b't_ms,angle [deg]', b'10,1.5']
    """
    sample = content[: 200 * SAMPLED_LINES].decode("utf-8", errors="replace").splitlines()[:SAMPLED_LINES]
    found = [pairs for line in sample if (pairs := _pairs(line)) is not None]
    if len(found) < MIN_LABELLED_ROWS:
        return None
    labels, count = Counter(tuple(label for label, _, _ in pairs) for pairs in found).most_common(1)[0]
    if len(labels) < 2 or len(set(labels)) < len(labels) or count < MIN_LABELLED_SHARE * len(found):
        return None
    units = [Counter(pairs[i][2] for pairs in found if len(pairs) == len(labels)).most_common(1)[0][0]
             for i in range(len(labels))]  # fmt: skip
    header = [f"{label} [{unit}]" if unit else label for label, unit in zip(labels, units, strict=True)]
    above: list[str] = []
    rows: list[str] = []
    for line in content.decode("utf-8", errors="replace").splitlines():
        pairs = _pairs(line)
        if pairs is not None and tuple(label for label, _, _ in pairs) == labels:
            cells = zip(pairs, units, strict=True)
            rows.append(",".join(_number_in(number, unit, common) or "" for (_, number, unit), common in cells))
        elif not rows and line.strip():
            above.append(f"# {line.strip()}")
    return "\n".join([*above, ",".join(header), *rows, ""]).encode()


def _pairs(line: str) -> list[tuple[str, str, str]] | None:
    """Return the labels, numbers and units of a row; None if it holds anything else."""
    if not 3 <= len(line) <= 2000:
        return None
    place, pairs = 0, []
    while place < len(line.rstrip(" ,;\t")):
        match = _PAIR.match(line, place)
        if match is None:
            return None
        pairs.append((match[1].strip(), match[2], match[3]))
        place = match.end()
    return pairs if len(pairs) >= 2 else None


_UNIT_CELL = re.compile(
    r"\s*(?:\"\s*)?([-+]?[\d.,]+(?:[eE][-+]?\d+)?)[ \u00a0\u202f]*"
    r"([^\W\d_][^\d\";,]{0,11}|[°%][^\d\";,]{0,6})\"?\s*"
)
"""A number, and a unit behind it."""


_UNIT_LETTER = re.compile(r"[^\W\d_]|[°%]")
"""The first letter of a unit."""


def table_without_units(content: bytes) -> bytes | None:
    """Return the content of a table whose cells hold units with these in the header; None of any other table.

    >>> table_without_units(b"t,angle\\n" + 20 * b"0.1,1.5 deg\\n").splitlines()[:2]
    [b't,angle [deg]', b'0.1,1.5']
    """
    lines = text.splitlines() if (text := _utf8(content)) is not None else []
    rows = [line for line in lines[1:] if line.strip()]
    if len(rows) < MIN_LABELLED_ROWS or _UNIT_LETTER.search("\n".join(rows[:SAMPLED_LINES])) is None:
        return None
    for mark in ("\t", ";", ","):
        width = lines[0].count(mark) + 1
        sample = [row.split(mark) for row in rows[:SAMPLED_LINES]]
        if width < 2 or any(len(cells) != width for cells in sample):
            continue
        units = [_unit_of(cells) for cells in zip(*sample, strict=True)]
        if not any(units):
            continue
        names = [name.strip().strip('"') for name in lines[0].split(mark)]
        heads = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
        plain = [_plain_row(row.split(mark), units, mark) for row in rows]
        return "\n".join([mark.join(heads), *plain, ""]).encode()
    return None


def _utf8(content: bytes) -> str | None:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return None


def _unit_of(cells: tuple[str, ...]) -> str | None:
    """Return the unit of most cells of a column that hold one of its dimension behind their number; None without."""
    found = [match[2].strip() for cell in cells if (match := _UNIT_CELL.fullmatch(cell)) is not None]
    if len(found) < MIN_LABELLED_SHARE * sum(1 for cell in cells if cell.strip()):
        return None
    counts = Counter(found)
    for unit, _ in counts.most_common():
        alike = sum(n for other, n in counts.items() if _factor(other, unit) is not None)
        if alike >= MIN_LABELLED_SHARE * len(found):
            return unit
    return None


def _plain_row(cells: list[str], units: list[str | None], mark: str) -> str:
    """Return a row's cells without their units, each number in the unit of its column."""
    plain = []
    for place, cell in enumerate(cells):
        match, unit = _UNIT_CELL.fullmatch(cell), units[place] if place < len(units) else None
        number = None if match is None or unit is None else _number_in(match[1], match[2].strip(), unit)
        plain.append(cell if number is None else number)
    return mark.join(plain)


def _number_in(number: str, unit: str, common: str) -> str | None:
    """Return the text of a number in a column's unit, where dashboards print 850 mA and 1.2 A; None if it has none.

    >>> _number_in("850", "mA", "A"), _number_in("1.2", "A", "A"), _number_in("3", "V", "A")
    ('0.85', '1.2', None)
    """
    if unit == common:
        return number
    factor = _factor(unit, common)
    if factor is None:
        return None
    has_comma = "," in number and "." not in number
    scaled = f"{factor * float(number.replace(',', '.') if has_comma else number.replace(',', '')):.12g}"
    return scaled.replace(".", ",") if has_comma else scaled


@lru_cache(maxsize=256)
def _factor(unit: str, common: str) -> float | None:
    """Return how many of a column's unit one of another unit is; None if no unit is known, or the dimensions differ."""
    own, other = unit_from_text(unit), unit_from_text(common)
    if own is None or other is None:
        return None
    try:
        return to_si_factor(own, other)[0] / to_si_factor(other, None)[0]
    except ValueError:
        return None
