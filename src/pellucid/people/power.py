"""Number of participants for a study: power of the tests, simulated from a pilot study.

Participants are sampled from a normal distribution with the pilot's means and covariances over conditions. Values that
all conditions of a participant share cancel, as in the tests. The control's mean stays, and the means of the other
conditions may be moved to the change that is to be detected. Each sample is one study, tested as in `comparison`. The
power is the share of studies with a significant test.

Draws come in parts with seeds of their own, so that the outcome is the same on however many cores. The parts go through
an executor of the standard library's kind; without one, small runs stay in this process and larger ones use every core.

With how many participants "transparent" would be said, if it is true, is found in the same way (`equivalence_power`).
Changes of all end points are drawn together about the changes that are supposed to be true (none, unless said): from a
normal distribution with their covariance over participants, or from a pilot's own people with replacement. Each draw is
one study, decided by `are_transparent` with everything that the study will have: its estimand, the shares of people,
and, where they are `Active`, orders of conditions and movements in their order.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache
from numbers import Integral
from typing import Any, Literal

import numpy as np
from scipy.special import chdtrc

from .._errors import PellucidError
from .._processes import InlineExecutor, processes, worker_count
from ..numerics.arguments import with_checked_arguments
from ..numerics.tied_ranks import tied_ranks
from ..units import parse_quantity
from .analysis import ESTIMAND_METHODS, MAX_SHARE, Analysis, EndPoint, Estimand, share_rule
from .comparison import friedman_statistics, rank_sums, tells_from_control, two_sided_p
from .design_columns import MovementDuration
from .equivalence import DEFAULT_CARRY_OVER, Margin, Method
from .movement_indices import SimulatedStudies, are_transparent
from .movement_noise import MovementNoise
from .session_periods import SessionPeriods
from .share_of_people import DEFAULT_RULE
from .survival import survival

STUDIES_PER_PART = 500
"""Number of studies that one part of a simulation draws. Each part has a seed of its own."""

MAX_INLINE_DRAWS = 5_000_000
"""A simulation of at most this many participants runs in this process; starting others would take longer."""

Test = Literal["friedman", "nemenyi", "signed_rank"]


@dataclass(frozen=True)
class Power:
    """Power of one test over numbers of participants.

    Attributes
    ----------
    test : str
    participants : tuple of int
    power : tuple of float
        Share of the simulated studies that were significant.
    standard_error : tuple of float
        Standard error of `power`, from the number of simulated studies.
    """

    test: str
    participants: tuple[int, ...]
    power: tuple[float, ...]
    standard_error: tuple[float, ...]

    def needed(self, power: float = 0.8) -> int | None:
        """Return the fewest participants from which on the power is reached; None if it is not reached."""
        enough = [p >= power for p in self.power]
        for i, n in enumerate(self.participants):
            if all(enough[i:]):
                return n
        return None


@with_checked_arguments
def power_curve(
    pilot: np.ndarray,
    participants: Sequence[int],
    *,
    test: Test = "friedman",
    control: int = 0,
    compared: int | None = None,
    change: float | None = None,
    comparisons: int = 1,
    alpha: float = 0.05,
    studies: int = 2000,
    seed: int = 1,
    executor: Any = None,
) -> Power:
    """Return the power of a test for studies of several sizes.

    Parameters
    ----------
    pilot : ndarray, shape (n, k)
        Participants' values of a pilot study, one column for each condition, in any one unit.
    participants : sequence of int
        Sizes to try, each at least 2.
    test : str
        ``"friedman"``: do conditions differ at all; ``"nemenyi"``, after a significant test of Friedman, or
        ``"signed_rank"``: does `compared` differ from control.
    control, compared : int
        Columns of the control and of the condition that is compared with it.
    change : float, optional
        True difference from control of `compared` (with ``"friedman"``, of every other condition), in the pilot's unit;
        by default that of the pilot.
    comparisons : int
        Number of comparisons among which `alpha` is divided, for ``"signed_rank"``.
    alpha : float
        Probability of a false alarm.
    studies : int
        Number of simulated studies for each size.
    seed : int
        Seed of the simulation.
    executor : object, optional
        With a method ``submit(function, *arguments)`` whose outcome has ``result()``: a `concurrent.futures.Executor`,
        or a Dask client.

    Returns
    -------
    Power

    Raises
    ------
    PellucidError
        If the pilot has fewer than 3 participants or 2 conditions, or there is nothing to compare.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> rng = np.random.default_rng(2)
    >>> pilot = rng.normal(1.0, 0.1, (6, 1)) + rng.normal(0.0, 0.05, (6, 3)) + np.array([0.0, 0.0, 0.1])
    >>> curve = pl.power_curve(pilot, [4, 8, 16], test="signed_rank", compared=2, change=0.05, studies=200)
    >>> curve.power[0], curve.needed(0.8)
    (0.0, 8)
    """
    pilot = np.asarray(pilot, float)
    if pilot.ndim != 2 or pilot.shape[0] < 3 or pilot.shape[1] < 2 or not np.isfinite(pilot).all():
        raise PellucidError(
            f"power: found a pilot of shape {pilot.shape}, expected at least 3 participants x 2 conditions"
        )
    if test != "friedman" and (compared is None or compared == control):
        raise PellucidError(f"power: found compared = {compared}, expected another condition than the control")
    if min(participants) < 2:
        raise PellucidError(f"power: found {min(participants)} participants, expected at least 2")
    mean = pilot.mean(axis=0)
    if change is not None:
        moved = [j for j in range(pilot.shape[1]) if j != control] if test == "friedman" else [compared]
        mean[moved] = mean[control] + change
    factor = covariance_root(np.cov(pilot, rowvar=False))
    settings = mean, factor, test, control, compared, alpha / comparisons
    return simulated_power(test, _count_significant_studies, settings, participants, studies, seed, executor)


def simulated_power(
    test: str,
    count: Callable[..., int],
    settings: tuple,
    participants: Sequence[int],
    studies: int,
    seed: int,
    executor: Any,
    numbers: int = 1,
) -> Power:
    """Return the power for studies of several sizes.

    `count(n, studies, seed, *settings)` returns the number of significant studies of one part. `numbers` is how many
    values each participant has.
    """
    parts = [(n, i) for n in participants for i in range(-(-studies // STUDIES_PER_PART))]
    arguments = [(n, min(STUDIES_PER_PART, studies - i * STUDIES_PER_PART), (seed, n, i), *settings) for n, i in parts]
    counts = run_parts(count, arguments, executor, studies * sum(participants) * numbers)
    hits = dict.fromkeys(participants, 0)
    for (n, _), found in zip(parts, counts, strict=True):
        hits[n] += found
    share = tuple(hits[n] / studies for n in participants)
    spread = tuple(float(np.sqrt(max(p * (1.0 - p), 1.0 / studies) / studies)) for p in share)
    return Power(test, tuple(participants), share, spread)


CANDIDATE_SIZES = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96)
"""Numbers of participants that the search tries first. It does not look for more than the last."""

SEARCH_DRAWS_PER_STUDY = 60
"""Approximate number of participants that a search draws for each simulated study; used to estimate its cost."""

STANDARDISED_CHANGES = (0.5, 0.8, 1.0, 1.25, 1.5, 2.0, 3.0)
"""Standardised changes (mean over standard deviation) for which plans list the number of participants."""


def participants_needed(pilot: np.ndarray, *, power: float = 0.8, **options) -> int | None:
    """Return the fewest participants with whom a test reaches the `power`. `pilot` (n, k)."""

    def enough(n: int) -> bool:
        return power_curve(pilot, (n,), **options).power[0] >= power

    return find_fewest(CANDIDATE_SIZES, enough, 2)


def find_fewest(sizes: Sequence[int], enough: Callable[[int], bool], too_few: int) -> int | None:
    """Return the smallest number that is enough; None if none of `sizes` is.

    The search halves the range between the first of `sizes` that is enough and the one before it. Numbers up to
    `too_few` are not tried.
    """
    last = too_few
    for size in sizes:
        if enough(size):
            low, high = last, size
            while high - low > 1:
                middle = (low + high) // 2
                low, high = (low, middle) if enough(middle) else (middle, high)
            return high
        last = size
    return None


def participants_for_effects(
    effects: Sequence[float],
    *,
    comparisons: int = 1,
    alpha: float = 0.05,
    studies: int = 2000,
    seed: int = 1,
    executor: Any = None,
) -> list[int | None]:
    """Return the fewest participants with whom the signed-rank test finds standardised `effects` in 8 of 10 studies."""
    arguments = [(abs(effect), comparisons, alpha, studies, seed) for effect in effects]
    return run_parts(_participants_for_effect, arguments, executor, SEARCH_DRAWS_PER_STUDY * studies * len(effects))


def _participants_for_effect(effect: float, comparisons: int, alpha: float, studies: int, seed: int) -> int | None:
    # The pilot holds three people with differences of mean 0 and standard deviation 1.
    pilot = np.array([[0.0, -1.0], [0.0, 0.0], [0.0, 1.0]])
    return participants_needed(
        pilot, test="signed_rank", compared=1, change=effect, comparisons=comparisons, alpha=alpha, studies=studies,
        seed=seed, executor=InlineExecutor(),
    )  # fmt: skip


def run_parts(
    function: Callable, arguments: list[tuple], executor: Any, size: int, on_done: Callable[[float], None] | None = None
) -> list:
    """Return the results of `function` for each of `arguments`, in order.

    They run in this process if the `size` is small or it is itself a worker, otherwise in the `executor` or in worker
    processes. `on_done` receives the share that is done after each.
    """
    if executor is None and (size <= MAX_INLINE_DRAWS or worker_count() <= 1):
        executor = InlineExecutor()
    results = []
    with processes() if executor is None else nullcontext(executor) as used:
        for future in [used.submit(function, *each) for each in arguments]:
            results.append(future.result())
            if on_done is not None:
                on_done(len(results) / len(arguments))
    return results


def _count_significant_studies(n, studies, seed, mean, factor, test, control, compared, alpha) -> int:
    """Return how many simulated studies are significant."""
    values = mean + _drawn(seed, (studies, n, len(mean))) @ factor.T
    if test == "signed_rank":
        return int(np.sum(_has_significant_ranks(values[:, :, compared] - values[:, :, control], alpha)))
    if test == "friedman":
        statistic = friedman_statistics(tied_ranks(values, axis=2))
        return int(np.sum(chdtrc(len(mean) - 1, statistic) < alpha))
    return int(tells_from_control(values, control, alpha=alpha)[:, compared].sum())


# Searches for several changes draw the same studies.
@lru_cache(maxsize=64)
def _drawn(seed: tuple[int, ...], shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(shape)


def _has_significant_ranks(differences: np.ndarray, alpha: float) -> np.ndarray:
    """Return whether the exact p value of each row of differences, (studies, n), is below `alpha`; (studies,)."""
    return two_sided_p(rank_sums(differences), differences.shape[1]) < alpha


def covariance_root(covariance: np.ndarray) -> np.ndarray:
    """Return a square root of a covariance, (k, k), which need not have full rank."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def lasting_bounds(
    lasted: Sequence[MovementDuration],
    participants: Sequence[str],
    conditions: Sequence[str],
    control: str,
    compared: str,
    change: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return lower and upper bounds of the change of median durations, (n,) each; None without shared cells.

    `change` maps the medians [s] in `compared` and in `control` to the change. Only cells of movements that occur in
    all `conditions` count.
    """
    found = lasting_medians(lasted, participants, conditions, (control, compared))
    if found is None:
        return None
    (base, own), (base_known, own_known) = found[0].T, found[1].T
    seen = change(own, base)
    return np.where(base_known, seen, -np.inf), np.where(own_known, seen, np.inf)


def lasting_medians(
    lasted: Sequence[MovementDuration], participants: Sequence[str], conditions: Sequence[str], of: Sequence[str]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return median durations [s] and whether all were reached, (n, k), in the k conditions `of`.

    Only cells of movements that occur in all `conditions` count. Without such cells the result is None.
    """
    cells: dict[tuple[str, str], dict[tuple, list[MovementDuration]]] = {}
    for each in lasted:
        own = cells.setdefault((each.participant, each.condition), {})
        own.setdefault(each.cell, []).append(each)
    longest = max((each.seconds for each in lasted if math.isfinite(each.seconds)), default=0.0)
    values, reached = [], []
    for person in participants:
        shared = set.intersection(*(set(cells.get((person, c), ())) for c in conditions))
        if not shared:
            return None
        found = [
            [_bounded_median(cells[person, condition][cell], longest) for cell in sorted(shared, key=str)]
            for condition in of
        ]
        values.append([np.mean([value for value, _ in own]) for own in found])
        reached.append([all(known for _, known in own) for own in found])
    return np.array(values), np.array(reached)


