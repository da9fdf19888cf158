"""With how many participants would "transparent" be said, if it is true? Power of a certificate by simulation.

Changes of all end points are drawn together about the changes that are supposed to be true (none, unless said): from a
normal distribution with their covariance over participants, or from a pilot's own people with replacement. Each draw is
one study, decided by `are_transparent` with everything that the study will have: its estimand, a declared share of
people, a person far beyond, and, where they are `Active`, orders of conditions and movements in their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._errors import PellucidError
from .certificate import Estimand, require_people
from .equivalence import Margin, Method
from .movement_indices import SimulatedStudies, are_transparent
from .power import (
    SEARCH_DRAWS_PER_STUDY,
    InlineExecutor,
    Power,
    covariance_root,
    find_fewest,
    run_parts,
    simulated_power,
)

LEVEL_SPREAD_RATIO = 5.0
"""People's levels in the control condition are drawn with this multiple of the standard deviation of their changes."""

LATE_SPREAD_RATIO = 1.0
"""Standard deviation of "the last third less all movements", as a multiple of that of people's changes.

Sixty movements of each condition that scatter by 12 % leave about that beside changes of 3 %."""


@dataclass(frozen=True)
class Active:
    """Parts of a certificate beside its test that a planned study will have."""

    estimand: Estimand = "mean"
    people: float | None = None  # declared share of people
    order: bool = False  # orders of two conditions are stated, each begun by half of the people
    learning: bool = False  # movements are recorded in their order, at least nine of each condition


CANDIDATE_SIZES = (5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128)
"""Numbers of participants that the search tries first. It does not look for more than the last."""


def equivalence_power(
    covariance: np.ndarray,
    margins: Sequence[Margin],
    participants: Sequence[int],
    *,
    change: Sequence[float] | None = None,
    alpha: float = 0.05,
    active: Active = Active(),
    method: Method | None = None,
    pilot: np.ndarray | None = None,
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
    active : Active
        What the study will have beside its test.
    method : str, optional
        Another test than the estimand's: ``"skew_robust"``, ``"signed_rank"`` or ``"t"``.
    pilot : ndarray, shape (k, m), optional
        Changes of a pilot's people, k >= 3: people are drawn from them, moved to `change`, in place of normal ones.
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
        If shapes do not fit, or the method is none of these.

    Examples
    --------
    >>> import numpy as np
    >>> margins = [Margin.of_ratio(0.1), Margin.of_ratio(0.1)]
    >>> curve = equivalence_power(0.05**2 * np.eye(2), margins, (8, 12, 20), studies=500)
    >>> [round(p, 1) for p in curve.power]
    [0.0, 0.0, 1.0]
    """
    covariance, m = np.atleast_2d(np.asarray(covariance, float)), len(margins)
    moved = np.zeros(m) if change is None else np.asarray(change, float)
    if covariance.shape != (m, m) or moved.shape != (m,) or not m:
        raise PellucidError(
            f"equivalence power: found a covariance of shape {covariance.shape} and {moved.shape} changes, expected "
            f"those of {m} end points"
        )
    if method not in (None, "skew_robust", "signed_rank", "t"):
        raise PellucidError(f"equivalence power: found the method {method!r}, expected skew_robust, signed_rank or t")
    require_people("equivalence power", active.estimand, active.people)
    if pilot is not None and (pilot.ndim != 2 or pilot.shape[1] != m or len(pilot) < 3):
        raise PellucidError(
            f"equivalence power: found a pilot of shape {pilot.shape}, expected at least 3 people x {m} end points"
        )
    if min(participants) < 2:
        raise PellucidError(f"equivalence power: found {min(participants)} participants, expected at least 2")
    people = None if pilot is None else (pilot - pilot.mean(axis=0)) * np.sqrt(len(pilot) / (len(pilot) - 1.0))
    settings = moved, covariance_root(covariance), tuple(margins), alpha, active, method, people
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
    active: Active = Active(),
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
    arguments = [(*job, power, alpha, active, studies, seed) for job in jobs]
    found = run_parts(
        _search_participants, arguments, executor, SEARCH_DRAWS_PER_STUDY * studies * len(jobs) * len(margins)
    )
    rows = [
        found[i : i + len(correlations) + len(margins)] for i in range(0, len(found), len(correlations) + len(margins))
    ]
    return [row[: len(correlations)] for row in rows], [row[len(correlations) :] for row in rows]


def _search_participants(covariance, margins, change, power, alpha, active, studies, seed) -> int | None:
    return find_equivalence_participants(
        covariance,
        margins,
        power=power,
        change=change,
        alpha=alpha,
        active=active,
        studies=studies,
        seed=seed,
        executor=InlineExecutor(),
    )


def _count_transparent_studies(n, studies, seed, change, factor, margins, alpha, active, method, people) -> int:
    """Return how many simulated studies end with the verdict "transparent"."""
    rng = np.random.default_rng(seed)
    if people is None:
        own = rng.standard_normal((studies, n, len(change))) @ factor.T
        spread = np.sqrt(np.sum(factor**2, axis=1))
    else:
        own = people[rng.integers(len(people), size=(studies, n))]
        spread = np.std(people, axis=0)
    drawn = draw_active(change + own, spread, active, rng)
    said = are_transparent(drawn, margins, alpha=alpha, estimand=active.estimand, people=active.people, method=method)
    return int(said.sum())


def draw_active(changes: np.ndarray, spread: np.ndarray, active: Active, rng: np.random.Generator) -> SimulatedStudies:
    """Return simulated studies of `changes` (k, n, m) with what is `active`; `spread`, (m,), is that of changes."""
    later = levels = drifts = late = None
    if active.order:
        later = np.where(np.arange(changes.shape[1]) % 2 == 0, 1.0, -1.0)
        levels = LEVEL_SPREAD_RATIO * spread * rng.standard_normal(changes.shape)
    if active.learning:
        thirds = np.sqrt(1.5) * LATE_SPREAD_RATIO * spread * rng.standard_normal((3, *changes.shape))
        drifts, late = thirds[2] - thirds[0], thirds[2] - thirds.mean(axis=0)
    return SimulatedStudies(changes, later, levels, drifts, late)
