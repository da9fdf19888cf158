"""Indices of movements: of a record's arrays, of a study's participants and conditions, and of simulated studies.

`movement_indices` finds movements in an angle record and gives duration, peak velocity, smoothness. `index_table` has
one value of each participant and condition; `isochrony` says how mean velocity and duration grow with amplitude.
`are_transparent` decides many simulated studies at once as `certificate` decides one.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .._errors import RecordingError
from .._tabular import html_table, text_table
from ..numerics.arguments import with_checked_arguments
from ..units import COORDINATES_BY_UNIT, Coordinate
from .comparison import rank_sums, two_sided_p
from .design_columns import DIRECTION_DOWN, DIRECTION_UP, MeasuredMovement, MovementDuration
from .equivalence import DEFAULT_CARRY_OVER, Margin, Method, margin_p_values
from .indices import MEAN_VELOCITY, MOVEMENT_DURATION, Index, indices_along, smoothness
from .movement_noise import MovementNoise
from .movements import MovementRule, kinematics, movements, rest_stretches, target_stretches
from .session_periods import SessionPeriods, adjustment
from .share_of_people import DEFAULT_RULE, ShareRule, share_p_values
from .survival import survival

UNITS = {
    "start": "s", "duration": "s", "first_arrival": "s", "after_arrival": "s", "corrections": "1", "direction": "1",
    "travel": "rad", "peak_velocity": "rad/s",
    "mean_velocity": "rad/s", "peak_acceleration": "rad/s^2", "peak_time": "1", "sparc": "1", "ldlj": "1",
    "normalised_jerk": "1",
}  # fmt: skip
"""Unit of every index that needs the angle alone."""


@dataclass(frozen=True, eq=False)
class MovementIndices(Mapping[str, np.ndarray]):
    """Indices of every movement of a record by name; each is an array with one value for each movement.

    Attributes
    ----------
    columns : Mapping of str to ndarray, shape (movements,)
        start, duration (time to rest), first_arrival (time until the speed first falls below the threshold),
        after_arrival (the rest of the duration) [s], corrections (their number), direction (1 along the angle, -1
        against it), travel [rad], peak_velocity (largest speed), mean_velocity [rad/s], peak_acceleration [rad/s^2],
        peak_time (of the largest speed, as a share of the duration), sparc, ldlj, normalised_jerk.
    left_out : Mapping of str to int
        Number of stretches of the record without a movement, by reason.
    """

    columns: Mapping[str, np.ndarray]
    left_out: Mapping[str, int]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def count(self) -> int:
        """Number of movements."""
        return len(self.columns["start"])

    def _table(self) -> tuple[list[str], list[list[str]]]:
        heads = [f"{name} ({UNITS[name]})" if UNITS[name] != "1" else name for name in self]
        return heads, [[f"{x:.3g}" for x in row] for row in zip(*self.values(), strict=True)]

    def __str__(self) -> str:
        left = ", ".join(f"{n} {reason}" for reason, n in self.left_out.items())
        head = f"{self.count} movements" + (f"; excluded: {left}" if left else "")
        return f"{head}\n{text_table(*self._table())}"

    def _repr_html_(self) -> str:
        return html_table(f"{self.count} movements", *self._table())


@with_checked_arguments
def movement_indices(
    time: ArrayLike,
    angle: ArrayLike,
    *,
    target: ArrayLike | None = None,
    lowpass: float = 3.0,
    order: int = 4,
    threshold: float = 0.05,
    ends: Literal["all", "peak"] = "all",
    least: float = 0.05,
) -> MovementIndices:
    """Find the point-to-point movements of a record, and compute each one's indices.

    Parameters
    ----------
    time, angle : array_like, shape (n,)
        [s], increasing, and [rad]; NaN where a sample is missing.
    target : array_like, shape (n,), optional
        Angle that is pointed to, constant between its steps [rad]: a movement for each step. Left out, a movement for
        each stretch between two rests.
    lowpass, order : float, int
        Cut-off [Hz] and order of one pass of the zero-phase Butterworth filter on the angle.
    threshold : float
        Share of a movement's largest speed that begins and ends it.
    ends : str
        ``"all"``: from the first to the last sample above it; ``"peak"``: only the run of samples with the largest.
    least : float
        Travel that makes a movement where there is no target [rad].

    Returns
    -------
    MovementIndices
        By name, one value a movement.

    Raises
    ------
    RecordingError
        If shapes differ, time does not increase, the filter does not fit the rate, or there is no movement.

    Examples
    --------
    A minute of minimum-jerk movements of 40 degrees in 0.8 s, whose SPARC is -1.40 and LDLJ -5.32:

    >>> import numpy as np
    >>> import pellucid as pl
    >>> time = np.arange(0.0, 60.0, 0.005)
    >>> share = np.clip((time % 3.0 - 1.0) / 0.8, 0.0, 1.0)
    >>> rise = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    >>> angle = np.radians(40.0) * np.where(time // 3.0 % 2 == 0, rise, 1.0 - rise)
    >>> found = pl.movement_indices(time, angle, lowpass=10.0)
    >>> found.count, float(found["duration"].mean().round(2)), float(found["peak_velocity"].mean().round(2))
    (20, 0.7, 1.64)
    >>> float(found["sparc"].mean().round(1))
    -1.4
    """
    time, angle = np.asarray(time, float), np.asarray(angle, float)
    rule = MovementRule(lowpass, order, threshold, ends)
    if time.ndim != 1 or angle.shape != time.shape or (target is not None and np.shape(target) != time.shape):
        shapes = [np.shape(x) for x in (time, angle, *(() if target is None else (target,)))]
        raise RecordingError(f"movements: found time, angle and target of the shapes {shapes}, expected (n,) of each")
    motion = kinematics(time, angle, rule)
    if target is None:
        stretches = rest_stretches(motion, rule, least=least)
    else:
        stretches = target_stretches(time, np.asarray(target, float))
    found, without = movements(motion, stretches, rule)
    if not found:
        reasons = ", ".join(sorted({f"{each.kind} ({each.found})" for each in without}))
        raise RecordingError(f"movements: found none in {len(stretches)} stretches, expected some {reasons}".rstrip())
    rows = [
        {name: getattr(each, name) for name in UNITS if hasattr(each, name)} | smoothness(motion, each)
        for each in found
    ]
    return MovementIndices(
        {name: np.array([row[name] for row in rows], float) for name in UNITS},
        dict(Counter(each.kind for each in without)),
    )


@dataclass(frozen=True)
class SimulatedStudies:
    """Values of k simulated studies of n people and m end points.

    Attributes
    ----------
    changes : ndarray, shape (k, n, m)
        People's changes from control, in the unit of the margins.
    sessions : SessionPeriods, optional
        When people had both conditions; without it, orders are not stated.
    drifts, late : ndarray, shape (k, n, m), optional
        Change of the last third of movements less that of the first, and that of the last third less that of all.
    noise : tuple of MovementNoise or None, length m
        Noise of the changes by single movements; () if it is not known.
    """

    changes: np.ndarray
    sessions: SessionPeriods | None = None
    drifts: np.ndarray | None = None
    late: np.ndarray | None = None
    noise: tuple[MovementNoise | None, ...] = ()


def are_transparent(
    studies: SimulatedStudies,
    margins: Sequence[Margin],
    *,
    alpha: float = 0.05,
    rule: ShareRule = DEFAULT_RULE,
    largest_carry_over: float = DEFAULT_CARRY_OVER,
    method: Method = "skew_robust",
) -> np.ndarray:
    """Return whether each study is certified as transparent, shape (k,): what `certificate` says of its values."""
    count, n, m = studies.changes.shape
    fit = adjustment(n, studies.sessions)
    said = np.ones(count, bool)
    for j, margin in enumerate(margins):
        allowance = largest_carry_over * margin.half_width * fit.carry_over_share
        d = fit.adjusted(studies.changes[:, :, j])
        said &= margin_p_values(d, d, margin, fit, method, studies.sessions, allowance)[0] <= alpha
        noise = studies.noise[j] if studies.noise else None
        shares = share_p_values(d, d, margin, fit, allowance=allowance, rule=rule, noise=noise)
        said &= np.maximum(*shares) <= rule.alpha
        if studies.drifts is not None and studies.late is not None:
            drifting = _has_trend(studies.drifts[:, :, j], alpha / m)
            late = fit.adjusted(studies.changes[:, :, j] + studies.late[:, :, j])
            within = margin_p_values(late, late, margin, fit, method, studies.sessions, allowance)[0] <= alpha
            said &= ~drifting | within
    return said


def _has_trend(drifts: np.ndarray, alpha: float) -> np.ndarray:
    """Return whether the exact two-sided p of signed ranks of each row of drifts, (k, n), is at most `alpha`."""
    return two_sided_p(rank_sums(drifts), drifts.shape[1]) <= alpha


@dataclass(frozen=True, eq=False)
class IndexTable:
    """Values of one index by participant and condition.

    A table holds the name of its index, not the index, so that a kept result restores data and no functions.
    """

    name: str  # name of the index in the catalogue
    along: str  # unit of the coordinate of movement, "rad" or "m"
    participants: tuple[str, ...]  # participants with a value in all of `conditions`
    conditions: tuple[str, ...]
    values: np.ndarray  # (n, k)

    @property
    def index(self) -> Index:
        """Entry of the catalogue for this coordinate."""
        return indices_along(COORDINATES_BY_UNIT[self.along])[self.name]

    def column(self, condition: str) -> np.ndarray:
        """Return the values in one condition, shape (n,)."""
        return self.values[:, self.conditions.index(condition)]


def cell_means(
    movements: Sequence[MeasuredMovement], of: str, direction: str = "", *, spread: bool = False
) -> dict[tuple, float]:
    """Return the mean value `of` similar movements by (participant, condition, cell), in one `direction` or both ("").

    With `spread` the result holds their standard deviations (n - 1), without cells of a single movement.
    """
    sums: dict[tuple, list[float]] = {}
    for m in movements:
        value = m.values.get(of, math.nan)
        if math.isfinite(value) and direction in ("", m.cell[1]):
            sums.setdefault((m.participant, m.condition, m.cell), []).append(value)
    if spread:
        return {key: float(np.std(each, ddof=1)) for key, each in sums.items() if len(each) > 1}
    return {key: math.fsum(each) / len(each) for key, each in sums.items()}


def shared_cells(
    means: Mapping[tuple, float], participants: Sequence[str], conditions: Sequence[str]
) -> dict[str, dict[str, np.ndarray]]:
    """Return each participant's values of the cells that they have in every condition, by participant and condition.

    `means` are the values by (participant, condition, cell); who has no cell in all `conditions` is not in the result.
    """
    cells: dict[tuple[str, str], set] = {}
    for person, condition, cell in means:
        cells.setdefault((person, condition), set()).add(cell)
    found = {}
    for person in participants:
        shared = set.intersection(*(cells.get((person, c), set()) for c in conditions))
        if shared:
            ordered = sorted(shared, key=str)
            found[person] = {c: np.array([means[person, c, cell] for cell in ordered]) for c in conditions}
    return found


def lasting_cells(lasted: Sequence[MovementDuration], index: Index) -> dict[tuple, float]:
    """Return the value of a lasting `index` from how long similar movements lasted, by (participant, condition, cell).

    A median that was not reached is replaced by the longest time seen. The result is empty if the index needs movements
    that never settled and there are none.
    """
    cells: dict[tuple, list[MovementDuration]] = {}
    for each in lasted:
        cells.setdefault((each.participant, each.condition, each.cell), []).append(each)
    if index.of_curve is None or (index.needs_unsettled and all(each.settled for each in lasted)):
        return {}
    found = {}
    for key, own in cells.items():
        curve = survival(np.array([each.seconds for each in own]), np.array([each.settled for each in own]))
        found[key] = index.of_curve(curve)
    return found


def index_table(
    movements: Sequence[MeasuredMovement],
    index: Index,
    participants: Sequence[str],
    conditions: Sequence[str],
    control: str,
    lasted: Sequence[MovementDuration] = (),
) -> IndexTable | None:
    """Return the values of `index` of the `participants` who have it under all `conditions`; None if nobody has.

    An index over `control` has no column for control, nor has one that needs a robot. `movements` holds all movements,
    and `lasted` how long each was seen.
    """
    if index.lasting:
        means = lasting_cells(lasted, index)
    else:
        means = cell_means(movements, index.of, index.direction, spread=index.spread)
    recorded = [c for c in conditions if any(key[1] == c for key in means)]
    # Without a robot there is no interaction: a condition in which nobody has a value is no column.
    if not recorded or (index.over_control and (control not in recorded or len(recorded) < 2)):
        return None
    rows, people = [], []
    for person, value in shared_cells(means, participants, recorded).items():
        if index.over_control:
            rows.append([float(np.mean(value[c] / value[control] - 1.0)) for c in recorded if c != control])
        else:
            rows.append([float(np.mean(value[c])) for c in recorded])
        people.append(person)
    if not rows:
        return None
    shown = tuple(c for c in recorded if not (index.over_control and c == control))
    return IndexTable(index.name, index.along, tuple(people), shown, np.array(rows))


@dataclass(frozen=True)
class Isochrony:
    """Straight lines of mean velocity and of duration over amplitude."""

    condition: str
    direction: str
    participants: tuple[str, ...]
    velocity_r2: tuple[float, ...]  # R^2 of each participant's own line through the means of each amplitude
    velocity_slope: float  # slope of the line through the means over participants [1/s]
    velocity_intercept: float  # intercept of that line [rad/s]
    duration_r2: tuple[float, ...]  # R^2 of each participant's own line of duration
    duration_slope: float  # slope of the line of duration through the means over participants [s/rad]
    duration_intercept: float  # intercept of that line [s]
    points: tuple[tuple[float, float, float], ...]  # amplitude, mean velocity and duration, averaged over participants
    people: tuple[tuple[tuple[float, float, float], ...], ...]  # the same of each participant
    unit: str = "rad"  # unit of amplitudes, "rad" or "m"; with "m" every [rad] above is [m]


def isochrony(
    movements: Sequence[MeasuredMovement],
    participants: Sequence[str],
    conditions: Sequence[str],
    along: Coordinate = COORDINATES_BY_UNIT["rad"],
) -> tuple[Isochrony, ...]:
    """Return the isochrony of every condition and direction with at least three amplitudes.

    `movements` are those of `participants` under `conditions`, `along` an angle or a position.
    """

    def si(amplitudes: Sequence[float]) -> np.ndarray:
        return np.asarray(amplitudes) / along.factor

    velocity, duration = (cell_means(movements, index.of) for index in (MEAN_VELOCITY, MOVEMENT_DURATION))
    found = []
    for condition in conditions:
        for direction in (DIRECTION_UP, DIRECTION_DOWN):
            each = [_person_line(person, condition, direction, velocity, duration) for person in participants]
            each = [(person, *line) for person, line in zip(participants, each, strict=True) if line is not None]
            if not each:
                continue
            amplitudes = sorted(set.intersection(*(set(a) for _, a, *_ in each)))
            if len(amplitudes) < 3:
                continue
            v = [np.mean([vs[a] for _, _, vs, _ in each]) for a in amplitudes]
            t = [np.mean([ts[a] for _, _, _, ts in each]) for a in amplitudes]
            slope, intercept, _ = affine(si(amplitudes), np.array(v))
            dslope, dintercept, _ = affine(si(amplitudes), np.array(t))
            found.append(
                Isochrony(
                    condition, direction, tuple(person for person, *_ in each),
                    tuple(affine(si(a), np.array([vs[x] for x in a]))[2] for _, a, vs, _ in each),
                    slope, intercept,
                    tuple(affine(si(a), np.array([ts[x] for x in a]))[2] for _, a, _, ts in each),
                    dslope, dintercept,
                    tuple(zip(si(amplitudes).tolist(), map(float, v), map(float, t), strict=True)),
                    tuple(tuple((float(si(x)), vs[x], ts[x]) for x in a) for _, a, vs, ts in each),
                    along.unit,
                )
            )  # fmt: skip
    return tuple(found)


def _person_line(person, condition, direction, velocity: Mapping, duration: Mapping):
    """Return a person's amplitudes [deg or mm] with mean velocity and duration; None with fewer than three."""
    cells = [
        key[2] for key in velocity
        if key[:2] == (person, condition) and key[2][1] == direction and key[2][0] is not None
    ]  # fmt: skip
    if len(cells) < 3:
        return None
    cells = sorted(cells)
    v = {cell[0]: velocity[person, condition, cell] for cell in cells}
    t = {cell[0]: duration[person, condition, cell] for cell in cells}
    return [cell[0] for cell in cells], v, t


def affine(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float]:
    """Return slope, intercept and R² of the least-squares line through x and y, (n,); R² is NaN if y is constant."""
    slope, intercept = np.polyfit(x, y, 1)
    spread = float(np.sum((y - y.mean()) ** 2))
    rest = float(np.sum((y - slope * x - intercept) ** 2))
    return float(slope), float(intercept), 1.0 - rest / spread if spread > 0.0 else float("nan")
