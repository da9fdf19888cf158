"""Values that roll over: jumps of one size between both ends of what a channel shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .study_file import ChannelSpec

FROM_END_TO_END = 0.8
"""Share of a channel's range by which every jump leaps."""

MOST_JUMPS = 0.05
"""Share of the samples that may jump."""

CALM = 0.25
"""Share of the period below which every other step is."""

ALIKE = 0.05
"""Share of the period by which jumps may differ, the motion between their samples taken off."""

AT_AN_END = 8
"""Samples in the outer fifth at either end of the range: a spike has fewer there."""

TURNS = (360.0, 180.0, 90.0, 720.0)
"""Periods that encoders of angles have [deg]."""

PIECE = 1 << 16  # samples

ROUND = 0.02
"""Share by which a period may be off one that encoders have."""


@dataclass(frozen=True)
class Rollover:
    """The period, in the channel's SI unit, and the samples after each jump, (k,)."""

    period: float
    jumps: np.ndarray


def rollover(samples: np.ndarray) -> Rollover | None:
    """How `samples`, (n,), roll over, if they do."""
    low, high = float(np.min(samples, initial=np.inf)), float(np.max(samples, initial=-np.inf))
    # Of hours, most often nothing leaps: seen piece by piece, without an array as long as they are.
    if np.isfinite(high - low) and not any(
        np.any(np.abs(np.diff(samples[i : i + PIECE + 1])) > FROM_END_TO_END * (high - low))
        for i in range(0, len(samples), PIECE)
    ):
        return None
    known = np.flatnonzero(np.isfinite(samples))
    x = samples[known]
    if len(x) < 20:
        return None
    steps, low, high = np.diff(x), float(x.min()), float(x.max())
    leaps = np.abs(steps) > FROM_END_TO_END * (high - low)
    jumps = np.flatnonzero(leaps)
    if not 0 < jumps.size <= MOST_JUMPS * len(x):
        return None
    calm = np.where(leaps, 0.0, steps)
    # What the machine moved meanwhile, from the two steps before and after.
    near = np.pad(~leaps, 2)[jumps[:, None] + np.arange(5)], np.pad(calm, 2)[jumps[:, None] + np.arange(5)]
    around = near[1].sum(axis=1) / np.maximum(near[0].sum(axis=1), 1)
    sizes = np.abs(steps[jumps] - around)
    period = float(np.median(sizes))
    fifth = 0.2 * (high - low)
    ends = min(int((x > high - fifth).sum()), int((x < low + fifth).sum()))
    if np.abs(calm).max() > CALM * period or ends < AT_AN_END or np.abs(sizes - period).max() > ALIKE * period:
        return None
    return Rollover(period, known[jumps + 1])


def to_write(found: Rollover, spec: ChannelSpec) -> str:
    """What to write into study.toml of a channel that rolls over; nothing where a single jump is of no size that
    encoders have: it may be any other jump."""
    counts = found.period / abs(spec.si_factor * spec.scale)
    bits = round(math.log2(counts)) if counts > 1.0 else 0
    if bits >= 8 and abs(counts / 2.0**bits - 1.0) < ROUND:
        return f"wrap_bits = {bits}"
    for turn in TURNS if spec.si_unit == "rad" else ():
        if abs(found.period / math.radians(turn) - 1.0) < ROUND:
            return f'wrap = "{turn:g} deg"'
    return f'wrap = "{found.period / abs(spec.si_factor):.4g} {spec.unit}"' if len(found.jumps) > 1 else ""
