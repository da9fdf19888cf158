"""Find garbage rows at either end of a file: numbers that no machine has, or time that does not advance.

A buffer that was not yet filled, or that was read past its end, leaves such rows. They are one block and one finding.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..clock import step_range

KIND = "garbage"

MAX_SANE_MAGNITUDE = 1e9
"""Numbers beyond this are no measurement in any unit. Times may be larger: clocks count nanoseconds since 1970."""

MAX_GARBAGE_SHARE = 0.1
"""Largest share of the rows in a block of garbage at either end."""

MAX_SANE_BRIDGE_ROWS = 5
"""This many sane rows between two rows of garbage still belong to the block."""

MIN_TIME_STEP_RATIO = 1e3
"""A time step at an edge that is this many times as long as usual separates garbage from the recording."""


@dataclass(frozen=True)
class GarbageRows:
    """Rows of garbage at the head and at the tail of a table."""

    head: int  # number of rows before the first sane one
    tail: int  # number of rows after the last sane one
    cause: str  # what shows that they are garbage

    @property
    def where(self) -> str:
        """Text that says which rows they are."""
        ends = [f"the first {self.head}"] * bool(self.head) + [f"the last {self.tail}"] * bool(self.tail)
        return " and ".join(ends)

    def between(self, n: int) -> slice:
        """Return the rows of a table of `n` rows that are left."""
        return slice(self.head, n - self.tail)


def find_garbage(time: np.ndarray | None, channels: Mapping[str, np.ndarray]) -> GarbageRows | None:
    """Return the rows of garbage at either end of a table; None without any.

    Parameters
    ----------
    time : ndarray, shape (n,), or None
        Time in any unit, if the table has it.
    channels : mapping of str to ndarray, shape (n,) each
        Other columns in any unit.
    """
    n = len(time) if time is not None else len(next(iter(channels.values()), ()))
    bad, causes = np.zeros(n, bool), []
    for name, x in channels.items():
        if max(np.fmax.reduce(x, initial=0.0), -np.fmin.reduce(x, initial=0.0)) > MAX_SANE_MAGNITUDE:
            causes.append(name)
            bad |= np.abs(x) > MAX_SANE_MAGNITUDE
    backwards = np.zeros(n, bool)
    edge = max(1, int(MAX_GARBAGE_SHARE * n))
    if time is not None and not _is_even(time):
        backwards = _rows_out_of_time(time) | _rows_beyond_a_reset(time, edge)
    head, tail = _block(bad | backwards, edge), _block((bad | backwards)[::-1], edge)
    if not head and not tail:
        return None
    rows = np.zeros(n, bool)
    rows[:head] = rows[n - tail :] = True
    told = [name for name in causes if np.any(np.abs(channels[name][rows]) > MAX_SANE_MAGNITUDE)]
    parts = [f"numbers up to {max(_largest(channels[name][rows]) for name in told):.3g}"] if told else []
    parts += ["time that does not advance"] if backwards[rows].any() else []
    return GarbageRows(head, tail, " and ".join(parts))


MIN_ZEROED_RUNS = 3
"""Fewest packets of zeros that are not attributed to chance."""

MAX_ZEROED_SHARE = 0.2
"""Largest share of packets of zeros; with more, zeros are a state of the machine."""

MAX_ZEROED_ROWS = 5
"""Most rows in a row that such packets fill."""

MIN_ZEROED_LEAP = 8.0
"""A channel leaps to 0 and back by this many times its usual step, the 95th percentile, in most of these packets."""


def zeroed_rows(channels: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the rows of packets that were filled with zeros, (n,) booleans: every changing channel is 0 at once.

    In at least one channel the value leaps to 0 and back, as no motion does. `channels`, (n,) each, are all columns.
    """
    n = max((len(x) for x in channels.values()), default=0)
    none = np.zeros(n, bool)
    changing = [x for x in channels.values() if len(x) == n and not _is_count(x) and _changes(x)]
    if n < 50 or len(changing) < 2:
        return none
    zero = np.all([x == 0.0 for x in changing], axis=0)
    if not 0.0 < np.mean(zero) <= MAX_ZEROED_SHARE or zero[0] or zero[-1]:
        return none
    edges = np.flatnonzero(np.diff(zero.astype(int)))
    runs = [(a, b + 1) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a <= MAX_ZEROED_ROWS]
    if len(runs) < MIN_ZEROED_RUNS:
        return none
    before, after = np.array(runs).T
    for x in changing:
        steps = np.abs(np.diff(x))[~(zero[1:] | zero[:-1])]
        usual = float(np.quantile(steps[np.isfinite(steps)], 0.95)) if np.isfinite(steps).any() else 0.0
        leaps = np.minimum(np.abs(x[before]), np.abs(x[after])) > MIN_ZEROED_LEAP * usual
        if usual > 0.0 and np.mean(leaps) >= 0.8:
            for a, b in runs:
                none[a + 1 : b] = True
            return none
    return none


