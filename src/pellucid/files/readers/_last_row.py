"""Find the last row of a text table if its writer was cut off in the middle of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

TAIL_BYTES = 1 << 16
"""Only this many bytes at the end of a file are read, enough to see the form of its rows."""

MAX_COMPARED_ROWS = 200
"""The last row is compared with at most this many rows before it."""


@dataclass(frozen=True)
class CutRow:
    """A row that was not written completely."""

    start: int  # position of the row's first byte in the file
    text: str  # the incomplete row


def cut_row(path: Path) -> CutRow | None:
    """Return the last row of a file if it is incomplete, else None.

    An incomplete row lacks a line end, and has fewer fields than the rows before or a shorter last number.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        begins = file.read(2)
        file.seek(max(size - TAIL_BYTES, 0))
        tail = file.read()
    if tail.endswith((b"\n", b"\r")) or b"\0" in tail or begins in (b"\xff\xfe", b"\xfe\xff"):
        return None
    # The first line of the tail may be incomplete too.
    lines = tail.splitlines()[size > TAIL_BYTES :]
    if len(lines) < 2 or not lines[-1].strip():
        return None
    last, before = lines[-1].decode("latin-1"), [line.decode("latin-1") for line in lines[-1 - MAX_COMPARED_ROWS : -1]]
    delimiter = next((d for d in "\t;," if 2 * sum(d in line for line in before) > len(before)), None)
    rows = [line.strip().split(delimiter) for line in before]
    fields = last.lstrip().split(delimiter)
    width = max(map(len, rows))
    whole = [row for row in rows if len(row) == width]
    if len(fields) < width or (len(fields) == width and _is_cut_number(fields[-1], [row[-1] for row in whole])):
        return CutRow(size - len(lines[-1]), last)
    return None


def _is_cut_number(number: str, others: list[str]) -> bool:
    """Whether `number` has fewer digits than the other numbers of its column."""
    number, others = number.strip(), [other.strip() for other in others]
    try:
        float(number.replace(",", "."))
    except ValueError:
        return number == "" or all(map(_is_number, others))
    decimals = {len(other.replace(",", ".").partition(".")[2]) for other in others if _is_number(other)}
    if len(decimals) == 1:
        return len(number.replace(",", ".").partition(".")[2]) < decimals.pop()
    # Where numbers differ in length, the number is cut if fewer than 1 in 50 others are as short.
    return len(others) >= MAX_COMPARED_ROWS // 4 and len(number) < sorted(map(len, others))[len(others) // 50]


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
