"""Leave out single rows of a text table that are damaged, and say which; refuse a table with many of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from ..._errors import RecordingError

MAX_DAMAGED_SHARE = 0.05
"""Largest share of a table's rows that is excluded as damaged. With more, the layout of the table is unknown."""


@dataclass
class LostRows:
    """Rows that were excluded.

    Attributes
    ----------
    count : int
        Number of rows.
    first : str
        Contents of the first of them; "" without one.
    """

    count: int = 0
    first: str = ""

    @property
    def text(self) -> str:
        """Return the excluded rows in words for a message; "" without any."""
        if not self.count:
            return ""
        rows = f"{self.count} rows that are" if self.count > 1 else "1 row that is"
        return f"{rows} damaged: {self.first}"


@dataclass
class RowWidths:
    """How many fields the rows of a table have."""

    _counts: Counter[int] = field(default_factory=Counter)
    _first: dict[int, int] = field(default_factory=dict)  # number of the first line, by width
    _nul_lines: list[int] = field(default_factory=list)
    _last: dict[int, int] = field(default_factory=dict)  # number of the last line, by width

    def add(self, numbers: Sequence[int], rows: Sequence[list[str]], *, may_hold_nul: bool) -> None:
        """Take more rows, each with the number of its line."""
        if may_hold_nul:
            kept = [(number, fields) for number, fields in zip(numbers, rows, strict=True) if not has_nul(fields)]
            self._nul_lines += sorted(set(numbers) - {number for number, _ in kept})
            numbers, rows = [number for number, _ in kept], [fields for _, fields in kept]
        widths = list(map(len, rows))
        counts = Counter(widths)
        self._counts.update(counts)
        for n in counts:
            self._first.setdefault(n, numbers[widths.index(n)])
            self._last[n] = numbers[-1 - widths[::-1].index(n)]

    def accepted(
        self, path: Path, width: int, lost: LostRows, *, may_be_longer: bool
    ) -> Callable[[list[str]], bool] | None:
        """Return whether a row's fields belong to a table of `width` columns; None if those of every row do.

        Rows of another width, and rows with NUL bytes, are counted in `lost`. RecordingError if they are many, unless
        the rows at the end are short because the last columns have ended.
        """
        good = {width, width + 1} if may_be_longer else {width}
        wrong = [(self._first[n], n) for n in self._counts if n not in good]
        count = sum(self._counts[n] for _, n in wrong) + len(self._nul_lines)
        total = sum(self._counts.values()) + len(self._nul_lines)
        if count and count > MAX_DAMAGED_SHARE * total:
            number, n = min(wrong, default=(0, 0))
            if wrong and not self._nul_lines and self._ends_in_short_rows(good):
                return None
            if not wrong:
                raise RecordingError(
                    f"{path.name}: {len(self._nul_lines)} of {total} rows hold NUL bytes, expected text"
                )
            raise RecordingError(f"{path.name}: line {number} has {n} fields, expected {width}")
        if count:
            nul = self._nul_lines[:1]
            number, n = min([*wrong, *((line, -1) for line in nul)])
            lost.count = count
            lost.first = (
                f"line {number} holds NUL bytes" if n < 0 else f"line {number} has {n} fields, expected {width}"
            )
        return (lambda fields: len(fields) in good and not has_nul(fields)) if count else None

    def _ends_in_short_rows(self, good: set[int]) -> bool:
        """Whether rows only become shorter: columns of slower signals end before the others."""
        order = sorted(self._counts, key=lambda n: self._first[n])
        falls = all(a > b and self._last[a] < self._first[b] for a, b in pairwise(order))
        return order[0] in good and falls


def has_nul(fields: Sequence[str]) -> bool:
    """Return whether a row holds a NUL byte, as it does where a logger lost its power."""
    return any("\0" in text for text in fields)