def zeroed_text(zeroed: np.ndarray) -> str:
    """Return in words how many rows `zeroed_rows` found."""
    return f"{int(zeroed.sum())} of {len(zeroed)} rows in which every channel is 0: packets without data"


def _changes(x: np.ndarray) -> bool:
    known = x[np.isfinite(x)]
    return len(known) > 0 and float(np.ptp(known)) > 0.0


def _is_count(x: np.ndarray) -> bool:
    """Return whether a column advances in nearly all rows, as times and counters do."""
    return len(x) > 1 and float(np.mean(np.diff(x) > 0.0)) > 0.9


def _largest(x: np.ndarray) -> float:
    return float(np.max(np.abs(x), where=np.isfinite(x), initial=0.0))


def _block(bad: np.ndarray, edge: int) -> int:
    """Return how many rows at the start belong to the block of `bad` rows, (n,); 0 if it does not begin there."""
    places = np.flatnonzero(bad[:edge])
    end = 0
    for place in places.tolist():
        if place > end + MAX_SANE_BRIDGE_ROWS:
            break
        end = place + 1
    # A block that goes on inside is no edge.
    return 0 if end >= edge > 1 and len(bad) > edge and bad[edge] else end


def _is_even(time: np.ndarray) -> bool:
    """Return whether no step of a time, (n,), is wrong: the shortest advances, the longest is no gap."""
    shortest, longest = step_range(time)
    return 0.0 < longest <= MIN_TIME_STEP_RATIO * shortest


def _rows_beyond_a_reset(time: np.ndarray, edge: int) -> np.ndarray:
    """Return a mask of the rows at either end that a step back in time separates from the recording, shape (n,) bool.

    An old buffer may advance by itself. Nothing is marked if time runs back further inside, too.
    """
    beyond = np.zeros(len(time), bool)
    with np.errstate(invalid="ignore"):
        back = np.flatnonzero(np.diff(time) < 0.0)
    if np.any((back >= edge) & (back < len(time) - 1 - edge)):
        return beyond
    head, tail = back[back < edge], back[back >= len(time) - 1 - edge]
    if head.size:
        beyond[: head[-1] + 1] = True
    if tail.size:
        beyond[tail[0] + 1 :] = True
    return beyond


def _rows_out_of_time(time: np.ndarray) -> np.ndarray:
    """Return a mask of the rows at either end whose time does not fit the steps of the others, shape (n,) bool."""
    out = ~np.isfinite(time)
    steps = np.diff(time)
    positive = steps[np.isfinite(steps) & (steps > 0.0)]
    if not positive.size:
        return np.zeros(len(time), bool)
    # A clock that stamps packets has few long steps between many short ones.
    usual = float(np.quantile(positive, 0.95))
    with np.errstate(invalid="ignore"):
        wrong = (steps < 0.0) | (steps > MIN_TIME_STEP_RATIO * usual) | ~np.isfinite(steps)
    half = len(time) // 2
    # Up to the last wrong step of the first half, rows are before the recording; after the first of the second, behind.
    out[:half] |= np.append(wrong, False)[:half]
    out[half + 1 :] |= wrong[half:]
    return out
