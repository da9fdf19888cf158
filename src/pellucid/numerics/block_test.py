r"""Compare the errors of models on samples that they were not fitted to, by a paired sign-flip test over blocks.

All models predict the same samples, so their losses are compared sample by sample, :math:`d_t = e_{a,t}^2 - e_{b,t}^2`
[1]_. Autocorrelated samples are not independent. Recordings are therefore cut into blocks of
`BLOCK_CORRELATION_LENGTHS` correlation lengths of :math:`d`, which are nearly independent. If the models were equally
good, each block sum :math:`D_b` could as well have the other sign [2]_. The p value is the share of all choices of
signs whose total is no smaller than the observed one. It holds for blocks of unequal spread; Student's t assumes equal
spread. `holm` corrects the p values of several tests together.

.. [1] F. X. Diebold, R. S. Mariano, "Comparing predictive accuracy", J. Business & Economic Statistics 13, 1995.
.. [2] R. A. Fisher, "The Design of Experiments", 1935, section 21.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .distributions import normal_share_below
from .uncertainty import correlation_length

SIGNIFICANCE_LEVEL = 0.05
"""Significance level of the one-sided tests of all candidates together."""

MIN_IMPROVEMENT = 0.05
"""Smallest share of its error by which a candidate must be improved on before it counts as worse. With many samples a
test finds differences that change no controller."""

BLOCK_CORRELATION_LENGTHS = 2.0
"""Length of a block in correlation lengths of the loss difference."""

MAX_ENUMERATED_BLOCKS = 12
"""Up to this many blocks every choice of signs is tried. Above it the normal approximation replaces the count."""

EQUAL_LOSS_TOLERANCE = 0.01
"""Two mean squares count as equal if they differ by at most this share of the smaller one. Rounding then decides
nothing."""


@dataclass(frozen=True)
class HeldOutComparison:
    """Comparison of candidates on the same held-out samples."""

    errors: Mapping[str, float]  # RMS error of each candidate, in the signal's unit
    winner: str  # candidate with the smallest error
    p_values: Mapping[str, float]  # p value of the hypothesis that a candidate is no worse than the winner
    blocks: int  # smallest number of blocks in any of the tests
    samples: float  # number of independent samples
    min_improvement: float = MIN_IMPROVEMENT  # smallest share of a worse candidate's error that the winner saves

    def improvement(self, name: str) -> float:
        """Return the share of a candidate's error that the winner saves."""
        return 1.0 - self.errors[self.winner] / self.errors[name] if self.errors[name] else 0.0

    def worse(self, name: str) -> bool:
        """Return whether a candidate is worse than the winner: significantly, and by at least `min_improvement`.

        The significance level is divided by the number of candidates that are compared with the winner (Bonferroni).
        """
        level = SIGNIFICANCE_LEVEL / max(len(self.errors) - 1, 1)
        return self.p_values[name] < level and self.improvement(name) >= self.min_improvement

    def first(self, ordered: Sequence[str]) -> str:
        """Return the first candidate, in this order, that is not worse than the winner."""
        return next(name for name in ordered if not self.worse(name))


def compare_held_out(
    residuals: Mapping[str, Sequence[np.ndarray]], min_improvement: float = MIN_IMPROVEMENT
) -> HeldOutComparison:
    """Test each candidate's residuals, shape (n_i,) per recording, against those of the best candidate.

    Every residual belongs to a sample that its candidate was not fitted to. A candidate is worse than the best only if
    the best saves at least the share `min_improvement` of its error.
    """
    losses = {name: [np.square(r) for r in each] for name, each in residuals.items()}
    power = {name: float(np.mean(np.concatenate(each))) for name, each in losses.items()}
    winner = min(power, key=power.__getitem__)
    p_values, blocks = {}, []
    for name, loss in losses.items():
        p_values[name] = 1.0
        if name != winner and power[name] > (1.0 + EQUAL_LOSS_TOLERANCE) * power[winner]:
            p_values[name], count = p_value_of_larger_loss(loss, losses[winner])
            blocks.append(count)
    errors = {name: float(np.sqrt(x)) for name, x in power.items()}
    samples = count_independent_samples(residuals[winner])
    return HeldOutComparison(errors, winner, p_values, min(blocks, default=0), samples, min_improvement)


def p_value_of_larger_loss(loss: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> tuple[float, int]:
    """Return the p value of the hypothesis that `loss` is no larger than `other`, and the number of blocks.

    Both have shape (n_i,) per recording.
    """
    apart = [a - b for a, b in zip(loss, other, strict=True)]
    sums = np.concatenate([np.add.reduceat(d, _block_starts(len(d), _count_blocks(d))) for d in apart if len(d)])
    return sign_flip_p_value(sums), len(sums)


def sign_flip_p_value(sums: np.ndarray) -> float:
    """Return the p value of the hypothesis that independent `sums`, shape (b,), have a mean of at most 0.

    It is the share of all choices of signs whose total is no smaller than the observed one.
    """
    total, count = float(sums.sum()), len(sums)
    if count > MAX_ENUMERATED_BLOCKS:
        spread = float(np.linalg.norm(sums))
        return normal_share_below(-total / spread) if spread else 1.0
    signs = 1.0 - 2.0 * ((np.arange(2**count)[:, None] >> np.arange(count)) & 1)
    return float(np.mean(signs @ sums >= total - 1e-9 * np.abs(sums).sum()))


def count_independent_samples(residuals: Sequence[np.ndarray]) -> float:
    """Return the effective number of independent samples in residuals, shape (n_i,) per recording."""
    return float(sum(len(r) / correlation_length(r) for r in residuals if len(r)))


def _block_starts(samples: int, blocks: int) -> np.ndarray:
    """Return the first samples of blocks of nearly equal length."""
    return np.arange(blocks) * samples // blocks


def _count_blocks(difference: np.ndarray) -> int:
    """Return how many blocks a recording's loss difference, shape (n,), is cut into."""
    return max(1, int(len(difference) / (BLOCK_CORRELATION_LENGTHS * correlation_length(difference))))


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p values corrected together after Holm, in the same order; at most 1."""
    p = np.asarray(p_values, float)
    order = np.argsort(p, kind="stable")
    corrected = np.minimum(np.maximum.accumulate(p[order] * (len(p) - np.arange(len(p)))), 1.0)
    back = np.empty(len(p))
    back[order] = corrected
    return [float(each) for each in back]
