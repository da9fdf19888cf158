"""Find dropouts: a lost signal, which repeats one value for a while in a channel that otherwise never rests.

The thresholds were chosen by judgement; no measurement is recorded for any. `research/evidence/spoilt.py` counts
what they miss in recordings with known defects.
"""

from __future__ import annotations

from collections.abc import Iterator

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

MIN_DROPOUT_SAMPLES = 10
"""A dropout has at least this many samples of one value."""

MIN_LENGTH_RATIO = 5.0
"""A dropout is at least this many times as long as the longest run of one value that is no dropout."""

MIN_LENGTH_RATIO_WITH_HIGH_LEAP = 1.5
"""This ratio of lengths is enough if the signal leaps by `MIN_HIGH_LEAP_RATIO` usual steps at both ends."""

MAX_DROPOUT_COUNT = 20
"""More long runs of one value than this in a recording mean that the channel rests by itself."""

MAX_DROPOUT_SHARE = 0.05
"""A larger share of the samples in long runs of one value also means that the channel rests by itself."""

MAX_DROPOUT_S = 1.0
"""A channel that holds one value for longer than this [s] was switched off."""

MIN_LEAP_RATIO = 5.0
"""At both ends of a dropout the signal leaps by at least this many usual steps."""

MIN_HIGH_LEAP_RATIO = 25.0
"""This many usual steps are required if the run is shorter than `MIN_LENGTH_RATIO` asks."""

MIN_RESOLUTION_RATIO = 8.0
"""At both ends of a dropout the signal leaps by at least this many times the channel's resolution."""

MIN_TRAVEL_SHARE = 0.1
"""A body moves during a dropout if it covers this share of the distance that is typical of so much time."""


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
        much_longer = set(_outstanding_runs(length, len(x), MIN_LENGTH_RATIO).tolist())
        for i in _outstanding_runs(length, len(x), MIN_LENGTH_RATIO_WITH_HIGH_LEAP).tolist():
            a, b = int(first[i]), int(first[i] + length[i] - 1)
            if length[i] > MAX_DROPOUT_S * watched.recording.fs or _is_at_extreme(watched, name, x, a):
                continue
            if is_out_of_contact(watched, name, a, b):
                continue
            lost = _has_leaps(x, a, b, MIN_LEAP_RATIO if i in much_longer else MIN_HIGH_LEAP_RATIO)
            if i in much_longer and not lost and not _is_motion(name):
                # A drive at zero may be switched off for a while; one that is on has noise.
                held = x[a] != 0.0 and a > 0 and b < len(x) - 1
                lost = held or (moved is not None and _has_moved(moved, a, b))
            if lost:
                many = f"the one value {x[a]:.6g} {watched.recording.channels[name].unit} in {length[i]} samples"
                yield make_cut(watched.recording, KIND, name, first=a, last=b, found=f"a dropout, {many}")


def _is_motion(name: str) -> bool:
    return name.partition(".")[0] in INERTIAL_CHANNELS


def _outstanding_runs(length: np.ndarray, n: int, min_ratio: float) -> np.ndarray:
    """Return the indices of the runs, among `n` samples, that are at least `min_ratio` times as long as all others."""
    order = np.argsort(length)[::-1][: MAX_DROPOUT_COUNT + 1]
    longest = np.append(length[order], 1).astype(float)
    gaps = np.flatnonzero(longest[:-1] >= min_ratio * longest[1:])
    # Runs shorter than a dropout easily differ by this ratio.
    gaps = gaps[longest[gaps] >= MIN_DROPOUT_SAMPLES]
    count = int(gaps[-1]) + 1 if gaps.size else 0
    kept = order[: count if count <= MAX_DROPOUT_COUNT else 0]
    few = length[kept].sum() <= MAX_DROPOUT_SHARE * n
    return np.sort(kept[length[kept] >= MIN_DROPOUT_SAMPLES]) if few else kept[:0]


def _is_at_extreme(watched: WatchedRecording, name: str, x: np.ndarray, at: int) -> bool:
    """Whether sample `at` is at a known limit or at the channel's largest or smallest value, as at an end stop."""
    value = x[at]
    return is_at_limit(watched, name, value) or value >= np.nanmax(x) or value <= np.nanmin(x)


def _has_leaps(x: np.ndarray, a: int, b: int, times: float) -> bool:
    """Whether the signal leaps to the value of samples `a` to `b` and back, by `times` usual steps and by
    `MIN_RESOLUTION_RATIO` times its resolution."""
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
    return leap > MIN_RESOLUTION_RATIO * float(np.min(steps, where=steps > 0.0, initial=np.inf))


def _has_moved(q: np.ndarray, a: int, b: int) -> bool:
    """Whether a body at positions `q` moves in both halves of samples `a` to `b`; see `MIN_TRAVEL_SHARE`."""
    half = (b - a) // 2
    travel = np.abs(q[half:] - q[: len(q) - half])
    travel = travel[np.isfinite(travel)]
    typical = float(np.quantile(travel, 0.9)) if travel.size else np.inf
    halves = np.abs([q[a + half] - q[a], q[a + 2 * half] - q[a + half]])
    return typical > 0.0 and bool(np.all(halves >= MIN_TRAVEL_SHARE * typical))
