r"""Whether one model predicts worse than another on data that neither was fitted to: a paired test over blocks.

Both predict the same samples, so that their losses are compared sample by sample,
:math:`d_t = e_{a,t}^2 - e_{b,t}^2` [1]_. What is coloured counts for less than it has samples: recordings are cut
into blocks of `MEMORY` correlation lengths of :math:`d`, which are as good as independent. Were the models alike, each
block's sum :math:`D_b` might as well have the other sign [2]_: of all choices of signs, the share whose total is no
smaller than the one found is the p value. It holds whatever the spread of each block; Student's t needs it to be one.

.. [1] F. X. Diebold, R. S. Mariano, "Comparing predictive accuracy", J. Business & Economic Statistics 13, 1995.
.. [2] R. A. Fisher, "The Design of Experiments", 1935, section 21.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..signals.correlation_length import correlation_length

LEVEL = 0.05  # of the one-sided test
MEMORY = 2.0  # correlation lengths in a block
COUNTED = 12  # blocks up to which every choice of signs is tried
ALIKE = 0.01  # share of the smaller mean square below which two losses are one: rounding decides nothing


@dataclass(frozen=True)
class Contest:
    """Candidates on the same held-out samples: `errors`, each one's RMS in the signal's unit; the `winner`, with the
    smallest; `p_values` of each being no worse than the winner; `blocks` and independent `samples` behind it."""

    errors: Mapping[str, float]
    winner: str
    p_values: Mapping[str, float]
    blocks: int
    samples: float

    def worse(self, name: str) -> bool:
        """Whether a candidate is significantly worse than the winner."""
        return self.p_values[name] < LEVEL

    def first(self, ordered: Sequence[str]) -> str:
        """The first, in this order, that is not significantly worse than the winner."""
        return next(name for name in ordered if not self.worse(name))


def contest(residuals: Mapping[str, Sequence[np.ndarray]]) -> Contest:
    """Each candidate's residuals on the same held-out recordings, (n_i,) each, tested against the best one's."""
    losses = {name: [np.square(r) for r in each] for name, each in residuals.items()}
    power = {name: float(np.mean(np.concatenate(each))) for name, each in losses.items()}
    winner = min(power, key=power.__getitem__)
    p_values, blocks = {}, []
    for name, loss in losses.items():
        p_values[name] = 1.0
        if name != winner and power[name] > (1.0 + ALIKE) * power[winner]:
            p_values[name], count = p_of_worse(loss, losses[winner])
            blocks.append(count)
    errors = {name: float(np.sqrt(x)) for name, x in power.items()}
    samples = independent_samples(residuals[winner])
    return Contest(errors, winner, p_values, min(blocks, default=0), samples)


def p_of_worse(loss: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> tuple[float, int]:
    """The p value of a `loss`, (n_i,) per recording, being no larger than the `other`; and over how many blocks."""
    apart = [a - b for a, b in zip(loss, other, strict=True)]
    sums = np.concatenate([np.add.reduceat(d, _starts(len(d), _blocks_in(d))) for d in apart if len(d)])
    return p_of_signs(sums), len(sums)


def p_of_signs(sums: np.ndarray) -> float:
    """The share of all choices of signs of independent `sums`, (b,), whose total is no smaller than theirs: the p value
    of their being no more than 0."""
    from scipy.special import ndtr

    total, count = float(sums.sum()), len(sums)
    if count > COUNTED:
        spread = float(np.linalg.norm(sums))
        return float(ndtr(-total / spread)) if spread else 1.0
    signs = 1.0 - 2.0 * ((np.arange(2**count)[:, None] >> np.arange(count)) & 1)
    return float(np.mean(signs @ sums >= total - 1e-9 * np.abs(sums).sum()))


def independent_samples(residuals: Sequence[np.ndarray]) -> float:
    """How many independent samples residuals, (n_i,) per recording, are worth."""
    return float(sum(len(r) / correlation_length(r) for r in residuals if len(r)))


def _starts(samples: int, blocks: int) -> np.ndarray:
    """First samples of blocks of nearly equal length."""
    return np.arange(blocks) * samples // blocks


def _blocks_in(difference: np.ndarray) -> int:
    return max(1, int(len(difference) / (MEMORY * correlation_length(difference))))
