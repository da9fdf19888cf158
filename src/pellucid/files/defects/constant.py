"""Find constant channels, and channels that fall silent while the rest of the log goes on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .watched import find_runs, repeats_next

KIND = "dead"

SAME_VALUE_TOLERANCE = 1e-9
"""Values count as equal if they differ by less than this share of the largest one, which unit conversion may cause."""

MAX_DEAD_LEVELS = 3
"""Largest number of neighbouring values of a dead channel, because the last digit of its converter may fluctuate."""

LEVEL_SAMPLE_COUNT = 5000
"""Number of samples, spread over a recording, that are checked first. They suffice for most live channels."""

MIN_SILENT_SAMPLES = 50
"""A channel fell silent only if it holds one value for at least this many samples. Chosen by judgement, as the other
thresholds here; `python -m research.evidence formats` counts what they miss."""

MIN_SILENT_SHARE = 0.03
"""A channel fell silent only if it holds one value for at least this share of the log."""

MIN_RUN_RATIO = 10.0
"""The silent stretch is at least this many times as long as the longest other stretch of one value."""


def few_levels(parts: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return the few neighbouring values that all samples of `parts`, each (n,), take.

    Returns None if there are more values, or if one is more than a single step from the next.
    """
    parts = [part[np.isfinite(part)] for part in parts]
    for thin in (True, False):
        values = np.concatenate([p[:: max(1, len(p) // LEVEL_SAMPLE_COUNT) if thin else 1] for p in parts])
        if not values.size:
            return np.zeros(0)
        tolerance = SAME_VALUE_TOLERANCE * float(np.abs(values).max())
        levels = np.unique(values)
        levels = levels[np.append(True, np.diff(levels) > tolerance)]
        if levels.size > MAX_DEAD_LEVELS:
            return None
    steps = np.diff(levels)
    return levels if steps.size < 2 or steps.max() < 1.5 * steps.min() else None


def silent_stretch(x: np.ndarray) -> tuple[int, int] | None:
    """Return first and last sample of the stretch in which a channel `x`, (n,), that otherwise never rests is silent.

    Returns None without such a stretch, and for a channel that rests by itself, as a command does.
    """
    first, length = find_runs(repeats_next(x))
    length = length + 1
    if not length.size:
        return None
    longest = int(np.argmax(length))
    others = np.delete(length, longest).max(initial=1)
    enough = max(MIN_SILENT_SAMPLES, MIN_SILENT_SHARE * len(x), MIN_RUN_RATIO * float(others))
    if length[longest] < enough or length[longest] > len(x) - MIN_SILENT_SAMPLES:
        return None
    return int(first[longest]), int(first[longest] + length[longest] - 1)
