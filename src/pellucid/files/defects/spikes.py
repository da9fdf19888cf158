"""Find spikes: a few samples far from their neighbours on both sides, in a channel without other such jumps.

The thresholds were chosen by judgement; no measurement is recorded for any. `research/evidence/spoilt.py` counts
what they miss in recordings with known defects.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .watched import INERTIAL_CHANNELS, WatchedRecording

KIND = "spike"


@dataclass(frozen=True)
class SpikeLimits:
    """When samples that leave the signal are a spike."""

    # A spike is at most this many samples wide, or `SPIKE_LIMITS.max_spike_s` if that is more samples.
    max_spike_samples: int = 5
    # A spike is at most this long [s], or `SPIKE_LIMITS.max_spike_samples` if that is longer.
    max_spike_s: float = 0.005
    # The steps between this many samples on either side of a spike are its surroundings.
    neighbourhood_samples: int = 12
    # A spike is at least this many times as high as the upper quartile of the steps in its surroundings.
    min_local_step_ratio: float = 8.0
    # A spike is at least this many times as high as the largest step of the recording that belongs to no spike.
    min_largest_step_ratio: float = 2.0
    # A spike is at least this many times as high as the channel's resolution.
    min_resolution_ratio: float = 8.0
    # In a channel that may jump, a spike at the first or last sample is at least this many times as high as the
    # range of the remaining samples. A recording may begin or end with a step.
    min_border_range_ratio: float = 3.0
    # A spike rises and falls in one step each by at least this share of its height.
    min_step_share: float = 0.4
    # After a spike the signal returns to its earlier value within this share of the spike's height.
    return_tolerance: float = 0.15
    # The search is repeated without the spikes already found, at most this many times. A high spike hides lower
    # ones.
    max_search_count: int = 5
    # Only this many of the largest steps are examined. The bound keeps the time for a noisy channel short.
    max_examined_step_count: int = 20000


SPIKE_LIMITS = SpikeLimits()

MIN_RANGE_RATIOS = {"emg": 30.0, "acceleration": 3.0, "angular_velocity": 3.0}
"""In channels with one of these words in their name, a spike is at least this many times as high as the range of the
remaining samples. A muscle or a knock makes peaks there that are as sharp as a spike."""


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for each spike in the channels that the study reads."""
    for name in watched.channels:
        unit = watched.recording.channels[name].unit_words
        widest = max(SPIKE_LIMITS.max_spike_samples, round(SPIKE_LIMITS.max_spike_s * watched.recording.fs))
        x, has_inertia = watched.samples(name), name.partition(".")[0] in INERTIAL_CHANNELS
        found = _find_repeatedly(x, widest)
        min_ratio = max((MIN_RANGE_RATIOS.get(part, 0.0) for part in name.split(".")), default=0.0)
        if found:
            rest = x.copy()
            for first, last, _ in found:
                rest[first : last + 1] = np.nan
            rest_range = float(np.nanmax(rest) - np.nanmin(rest)) if np.isfinite(rest).any() else 0.0
            # A channel may begin or end with a step, unless it has inertia.
            at_border = [each for each in found if each[0] == 0 or each[1] == len(x) - 1]
            border_ratio = 0.0 if has_inertia else SPIKE_LIMITS.min_border_range_ratio
            found = [e for e in found if e[2] > rest_range * max(min_ratio, border_ratio if e in at_border else 0.0)]
        for first, last, height in found:
            yield make_cut(
                watched.recording, KIND, name, first=first, last=last, found=f"a spike of {height:.3g}{unit}"
            )


def _find_repeatedly(x: np.ndarray, widest: int) -> list[tuple[int, int, float]]:
    """Return the spikes of `x`, also those that show only after higher ones are removed; as `find_spikes` does."""
    found: list[tuple[int, int, float]] = []
    for _ in range(SPIKE_LIMITS.max_search_count):
        more = find_spikes(x, widest)
        if not more:
            break
        found += more
        x = x.copy()
        for first, last, _ in more:
            x[first : last + 1] = np.nan
    return sorted(found)


