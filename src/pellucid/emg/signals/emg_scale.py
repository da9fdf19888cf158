"""Scale of envelopes from raw EMG of maximal contractions, and its interval.

Raw EMG is random even at a constant effort. The rectified signal is its level times a random factor. The factor is
drawn again in blocks that are longer than its correlation, from the time at which the level is high, and smoothed as
before. The spread of the largest envelope of many draws is that between repetitions of the same contraction.

A chain without smoothing takes the largest single sample. Its distribution is that of the largest of many maxima of
short blocks, which is Gumbel's [1]_.

.. [1] E. J. Gumbel, "Statistics of Extremes", Columbia University Press, 1958.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import RecordingError
from ...numerics.arguments import with_checked_arguments
from .emg_chain import FILTER_STAGES, EmgChain, Stage, emg_chain, envelope
from .emg_findings import without_short_peaks


@dataclass(frozen=True)
class ScaleDraws:
    """How repetitions of a contraction are drawn. Chosen by judgement; no measurement is recorded."""

    count: int = 200
    block_s: float = 0.02  # Length of a block; the correlation of EMG ends within 10 ms
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


MAX_CONTRACTION_COUNT = 100
"""More contractions than this are samples that were meant as one array."""


@with_checked_arguments
def maximal_envelope(
    contractions: Sequence[ArrayLike], *, rate: float, chain: str | EmgChain = "able", level: float | None = None
) -> np.ndarray | float | tuple[np.ndarray | float, np.ndarray | float, np.ndarray | float]:
    """Return the largest envelope of maximal voluntary contractions (MVC), by which `envelope` normalises.

    Parameters
    ----------
    contractions : sequence of array_like, each of shape (n,) or (n, muscles)
        Raw EMG of each contraction [V]; their lengths may differ. A muscle's largest value may be in any of them.
        Short peaks far above all other samples are excluded as artefacts.
    rate : float
        Sampling rate [Hz].
    chain : str or EmgChain
        Chain of the envelopes that are to be relative; as in `envelope`.
    level : float, optional
        Probability of an interval, in (0, 1), in which repetitions of the same contractions have their largest
        envelope. With it, the ends of the interval are returned too.

    Returns
    -------
    ndarray of shape (muscles,), or float
        Largest envelope of each muscle [V]; a number for contractions of shape (n,). With `level`: a tuple of it, of
        the lower and of the upper end of its interval.

    Raises
    ------
    RecordingError
        If there is no contraction, their numbers of muscles differ, the chain does not make envelopes relative, or
        `envelope` refuses one.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> rng = np.random.default_rng(0)
    >>> mvc, task = (1e-4 * effort * rng.standard_normal(8000) for effort in (1.0, 0.4))
    >>> top = pl.maximal_envelope([mvc], rate=2000.0, chain="hill")
    >>> relative = pl.envelope(task, rate=2000.0, chain="hill", maximum=top)
    >>> bool(0.25 < np.median(relative) < 0.45)
    True
    """
    count = len(contractions)
    if not 0 < count <= MAX_CONTRACTION_COUNT or np.ndim(contractions[0]) == 0:
        raise RecordingError(
            f"maximal_envelope: found {count} contractions, expected a list of 1 to {MAX_CONTRACTION_COUNT} arrays, "
            "one for each contraction"
        )
    asked = emg_chain(chain) if isinstance(chain, str) else chain
    if not any(stage.kind == "normalise" for stage in asked.stages):
        raise RecordingError(
            f"maximal_envelope: found the chain {asked.name}, expected one whose envelopes are relative, such as hill"
        )
    if level is not None and not 0.0 < level < 1.0:
        raise RecordingError(f"maximal_envelope: found level = {level:g}, expected a probability in (0, 1)")
    tops, sounds = [], []
    for i, contraction in enumerate(contractions):
        try:
            # Over a maximum of 1 V a relative envelope is one in V. A short artefact is no muscle's maximum.
            x = np.asarray(contraction, dtype=np.float64)
            sound = np.apply_along_axis(without_short_peaks, 0, x, rate) if x.ndim in (1, 2) and x.size else x
            tops.append(envelope(sound, rate=rate, chain=asked, maximum=1.0).max(axis=0))
            sounds.append(sound.reshape(len(sound), -1))
        except RecordingError as error:
            raise RecordingError(f"maximal_envelope, contraction {i}: {error}") from None
    shapes = sorted({top.shape for top in tops})
    if len(shapes) > 1:
        raise RecordingError(
            f"maximal_envelope: found contractions of {' and '.join(str(s[0] if s else 1) for s in shapes)} muscles, "
            "expected the same muscles in each"
        )
    top = np.max(tops, axis=0)
    made = float(top) if top.ndim == 0 else top
    if level is None:
        return made
    ends = [scale_interval([x[:, k] for x in sounds], rate, asked, level) for k in range(sounds[0].shape[1])]
    low, high = (made * (share[0] if np.ndim(made) == 0 else np.array(share)) for share in zip(*ends, strict=True))
    return made, low, high
