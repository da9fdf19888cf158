"""Hours of motion: filtered one piece after another, each with borders of its own, and thinned before decimation.

Pieces follow each other without a gap: what is trimmed of one lies in its neighbours. The low-pass forgets a border to
one part in 10^13 before that, so that pieces hold what one pass over everything would.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from .filters import decimation_memory, lowpass_memory
from .motion import Filtering, Motion, motion_of

MIN_LONG_SAMPLES = 60_000
"""Longer stretches are processed in pieces."""

PIECE_SAMPLES = 1 << 17
"""Approximate number of samples of a piece: few enough for the processor's cache, many compared with its borders."""

MIN_SAMPLES_PER_PERIOD = 4.0
"""Thinning leaves at least this many samples per period of the low-pass's cut-off."""

MOST_ROWS = 2_000_000
"""Rows of a regression that a stretch gives at most."""


def thinned(filtering: Filtering, fs: float, samples: int) -> Filtering:
    """The `filtering` of `samples` at `fs` [Hz] with as much thinning as its low-pass allows, and few enough rows."""
    most = 1 if filtering.lowpass is None else max(1, int(fs / (MIN_SAMPLES_PER_PERIOD * filtering.lowpass)))
    thin = max(k for k in range(1, most + 1) if filtering.decimate == 1 or filtering.decimate % k == 0)
    decimate = max(filtering.decimate, thin)
    fewer = -(-samples // (decimate * MOST_ROWS))
    return replace(filtering, thin=thin * fewer, decimate=decimate * fewer)


def pieces(
    time: np.ndarray,
    position: np.ndarray,
    command: np.ndarray,
    filtering: Filtering,
    *,
    fs: float,
    velocity: np.ndarray | None = None,
    **more,
) -> Iterator[Motion]:
    """A stretch as motions whose inner samples follow each other; `time`, `position`, `command`, a recorded `velocity`
    (n,) [s], [rad or m], in the drive's unit; `fs` [Hz]. What else `motion_of` takes goes to it."""
    f = thinned(filtering, fs, len(time))
    margin = -(-decimation_memory(f.decimate // f.thin) * f.thin // f.decimate)
    settled = 0 if f.lowpass is None else lowpass_memory(f.order, f.lowpass, fs)
    border = f.trim + f.decimate * (margin + max(0, -(-(settled - f.trim) // f.decimate)))
    rows = (len(time) - 2 * border) // f.decimate
    count = max(1, round(rows * f.decimate / max(PIECE_SAMPLES, 20 * border)))
    edges = [border + f.decimate * (i * rows // count) for i in range(count + 1)]
    own = replace(f, trim=border, margin=margin)
    for first, last in pairwise(edges):
        part = slice(first - border, last + border)
        recorded = None if velocity is None else velocity[part]
        made = motion_of(time[part], position[part], command[part], own, fs=fs, velocity=recorded, **more)
        yield replace(made, raw_position=None, command=None)
