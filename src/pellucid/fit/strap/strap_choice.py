"""Which features a strap has: those without which blocks that were not fitted are predicted worse.

All features are fitted first; then the one that is missed least is given up, as long as it is not missed. A feature is
missed where the prediction of blocks held out is worse without it (``block_test``), at `LEVEL` over the features that
could be: a strap without any of them seems to have one in so many cases at most.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..block_test import p_of_worse
from ..parameter import Parameter
from .strap_fit import StrapFit, StrapRecord, fit_strap
from .strap_model import FEATURES, FULL, KELVIN_VOIGT, StrapModel

LEVEL = 0.05
"""Of a feature that is not there, over all of them."""
BLOCKS = 4
"""Of each swing, that are held out in turn."""
ALIKE = 0.01
"""Share of a mean square below which two predictions are one."""


@dataclass(frozen=True, eq=False)
class StrapChoice:
    """The model that is chosen, the simplest one, and all that were tried."""

    fit: StrapFit
    plain: StrapFit
    tried: Mapping[str, StrapFit]
    missed: Mapping[str, float]  # By feature of the chosen model: p of predicting no worse without it
    errors: Mapping[str, float]  # Of blocks held out, by model [rad]


def blocks_of(lengths: Sequence[int]) -> list[slice]:
    """Blocks of every swing."""
    made, begin = [], 0
    for n in lengths:
        edges = begin + np.arange(BLOCKS + 1) * n // BLOCKS
        made += [slice(int(a), int(b)) for a, b in pairwise(edges)]
        begin += n
    return made


def choose_strap(records: Sequence[StrapRecord], gain: Parameter, full: StrapFit) -> StrapChoice:
    """Give up features that are not missed, from a fit of all of them."""
    blocks, noise = blocks_of(full.lengths), full.noise
    tried: dict[str, StrapFit] = {}

    def fitted(model: StrapModel, like: StrapFit) -> StrapFit:
        if model.name not in tried:
            near = {**like.values, "gain": like.gain}
            tried[model.name] = fit_strap(model, records, gain=gain, noise=noise, start=near, shifts=like.shifts)
        return tried[model.name]

    best = fitted(FULL, full)
    missed: dict[str, float] = {}
    while True:
        loss = best.loss(blocks)
        level = float(np.mean(np.concatenate(loss)))
        p = {}
        for feature in best.model.features:
            without = fitted(best.model.without(feature), best).loss(blocks)
            worse = float(np.mean(np.concatenate(without))) > (1.0 + ALIKE) * level
            p[feature] = p_of_worse(without, loss)[0] if worse else 1.0
        least = max(p, key=p.__getitem__, default=None)
        if least is None or p[least] < LEVEL / len(FEATURES):
            missed = p
            break
        best = fitted(best.model.without(least), best)
    plain = fitted(KELVIN_VOIGT, best)
    errors = {n: float(np.sqrt(np.mean(np.concatenate(f.loss(blocks))))) for n, f in tried.items()}
    return StrapChoice(best, plain, tried, missed, errors)
