"""One or a few samples far from their neighbours on both sides, where the channel jumps nowhere else like that."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..cut import Cut, cut_of
from .watched import MOTION, Watched

KIND = "spike"

WIDEST = (5, 0.005)
"""Samples, and seconds, of which the larger number is the widest spike."""

AROUND = 12
"""Samples on either side that say how the channel changes there."""

LOCALLY = 8.0
"""A spike is this many times as high as three in four of the steps around it."""

ELSEWHERE = 2.0
"""And as many times as high as the largest step of the recording that is no spike."""

QUANTA = 8.0
"""And as many times as high as the channel's resolution."""

BEYOND = {"emg": 30.0, "acceleration": 3.0, "angular_velocity": 3.0}
"""Parts of names of channels in which a knock, or a muscle, is as sharp: a spike is so many times as high as all the
rest of the channel is wide."""

STEPS = 3.0
"""And where a channel without inertia begins or ends."""

SHARP = 0.4
"""Share of a spike's height by which it rises, and falls, in one step."""

RETURNS = 0.15
"""Share of a spike's height within which it comes back to where it left."""

ROUNDS = 5
"""Times that spikes are looked for among what is left."""

MOST = 20000
"""Steps that are looked at closely, the highest ones."""


def find(watched: Watched) -> Iterator[Cut]:
    """Spikes of every channel that is read."""
    for name in watched.channels:
        unit = watched.recording.channels[name].unit
        widest = max(WIDEST[0], round(WIDEST[1] * watched.recording.fs))
        x, inert = watched.samples(name), name.partition(".")[0] in MOTION
        found = _every(x, widest)
        beyond = max((BEYOND.get(part, 0.0) for part in name.split(".")), default=0.0)
        if found:
            rest = x.copy()
            for first, last, _ in found:
                rest[first : last + 1] = np.nan
            wide = float(np.nanmax(rest) - np.nanmin(rest)) if np.isfinite(rest).any() else 0.0
            # What begins or ends may step, unless it has inertia.
            ends = [each for each in found if each[0] == 0 or each[1] == len(x) - 1]
            found = [e for e in found if e[2] > wide * max(beyond, STEPS if e in ends and not inert else 0.0)]
        for first, last, height in found:
            yield cut_of(watched.recording, KIND, name, first, last, f"a spike of {height:.3g} {unit}")


def _every(x: np.ndarray, widest: int) -> list[tuple[int, int, float]]:
    """Spikes, and those that show once higher ones are gone."""
    found: list[tuple[int, int, float]] = []
    for _ in range(ROUNDS):
        more = spikes(x, widest)
        if not more:
            break
        found += more
        x = x.copy()
        for first, last, _ in more:
            x[first : last + 1] = np.nan
    return sorted(found)


def spikes(x: np.ndarray, widest: int) -> list[tuple[int, int, float]]:
    """First and last sample of each spike of `x`, shape (n,), and its height; at most `widest` samples."""
    n = len(x)
    if n < 4 * AROUND:
        return []
    steps = np.diff(x)
    np.abs(steps, out=steps)
    steps[~np.isfinite(steps)] = 0.0
    every = max(1, n // 200_000)
    usual, sparse = float(np.quantile(steps[::every], 0.99)), np.abs(x[::every])
    large = float(np.quantile(sparse[np.isfinite(sparse)], 0.99)) if np.isfinite(sparse).any() else 0.0
    quantum = float(np.min(steps, where=steps > 1e-9 * large, initial=np.inf))
    if not np.isfinite(quantum):
        return []
    leaps = np.flatnonzero(steps > max(QUANTA * quantum, 3.0 * usual))
    if leaps.size > MOST:
        leaps = np.sort(leaps[np.argpartition(steps[leaps], -MOST)[-MOST:]])
    first, last, height = _excursions(x, leaps, widest)
    # The largest step that is part of no excursion is what the channel itself can do.
    bounds = np.searchsorted(leaps, np.column_stack([first - 1, last + 1]))
    change = np.zeros(leaps.size + 1, int)
    np.add.at(change, bounds[:, 0], 1)
    np.add.at(change, bounds[:, 1], -1)
    own = np.cumsum(change)[:-1] == 0
    largest = max(float(steps[leaps[own]].max(initial=0.0)), usual)
    found, after = [], -1
    for a, b, h in zip(first.tolist(), last.tolist(), height.tolist(), strict=True):
        if h > ELSEWHERE * largest and h > QUANTA * quantum and a > after:
            found.append((a, b, h))
            after = b
    return found


def _excursions(x: np.ndarray, leaps: np.ndarray, widest: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First and last sample, and height, of each stretch of at most `widest` samples into which a leap leads and from
    which `x` comes back at once."""
    n = len(x)
    around = np.concatenate([np.arange(-AROUND, 0), np.arange(widest + 1, widest + 1 + AROUND)])
    places = leaps[:, None] + around
    inside = (places >= 0) & (places + 1 < n)
    with np.errstate(invalid="ignore"):
        change = np.where(inside, x[np.clip(places + 1, 0, n - 1)] - x[np.clip(places, 0, n - 1)], np.nan)
    known = np.isfinite(change).any(axis=1)
    leaps, change = leaps[known], change[known]
    if leaps.size == 0:
        return leaps, leaps, np.zeros(0)
    local = np.nanquantile(np.abs(change), 0.75, axis=1)
    trend = np.nanmedian(change, axis=1)
    later = leaps[:, None] + 1 + np.arange(widest + 1)
    ahead = np.where(later < n, x[np.minimum(later, n - 1)], np.nan)
    off = ahead - x[leaps][:, None] - trend[:, None] * np.arange(1, widest + 2)
    peak = np.maximum.accumulate(np.abs(off), axis=1)[:, :-1]
    rise = np.abs(off[:, :1])
    fall = np.abs(np.diff(off, axis=1))
    with np.errstate(invalid="ignore"):
        back = np.abs(off[:, 1:]) <= np.maximum(RETURNS * peak, np.minimum(LOCALLY * local[:, None], 0.5 * peak))
        sharp = (np.minimum(rise, fall) >= SHARP * peak) & (peak > LOCALLY * local[:, None])
    whole = back & sharp
    found = whole.any(axis=1)
    width = whole.argmax(axis=1) + 1
    first, last = leaps[found] + 1, leaps[found] + width[found]
    height = peak[found, width[found] - 1]
    # Where it begins or ends there is nothing to come back to.
    begins, ends = leaps < widest, leaps >= n - 1 - widest
    edge = (begins | ends) & (rise[:, 0] > LOCALLY * local) & ~found
    first = np.concatenate([first, np.where(begins, 0, leaps + 1)[edge]])
    last = np.concatenate([last, np.where(begins, leaps, n - 1)[edge]])
    height = np.concatenate([height, rise[edge, 0]])
    order = np.argsort(first, kind="stable")
    return first[order], last[order], height[order]
