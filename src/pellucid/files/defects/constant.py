"""Find constant channels, and channels that fall silent while the rest of the log goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .watched import find_runs, repeats_next

KIND = "dead"


@dataclass(frozen=True)
class SilenceLimits:
    """When a channel is dead, and when it fell silent."""

    # Values count as equal if they differ by less than this share of the largest one, which unit conversion may
    # cause.
    same_value_tolerance: float = 1e-9
    # Largest number of neighbouring values of a dead channel, because the last digit of its converter may
    # fluctuate.
    max_dead_levels: int = 3
    # Number of samples, spread over a recording, that are checked first. They suffice for most live channels.
    level_sample_count: int = 5000
    # A channel fell silent only if it holds one value for at least this many samples. Chosen by judgement, as the
    # other thresholds here; `python -m research.evidence formats` counts what they miss.
    min_silent_samples: int = 50
    # A channel fell silent only if it holds one value for at least this share of the log.
    min_silent_share: float = 0.03
    # The silent stretch is at least this many times as long as the longest other stretch of one value.
    min_run_ratio: float = 10.0


SILENCE_LIMITS = SilenceLimits()


def finite_samples(samples: np.ndarray) -> np.ndarray:
    """Return the samples, (n,), that are finite; if all are, no copy, which hours of data have no memory for."""
    finite = np.isfinite(samples)
    return samples if finite.all() else samples[finite]


def few_levels(parts: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return the few neighbouring values that all samples of `parts`, each (n,), take.

    Returns None if there are more values, or if one is more than a single step from the next.
    """
    parts = [finite_samples(part) for part in parts]
    for thin in (True, False):
        values = np.concatenate(
            [p[:: max(1, len(p) // SILENCE_LIMITS.level_sample_count) if thin else 1] for p in parts]
        )
        if not values.size:
            return np.zeros(0)
        tolerance = SILENCE_LIMITS.same_value_tolerance * float(np.abs(values).max())
        levels = np.unique(values)
        levels = levels[np.append(True, np.diff(levels) > tolerance)]
        if levels.size > SILENCE_LIMITS.max_dead_levels:
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
    enough = max(
        SILENCE_LIMITS.min_silent_samples,
        SILENCE_LIMITS.min_silent_share * len(x),
        SILENCE_LIMITS.min_run_ratio * float(others),
    )
    if length[longest] < enough or length[longest] > len(x) - SILENCE_LIMITS.min_silent_samples:
        return None
    return int(first[longest]), int(first[longest] + length[longest] - 1)