def _bounded_median(own: Sequence[MovementDuration], longest: float) -> tuple[float, bool]:
    """Return the median duration of similar movements [s], and whether it was reached.

    A movement that never settled counts as longer than the longest one.
    """
    seconds = np.minimum([each.seconds for each in own], longest)
    curve = survival(seconds, np.array([each.settled for each in own]))
    return curve.bounded_median, bool(np.isfinite(curve.median))


LATE_SPREAD_RATIO = 1.0
"""Standard deviation of the mean of the last third minus that of all movements, as a multiple of that of changes.

Sixty movements of each condition that scatter by 12 % have about this ratio if changes are 3 %."""

NOISE_DEGREES_A_PERSON = 2.0
"""Degrees of freedom for each person of the noise of movements in a planned study.

About five movements of each cell and condition in `movement_noise.MAX_PARTS` parts have that."""


@dataclass(frozen=True)
class Active:
    """Parts of a planned study's certificate in addition to its test."""

    estimand: Estimand = "mean"
    people: float | None = None  # declared share of people
    people_level: float = DEFAULT_RULE.alpha  # level of the tests of both shares of people
    order: bool = False  # orders of two conditions are stated, each begun by half of the people
    largest_carry_over: float = DEFAULT_CARRY_OVER  # in half-widths of the margin; matters where orders are stated
    learning: bool = False  # movements are recorded in their order, at least nine of each condition
    noise: tuple[float, ...] = ()  # by end point, the share of the variance of changes that is noise of movements

    @classmethod
    def of(cls, analysis: Analysis, *, order: bool, learning: bool, noise: Sequence[float] = ()) -> Active:
        """Return what a study with this analysis will have; `order`: whether its sessions come in stated orders."""
        return cls(
            analysis.estimand, analysis.people, analysis.people_level, order, analysis.largest_carry_over, learning,
            tuple(noise),
        )  # fmt: skip


