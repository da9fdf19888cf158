"""Find values that roll over: jumps of one size between both ends of a channel's range."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .study_file import ChannelSpec

@dataclass(frozen=True)
class RolloverRule:
    """Thresholds by which jumps count as a value that rolls over. Chosen by judgement; no measurement is recorded."""

    # Every jump of a rollover is larger than this share of the channel's range. Chosen by judgement; no measurement
    # is recorded, as for the other thresholds here.
    min_jump_share: float = 0.8
    max_jumping_share: float = 0.05  # At most this share of the samples jump
    max_other_step_share: float = 0.25  # Every step that is no jump is at most this share of the period
    # The sizes of the jumps, corrected for the motion between samples, differ by at most this share of the period
    jump_tolerance: float = 0.05
    # At least this many samples lie in the outer fifth of the range at either end; a spike has fewer there
    min_end_samples: int = 8
    # A value that rolls over has at least this many levels. The last digit of a value at rest flickers between two.
    min_level_count: int = 16
    # A period counts as that of a common encoder if it differs from it by at most this share
    period_tolerance: float = 0.02


ROLLOVER_RULE = RolloverRule()


ENCODER_PERIODS_DEG = (360.0, 180.0, 90.0, 720.0)
"""Periods of common encoders of angles [deg]."""

BLOCK_SAMPLES = 1 << 16
"""The first search runs in blocks of this many samples, which saves memory."""

@dataclass(frozen=True)
class Rollover:
    """A value that rolls over."""

    period: float  # size of the jumps in the channel's SI unit
    jumps: np.ndarray  # index of the sample after each jump, shape (k,)


def find_rollover(samples: np.ndarray) -> Rollover | None:
    """Return how `samples`, (n,), roll over; None if they do not."""
    low, high = float(np.min(samples, initial=np.inf)), float(np.max(samples, initial=-np.inf))
    # Most recordings have no jump. The search in blocks shows that without an array as long as the recording.
    if np.isfinite(high - low) and not any(
        np.any(np.abs(np.diff(samples[i : i + BLOCK_SAMPLES + 1])) > ROLLOVER_RULE.min_jump_share * (high - low))
        for i in range(0, len(samples), BLOCK_SAMPLES)
    ):
        return None
    known = np.flatnonzero(np.isfinite(samples))
    x = samples[known]
    if len(x) < 20 or len(np.unique(x)) < ROLLOVER_RULE.min_level_count:
        return None
    steps, low, high = np.diff(x), float(x.min()), float(x.max())
    leaps = np.abs(steps) > ROLLOVER_RULE.min_jump_share * (high - low)
    jumps = np.flatnonzero(leaps)
    if not 0 < jumps.size <= ROLLOVER_RULE.max_jumping_share * len(x):
        return None
    other_steps = np.where(leaps, 0.0, steps)
    # The machine's own motion during a jump is estimated from the two steps before and after it.
    near = np.pad(~leaps, 2)[jumps[:, None] + np.arange(5)], np.pad(other_steps, 2)[jumps[:, None] + np.arange(5)]
    motion = near[1].sum(axis=1) / np.maximum(near[0].sum(axis=1), 1)
    sizes = np.abs(steps[jumps] - motion)
    period = float(np.median(sizes))
    fifth = 0.2 * (high - low)
    ends = min(int((x > high - fifth).sum()), int((x < low + fifth).sum()))
    if (
        np.abs(other_steps).max() > ROLLOVER_RULE.max_other_step_share * period
        or ends < ROLLOVER_RULE.min_end_samples
        or np.abs(sizes - period).max() > ROLLOVER_RULE.jump_tolerance * period
    ):
        return None
    return Rollover(period, known[jumps + 1])


def wrap_setting(found: Rollover, spec: ChannelSpec) -> str:
    """Return the setting for study.toml that unwraps a channel; "" for a single jump that fits no common encoder.

    Such a jump may have any other cause.
    """
    counts = found.period / abs(spec.si_factor * spec.scale)
    bits = round(math.log2(counts)) if counts > 1.0 else 0
    if bits >= 8 and abs(counts / 2.0**bits - 1.0) < ROLLOVER_RULE.period_tolerance:
        return f"wrap_bits = {bits}"
    for turn in ENCODER_PERIODS_DEG if spec.si_unit == "rad" else ():
        if abs(found.period / math.radians(turn) - 1.0) < ROLLOVER_RULE.period_tolerance:
            return f'wrap = "{turn:g} deg"'
    return f'wrap = "{found.period / abs(spec.si_factor):.4g} {spec.unit}"' if len(found.jumps) > 1 else ""
