"""Tell recordings of maximal contractions from recordings of movement by the shape of their EMG.

In a maximal contraction a muscle is held at its highest level for seconds. In movements such as gait it works in bursts
that are shorter than a second.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage


@dataclass(frozen=True)
class PlateauLimits:
    """When EMG holds a level as in a maximal contraction. Chosen by judgement; no measurement is recorded."""

    window_s: float = 0.25  # Window of the root mean square that is the level
    plateau_s: float = 1.0  # A level is held if the muscle stays above it for this long
    # A contraction is held if this share of its peak is
    min_held_share: float = 0.5
    # A muscle that is held at a lower level than this share of its peak in all recordings is at rest
    min_active_share: float = 0.2
    peak_quantile: float = 0.99  # Quantile of the level that is its peak


PLATEAU_LIMITS = PlateauLimits()


@dataclass(frozen=True)
class _Level:
    """Level of one muscle in one recording."""

    held: float  # Highest level that it stays above for `PLATEAU_LIMITS.plateau_s`
    peak: float  # Its peak


def find_maximal_contractions(recordings: Sequence[Mapping[str, np.ndarray]], rate: float) -> list[int]:
    """Return the places of the recordings that are maximal contractions, among those of one person and session.

    Each recording has EMG by muscle, (n,), raw or as an envelope, at a `rate` [Hz]. A maximal contraction holds at
    least one muscle above its peak in every recording of movement, of which there must be one: contractions that are
    all held may be of any level.
    """
    levels = [{muscle: _level(x, rate) for muscle, x in each.items()} for each in recordings]
    tops: dict[str, float] = {}
    for each in levels:
        for muscle, level in each.items():
            tops[muscle] = max(tops.get(muscle, 0.0), level.peak)

    def is_held(muscle: str, level: _Level) -> bool:
        is_active = level.peak > PLATEAU_LIMITS.min_active_share * tops[muscle]
        return is_active and level.held >= PLATEAU_LIMITS.min_held_share * level.peak

    held = [{m: level for m, level in each.items() if is_held(m, level)} for each in levels]
    movements = [each for each, own in zip(levels, held, strict=True) if not own]
    if not movements:
        return []

    def exceeds(muscle: str, level: _Level) -> bool:
        return all(level.held > each[muscle].peak for each in movements if muscle in each)

    return [i for i, own in enumerate(held) if any(exceeds(m, level) for m, level in own.items())]


def _level(x: np.ndarray, rate: float) -> _Level:
    """Return the level of one muscle, (n,)."""
    known = np.where(np.isfinite(x), x, 0.0)
    # An envelope has a mean, and raw EMG may have an offset.
    known = known - np.median(known) if np.any(known < 0.0) else known
    window, plateau = (max(1, round(s * rate)) for s in (PLATEAU_LIMITS.window_s, PLATEAU_LIMITS.plateau_s))
    if len(known) < 2 * plateau:
        return _Level(0.0, 0.0)
    rms = np.sqrt(np.maximum(ndimage.uniform_filter1d(known**2, window), 0.0))
    return _Level(
        float(ndimage.minimum_filter1d(rms, plateau).max()), float(np.quantile(rms, PLATEAU_LIMITS.peak_quantile))
    )