MIN_FORECAST_PEOPLE = 3
"""Smallest number of people whose changes tell how many people are needed."""

CERTIFICATE_SIZES = (12, 14, 16, 20, 24, 32, 48, 64, 96, 128)
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
        Numbers of participants to simulate, each at least 2.
    change : sequence of float, length m, optional
        Assumed true changes; by default 0.
    alpha : float
        Level of each one-sided test.
    active : Active
        Parts of the certificate in addition to its test.
    method : str, optional
        Test that replaces the estimand's: ``"skew_robust"``, ``"signed_rank"`` or ``"t"``.
    pilot : ndarray, shape (k, m), optional
        Changes of a pilot's people, k >= 3. Simulated people are then sampled from these changes, moved to `change`,
        instead of from a normal distribution.
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
    [0.0, 0.8, 1.0]
    """
    covariance, m = np.atleast_2d(np.asarray(covariance, float)), len(margins)
    moved = np.zeros(m) if change is None else np.asarray(change, float)
    if covariance.shape != (m, m) or moved.shape != (m,) or not m:
        raise PellucidError(
            f"equivalence power: found a covariance of shape {covariance.shape} and changes of shape {moved.shape}, "
            f"expected ({m}, {m}) and ({m},): one row and one change for each of the {m} margins"
        )
    if method not in (None, "skew_robust", "signed_rank", "t"):
        raise PellucidError(f"equivalence power: found the method {method!r}, expected skew_robust, signed_rank or t")
    share_rule("equivalence power", active.estimand, active.people, active.people_level)
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


@with_checked_arguments
def plan(
    analysis: Analysis | Mapping[str, Any] | str | os.PathLike[str],
    *,
    people: int | Sequence[int],
    sd: float | str | Mapping[str, float | str],
    effect: float | str | Mapping[str, float | str] = 0.0,
    noise_share: float | Mapping[str, float] = 0.0,
    correlation: float = 0.0,
    learning: bool = True,
    studies: int = 2000,
    seed: int = 1,
    executor: Any = None,
) -> float | tuple[float, ...]:
    """Return the power of an analysis: the probability that it ends with "transparent".

    People's changes are drawn from a normal distribution. Each simulated study is decided as `certify` decides it, with
    the estimand, both shares of people and, where sessions are ordered, the effect of the period and the largest
    carry-over.

    Parameters
    ----------
    analysis : Analysis, mapping, or path-like
        The analysis with its margins: an object, its mapping, ``analysis.toml``, or study.toml with ``[assessment]``.
        With the design ``"AB/BA"`` or ``"Williams"``, or with a column of periods, orders are balanced and their
        effects are taken out.
    people : int or sequence of int
        Number of participants, or several.
    sd : float, str, or mapping of str to float or str
        Standard deviation of people's changes, of each end point or of all: as a share (0.05, ``"5 %"``) where the
        margin is one, otherwise in the index's unit.
    effect : float, str, or mapping of str to float or str
        True change, in the same units.
    noise_share : float or mapping of str to float
        Share in [0, 1) of the variance of people's changes that is noise of their movements, which the study will
        tell from several movements of each kind; 0 if each person has one value of each condition.
    correlation : float
        Correlation of people's changes between end points, in [0, 1].
    learning : bool
        Whether movements are recorded in their order, at least nine of each condition, so that learning is tested.
    studies : int
        Number of simulated studies for each number of participants.
    seed : int
        Seed of the simulation.
    executor : concurrent.futures.Executor, optional
        Executor of the simulation; by default large runs use every core.

    Returns
    -------
    float or tuple of float
        Probability of "transparent", for each number of participants.

    Raises
    ------
    PellucidError
        If the analysis has no margins, or a standard deviation is missing or not above 0.

    Examples
    --------
    >>> import pellucid as pl
    >>> stated = {"margins": {"duration": "10 %"}, "design": "AB/BA"}
    >>> [round(power, 1) for power in pl.plan(stated, people=(8, 12, 24), sd="4 %", studies=500)]
    [0.0, 0.8, 1.0]
    """
    stated = Analysis.of(analysis)
    points = stated.end_points()
    if not points:
        raise PellucidError(f"plan, {stated.where}: found no margins, expected one for each end point")
    if not 0.0 <= correlation <= 1.0:
        raise PellucidError(f"plan: found correlation = {correlation:g}, expected one from 0 to 1")
    spread = np.array([expected_size(points[name], "sd", sd) for name in points])
    moved = np.array([expected_size(points[name], "effect", effect) for name in points])
    noise = [float(noise_share[n] if isinstance(noise_share, Mapping) else noise_share) for n in points]
    if not all(0.0 <= share < 1.0 for share in noise):
        raise PellucidError(f"plan: found noise_share = {noise_share}, expected shares from 0 to below 1")
    found = planned_power(
        points, spread, moved, (people,) if isinstance(people, Integral) else tuple(people),
        correlation=correlation, alpha=stated.false_transparent,
        active=Active.of(stated, order=stated.is_ordered, learning=learning, noise=noise if any(noise) else ()),
        studies=studies, seed=seed,
        executor=executor,
    )  # fmt: skip
    return found.power[0] if isinstance(people, Integral) else found.power


def planned_power(
    points: Mapping[str, EndPoint], spread: np.ndarray, change: np.ndarray, participants: Sequence[int], *,
    correlation: float = 0.0, **options: Any,
) -> Power:  # fmt: skip
    """Return the power for end points whose people's changes have these spreads and true changes, (m,) each."""
    shape = (1.0 - correlation) * np.eye(len(points)) + correlation
    margins = [point.margin for point in points.values()]
    return equivalence_power(np.outer(spread, spread) * shape, margins, participants, change=change, **options)


