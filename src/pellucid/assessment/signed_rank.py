r"""Wilcoxon's signed-rank test of paired differences, its p counted, with the effect size that goes with it.

Differences are ranked by size; W+ and W- are the rank sums of those above and below 0. If conditions do not differ,
each difference is as likely of either sign, so that the chance of a W+ at least as far from its middle is a sum over
:math:`2^n` signs, counted rank by rank. Ties share their mean rank; differences of 0 are left out [1]_. The matched
rank-biserial correlation is (W+ - W-) / (W+ + W-) [2]_: 1 where all differ upwards.

.. [1] F. Wilcoxon, "Individual comparisons by ranking methods", Biometrics Bull. 1, 1945.
.. [2] D. S. Kerby, "The simple difference formula", Compr. Psychol. 3, 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from .._errors import PellucidError


@dataclass(frozen=True)
class SignedRankTest:
    """The outcome of a signed-rank test: W+, the two-sided `p_value`, counted, the matched `rank_biserial` correlation
    and how many `pairs` differed at all."""

    statistic: float
    p_value: float
    rank_biserial: float
    pairs: int


def signed_rank(differences: np.ndarray) -> SignedRankTest:
    """Do paired differences lean to one side?. `differences` (n,)."""
    d = np.asarray(differences, float)
    if d.ndim != 1 or not len(d) or not np.isfinite(d).all():
        raise PellucidError(f"signed ranks: found differences of shape {d.shape}, expected (n,) finite numbers")
    d = d[d != 0.0]
    if not len(d):
        return SignedRankTest(0.0, 1.0, 0.0, 0)
    ranks = rankdata(np.abs(d))
    above = float(ranks[d > 0.0].sum())
    total = float(ranks.sum())
    chance = sign_distribution(np.rint(2.0 * ranks).astype(int))
    # In half ranks, so that ties are integers.
    far = np.abs(np.arange(len(chance)) - total) >= abs(2.0 * above - total) - 1e-9
    return SignedRankTest(above, float(min(1.0, chance[far].sum())), (2.0 * above - total) / total, len(d))


def sign_distribution(weights: np.ndarray) -> np.ndarray:
    """Chance of every sum of `weights` (integers above 0), each taken or left as by a coin; shape (sum of weights +
    1,).
    """
    chance = np.zeros(int(np.sum(weights)) + 1)
    chance[0] = 1.0
    for weight in weights:
        moved = np.zeros_like(chance)
        moved[weight:] = chance[: len(chance) - weight]
        chance = 0.5 * (chance + moved)
    return chance


def rank_sums(differences: np.ndarray) -> np.ndarray:
    """W+ of many samples of differences, (k, n), neither tied nor 0; shape (k,), integers."""
    ranks = np.argsort(np.argsort(np.abs(differences), axis=1), axis=1) + 1
    return np.sum(ranks * (differences > 0.0), axis=1)


def smallest_p(pairs: int) -> float:
    """The smallest p that so many pairs can give: all differ to one side."""
    return min(1.0, 2.0 ** (1 - pairs))
