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
    """The outcome of a signed-rank test."""

    statistic: float  # W+
    p_value: float  # exact two-sided p value
    rank_biserial: float  # matched rank-biserial correlation, -1 to 1
    pairs: int  # number of pairs that differ


def signed_rank(differences: np.ndarray) -> SignedRankTest:
    """Return the signed-rank test of paired `differences`, (n,), against 0."""
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
    # Sums are counted in half ranks, so that ties are integers.
    far = np.abs(np.arange(len(chance)) - total) >= abs(2.0 * above - total) - 1e-9
    return SignedRankTest(above, float(min(1.0, chance[far].sum())), (2.0 * above - total) / total, len(d))


def sign_distribution(weights: np.ndarray) -> np.ndarray:
    """Return the probability of every sum of `weights` if each is included with probability 1/2.

    `weights` are integers above 0; the result has shape (sum of weights + 1,).
    """
    chance = np.zeros(int(np.sum(weights)) + 1)
    chance[0] = 1.0
    for weight in weights:
        moved = np.zeros_like(chance)
        moved[weight:] = chance[: len(chance) - weight]
        chance = 0.5 * (chance + moved)
    return chance


def rank_sums(differences: np.ndarray) -> np.ndarray:
    """Return W+ of each row of differences, (k, n), which are neither tied nor 0; shape (k,), integers."""
    ranks = np.argsort(np.argsort(np.abs(differences), axis=1), axis=1) + 1
    return np.sum(ranks * (differences > 0.0), axis=1)


def smallest_p(pairs: int) -> float:
    """Return the smallest p value that a number of `pairs` can give: all differ to one side."""
    return min(1.0, 2.0 ** (1 - pairs))
