"""Find channels on another clock: each value is held over the same number of rows, for it is sampled more slowly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

KIND = "another_clock"

MIN_HELD_ROWS = 2
"""A value is held if it stays for at least this many rows."""

MIN_REGULAR_SHARE = 0.8
"""At least this share of the holds have the usual length, give or take a row. Chosen by judgement: at rest, and between
two steps of an encoder, values stay for irregular times."""

MIN_HOLD_COUNT = 20
"""Fewer holds than this do not show a clock."""

MAX_FRESH_SHARE = 0.75
"""At most this share of the rows bring a new value."""


@dataclass(frozen=True)
class HeldChannel:
    """A channel that is updated more slowly than the rows of the log."""

    rows: float  # mean number of rows for which a value is held
    regular: float  # share of the holds that have the usual length


def find_held(x: np.ndarray) -> HeldChannel | None:
    """Return how a channel `x`, (n,), is held between its own samples; None if it is sampled with every row."""
    x = x[np.isfinite(x)]
    fresh = np.flatnonzero(np.diff(x) != 0.0) + 1
    if fresh.size < MIN_HOLD_COUNT or fresh.size > MAX_FRESH_SHARE * len(x):
        return None
    lengths = np.diff(fresh)
    usual = float(np.median(lengths))
    if usual < MIN_HELD_ROWS:
        return None
    # A value that happens to repeat makes a hold of twice the usual length.
    multiples = np.maximum(1.0, np.round(lengths / usual))
    regular = float(np.mean(np.abs(lengths - multiples * usual) <= np.where(usual > 2.5, 1.0, 0.0)))
    spread = float(np.mean(multiples == 1.0))
    if regular < MIN_REGULAR_SHARE or spread < MIN_REGULAR_SHARE:
        return None
    return HeldChannel(float(np.mean(lengths)), regular)
