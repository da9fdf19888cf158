"""A channel that is cut off at its largest or smallest value: flat there, and steep before and after."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..cut import Cut, cut_of
from .scale import Scale
from .watched import Watched, runs

KIND = "clipped"

FEWEST = 5
"""Samples in flat runs at one end below which a channel is not clipped."""


SINGLE = 0.005
"""Share of the samples that a flat run holds at least, where there is only one: a peak may happen to be flat."""

ROUND = 8
"""The top of a round peak on a grid lasts up to about five times as long as the level beside it; with noise, this."""

LEVEL = 64
"""Samples that a level beside a flat run is followed for."""


def find(watched: Watched) -> Iterator[Cut]:
    """Flat runs that are no limit known or accepted."""
    for name in watched.channels:
        if name in watched.accepted or name == "reference":
            continue
        for sign in (1.0, -1.0):
            x = watched.samples(name)
            firsts, lengths = flat_tops(sign * x)
            if firsts.size == 0 or at_limit(watched, name, x[firsts[0]]):
                continue
            for first, length in zip(firsts.tolist(), lengths.tolist(), strict=True):
                found = f"{length} samples clipped at {x[first]:.6g} {watched.recording.channels[name].unit}"
                yield cut_of(watched.recording, KIND, name, first, first + length - 1, found)


def at_limit(watched: Watched, name: str, value: float) -> bool:
    """Whether a command rests at a limit that is known."""
    return any(abs(value) >= 0.98 * limit for limit in watched.limits.get(name, ()))


def flat_tops(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First index and length of the runs in which `x`, shape (n,), is cut off at its maximum."""
    none = np.zeros(0, int), np.zeros(0, int)
    finite = np.isfinite(x)
    if not finite.any():
        return none
    top, low = float(np.max(x, where=finite, initial=-np.inf)), float(np.min(x, where=finite, initial=np.inf))
    starts, lengths = runs(x >= top - 1e-9 * (top - low))
    long = lengths >= 3
    starts, lengths = starts[long], lengths[long]
    if starts.size == 0:
        return none
    scale = Scale(x)
    if scale.range == 0.0 or scale.typical == 0.0:
        return none
    k = scale.stride
    before, after = starts - 1, starts + lengths
    inner = (before - k >= 0) & (after + k < len(x))  # at a border there is no telling a cut from a rest
    starts, lengths, before, after = (each[inner] for each in (starts, lengths, before, after))
    slope = np.minimum(x[before] - x[before - k], x[after] - x[after + k])
    # Slope into the run times its length is how far the peak was cut; a peak's own width costs one resolution, and
    # more by as much as the stride, over which the slope is taken, is as wide as the run.
    own = scale.resolution * (1 + k / lengths)
    steep = (slope > 0.1 * scale.typical) & (slope / k * lengths / 4 > 2 * own)
    steep &= ~_round(x, starts, lengths)
    starts, lengths = starts[steep], lengths[steep]
    least = FEWEST if starts.size > 1 else max(FEWEST, SINGLE * len(x))
    return (starts, lengths) if lengths.sum() >= least else none


def _round(x: np.ndarray, starts: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Which runs are the top of a round peak, that a coarse grid makes flat: levels beside it last long, too."""
    moved = np.abs(np.diff(x))
    small = 3.0 * float(np.median(moved[moved > 0.0]))
    reach, ends = np.arange(1, LEVEL), starts + lengths
    lasts, edge = np.zeros(len(starts), int), np.zeros(len(starts))
    for beside, away in ((starts - 1, -reach), (ends, reach)):
        level = x[np.clip(beside[:, None] + away, 0, len(x) - 1)] == x[beside][:, None]
        lasts = np.maximum(lasts, 1 + np.cumprod(level, axis=1).sum(axis=1))
        edge = np.maximum(edge, np.abs(x[beside] - x[starts]))
    return (lengths <= ROUND * lasts) & (edge <= small)
