r"""A band that holds what a model has not been shown: conformal, from blocks of recordings that it did not see.

Half the width is a quantile of the absolute errors on held-out recordings [1]_, or, where nothing is held out, on
blocks of the fitted ones, each predicted from all the others [2]_. Samples that remember each other count once in two
correlation times: of m such, the quantile at :math:`(1 + 1/m)` times the level holds the next with at least that level,
whatever the errors' distribution, as long as it stays the same.

How much a band holds is told of blocks that had no part in it: that of each block is made from the others.

.. [1] H. Papadopoulos, K. Proedrou, V. Vovk, A. Gammerman, "Inductive confidence machines for regression", ECML 2002.
.. [2] V. Vovk, "Cross-conformal predictors", Ann. Math. Artif. Intell. 74, 2015.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..uncertainty import block_length, correlation_time
from .evaluation import Prediction

FEWEST = 30
"""Samples that a condition needs to be told of."""

MOST_BLOCKS = 50  # left out one at a time: of hours they are longer


@dataclass(frozen=True)
class ConditionCoverage:
    """Share of samples that a band holds under one condition, of which a band has seen none."""

    kind: str  # "direction", "speed", "position" or "recording"
    condition: str
    coverage: float
    samples: int


@dataclass(frozen=True)
class PredictiveBand:
    """Half its width, in the effort's unit; whether held-out recordings made it; its coverage of each recording that
    has a part in it, and by condition."""

    half_width: float
    heldout: bool
    by_recording: dict[str, float]
    conditions: tuple[ConditionCoverage, ...] = ()


def conformal_half_width(errors: np.ndarray, level: float, independent: float) -> float:
    """The quantile of absolute `errors`, (n,), worth so many `independent` ones, that holds the next with `level`."""
    return float(np.quantile(errors, _share(level, independent), method="higher"))


def _share(level: float, independent: float) -> float:
    return min(1.0, level * (1.0 + 1.0 / max(independent, 1.0)))


def predictive_band(
    predictions: Sequence[Prediction], crossed: Sequence[np.ndarray], level: float
) -> PredictiveBand | None:
    """From `predictions` of held-out recordings; without any, from `crossed` residuals of the fitted ones, one array
    for each stretch in their order. None where there is neither."""
    heldout = [p for p in predictions if p.split == "heldout"]
    own = heldout or [p for p in predictions if p.split == "fitted"]
    errors = [p.residual for p in heldout] if heldout else _by_prediction(own, crossed)
    if not errors or not sum(map(len, errors)):
        return None
    lengths = [len(e) for e in errors]
    together = np.concatenate(errors)
    time = correlation_time(together, lengths)
    size, block = np.abs(together), max(block_length(time, len(together)), len(together) // MOST_BLOCKS)
    # Blocks of their own in every recording.
    owner = np.concatenate([np.full(n, i) for i, n in enumerate(lengths)])
    before = np.cumsum([0, *(-(-n // block) for n in lengths)])
    blocks = np.concatenate([first + np.arange(n) // block for first, n in zip(before, lengths, strict=False)])
    order = np.argsort(size)  # once: what is left without a block is in order too
    ordered, owned = size[order], blocks[order]
    worth = len(size) / max(2.0 * time, 1.0)
    inside = np.empty(len(size), bool)
    for b in range(blocks.max() + 1):
        mine = blocks == b
        rest = ordered[owned != b] if not mine.all() else ordered
        share = _share(level, worth * len(rest) / len(size))
        inside[mine] = size[mine] <= rest[int(np.ceil(share * (len(rest) - 1)))]
    by_recording = {p.recording: float(inside[owner == i].mean()) for i, p in enumerate(own)}
    return PredictiveBand(
        conformal_half_width(size, level, worth), bool(heldout), by_recording, tuple(_conditions(own, inside))
    )


def banded(predictions: Sequence[Prediction], band: PredictiveBand) -> tuple[Prediction, ...]:
    """The same with a band, and what it holds of each: of those with a part in it, by bands without them."""
    return tuple(
        replace(
            p,
            half_width=band.half_width,
            coverage=band.by_recording.get(
                p.recording if (p.split == "heldout") == band.heldout else "",
                float(np.mean(np.abs(p.residual) <= band.half_width)),
            ),
        )
        for p in predictions
    )


def _by_prediction(own: Sequence[Prediction], crossed: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Crossed residuals of stretches as one array for each recording; the fitted ones where they do not match."""
    total = np.concatenate(crossed) if crossed else np.zeros(0)
    if len(total) != sum(len(p.effort) for p in own):
        return [p.residual for p in own]
    return np.split(total, np.cumsum([len(p.effort) for p in own])[:-1])


def _conditions(own: Sequence[Prediction], inside: np.ndarray) -> Iterator[ConditionCoverage]:
    velocity, position = (np.concatenate([getattr(p, n) for p in own]) for n in ("velocity", "position"))
    kinds = [("direction", (velocity > 0.0).astype(int), ("negative", "positive"))]
    for kind, values, words in (
        ("speed", np.abs(velocity), ("slow", "middle", "fast")),
        ("position", position, ("low", "middle", "high")),
    ):
        kinds.append((kind, np.searchsorted(np.quantile(values, [1.0 / 3.0, 2.0 / 3.0]), values), words))
    owner = np.repeat(np.arange(len(own)), [len(p.effort) for p in own])
    for kind, label, words in (*kinds, ("recording", owner, tuple(p.recording for p in own))):
        for i, word in enumerate(words):
            mine = label == i
            if mine.sum() >= FEWEST:
                yield ConditionCoverage(kind, word, float(inside[mine].mean()), int(mine.sum()))
