"""The last row of a text table, where its writer was cut off in it."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

TAIL = 1 << 16
"""Bytes at a file's end that say what its rows look like."""

ROWS = 200
"""Rows before the last one that it is compared with."""


@dataclass(frozen=True)
class CutRow:
    """A row that was not written whole: where it begins [bytes], and its text."""

    start: int
    text: str


def cut_row(path: Path) -> CutRow | None:
    """The last row, if no line end closes it and it has fewer fields than those before, or a shorter last number."""
    size = path.stat().st_size
    with path.open("rb") as file:
        begins = file.read(2)
        file.seek(max(size - TAIL, 0))
        tail = file.read()
    if tail.endswith((b"\n", b"\r")) or b"\0" in tail or begins in (b"\xff\xfe", b"\xfe\xff"):
        return None
    # The first line of the tail may itself be a part of one.
    lines = tail.splitlines()[size > TAIL :]
    if len(lines) < 2 or not lines[-1].strip():
        return None
    last, before = lines[-1].decode("latin-1"), [line.decode("latin-1") for line in lines[-1 - ROWS : -1]]
    delimiter = next((d for d in "\t;," if 2 * sum(d in line for line in before) > len(before)), None)
    rows = [line.strip().split(delimiter) for line in before]
    fields = last.lstrip().split(delimiter)
    width = max(map(len, rows))
    whole = [row for row in rows if len(row) == width]
    if len(fields) < width or (len(fields) == width and _shorter(fields[-1], [row[-1] for row in whole])):
        return CutRow(size - len(lines[-1]), last)
    return None


def _shorter(number: str, others: list[str]) -> bool:
    """Whether a number ends before its last digit, as all the others of its column have it."""
    number, others = number.strip(), [other.strip() for other in others]
    try:
        float(number.replace(",", "."))
    except ValueError:
        return number == "" or all(map(_is_number, others))
    decimals = {len(other.replace(",", ".").partition(".")[2]) for other in others if _is_number(other)}
    if len(decimals) == 1:
        return len(number.replace(",", ".").partition(".")[2]) < decimals.pop()
    # Of numbers of any length one in fifty is as short.
    return len(others) >= ROWS // 4 and len(number) < sorted(map(len, others))[len(others) // 50]


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


class Part(io.RawIOBase):
    """A file's bytes up to `end`."""

    def __init__(self, path: Path, end: int):
        self._file, self._end = path.open("rb"), end

    def readable(self) -> bool:
        """Always."""
        return True

    def seekable(self) -> bool:
        """Always."""
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        """As a file's."""
        return self._file.seek(offset if whence == 0 else self._end + offset if whence == 2 else self.tell() + offset)

    def tell(self) -> int:
        """As a file's."""
        return self._file.tell()

    def read(self, size: int = -1) -> bytes:
        """As a file's, up to the end."""
        left = max(self._end - self.tell(), 0)
        return self._file.read(left if size < 0 else min(size, left))

    def close(self) -> None:
        """As a file's."""
        self._file.close()
        super().close()
