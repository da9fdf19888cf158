"""Indices of transparency: what each is, and each participant's value in each condition.

A value is a mean over movements that are alike (one amplitude, one direction), then over these cells, of those alone
that the participant has in every condition: a movement left out does not tip the balance between short and long ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..units import COORDINATES_BY_UNIT, Coordinate
from .measured import DIRECTION_DOWN, DIRECTION_UP, MeasuredMovement, MovementDuration
from .survival import survival


@dataclass(frozen=True)
class Index:
    """One index of transparency."""

    name: str  # name in ids
    words: str  # full name
    short: str  # short name for narrow tables
    unit: str
    of: str  # key of the movement's value from which the index is made
    direction: str = ""  # ``"up"`` or ``"down"``; ``""`` for both
    over_control: bool = False  # True: the ratio to the control's value less 1, which is 0 for control
    spread: bool = False  # True: standard deviation of similar movements instead of their mean
    lasting: bool = False  # True: made from how long movements lasted, including those that never settled

    @property
    def scaled(self) -> bool:
        """Whether a change in % is meaningful because all values are above 0."""
        return self.name not in ("sparc", "ldlj", "end_error", "unsettled") and not self.over_control

    @property
    def shown(self) -> tuple[float, str]:
        """Factor and unit of the index in tables and figures."""
        if self.name == "unsettled":
            return 100.0, "%"
        along = COORDINATES_BY_UNIT.get(self.unit)
        return (1.0, self.unit) if along is None else (along.factor, along.shown)


INDICES = {
    index.name: index
    for index in (
        Index("duration", "Duration", "Duration", "s", "duration"),
        Index("vmax", "Peak velocity", "Peak vel.", "rad/s", "vmax"),
        Index("vmean", "Mean velocity", "Mean vel.", "rad/s", "vmean"),
        Index("acceleration", "Peak acceleration", "Acc.", "rad/s^2", "acceleration"),
        Index(
            "peak_time_up", "Relative time to peak velocity upwards", "Peak time, up", "1", "peak_time", DIRECTION_UP
        ),
        Index(
            "peak_time_down",
            "Relative time to peak velocity downwards",
            "Peak time, down",
            "1",
            "peak_time",
            DIRECTION_DOWN,
        ),
        Index("end_error", "Signed end-point error", "End bias", "rad", "end_error"),
        Index("end_absolute", "Absolute end-point error", "End error", "rad", "end_absolute"),
        Index("end_spread", "Variable end-point error", "End spread", "rad", "end_error", spread=True),
        Index("sparc", "Spectral arc length", "SPARC", "1", "sparc"),
        Index("ldlj", "Log dimensionless jerk", "LDLJ", "1", "ldlj"),
        Index("emg_level", "EMG level", "EMG level", "1", "emg_level"),
        Index("emgacc", "EMG/Acc", "EMG/Acc", "1", "emg_per_acc", DIRECTION_UP, True),
        Index("torque_rms", "RMS interaction torque", "Torque RMS", "N*m", "torque_rms"),
        Index("torque_peak", "Peak interaction torque", "Torque peak", "N*m", "torque_peak"),
        Index("work", "Work against the robot", "Work", "J", "work"),
        Index("duration_median", "Median duration", "Median dur.", "s", "", lasting=True),
        Index("unsettled", "Share of movements that never settled", "Never settled", "1", "", lasting=True),
    )
}
"""All indices of an angle."""


def indices_along(along: Coordinate) -> Mapping[str, Index]:
    """Return all indices along an angle or a position; names stay, units and words change."""
    if along.unit == "rad":
        return INDICES
    units = {"N*m": along.effort}
    words = {"torque": "force", "Torque": "Force", "upwards": "forwards", "downwards": "backwards", ", up": ", forth",
             ", down": ", back"}  # fmt: skip

    def of(index: Index) -> Index:
        said = [index.words, index.short]
        for one, other in words.items():
            said = [text.replace(one, other) for text in said]
        unit = units.get(index.unit, index.unit.replace("rad", along.unit))
        return replace(index, words=said[0], short=said[1], unit=unit)

    return {name: of(index) for name, index in INDICES.items()}


@dataclass(frozen=True, eq=False)
class IndexTable:
    """Values of one index by participant and condition."""

    index: Index
    participants: tuple[str, ...]  # participants with a value in all of `conditions`
    conditions: tuple[str, ...]
    values: np.ndarray  # (n, k)

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
        value = m.values.get(of, np.nan)
        if np.isfinite(value) and direction in ("", m.cell[1]):
            sums.setdefault((m.participant, m.condition, m.cell), []).append(value)
    if spread:
        return {key: float(np.std(each, ddof=1)) for key, each in sums.items() if len(each) > 1}
    return {key: float(np.mean(each)) for key, each in sums.items()}


def lasting_cells(lasted: Sequence[MovementDuration], name: str) -> dict[tuple, float]:
    """Return the median duration [s] of similar movements, or their share that never settled, by cell.

    Keys are (participant, condition, cell). A median that was not reached is replaced by the longest time seen. The
    result is empty if `name` is "unsettled" and every movement settled.
    """
    cells: dict[tuple, list[MovementDuration]] = {}
    for each in lasted:
        cells.setdefault((each.participant, each.condition, each.cell), []).append(each)
    if name == "unsettled" and all(each.settled for each in lasted):
        return {}
    found = {}
    for key, own in cells.items():
        curve = survival(np.array([each.seconds for each in own]), np.array([each.settled for each in own]))
        found[key] = curve.cut if name == "unsettled" else curve.bounded_median
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
        means = lasting_cells(lasted, index.name)
    else:
        means = cell_means(movements, index.of, index.direction, spread=index.spread)
    recorded = [c for c in conditions if any(key[1] == c for key in means)]
    # Without a robot there is no interaction: a condition in which nobody has a value is no column.
    if not recorded or (index.over_control and (control not in recorded or len(recorded) < 2)):
        return None
    rows, people = [], []
    for person in participants:
        cells = [{key[2] for key in means if key[:2] == (person, c)} for c in recorded]
        shared = set.intersection(*cells)
        if not shared:
            continue
        ordered = sorted(shared, key=str)
        value = {c: np.array([means[person, c, cell] for cell in ordered]) for c in recorded}
        if index.over_control:
            rows.append([float(np.mean(value[c] / value[control] - 1.0)) for c in recorded if c != control])
        else:
            rows.append([float(np.mean(value[c])) for c in recorded])
        people.append(person)
    if not rows:
        return None
    shown = tuple(c for c in recorded if not (index.over_control and c == control))
    return IndexTable(index, tuple(people), shown, np.array(rows))


@dataclass(frozen=True)
class Isochrony:
    """Straight lines of mean velocity and of duration over amplitude."""

    condition: str
    direction: str
    participants: tuple[str, ...]
    velocity_r2: tuple[float, ...]  # R^2 of each participant's own line through the means of each amplitude
    velocity_slope: float  # slope of the line through the means over participants [1/s]
    velocity_intercept: float  # intercept of that line [rad/s]
    group_r2: float  # R^2 of that line
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

    velocity, duration = cell_means(movements, "vmean"), cell_means(movements, "duration")
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
            slope, intercept, r2 = affine(si(amplitudes), np.array(v))
            dslope, dintercept, _ = affine(si(amplitudes), np.array(t))
            found.append(
                Isochrony(
                    condition, direction, tuple(person for person, *_ in each),
                    tuple(affine(si(a), np.array([vs[x] for x in a]))[2] for _, a, vs, _ in each),
                    slope, intercept, r2,
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
