"""Tell a command from a measurement: both move alike, and what was asked for carries no noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

MIN_FOLLOWING_CORRELATION = 0.9
"""Two columns are a command and its measurement if they correlate at least so, at the best shift."""

MAX_SCALE_ERROR = 0.5
"""A measurement follows its command with a slope within this of 1; a saturated drive follows by less."""

MAX_SHIFT_SHARE = 0.02
"""The measurement may come later by at most this share of the recording."""

MAX_STEPPED_SHARE = 0.15
"""A column that changes in less than this share of its rows is stepped: a program set it."""


MIN_LIMIT_ROWS = 4
"""A channel rests at its limit if it stays there for so many rows."""

MIN_LIMIT_RUNS = 3
"""A largest number is a limit if a channel rests there at least so often."""

MIN_LEVEL_ROWS = 20
"""A column rests on a level if it does not change for so many rows."""

MIN_LEVEL_SHARE = 0.15
"""A program set a column that rests on levels other than 0 for at least this share of its rows."""


@dataclass(frozen=True)
class FollowedCommand:
    """Two columns of which one follows the other."""

    command: str
    measured: str
    slope: float  # slope of the measurement over the command
    why: str  # reason, for a comment in study.toml


def find_command(a: tuple[str, np.ndarray], b: tuple[str, np.ndarray]) -> FollowedCommand | None:
    """Return which of two named columns, shape (n,) each, is the other's command; None if neither follows the other.

    The measurement is later, or rougher: encoders have quanta and currents have ripple, a command has neither.
    """
    (name_a, x), (name_b, y) = a, b
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if len(x) < 50 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return None
    stride = max(1, len(x) // 8_000)
    lag, correlation = _best_lag(x[::stride] - x.mean(), y[::stride] - y.mean())
    if correlation < MIN_FOLLOWING_CORRELATION:
        return None
    slope = float(np.std(y) / np.std(x))
    if not 1.0 - MAX_SCALE_ERROR <= slope <= 1.0 / (1.0 - MAX_SCALE_ERROR):
        return None
    rough_x, rough_y = roughness(x), roughness(y)
    if lag != 0:
        late = name_b if lag > 0 else name_a
        first = name_a if lag > 0 else name_b
        why = f'"{late}" follows "{first}" {abs(lag) * stride} samples later'
    elif rough_x < 0.5 * rough_y or rough_y < 0.5 * rough_x:
        first, late = (name_a, name_b) if rough_x < rough_y else (name_b, name_a)
        why = f'"{first}" has no noise, and "{late}" follows it'
    else:
        return None
    return FollowedCommand(first, late, slope if first == name_a else 1.0 / slope, why)


def roughness(values: np.ndarray) -> float:
    """Return the size of third differences relative to the spread: noise and quanta, without slow motion."""
    spread = float(np.std(values))
    return float(np.median(np.abs(np.diff(values, 3)))) / spread if spread > 0.0 and len(values) > 4 else 0.0


def is_stepped(values: np.ndarray) -> bool:
    """Whether a column rests on levels and changes in few rows, as a program's command does."""
    known = values[np.isfinite(values)]
    if len(known) < 20:
        return False
    changes = float(np.mean(np.diff(known) != 0.0))
    return 0.0 < changes < MAX_STEPPED_SHARE


def is_set_by_program(values: np.ndarray) -> bool:
    """Whether a column rests exactly on several levels for a good part of the time, as no measurement does."""
    known = values[np.isfinite(values)]
    edges = np.flatnonzero(np.diff(known) != 0.0)
    if len(edges) < 2:
        return False
    starts, ends = np.concatenate(([0], edges + 1)), np.concatenate((edges + 1, [len(known)]))
    long = ends - starts >= MIN_LEVEL_ROWS
    levels = np.unique(known[starts[long]])
    resting = float(np.sum((ends - starts)[long & (known[starts] != 0.0)]))
    return len(levels) >= 2 and resting > MIN_LEVEL_SHARE * len(known)


def find_resting_limit(recordings: Sequence[np.ndarray]) -> float | None:
    """Return the magnitude at which a channel rests again and again, None if it rests at none.

    A drive that reaches its limit stays there for some samples, and at the same largest number each time.
    """
    largest = max((float(np.nanmax(np.abs(x))) for x in recordings if np.isfinite(x).any()), default=0.0)
    if largest == 0.0:
        return None
    runs = 0
    for values in recordings:
        at = np.abs(np.abs(values) - largest) <= 1e-9 * largest
        edges = np.flatnonzero(np.diff(np.concatenate(([False], at, [False])).astype(int)))
        runs += int(np.sum(edges[1::2] - edges[::2] >= MIN_LIMIT_ROWS))
    return largest if runs >= MIN_LIMIT_RUNS else None


def _best_lag(x: np.ndarray, y: np.ndarray) -> tuple[int, float]:
    """Return by how many rows `y` is later than `x`, and the correlation there."""
    reach = max(1, int(MAX_SHIFT_SHARE * len(x)))
    size = 2 ** int(np.ceil(np.log2(2 * len(x))))
    product = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
    around = np.concatenate((product[-reach:], product[: reach + 1]))
    at = int(np.argmax(around))
    return at - reach, float(around[at] / (np.linalg.norm(x) * np.linalg.norm(y)))
