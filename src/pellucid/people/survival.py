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
    """Kaplan-Meier curve: the share that has not ended, with a step at each time at which one ended."""

    time: np.ndarray  # (k,) times at which durations ended [s]
    share: np.ndarray  # (k,) share that has not ended after each time
    low: np.ndarray  # (k,) lower end of the interval of the share
    high: np.ndarray  # (k,) upper end of the interval of the share
    longest: float  # longest duration, ended or cut off [s]
    cut: float  # share of durations that were cut off

    @property
    def median(self) -> float:
        """Time by which half have ended [s]; infinite if fewer did."""
        below = np.flatnonzero(self.share <= 0.5 + 1e-12)
        return float(self.time[below[0]]) if len(below) else float("inf")

    @property
    def bounded_median(self) -> float:
        """Median, or the longest time seen [s] as its lower bound if the median was not reached."""
        return min(self.median, self.longest)


def survival(duration: np.ndarray, ended: np.ndarray, confidence: float = 0.95) -> Survival:
    """Return the Kaplan-Meier curve of durations, (n,) [s]; those that have not `ended`, (n,), were cut off."""
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