def expected_size(point: EndPoint, what: str, given: float | str | Mapping[str, float | str], where: str = "") -> float:
    """Return the ``"sd"`` or the ``"effect"`` that is `given` for an end point, in the unit of its changes.

    `where` begins messages.
    """
    where = where or f"plan, {what} of {point.name}"
    if isinstance(given, Mapping) and point.name not in given:
        raise PellucidError(f"{where}: found {', '.join(given) or 'nothing'}, expected {point.name} too")
    value = given[point.name] if isinstance(given, Mapping) else given
    if isinstance(value, str):
        share = value.strip().endswith("%")
        size = parse_quantity(value, "1" if share else point.index.unit, where)
        if share != point.stated.strip().endswith("%"):
            raise PellucidError(f'{where}: found "{value}", expected a size of the kind of its margin, {point.stated}')
    else:
        size = float(value)
        if point.ratio and abs(size) > MAX_SHARE:
            raise PellucidError(
                f'{where}: found {value}, which is {100.0 * size:g} % of the control condition, expected a share such '
                f'as {size / 100.0:g}, or a percentage such as "{size:g} %"'
            )
    if not np.isfinite(size) or (what == "sd" and not size > 0.0) or (point.ratio and size <= -1.0):
        raise PellucidError(f"{where}: found {value}, expected a finite number{' above 0' * (what == 'sd')}")
    # The standard deviation of logarithms of ratios is that of small relative changes.
    return float(np.log1p(size)) if point.ratio and what == "effect" else size


