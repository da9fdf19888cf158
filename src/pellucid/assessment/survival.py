r"""How long until it ends, where some never do: durations that were cut off count as longer than what was seen of them.

A movement that was not at rest when the next target came lasted at least until then. A mean over such durations is a
mean of where the record was cut; the share that still goes on after t is not. By Kaplan and Meier [1]_, with d_i
movements that end at t_i and n_i that had not ended before,

.. math::
   S(t) = \prod_{t_i \le t} \Bigl(1 - \frac{d_i}{n_i}\Bigr), \qquad
   \hat\sigma^2 = \frac{1}{\ln^2 S} \sum_{t_i \le t} \frac{d_i}{n_i (n_i - d_i)},

and an interval :math:`S^{\exp(\pm z \hat\sigma)}`. The median is where S first is one half or less; where more than
half were cut off there is none, and the longest time seen is a bound from below.

.. [1] E. L. Kaplan, P. Meier, "Nonparametric estimation from incomplete observations", J. Am. Stat. Assoc. 53, 1958.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from .._errors import PellucidError


@dataclass(frozen=True, eq=False)
class Survival:
    """Share that has not ended, a step at each time at which one did."""

    time: np.ndarray  # (k,) [s]
    share: np.ndarray  # (k,) After each
    low: np.ndarray  # low, high: (k,) Its interval
    high: np.ndarray
    longest: float  # [s] of all, ended or cut off
    cut: float  # Share that was cut off

    @property
    def median(self) -> float:
        """Time by which half have ended [s]; infinite where fewer did."""
        below = np.flatnonzero(self.share <= 0.5 + 1e-12)
        return float(self.time[below[0]]) if len(below) else float("inf")

    @property
    def bounded_median(self) -> float:
        """The same, or the longest time seen [s], which is then below it."""
        return min(self.median, self.longest)


def survival(duration: np.ndarray, ended: np.ndarray, confidence: float = 0.95) -> Survival:
    """Kaplan and Meier's curve of durations, (n,) [s], of which those that have not `ended`, (n,), were cut off."""
    duration, ended = np.asarray(duration, float), np.asarray(ended, bool)
    if duration.ndim != 1 or ended.shape != duration.shape or not len(duration) or not np.isfinite(duration).all():
        raise PellucidError(
            f"survival: found durations {duration.shape} and ends {ended.shape}, expected as many numbers of both"
        )
    time = np.unique(duration[ended])
    going = len(duration) - np.searchsorted(np.sort(duration), time)
    ends = np.searchsorted(np.sort(duration[ended]), time, side="right") - np.searchsorted(
        np.sort(duration[ended]), time
    )
    share = np.cumprod(1.0 - ends / going)
    inner = (share > 0.0) & (share < 1.0)
    summed = np.cumsum(np.divide(ends, going * (going - ends), out=np.zeros(len(time)), where=going > ends))
    spread = np.sqrt(summed[inner]) / np.abs(np.log(share[inner]))
    low, high = share.copy(), share.copy()
    z = float(ndtri(0.5 + 0.5 * confidence))
    low[inner], high[inner] = (share[inner] ** np.exp(sign * z * spread) for sign in (1.0, -1.0))
    return Survival(time, share, low, high, float(duration.max()), float(np.mean(~ended)))
