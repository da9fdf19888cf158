"""With how many participants would "transparent" be said, if it is true? Power of a certificate by simulation.

Changes of all end points are drawn together from a normal distribution with their covariance over participants, about
the changes that are supposed to be true (none, unless said); each draw is one study, tested as `certificate` would.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from .._errors import PellucidError
from .equivalence import Margin, Method, critical_rank_sum
from .power import (
    SEARCH_DRAWS_PER_STUDY,
    InlineExecutor,
    Power,
    covariance_root,
    find_fewest,
    run_parts,
    simulated_power,
)
from .signed_rank import rank_sums

CANDIDATE_SIZES = (5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128)
"""Numbers of participants that the search tries first. It does not look for more than the last."""


def equivalence_power(
    covariance: np.ndarray,
    margins: Sequence[Margin],
    participants: Sequence[int],
    *,
    change: Sequence[float] | None = None,
    alpha: float = 0.05,
    method: Method = "signed_rank",
    studies: int = 2000,
    seed: int = 1,
    executor: Any = None,
) -> Power:
    """Return the probability that all end points are found within their margins, for studies of several sizes.

    Parameters
    ----------
    covariance : ndarray, shape (m, m)
        Covariance of participants' changes over end points, in the squared units of the margins.
    margins : sequence of Margin, length m
        Margins of the end points.
    participants : sequence of int
        Sizes to try, each at least 2.
    change : sequence of float, length m, optional
        True changes that are assumed; by default 0.
    alpha : float
        Level of each one-sided test.
    method : str
        ``"signed_rank"`` or ``"t"``.
    studies : int
        Number of simulated studies for each size.
    seed : int
        Seed of the simulation.
    executor : concurrent.futures.Executor, optional
        Executor of the parts, such as a Dask client's; by default large runs use every core.

    Returns
    -------
    Power

    Raises
    ------
    PellucidError
        If shapes do not fit, or the method is neither of both.

    Examples
    --------
    >>> import numpy as np
    >>> margins = [Margin.of_ratio(0.1), Margin.of_ratio(0.1)]
    >>> curve = equivalence_power(0.06**2 * np.eye(2), margins, (6, 16), studies=500)
    >>> curve.power[0] < 0.8 < curve.power[1]
    True
    """
    covariance, m = np.atleast_2d(np.asarray(covariance, float)), len(margins)
    moved = np.zeros(m) if change is None else np.asarray(change, float)
    if covariance.shape != (m, m) or moved.shape != (m,) or not m:
        raise PellucidError(
            f"equivalence power: found a covariance of shape {covariance.shape} and {moved.shape} changes, expected "
            f"those of {m} end points"
        )
    if method not in ("signed_rank", "t"):
        raise PellucidError(f"equivalence power: found the method {method!r}, expected signed_rank or t")
    if min(participants) < 2:
        raise PellucidError(f"equivalence power: found {min(participants)} participants, expected at least 2")
    ends = np.array([(margin.low, margin.high) for margin in margins])
    settings = moved, covariance_root(covariance), ends, alpha, method
    return simulated_power(
        "equivalence", _count_transparent_studies, settings, participants, studies, seed, executor, m
    )


def find_equivalence_participants(
    covariance: np.ndarray, margins: Sequence[Margin], *, power: float = 0.9, **options
) -> int | None:
    """Return the fewest participants that reach the certificate's `power`; None if the largest size does not."""

    def enough(n: int) -> bool:
        return equivalence_power(covariance, margins, (n,), **options).power[0] >= power

    return find_fewest(CANDIDATE_SIZES, enough, 1)


def participants_for_changes(
    spreads: Sequence[float],
    margins: Sequence[Margin],
    shares: Sequence[float],
    correlations: Sequence[float],
    *,
    power: float = 0.9,
    alpha: float = 0.05,
    studies: int = 2000,
    seed: int = 1,
    executor: Any = None,
) -> tuple[list[list[int | None]], list[list[int | None]]]:
    """Return the fewest participants for all end points together, and for each end point alone.

    Rows are true changes, as `shares` of every margin's upper end. Columns are `correlations` of people's changes over
    end points, or single end points. `spreads`, (m,), are standard deviations of people's changes. Each search is a job
    of its own, on every core or through the `executor`.
    """
    if len(spreads) != len(margins) or not margins or not all(s > 0.0 for s in spreads):
        raise PellucidError(
            f"plan: found {len(spreads)} spreads, expected one above 0 for each of {len(margins)} margins"
        )
    spread, ends = np.asarray(spreads, float), np.array([margin.high for margin in margins])
    jobs = []
    for share in shares:
        for rho in correlations:
            shape = (1.0 - rho) * np.eye(len(spread)) + rho
            jobs.append((np.outer(spread, spread) * shape, list(margins), share * ends))
        for i, margin in enumerate(margins):
            jobs.append((spread[i : i + 1, None] ** 2, [margin], share * ends[i : i + 1]))
    arguments = [(*job, power, alpha, studies, seed) for job in jobs]
    found = run_parts(
        _search_participants, arguments, executor, SEARCH_DRAWS_PER_STUDY * studies * len(jobs) * len(margins)
    )
    rows = [
        found[i : i + len(correlations) + len(margins)] for i in range(0, len(found), len(correlations) + len(margins))
    ]
    return [row[: len(correlations)] for row in rows], [row[len(correlations) :] for row in rows]


def _search_participants(covariance, margins, change, power, alpha, studies, seed) -> int | None:
    return find_equivalence_participants(
        covariance,
        margins,
        power=power,
        change=change,
        alpha=alpha,
        studies=studies,
        seed=seed,
        executor=InlineExecutor(),
    )


def _count_transparent_studies(n, studies, seed, change, factor, ends, alpha, method) -> int:
    """Return how many simulated studies end with the verdict "transparent"."""
    rng = np.random.default_rng(seed)
    drawn = change + rng.standard_normal((studies, n, len(change))) @ factor.T
    within = np.ones(studies, bool)
    for j, (low, high) in enumerate(ends):
        for inner in (drawn[:, :, j] - low, high - drawn[:, :, j]):
            if np.isfinite(inner).all():
                within &= _is_above_zero(inner, alpha, method)
    return int(within.sum())


def _is_above_zero(differences: np.ndarray, alpha: float, method: str) -> np.ndarray:
    """Return whether each row of differences, (studies, n), is significantly above 0; shape (studies,)."""
    n = differences.shape[1]
    if method == "t":
        spread = np.std(differences, axis=1, ddof=1) / np.sqrt(n)
        return differences.mean(axis=1) >= stats.t.isf(alpha, n - 1) * spread
    needed = critical_rank_sum(n, alpha)
    if needed is None:
        return np.zeros(len(differences), bool)
    return rank_sums(differences) >= needed
