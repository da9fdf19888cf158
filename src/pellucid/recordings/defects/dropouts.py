"""A channel that stays one value for a while, though it never rests otherwise: a signal that was lost."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..cut import Cut, cut_of
from .clipped import at_limit
from .watched import MOTION, Watched, ending_of, runs, stays

KIND = "dropout"

SHORTEST = 10
"""Samples of one value from which on a dropout is looked for."""

APART = 5.0
"""How many times longer than any other run of one value a dropout is."""

NEAR = 1.5
"""And where it leaps by `SURE` times the usual step."""

MOST = 20
"""Dropouts in a recording beyond which resting is the channel's way."""

MOST_SHARE = 0.05
"""Share of the samples in dropouts beyond which it is, too."""

LONGEST = 1.0
"""A channel that stays one value for longer [s] was switched off."""

LEAP = 5.0
"""A value that is lost and comes back leaps by this many times the usual step on either side."""

SURE = 25.0
"""And by this many times where its length alone says little."""

QUANTA = 8.0
"""And by this many times the channel's resolution."""

MOVES = 0.1
"""Share of the typical way that a body goes in the time of a dropout, if it moves."""


def find(watched: Watched) -> Iterator[Cut]:
    """Runs of one value that stand out by their length, and that leap at both ends, are held at no zero, or during
    which the body moves."""
    for name in watched.channels:
        x, own = watched.samples(name), f"position{ending_of(name)}"
        position = own if own in watched.channels else "position"
        moved = watched.samples(position) if position in watched.channels else None
        first, length = runs(stays(x))
        length = length + 1
        far = set(_outstanding(length, len(x), APART).tolist())
        for i in _outstanding(length, len(x), NEAR).tolist():
            a, b = int(first[i]), int(first[i] + length[i] - 1)
            if length[i] > LONGEST * watched.recording.fs or _limited(watched, name, x, a):
                continue
            lost = _leaps(x, a, b, LEAP if i in far else SURE)
            if i in far and not lost and not _is_motion(name):
                # A drive may be switched off for a while; one that is on has noise.
                held = x[a] != 0.0 and a > 0 and b < len(x) - 1
                lost = held or (moved is not None and _moves(moved, a, b))
            if lost:
                many = f"the one value {x[a]:.6g} {watched.recording.channels[name].unit} in {length[i]} samples"
                yield cut_of(watched.recording, KIND, name, a, b, f"a dropout, {many}")


def _is_motion(name: str) -> bool:
    return name.partition(".")[0] in MOTION


def _outstanding(length: np.ndarray, n: int, apart: float) -> np.ndarray:
    """Which runs are so many times longer than all others of `n` samples."""
    order = np.argsort(length)[::-1][: MOST + 1]
    longest = np.append(length[order], 1).astype(float)
    gaps = np.flatnonzero(longest[:-1] >= apart * longest[1:])
    # Below the shortest dropout any two runs are that far apart.
    gaps = gaps[longest[gaps] >= SHORTEST]
    count = int(gaps[-1]) + 1 if gaps.size else 0
    kept = order[: count if count <= MOST else 0]
    return np.sort(kept[length[kept] >= SHORTEST]) if length[kept].sum() <= MOST_SHARE * n else kept[:0]


def _limited(watched: Watched, name: str, x: np.ndarray, at: int) -> bool:
    """Whether it rests where it is largest: that is a limit, or a stop."""
    value = x[at]
    return at_limit(watched, name, value) or value >= np.nanmax(x) or value <= np.nanmin(x)


def _leaps(x: np.ndarray, a: int, b: int, times: float) -> bool:
    """Whether it leaves for one value at once, and comes back from it at once, by so many times the usual step, and
    by some times its resolution."""
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
    return leap > QUANTA * float(np.min(steps, where=steps > 0.0, initial=np.inf))


def _moves(q: np.ndarray, a: int, b: int) -> bool:
    """Whether a body goes on in both halves of samples `a` to `b` as it typically does in that time."""
    half = (b - a) // 2
    way = np.abs(q[half:] - q[: len(q) - half])
    way = way[np.isfinite(way)]
    usual = float(np.quantile(way, 0.9)) if way.size else np.inf
    parts = np.abs([q[a + half] - q[a], q[a + 2 * half] - q[a + half]])
    return usual > 0.0 and bool(np.all(parts >= MOVES * usual))
