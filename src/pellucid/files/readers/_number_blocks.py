"""Read a text table's lines in blocks, and blocks of plain numbers at once: in the core, or by NumPy without delimiter.

Both give the same bits. Neither accepts a block that has more than numbers and missing samples in it; then the careful
reader takes over, which goes from field to field.
"""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Iterator, Sequence
from functools import cache
from typing import BinaryIO

import numpy as np

from ... import _core
from ..name_evidence import LANGUAGE_PARTS

BLOCK_BYTES = 1 << 19
"""Size of the blocks in which a file is read, so that its text takes little memory compared with its numbers."""

USUAL_HEADER_LETTERS = 20_000
"""The lines above the rows are looked for in this many letters first, then in the whole block."""

MISSING_WORDS = ("", "nan", "na", "n/a", "null", "none", "-", "--", "missing")
"""Words that mean a missing sample, in lower case."""

COMMENT_MARKS = ("#", "%", "//", "!")
"""Beginnings of the lines that are comments."""

_JAPANESE_BYTES = re.compile(rb"(?:[\x81-\x9f][\x40-\x7e\x80-\xfc]){2}")
_ENCODINGS = ("cp932", "gb18030", "cp949", "big5", "euc_jp", "cp1251")
_OTHER_LINE = re.compile(r"\n(?![^\s\ufeff#%!/])[\s\ufeff]*?(?:$|[#%!]|//)", re.MULTILINE)


def line_blocks(file: BinaryIO, end: int | None = None) -> Iterator[bytes]:
    """Yield blocks of whole lines, from the beginning of a file to its byte `end`."""
    file.seek(0)
    rest = b""
    while True:
        # A block without a line end is read on in steps that double.
        size = max(BLOCK_BYTES, len(rest))
        piece = file.read(size if end is None else min(size, end - file.tell()))
        rest += piece
        if not piece:
            break
        # The second half of a line end of two characters may be in the next block.
        cut = (rest.rfind(b"\n") + 1) or (rest.rfind(b"\r", 0, -1) + 1)
        if cut:
            yield rest[:cut]
            rest = rest[cut:]
    if rest:
        yield rest


def text_of(block: bytes) -> str:
    """Return the text of a block: UTF-8, or else the encoding under which it holds known words.

    Without such words it is what Windows writes in Japan or, with a degree sign, in the West.
    """
    try:
        return block.decode("utf-8-sig")
    except UnicodeDecodeError:
        pass
    found = {encoding: text for encoding in _ENCODINGS if (text := _text_in(block, encoding)) is not None}
    known = {encoding: sum(text.count(part) for part in LANGUAGE_PARTS) for encoding, text in found.items()}
    best = max(known, key=lambda encoding: known[encoding], default=None)
    if best is not None and known[best]:
        return found[best]
    # Shift JIS begins most of its letters with bytes that Latin-1 uses for no letter.
    if _JAPANESE_BYTES.search(block) is not None and "cp932" in found:
        return found["cp932"]
    return block.decode("latin-1")


def _text_in(block: bytes, encoding: str) -> str | None:
    """Return the text of a block in one encoding; None if a byte or a character is none of it."""
    try:
        text = block.decode(encoding)
    except UnicodeDecodeError:
        return None
    return None if any(unicodedata.category(letter) in ("Cn", "Co") for letter in set(text)) else text


def is_comment(line: str) -> bool:
    """Return whether a line is a comment."""
    return line.lstrip().startswith(COMMENT_MARKS)


def data_lines(lines: Sequence[str], before: int = 0) -> list[tuple[int, str]]:
    """Return the lines that are neither empty nor comments, each with its number; `before` lines came before them."""
    numbered = enumerate(lines, before + 1)
    # A search for line ends is faster than one that tries each place.
    if _OTHER_LINE.search("\n" + "\n".join(lines)) is None:
        return list(numbered)
    # A byte order mark may stand within a file that was put together.
    return [(i, line) for i, line in numbered if line.strip("\ufeff \t\r\n") and not is_comment(line)]


def read_numbers(
    file: BinaryIO, end: int | None, skipped: int, width: int, delimiter: str | None, decimal: str
) -> list[np.ndarray] | None:
    """Return `width` columns, shape (n,) each, of the rows after the first `skipped` lines and before the byte `end`.

    The result is None if a row is not `width` numbers with the given `delimiter` and `decimal` mark, or missing ones.
    """
    size = end or file.seek(0, os.SEEK_END)
    columns = [np.empty(0) for _ in range(width)]
    filled = read = 0
    for block in line_blocks(file, end):
        read += len(block)
        if skipped:
            text = text_of(block)
            # The last of the lines in a part of the text may go on.
            lines = text[:USUAL_HEADER_LETTERS].splitlines(keepends=True)[:-1]
            if len(lines) < skipped:
                lines = text.splitlines(keepends=True)
            block = text[sum(map(len, lines[:skipped])) :].encode()
            skipped = max(skipped - len(lines), 0)
        letters = np.frombuffer(block, np.uint8)  # in which NumPy counts ten times as fast as bytes do
        most = filled + sum(np.count_nonzero(letters == end_of_line) for end_of_line in b"\n\r") + 1
        if width and most > len(columns[0]):
            # Rows are similar in length, so that mostly one allocation is enough.
            room = max(most + filled // 4, int(1.02 * size * most / read))
            longer = [np.empty(room) for _ in columns]
            for column, new in zip(columns, longer, strict=True):
                new[:filled] = column[:filled]
            columns = longer
        found = None
        if delimiter is not None:
            found = _core.read_rows(block, columns, filled, delimiter, decimal, [*MISSING_WORDS])
        if found is None:
            parts = _numpy_numbers(block, width, delimiter, decimal)
            if parts is None:
                return None
            found = filled + (len(parts[0]) if parts else 0)
            for column, part in zip(columns, parts, strict=bool(parts)):
                column[filled:found] = part
        filled = found
    for column in columns:
        column.resize(filled, refcheck=False)
    return columns


def _numpy_numbers(block: bytes, width: int, delimiter: str | None, decimal: str) -> list[np.ndarray] | None:
    """Return the columns of a block by NumPy; none of a block without rows."""
    lines = [line for _, line in data_lines(text_of(block).splitlines())]
    if not lines:
        return []
    if decimal != ".":
        text = "\n".join(lines)
        if "." in text:
            return None
        lines = text.replace(decimal, ".").splitlines()
    table = _loaded(lines, delimiter)
    if table is None and delimiter is not None:
        table = _loaded(_missing_cell(delimiter).sub("nan", "\n".join(lines)).splitlines(), delimiter)
    return None if table is None or table.shape[1] != width else list(table.T)


def _loaded(lines: list[str], delimiter: str | None) -> np.ndarray | None:
    try:
        return np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2, dtype=np.float64)
    except ValueError:
        return None


@cache
def _missing_cell(delimiter: str) -> re.Pattern[str]:
    """Return the pattern of a cell of a missing sample between two delimiters, or between one and a line's end."""
    words, mark = "|".join(map(re.escape, MISSING_WORDS)), re.escape(delimiter)
    return re.compile(rf"(?:^|(?<={mark})) {{0,99}}(?:{words}) {{0,99}}(?={mark}|$)", re.IGNORECASE | re.MULTILINE)
