"""Find the last row of a text table if its writer was cut off in the middle of it."""

from __future__ import annotations

import io
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


class FilePart(io.RawIOBase):
    """A readable file that ends at byte `end` of the file `path`."""

    def __init__(self, path: Path, end: int):
        self._file, self._end = path.open("rb"), end

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        """Set the position and return it, as `io.RawIOBase.seek` does."""
        return self._file.seek(offset if whence == 0 else self._end + offset if whence == 2 else self.tell() + offset)

    def tell(self) -> int:
        """Return the position, as `io.RawIOBase.tell` does."""
        return self._file.tell()

    def read(self, size: int = -1) -> bytes:
        """Read at most `size` bytes, up to `end`; all of them if `size` is negative."""
        left = max(self._end - self.tell(), 0)
        return self._file.read(left if size < 0 else min(size, left))

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()
