r"""Wilcoxon's signed-rank test of paired differences, its p counted, with the effect size that goes with it.

Differences are ranked by size; W+ and W- are the rank sums of those above and below 0. If conditions do not differ,
each difference is as likely of either sign, so that the chance of a W+ at least as far from its middle is a sum over
:math:`2^n` signs, counted rank by rank. Ties share their mean rank; differences of 0 are left out [1]_. Differences
that rounding alone tells apart are ties (`numerics/tied_ranks.py`). The matched
rank-biserial correlation is (W+ - W-) / (W+ + W-) [2]_: 1 where all differ upwards.

.. [1] F. Wilcoxon, "Individual comparisons by ranking methods", Biometrics Bull. 1, 1945.
.. [2] D. S. Kerby, "The simple difference formula", Compr. Psychol. 3, 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._errors import PellucidError
from ..numerics.tied_ranks import tied_ranks, tied_signs


@dataclass(frozen=True)
class SignedRankTest:
    """The outcome of a signed-rank test."""

    statistic: float  # W+
    p_value: float  # exact two-sided p value
    rank_biserial: float  # matched rank-biserial correlation, -1 to 1
    pairs: int  # number of pairs that differ


def signed_rank(differences: np.ndarray, scale: float | None = None) -> SignedRankTest:
    """Return the signed-rank test of paired `differences`, (n,), against 0.

    `scale` is the size of the values that they are differences of; by default that of the largest difference.
    """
    d = np.asarray(differences, float)
    if d.ndim != 1 or not len(d) or not np.isfinite(d).all():
        raise PellucidError(f"signed ranks: found differences of shape {d.shape}, expected (n,) finite numbers")
    signs = tied_signs(d, scale)
    d = d[signs != 0.0]
    if not len(d):
        return SignedRankTest(0.0, 1.0, 0.0, 0)
    ranks = tied_ranks(np.abs(d), scale)
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
    """Return W+ of each row of differences, (k, n), shape (k,); a difference of 0 counts half its rank.

    With the 0s counted so, rows are judged by the distribution of n differences: no evidence comes from a 0.
    """
    return np.sum(tied_ranks(np.abs(differences)) * (0.5 + 0.5 * tied_signs(differences)), axis=1)


def two_sided_p(above: np.ndarray, pairs: int) -> np.ndarray:
    """Return the exact two-sided p of each W+ (k,), of a number of `pairs` without ties; a W+ between two counts as the
    less extreme one."""
    chance = np.cumsum(sign_distribution(np.arange(1, pairs + 1)))
    below = np.minimum(above, pairs * (pairs + 1) / 2 - above)
    return np.minimum(2.0 * chance[np.ceil(below - 1e-9).astype(int)], 1.0)


def smallest_p(pairs: int) -> float:
    """Return the smallest p value that a number of `pairs` can give: all differ to one side."""
    return min(1.0, 2.0 ** (1 - pairs))