def find_equivalence_participants(
    covariance: np.ndarray, margins: Sequence[Margin], *, power: float = 0.9, **options
) -> int | None:
    """Return the fewest participants that reach the certificate's `power`; None if the largest size does not."""

    def enough(n: int) -> bool:
        return equivalence_power(covariance, margins, (n,), **options).power[0] >= power

    return find_fewest(CERTIFICATE_SIZES, enough, CERTIFICATE_SIZES[0] - 1)


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
    on_done: Callable[[float], None] | None = None,
) -> tuple[list[list[int | None]], list[list[int | None]]]:
    """Return the fewest participants for all end points together, and for each end point alone.

    Rows are true changes, as `shares` of every margin's upper end. Columns are `correlations` of people's changes over
    end points, or single end points. `spreads`, (m,), are standard deviations of people's changes. Each search is a job
    of its own, on every core or through the `executor`; `on_done` receives the share that is done after each.
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
        _search_participants, arguments, executor, SEARCH_DRAWS_PER_STUDY * studies * len(jobs) * len(margins), on_done
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
    said = are_transparent(
        drawn,
        margins,
        alpha=alpha,
        rule=share_rule("equivalence power", active.estimand, active.people, active.people_level),
        largest_carry_over=active.largest_carry_over,
        method=ESTIMAND_METHODS[active.estimand] if method is None else method,
    )
    return int(said.sum())


def draw_active(changes: np.ndarray, spread: np.ndarray, active: Active, rng: np.random.Generator) -> SimulatedStudies:
    """Return simulated studies of `changes` (k, n, m) with what is `active`; `spread`, (m,), is that of changes."""
    sessions = drifts = late = None
    if active.order:
        sessions = SessionPeriods.of_two(np.where(np.arange(changes.shape[1]) % 2 == 0, 1.0, -1.0))
    if active.learning:
        thirds = np.sqrt(1.5) * LATE_SPREAD_RATIO * spread * rng.standard_normal((3, *changes.shape))
        drifts, late = thirds[2] - thirds[0], thirds[2] - thirds.mean(axis=0)
    noise: tuple[MovementNoise | None, ...] = ()
    if active.noise:
        degrees = NOISE_DEGREES_A_PERSON * changes.shape[1]
        noise = tuple(
            MovementNoise(share * float(own) ** 2, degrees) if share > 0.0 else None
            for share, own in zip(active.noise, spread, strict=True)
        )
    return SimulatedStudies(changes, sessions, drifts, late, noise)
