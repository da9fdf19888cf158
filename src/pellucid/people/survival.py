r"""How long until it ends, where some never do: durations that were cut off count as longer than what was seen of them.

A movement that was not at rest when the next target came lasted at least until then. A mean over such durations is a
mean of where the record was cut; the share that still goes on after t is not. By Kaplan and Meier [1]_, with d_i
movements that end at t_i and n_i that had not ended before,

.. math::
   S(t) = \prod_{t_i \le t} \Bigl(1 - \frac{d_i}{n_i}\Bigr), \qquad
   \hat\sigma^2 = \frac{1}{\ln^2 S} \sum_{t_i \le t} \frac{d_i}{n_i (n_i - d_i)},

and an interval :math:`S^{\exp(\pm z \hat\sigma)}`. The median is where S first is one half or less; where more than
half were cut off there is none, and the longest time seen is a bound from below.

`looks` gives the levels of a study that is analysed several times on the way.

.. [1] E. L. Kaplan, P. Meier, "Nonparametric estimation from incomplete observations", J. Am. Stat. Assoc. 53, 1958.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from scipy import optimize
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
    count: int = 0  # number of durations
    cut_count: int = 0  # number of durations that were cut off

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
            f"survival: found durations {duration.shape} and ends {ended.shape}, expected equal shapes (n,)"
        )
    time, ends = np.unique(duration[ended], return_counts=True)
    going = len(duration) - np.searchsorted(np.sort(duration), time)
    share = np.cumprod(1.0 - ends / going)
    inner = (share > 0.0) & (share < 1.0)
    summed = np.cumsum(np.divide(ends, going * (going - ends), out=np.zeros(len(time)), where=going > ends))
    spread = np.sqrt(summed[inner]) / np.abs(np.log(share[inner]))
    low, high = share.copy(), share.copy()
    z = float(ndtri(0.5 + 0.5 * confidence))
    low[inner], high[inner] = (share[inner] ** np.exp(sign * z * spread) for sign in (1.0, -1.0))
    return Survival(
        time, share, low, high, float(duration.max()), float(np.mean(~ended)), len(ended), int(np.sum(~ended))
    )


INTEGRATION_NODE_COUNT = 801
"""Number of nodes of the numerical integration over the statistic."""

INTEGRATION_REACH_SD = 8.0
"""The integration over the statistic reaches this many standard deviations to either side."""


@dataclass(frozen=True)
class Looks:
    """One-sided boundaries of a study that is looked at several times."""

    share: tuple[float, ...]  # share of the participants at each look
    boundary: tuple[float, ...]  # boundary of the standardised statistic at each look
    level: tuple[float, ...]  # one-sided level of the test at each look
    spent: tuple[float, ...]  # alpha spent up to and including each look


def looks(share: Sequence[float], alpha: float = 0.05) -> Looks:
    """Return the levels of interim looks at given shares of the participants, by the spending of O'Brien and Fleming.

    It spends little of alpha at first, so that an early look can claim only what is very clear.

    Parameters
    ----------
    share : sequence of float
        Increasing shares of the participants, in (0, 1].
    alpha : float
        One-sided level of the whole study, in (0, 0.5).

    Returns
    -------
    Looks

    Raises
    ------
    PellucidError
        If shares do not rise, or the level is none.

    Examples
    --------
    >>> [round(z, 2) for z in looks((0.5, 1.0), 0.025).boundary]
    [2.96, 1.97]
    """
    t = np.asarray(share, float)
    if t.ndim != 1 or not len(t) or not (np.diff(t, prepend=0.0) > 0.0).all() or t[-1] > 1.0 + 1e-12:
        raise PellucidError(f"looks: found the shares {list(share)}, expected increasing shares above 0 and up to 1")
    if not 0.0 < alpha < 0.5:
        raise PellucidError(f"looks: found the level {alpha!r}, expected one between 0 and 0.5")
    spent = 2.0 * scipy.stats.norm.sf(scipy.stats.norm.isf(0.5 * alpha) / np.sqrt(np.minimum(t, 1.0)))
    boundaries: list[float] = []
    grid = density = None
    for k, new in enumerate(np.diff(spent, prepend=0.0)):
        step = t[k] - (t[k - 1] if k else 0.0)

        def crossing(z: float, now=t[k], step=step, grid=grid, density=density) -> float:
            bound = z * np.sqrt(now)
            if grid is None:
                return float(scipy.stats.norm.sf(z))
            return float(np.trapezoid(density * scipy.stats.norm.sf((bound - grid) / np.sqrt(step)), grid))

        z = (
            float(optimize.brentq(lambda z, new=new: crossing(z) - new, -INTEGRATION_REACH_SD, INTEGRATION_REACH_SD))
            if new > 1e-14
            else INTEGRATION_REACH_SD
        )
        boundaries.append(z)
        # The study goes on with the density of the sum below the boundary.
        bound = z * np.sqrt(t[k])
        onward = np.linspace(-INTEGRATION_REACH_SD * np.sqrt(t[k]), bound, INTEGRATION_NODE_COUNT)
        if grid is None:
            density = scipy.stats.norm.pdf(onward, scale=np.sqrt(step))
        else:
            moved = scipy.stats.norm.pdf(onward[:, None] - grid, scale=np.sqrt(step))
            density = np.trapezoid(density * moved, grid, axis=1)
        grid = onward
    return Looks(
        tuple(map(float, t)), tuple(boundaries), tuple(float(scipy.stats.norm.sf(z)) for z in boundaries),
        tuple(map(float, spent)),
    )  # fmt: skip
