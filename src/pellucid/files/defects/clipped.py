"""Find clipped samples: a channel that is flat at its largest or smallest value, and steep before and after.

The thresholds were chosen by judgement; no measurement is recorded for any. `research/evidence/spoilt.py` counts
what they miss in recordings with known defects.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .rest import comes_to_rest, is_at_rest, is_own_speed
from .scale import Scale
from .watched import INERTIAL_CHANNELS, WatchedRecording, find_runs, finite_range, is_out_of_contact, joint_ending

KIND = "clipped"


@dataclass(frozen=True)
class ClipLimits:
    """When flat tops are those of a channel that is clipped."""

    # A channel is clipped at one end only if its flat runs there have at least this many samples together.
    min_clipped_samples: int = 5
    # A single flat run counts only if it has at least this share of all samples. A single peak may happen to be
    # flat.
    min_single_run_share: float = 0.005
    # A flat run is the top of a round peak if it is at most this many times as long as the level beside it. On a
    # coarse grid the ratio reaches about 5; noise raises it.
    max_peak_length_ratio: int = 8
    # The length of the level beside a flat run is counted up to this many samples.
    max_level_samples: int = 64
    # A command at this share of a known limit is at the limit.
    limit_share: float = 0.98
    # Shorter runs at the largest value are not examined: two equal samples at a peak are common.
    min_flat_run_samples: int = 3


CLIP_LIMITS = ClipLimits()


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for each flat run, except at limits that are known or that the study accepts."""
    for name in watched.channels:
        if name in watched.accepted or name == "reference":
            continue
        for sign in (1.0, -1.0):
            x = watched.samples(name)
            firsts, lengths = flat_tops(sign * x)
            if firsts.size == 0 or is_at_limit(watched, name, x[firsts[0]]):
                continue
            for first, length in zip(firsts.tolist(), lengths.tolist(), strict=True):
                if is_dwell(watched, name, first, first + length - 1):
                    continue
                found = f"{length} samples clipped at {x[first]:.6g}{watched.recording.channels[name].unit_words}"
                yield make_cut(watched.recording, KIND, name, first=first, last=first + length - 1, found=found)


def is_at_limit(watched: WatchedRecording, name: str, value: float) -> bool:
    """Whether `value` of channel `name` is at a known limit."""
    return any(abs(value) >= CLIP_LIMITS.limit_share * limit for limit in watched.limits.get(name, ()))


def is_dwell(watched: WatchedRecording, name: str, first: int, last: int) -> bool:
    """Whether a flat run is what the joint did: it rested at its largest position, moved at a constant speed, or was
    out of contact."""
    if is_out_of_contact(watched, name, first, last):
        return True
    head, channels = name.partition(".")[0], watched.recording.channels
    if head in INERTIAL_CHANNELS:
        return comes_to_rest(watched.samples(name), first, last) or is_at_rest(watched, name, first, last)
    position = f"position{joint_ending(name)}"
    if head == "velocity" and position in channels:
        arrays = channels[position].samples, channels[name].samples, watched.recording.time
        return is_own_speed(*arrays, first, last)
    return False


def flat_tops(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return first index and length of the runs in which `x`, shape (n,), is clipped at its maximum."""
    none = np.zeros(0, int), np.zeros(0, int)
    low, top = finite_range(x)
    if low > top:
        return none
    starts, lengths = find_runs(x >= top - 1e-9 * (top - low))
    long = lengths >= CLIP_LIMITS.min_flat_run_samples
    starts, lengths = starts[long], lengths[long]
    if starts.size == 0:
        return none
    scale = Scale(x)
    if scale.range == 0.0 or scale.typical == 0.0:
        return none
    k = scale.stride
    before, after = starts - 1, starts + lengths
    inner = (before - k >= 0) & (after + k < len(x))  # at a border, clipping and resting look the same
    starts, lengths, before, after = (each[inner] for each in (starts, lengths, before, after))
    slope = np.minimum(x[before] - x[before - k], x[after] - x[after + k])
    # The height that was cut off is about the slope into the run times the run's length. A round peak that is not
    # clipped has about one resolution of it. It has more if the stride of the slope is as wide as the run.
    unclipped = scale.resolution * (1 + k / lengths)
    steep = (slope > 0.1 * scale.typical) & (slope / k * lengths / 4 > 2 * unclipped)
    steep &= ~_are_round_peaks(x, starts, lengths)
    starts, lengths = starts[steep], lengths[steep]
    min_samples: float = CLIP_LIMITS.min_clipped_samples
    if starts.size <= 1:
        min_samples = max(min_samples, CLIP_LIMITS.min_single_run_share * len(x))
    return (starts, lengths) if lengths.sum() >= min_samples else none


def _are_round_peaks(x: np.ndarray, starts: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return a mask of the runs that are tops of round peaks, which a coarse grid makes flat; their neighbouring
    levels are long too.
    """
    moved = np.abs(np.diff(x))
    small = 3.0 * float(np.median(moved[moved > 0.0]))
    reach, ends = np.arange(1, CLIP_LIMITS.max_level_samples), starts + lengths
    level_lengths, edge = np.zeros(len(starts), int), np.zeros(len(starts))
    for beside, away in ((starts - 1, -reach), (ends, reach)):
        is_level = x[np.clip(beside[:, None] + away, 0, len(x) - 1)] == x[beside][:, None]
        level_lengths = np.maximum(level_lengths, 1 + np.cumprod(is_level, axis=1).sum(axis=1))
        edge = np.maximum(edge, np.abs(x[beside] - x[starts]))
    return (lengths <= CLIP_LIMITS.max_peak_length_ratio * level_lengths) & (edge <= small)