def find_spikes(x: np.ndarray, widest: int) -> list[tuple[int, int, float]]:
    """Return first sample, last sample and height of each spike of `x`, shape (n,), at most `widest` samples wide."""
    n = len(x)
    if n < 4 * SPIKE_LIMITS.neighbourhood_samples:
        return []
    steps = np.diff(x)
    np.abs(steps, out=steps)
    if not np.isfinite(steps.max()):
        steps[~np.isfinite(steps)] = 0.0
    every = max(1, n // 200_000)
    usual = _high_quantile(steps[::every], 0.99)
    if not steps.max() > 3.0 * usual:
        return []
    sparse = np.abs(x[::every])
    sparse = sparse if np.isfinite(sparse).all() else sparse[np.isfinite(sparse)]
    large = _high_quantile(sparse, 0.99) if sparse.size else 0.0
    quantum = float(np.min(steps, where=steps > 1e-9 * large, initial=np.inf))
    if not np.isfinite(quantum):
        return []
    resolved = SPIKE_LIMITS.min_resolution_ratio * quantum
    leaps, most = np.flatnonzero(steps > max(resolved, 3.0 * usual)), SPIKE_LIMITS.max_examined_step_count
    if leaps.size > most:
        leaps = np.sort(leaps[np.argpartition(steps[leaps], -most)[-most:]])
    first, last, height = _excursions(x, leaps, widest)
    # The largest step outside every excursion shows how fast the channel itself changes.
    bounds = np.searchsorted(leaps, np.column_stack([first - 1, last + 1]))
    change = np.zeros(leaps.size + 1, int)
    np.add.at(change, bounds[:, 0], 1)
    np.add.at(change, bounds[:, 1], -1)
    own = np.cumsum(change)[:-1] == 0
    largest = max(float(steps[leaps[own]].max(initial=0.0)), usual)
    found, after = [], -1
    for a, b, h in zip(first.tolist(), last.tolist(), height.tolist(), strict=True):
        if h > SPIKE_LIMITS.min_largest_step_ratio * largest and h > resolved and a > after:
            found.append((a, b, h))
            after = b
    return found


def _high_quantile(values: np.ndarray, share: float) -> float:
    """Return `numpy.quantile` of finite values, shape (n,), from those above a slightly lower quantile of a few."""
    n = len(values)
    place = share * (n - 1)
    top = values[values >= np.quantile(values[:: max(1, n // 2000)], share - 0.01)]
    first = int(place) - (n - len(top))
    if first < 0 or first + 2 > len(top):
        return float(np.quantile(values, share))
    return float(np.quantile(np.partition(top, (first, first + 1))[first : first + 2], place - int(place)))


def _excursions(x: np.ndarray, leaps: np.ndarray, widest: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return first sample, last sample and height of each excursion: at most `widest` samples between a leap and an
    equally sudden return."""
    n, near = len(x), SPIKE_LIMITS.neighbourhood_samples
    around = np.concatenate([np.arange(-near, 0), np.arange(widest + 1, widest + 1 + near)])
    places = leaps[:, None] + around
    inside = (places >= 0) & (places + 1 < n)
    with np.errstate(invalid="ignore"):
        change = np.where(inside, x[np.clip(places + 1, 0, n - 1)] - x[np.clip(places, 0, n - 1)], np.nan)
    known = np.isfinite(change).any(axis=1)
    leaps, change = leaps[known], change[known]
    if leaps.size == 0:
        return leaps, leaps, np.zeros(0)
    local, complete = np.empty(len(change)), np.isfinite(change).all(axis=1)
    local[complete] = np.quantile(np.abs(change[complete]), 0.75, axis=1)  # a hundred times as fast, where it can be
    local[~complete] = np.nanquantile(np.abs(change[~complete]), 0.75, axis=1)
    trend = np.nanmedian(change, axis=1)
    later = leaps[:, None] + 1 + np.arange(widest + 1)
    ahead = np.where(later < n, x[np.minimum(later, n - 1)], np.nan)
    off = ahead - x[leaps][:, None] - trend[:, None] * np.arange(1, widest + 2)
    peak = np.maximum.accumulate(np.abs(off), axis=1)[:, :-1]
    rise = np.abs(off[:, :1])
    fall = np.abs(np.diff(off, axis=1))
    usual = SPIKE_LIMITS.min_local_step_ratio * local[:, None]
    with np.errstate(invalid="ignore"):
        back = np.abs(off[:, 1:]) <= np.maximum(SPIKE_LIMITS.return_tolerance * peak, np.minimum(usual, 0.5 * peak))
        sharp = (np.minimum(rise, fall) >= SPIKE_LIMITS.min_step_share * peak) & (peak > usual)
    whole = back & sharp
    found = whole.any(axis=1)
    width = whole.argmax(axis=1) + 1
    first, last = leaps[found] + 1, leaps[found] + width[found]
    height = peak[found, width[found] - 1]
    # At the first and last samples there is no value to return to.
    begins, ends = leaps < widest, leaps >= n - 1 - widest
    edge = (begins | ends) & (rise[:, 0] > SPIKE_LIMITS.min_local_step_ratio * local) & ~found
    first = np.concatenate([first, np.where(begins, 0, leaps + 1)[edge]])
    last = np.concatenate([last, np.where(begins, leaps, n - 1)[edge]])
    height = np.concatenate([height, rise[edge, 0]])
    order = np.argsort(first, kind="stable")
    return first[order], last[order], height[order]
