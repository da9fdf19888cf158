"""Interval of the largest envelope of contractions, by which envelopes are made relative.

Raw EMG is random even at a constant effort. The rectified signal is its level times a random factor. The factor is
drawn again in blocks that are longer than its memory, from the time at which the level is high, and smoothed as before.
The spread of the largest envelope of many draws is that between repetitions of the same contraction.

A chain without smoothing takes the largest single sample. Its distribution is that of the largest of many maxima of
short blocks, which is Gumbel's [1]_.

.. [1] E. J. Gumbel, "Statistics of Extremes", Columbia University Press, 1958.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .emg_chain import FILTER_STAGES, EmgChain, Stage


@dataclass(frozen=True)
class ScaleDraws:
    """How repetitions of a contraction are drawn. Chosen by judgement; no measurement is recorded."""

    count: int = 200
    block_s: float = 0.02  # Length of a block; EMG forgets itself within 10 ms
    reach_s: float = 1.0  # Time on either side of the largest envelope that is drawn again
    level_s: float = 0.25  # Blocks whose maxima tell the largest sample of a chain that does not smooth
    min_level_share: float = 0.5  # Factors are taken where the level has at least this share of its peak
    min_top_share: float = 0.7  # Contractions whose envelope stays below this share of the largest never reach it
    seed: int = 5200


SCALE_DRAWS = ScaleDraws()


def scale_interval(
    contractions: Sequence[np.ndarray], rate: float, chain: EmgChain, level: float = 0.95
) -> tuple[float, float]:
    """Return the ends of the interval of the largest envelope, as shares of it.

    `contractions` are raw EMG of one muscle, (n,) each [V], at a `rate` [Hz]; `level` is the interval's probability.
    """
    at = next((i for i, stage in enumerate(chain.stages) if stage.kind == "rectify"), len(chain.stages) - 1)
    before = replace(chain, stages=chain.stages[: at + 1])
    behind = tuple(stage for stage in chain.stages[at + 1 :] if stage.kind in (*FILTER_STAGES, "rms"))
    tails = 0.5 - 0.5 * level, 0.5 + 0.5 * level
    rectified = [before.zero_phase(x, rate) for x in contractions]
    if not behind:
        return _extreme_interval(rectified, rate, tails)
    smoothing = replace(chain, stages=(Stage("rectify"), *behind))
    rng = np.random.default_rng(SCALE_DRAWS.seed)
    envelopes = [smoothing.zero_phase(r, rate) for r in rectified]
    top = max(float(e.max()) for e in envelopes)
    drawn = [
        _drawn_tops(r, e, rate, smoothing, rng)
        for r, e in zip(rectified, envelopes, strict=True)
        if e.max() >= SCALE_DRAWS.min_top_share * top
    ]
    tops = np.max(drawn, axis=0)
    middle = float(np.median(tops))
    if not middle > 0.0:
        return 1.0, 1.0
    low, high = np.quantile(tops / middle, tails)
    return float(low), float(high)


def _extreme_interval(
    rectified: Sequence[np.ndarray], rate: float, tails: tuple[float, float]
) -> tuple[float, float]:
    """Return the quantiles at `tails` of the largest sample of rectified EMG, (n,) each, over its median."""
    size = max(2, round(SCALE_DRAWS.level_s * rate))
    blocks = np.concatenate([x[: len(x) // size * size].reshape(-1, size) for x in rectified])
    power = np.sqrt(np.mean(blocks**2, axis=1)) if len(blocks) else np.zeros(0)
    tops = blocks[power >= SCALE_DRAWS.min_level_share * power.max()].max(axis=1) if power.any() else power
    if len(tops) < 2:
        return 1.0, 1.0
    spread = np.sqrt(6.0) / np.pi * float(tops.std(ddof=1))
    place = float(tops.mean()) - np.euler_gamma * spread + spread * np.log(len(tops))
    low, middle, high = (place - spread * np.log(-np.log(p)) for p in (tails[0], 0.5, tails[1]))
    return float(low / middle), float(high / middle)


def _drawn_tops(
    rectified: np.ndarray, envelope: np.ndarray, rate: float, smoothing: EmgChain, rng: np.random.Generator
) -> np.ndarray:
    """Return the largest envelope of each draw of one contraction, (draws,)."""
    place, reach = int(np.argmax(envelope)), round(SCALE_DRAWS.reach_s * rate)
    part = slice(max(place - reach, 0), place + reach + 1)
    values, level = rectified[part], envelope[part]
    floor = SCALE_DRAWS.min_level_share * float(level.max())
    factor = values / np.maximum(level, max(floor, 1e-300))
    size = max(2, round(SCALE_DRAWS.block_s * rate))
    starts = np.flatnonzero(level[: len(level) - size] >= floor)
    if not len(starts):
        return np.full(SCALE_DRAWS.count, float(envelope.max()))
    count, n = -(-len(level) // size), len(level)
    tops = []
    for _ in range(SCALE_DRAWS.count):
        blocks = rng.choice(starts, count)[:, None] + np.arange(size)
        repeated = level * factor[blocks].ravel()[:n]
        tops.append(float(smoothing.zero_phase(repeated, rate).max()))
    return np.array(tops)
