"""Choose the features of a strap model by backward elimination, judged on held-out blocks of the swings.

The search starts from all features. A feature is significant if the held-out blocks are predicted worse without it
(``block_test``) and the error of the swings, or of the trials with held torques, grows by the share `MIN_IMPROVEMENT`.
Features whose coefficient rests at the bound where it does nothing go first, without a test. All insignificant ones
then go at once, if the blocks are predicted no worse without all of them; otherwise each may imitate another, and the
least important one goes alone. The test has the family-wise level `FEATURE_TEST_LEVEL`: a strap without features
receives one in at most this share of cases.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...models.parameter import Parameter
from ...numerics.block_test import MIN_IMPROVEMENT, p_value_of_larger_loss
from .strap_fit import StrapFit, StrapRecord, fit_strap_model
from .strap_model import FULL_MODEL, KELVIN_VOIGT, STRAP_FEATURES, StrapModel

FEATURE_TEST_LEVEL = 0.05
"""Family-wise probability that a feature is chosen although the strap has none."""

HELD_OUT_BLOCKS_PER_SWING = 4
"""Each swing is divided into this many blocks, which are held out in turn."""


@dataclass(frozen=True, eq=False)
class StrapChoice:
    """The chosen model's fit, with the fits of all models that were tried."""

    fit: StrapFit
    plain: StrapFit  # fit of the spring and damper alone
    tried: Mapping[str, StrapFit]  # fits by model name
    missed: Mapping[str, float]  # p value, by feature of the chosen model, of predicting no worse without it
    errors: Mapping[str, float]  # RMS error on held-out blocks, by model name [rad]


def held_out_blocks(lengths: Sequence[int]) -> list[slice]:
    """Return the held-out blocks of every swing, as slices of all samples; `lengths` are the samples of each swing."""
    made, begin = [], 0
    for n in lengths:
        edges = begin + np.arange(HELD_OUT_BLOCKS_PER_SWING + 1) * n // HELD_OUT_BLOCKS_PER_SWING
        made += [slice(int(a), int(b)) for a, b in pairwise(edges)]
        begin += n
    return made


def choose_strap(records: Sequence[StrapRecord], gain: Parameter, full: StrapFit) -> StrapChoice:
    """Choose a strap model by removing insignificant features from `full`, the fit of the model with all features."""
    blocks, noise = held_out_blocks(full.lengths), full.noise
    # Swings and held torques are different experiments: what relaxes slowly shows in the latter alone.
    swinging = HELD_OUT_BLOCKS_PER_SWING * sum(not still for still in full.still)
    kinds = [kind for kind in (slice(0, swinging), slice(swinging, len(blocks))) if blocks[kind]]
    tried: dict[str, StrapFit] = {}

    def fitted(model: StrapModel, like: StrapFit) -> StrapFit:
        if model.name not in tried:
            near = {**like.values, "gain": like.gain}
            tried[model.name] = fit_strap_model(model, records, gain=gain, noise=noise, start=near, shifts=like.shifts)
        return tried[model.name]

    def p_without(features: Sequence[str], best: StrapFit, loss: list[np.ndarray]) -> tuple[float, float]:
        """Return the p value of predicting no worse without some features, and the loss without them."""
        without = fitted(StrapModel(tuple(f for f in best.model.features if f not in features)), best).loss(blocks)
        worse = any(
            np.mean(np.concatenate(loss[kind])) < (1.0 - MIN_IMPROVEMENT) ** 2 * np.mean(np.concatenate(without[kind]))
            for kind in kinds
        )
        return (p_value_of_larger_loss(without, loss)[0] if worse else 1.0), float(np.mean(np.concatenate(without)))

    best = fitted(FULL_MODEL, full)
    level = FEATURE_TEST_LEVEL / len(STRAP_FEATURES)
    while idle := [f for f in best.model.features if STRAP_FEATURES[f][0].name in best.at_bound]:
        best = fitted(StrapModel(tuple(f for f in best.model.features if f not in idle)), best)
    while True:
        loss = best.loss(blocks)
        found = {feature: p_without([feature], best, loss) for feature in best.model.features}
        missed = {feature: p for feature, (p, _) in found.items()}
        gone = [feature for feature, p in missed.items() if p >= level]
        if not gone:
            break
        # Several features may be dispensable because each imitates another. The one without which the prediction is
        # best goes first.
        if len(gone) > 1 and p_without(gone, best, loss)[0] < level:
            gone = [max(gone, key=lambda feature: (found[feature][0], -found[feature][1]))]
        best = fitted(StrapModel(tuple(f for f in best.model.features if f not in gone)), best)
    plain = fitted(KELVIN_VOIGT, best)
    fitted(FULL_MODEL.without("tissue"), full)  # the intervals of straps without tissue need it
    errors = {n: float(np.sqrt(np.mean(np.concatenate(f.loss(blocks))))) for n, f in tried.items()}
    return StrapChoice(best, plain, tried, missed, errors)
