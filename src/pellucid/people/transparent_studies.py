"""Decide of many simulated studies at once which of them are certified: the tests of `certificate`, and all doubts.

A simulated study has people's changes of each end point. Where the orders of conditions are stated, it also has the
periods and people's levels, for the period's effect and carry-over; where movements are recorded in their order, the
changes of its last thirds, for learning. What is active in a study takes part here, so that a plan and a proof of error
rates meet the same decisions as a user.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from ..numerics.tied_ranks import TIE_TOLERANCE
from .certificate import ESTIMAND_METHODS, Estimand
from .crossover import carry_over_of_studies, is_balanced, without_period
from .equivalence import FAR_MARGIN_COUNT, Margin, Method, critical_rank_sum, share_bound
from .mean_test import mean_p_values
from .signed_rank import rank_sums, two_sided_p


@dataclass(frozen=True)
class SimulatedStudies:
    """Values of k simulated studies of n people and m end points.

    Attributes
    ----------
    changes : ndarray, shape (k, n, m)
        People's changes from control, in the unit of the margins.
    later : ndarray, shape (n,), optional
        Number of periods by which the condition came after control; without it, orders are not stated.
    levels : ndarray, shape (k, n, m), optional
        People's values in the control condition, for carry-over; needs `later`.
    drifts, late : ndarray, shape (k, n, m), optional
        Change of the last third of movements less that of the first, and that of the last third less that of all.
    """

    changes: np.ndarray
    later: np.ndarray | None = None
    levels: np.ndarray | None = None
    drifts: np.ndarray | None = None
    late: np.ndarray | None = None


def are_transparent(
    studies: SimulatedStudies,
    margins: Sequence[Margin],
    *,
    alpha: float = 0.05,
    estimand: Estimand = "mean",
    people: float | None = None,
    method: Method | None = None,
) -> np.ndarray:
    """Return whether each study is certified as transparent, shape (k,): what `certificate` says of its values."""
    used: Method = ESTIMAND_METHODS[estimand] if method is None else method
    said = np.ones(len(studies.changes), bool)
    for j, margin in enumerate(margins):
        d = studies.changes[:, :, j]
        excess = margin.excess(d, d)
        said &= are_within(d, margin, alpha, used) & (excess <= FAR_MARGIN_COUNT).all(axis=1)
        if people is not None:
            said &= np.sum(excess <= 1.0 + TIE_TOLERANCE, axis=1) >= _needed_count(people, d.shape[1], alpha)
        said &= ~_is_contradicted(studies, j, margin, alpha, used)
    return said


def are_within(differences: np.ndarray, margin: Margin, alpha: float, method: Method) -> np.ndarray:
    """Return whether each row of differences, (k, n), tests within a margin at level `alpha`; shape (k,)."""
    n = differences.shape[1]
    if method == "skew_robust":
        return mean_p_values(differences, differences, margin.low, margin.high)[0] <= alpha
    said = np.ones(len(differences), bool)
    for inner in (differences - margin.low, margin.high - differences):
        if np.isfinite(inner).all():
            if method == "t":
                error = np.std(inner, axis=1, ddof=1) / np.sqrt(n)
                said &= inner.mean(axis=1) >= stats.t.isf(alpha, n - 1) * error
            else:
                needed = critical_rank_sum(n, alpha)
                said &= needed is not None and rank_sums(inner) >= needed
    return said


def _is_contradicted(studies: SimulatedStudies, j: int, margin: Margin, alpha: float, method: Method) -> np.ndarray:
    """Return whether a doubt takes the claim about one end point from each study, shape (k,)."""
    d, level = studies.changes[:, :, j], alpha / studies.changes.shape[2]
    taken = np.zeros(len(d), bool)
    later = studies.later
    if later is not None and d.shape[1] >= 4 and np.ptp(later) > 0.0:
        if not is_balanced(later):
            taken |= ~are_within(without_period(d, later)[1], margin, alpha, method)
        first = later < 0.0
        if studies.levels is not None and min(first.sum(), (~first).sum()) >= 2:
            control = studies.levels[:, :, j]
            p, change, error = carry_over_of_studies(control, control + d, first)
            reach = stats.t.isf(alpha, d.shape[1] - 2) * error
            taken |= (p <= level) & ~((change - reach >= margin.low) & (change + reach <= margin.high))
    if studies.drifts is not None and studies.late is not None:
        drifting = _has_trend(studies.drifts[:, :, j], level)
        taken |= drifting & ~are_within(d + studies.late[:, :, j], margin, alpha, method)
    return taken


def _has_trend(drifts: np.ndarray, alpha: float) -> np.ndarray:
    """Return whether the exact two-sided p of signed ranks of each row of drifts, (k, n), is at most `alpha`."""
    return two_sided_p(rank_sums(drifts), drifts.shape[1]) <= alpha


def _needed_count(share: float, people: int, alpha: float) -> int:
    """Return the fewest people within of a number of `people` whose lower confidence bound reaches a `share`."""
    return next((k for k in range(people + 1) if share_bound(k, people, alpha) >= share), people + 1)
