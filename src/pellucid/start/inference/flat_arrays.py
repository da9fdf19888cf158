"""Find how a flat list of numbers, one a line, holds several columns: in turn, or one after another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import gcd

import numpy as np

MAX_FLAT_COLUMNS = 16
"""A flat list is tried to hold at most so many columns."""

MIN_FLAT_ROWS = 200
"""A column in a flat list has at least so many rows."""

MIN_SMOOTHING = 5.0
"""The columns are those of which the usual step is at least so many times smaller than that of the flat list."""


@dataclass(frozen=True)
class FlatShape:
    """Columns of a flat list."""

    count: int  # number of columns
    order: str  # "interleaved": row after row; "stacked": column after column; "single": one column

    def split(self, values: np.ndarray) -> list[np.ndarray]:
        """Return the columns of a flat list, shape (n,), each shape (n / count,)."""
        if self.order == "interleaved":
            return [values[i :: self.count] for i in range(self.count)]
        if self.order == "stacked":
            return list(values.reshape(self.count, -1))
        return [values]


def find_flat_shape(values: np.ndarray, counts: tuple[int, ...] = ()) -> FlatShape:
    """Return how a flat list, shape (n,), holds columns.

    Steps from a number to the next are small within a column and large between columns. `counts` are the numbers of
    columns that the lengths of other files make likely; without them all up to 16 are tried.
    """
    known = np.nan_to_num(values)
    n = len(known)
    plain = float(np.median(np.abs(np.diff(known)))) if n > 1 else 0.0
    tried = [k for k in (counts or range(2, MAX_FLAT_COLUMNS + 1)) if k > 1 and n % k == 0 and n // k >= MIN_FLAT_ROWS]
    best: tuple[float, int] | None = None
    for k in tried:
        step = float(np.median(np.abs(np.diff(known.reshape(-1, k), axis=0))))
        if plain > MIN_SMOOTHING * step and (best is None or step < 0.5 * best[0]):
            best = (step, k)
    if best is not None:
        return FlatShape(best[1], "interleaved")
    for k in tried:
        if counts and _jumps_at_borders(known, k):
            return FlatShape(k, "stacked")
    return FlatShape(counts[0], "stacked") if counts and counts[0] in tried else FlatShape(1, "single")


def common_rows(lengths: Mapping[str, int]) -> int | None:
    """Return the number of rows that flat files share, if each length is a small multiple of it; None if none is."""
    common = 0
    for length in lengths.values():
        common = gcd(common, length)
    shortest = min(lengths.values())
    for rows in (shortest, common):
        if rows >= MIN_FLAT_ROWS and all(n % rows == 0 and n // rows <= MAX_FLAT_COLUMNS for n in lengths.values()):
            return rows
    return None


def _jumps_at_borders(values: np.ndarray, count: int) -> bool:
    rows = len(values) // count
    steps = np.abs(np.diff(values))
    borders = np.arange(1, count) * rows - 1
    return bool(np.median(steps[borders]) > 20.0 * (np.quantile(steps, 0.9) + 1e-300))
