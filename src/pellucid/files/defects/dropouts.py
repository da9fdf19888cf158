"""Find dropouts: a lost signal, which repeats one value for a while in a channel that otherwise never rests.

The thresholds were chosen by judgement; no measurement is recorded for any. `research/evidence/spoilt.py` counts
what they miss in recordings with known defects.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .clipped import is_at_limit
from .watched import (
    INERTIAL_CHANNELS,
    WatchedRecording,
    find_runs,
    is_out_of_contact,
    joint_ending,
    repeats_next,
)

KIND = "dropout"


@dataclass(frozen=True)
class DropoutLimits:
    """When a stretch of one value is a dropout."""

    # A dropout has at least this many samples of one value.
    min_dropout_samples: int = 10
    # A dropout is at least this many times as long as the longest run of one value that is no dropout.
    min_length_ratio: float = 5.0
    # This ratio of lengths is enough if the signal leaps by `min_high_leap_ratio` usual steps at both ends.
    min_length_ratio_with_high_leap: float = 1.5
    # More long runs of one value than this in a recording mean that the channel rests by itself.
    max_dropout_count: int = 20
    # A larger share of the samples in long runs of one value also means that the channel rests by itself.
    max_dropout_share: float = 0.05
    # A channel that holds one value for longer than this [s] was switched off.
    max_dropout_s: float = 1.0
    # At both ends of a dropout the signal leaps by at least this many usual steps.
    min_leap_ratio: float = 5.0
    # This many usual steps are required if the run is shorter than `DROPOUT_LIMITS.min_length_ratio` asks.
    min_high_leap_ratio: float = 25.0
    # At both ends of a dropout the signal leaps by at least this many times the channel's resolution.
    min_resolution_ratio: float = 8.0
    # A body moves during a dropout if it covers this share of the distance that is typical of so much time.
    min_travel_share: float = 0.1


DROPOUT_LIMITS = DropoutLimits()


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for each dropout in the channels that the study reads.

    A dropout is a run of one value that is much longer than others. In addition the signal leaps at both ends, or a
    drive's value is held at another value than zero, or the body moves meanwhile.
    """
    for name in watched.channels:
        x, own = watched.samples(name), f"position{joint_ending(name)}"
        position = own if own in watched.channels else "position"
        moved = watched.samples(position) if position in watched.channels else None
        first, length = find_runs(repeats_next(x))
        length = length + 1
        much_longer = set(_outstanding_runs(length, len(x), DROPOUT_LIMITS.min_length_ratio).tolist())
        for i in _outstanding_runs(length, len(x), DROPOUT_LIMITS.min_length_ratio_with_high_leap).tolist():
            a, b = int(first[i]), int(first[i] + length[i] - 1)
            if length[i] > DROPOUT_LIMITS.max_dropout_s * watched.recording.fs or _is_at_extreme(watched, name, x, a):
                continue
            if is_out_of_contact(watched, name, a, b):
                continue
            least = DROPOUT_LIMITS.min_leap_ratio if i in much_longer else DROPOUT_LIMITS.min_high_leap_ratio
            lost = _has_leaps(x, a, b, least)
            if i in much_longer and not lost and not _is_motion(name):
                # A drive at zero may be switched off for a while; one that is on has noise.
                held = x[a] != 0.0 and a > 0 and b < len(x) - 1
                lost = held or (moved is not None and _has_moved(moved, a, b))
            if lost:
                many = f"the one value {x[a]:z.6g}{watched.recording.channels[name].unit_words} in {length[i]} samples"
                yield make_cut(watched.recording, KIND, name, first=a, last=b, found=f"a dropout, {many}")


def _is_motion(name: str) -> bool:
    return name.partition(".")[0] in INERTIAL_CHANNELS


def _outstanding_runs(length: np.ndarray, n: int, min_ratio: float) -> np.ndarray:
    """Return the indices of the runs, among `n` samples, that are at least `min_ratio` times as long as all others."""
    order = np.argsort(length)[::-1][: DROPOUT_LIMITS.max_dropout_count + 1]
    longest = np.append(length[order], 1).astype(float)
    gaps = np.flatnonzero(longest[:-1] >= min_ratio * longest[1:])
    # Runs shorter than a dropout easily differ by this ratio.
    gaps = gaps[longest[gaps] >= DROPOUT_LIMITS.min_dropout_samples]
    count = int(gaps[-1]) + 1 if gaps.size else 0
    kept = order[: count if count <= DROPOUT_LIMITS.max_dropout_count else 0]
    few = length[kept].sum() <= DROPOUT_LIMITS.max_dropout_share * n
    return np.sort(kept[length[kept] >= DROPOUT_LIMITS.min_dropout_samples]) if few else kept[:0]


def _is_at_extreme(watched: WatchedRecording, name: str, x: np.ndarray, at: int) -> bool:
    """Whether sample `at` is at a known limit or at the channel's largest or smallest value, as at an end stop."""
    value = x[at]
    return is_at_limit(watched, name, value) or value >= np.nanmax(x) or value <= np.nanmin(x)


def _has_leaps(x: np.ndarray, a: int, b: int, times: float) -> bool:
    """Whether the signal leaps to the value of samples `a` to `b` and back, by `times` usual steps and by
    `DROPOUT_LIMITS.min_resolution_ratio` times its resolution."""
    if a == 0 or b + 1 >= len(x):
        return False
    there, back = x[a] - x[a - 1], x[b] - x[b + 1]
    around = np.abs(np.concatenate([np.diff(x[max(a - 25, 0) : a]), np.diff(x[b + 1 : b + 26])]))
    around = around[np.isfinite(around)]
    usual = float(np.quantile(around, 0.75)) if around.size else np.inf
    leap = min(abs(there), abs(back))
    if there * back <= 0.0 or leap <= times * usual:
        return False
    steps = np.abs(np.diff(x))
    return leap > DROPOUT_LIMITS.min_resolution_ratio * float(np.min(steps, where=steps > 0.0, initial=np.inf))


def _has_moved(q: np.ndarray, a: int, b: int) -> bool:
    """Whether a body at positions `q` moves in both halves of samples `a` to `b`; see `min_travel_share`."""
    half = (b - a) // 2
    travel = np.abs(q[half:] - q[: len(q) - half])
    travel = travel[np.isfinite(travel)]
    typical = float(np.quantile(travel, 0.9)) if travel.size else np.inf
    halves = np.abs([q[a + half] - q[a], q[a + 2 * half] - q[a + half]])
    return typical > 0.0 and bool(np.all(halves >= DROPOUT_LIMITS.min_travel_share * typical))
