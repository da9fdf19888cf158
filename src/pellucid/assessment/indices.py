"""Indices of transparency: what each is, and each participant's value in each condition.

A value is a mean over movements that are alike (one amplitude, one direction), then over these cells, of those alone
that the participant has in every condition: a movement left out does not tip the balance between short and long ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..units import COORDINATES, Coordinate
from .measured import DOWN, UP, Lasted, Measured
from .survival import survival


@dataclass(frozen=True)
class Index:
    """One index."""

    name: str  # In ids
    words: str  # words, short, unit: What it is, in full and as narrow tables call it
    short: str
    unit: str
    of: str  # Which of a movement's values
    direction: str = ""  # ``"up"`` or ``"down"``; ``""`` for both
    over_control: bool = False  # Whether it is a share of control's ratio less 1, and thus 0 for control
    spread: bool = False  # Whether it is the standard deviation of movements that are alike, in place of their mean
    lasting: bool = False  # Whether it is of how long movements lasted, those that never settled too

    @property
    def scaled(self) -> bool:
        """Whether a change in % says something: its values are above 0."""
        return self.name not in ("sparc", "ldlj", "end_error", "unsettled") and not self.over_control

    @property
    def shown(self) -> tuple[float, str]:
        """Factor and unit with which tables and figures show it."""
        if self.name == "unsettled":
            return 100.0, "%"
        along = COORDINATES.get(self.unit)
        return (1.0, self.unit) if along is None else (along.factor, along.shown)


INDICES = {
    index.name: index
    for index in (
        Index("duration", "Duration", "Duration", "s", "duration"),
        Index("vmax", "Peak velocity", "Peak vel.", "rad/s", "vmax"),
        Index("vmean", "Mean velocity", "Mean vel.", "rad/s", "vmean"),
        Index("acceleration", "Peak acceleration", "Acc.", "rad/s^2", "acceleration"),
        Index("peak_time_up", "Relative time to peak velocity upwards", "Peak time, up", "1", "peak_time", UP),
        Index("peak_time_down", "Relative time to peak velocity downwards", "Peak time, down", "1", "peak_time", DOWN),
        Index("end_error", "Signed end-point error", "End bias", "rad", "end_error"),
        Index("end_absolute", "Absolute end-point error", "End error", "rad", "end_absolute"),
        Index("end_spread", "Variable end-point error", "End spread", "rad", "end_error", spread=True),
        Index("sparc", "Spectral arc length", "SPARC", "1", "sparc"),
        Index("ldlj", "Log dimensionless jerk", "LDLJ", "1", "ldlj"),
        Index("emg_level", "EMG level", "EMG level", "1", "emg_level"),
        Index("emgacc", "EMG/Acc", "EMG/Acc", "1", "emg_per_acc", UP, True),
        Index("torque_rms", "RMS interaction torque", "Torque RMS", "N*m", "torque_rms"),
        Index("torque_peak", "Peak interaction torque", "Torque peak", "N*m", "torque_peak"),
        Index("work", "Work against the robot", "Work", "J", "work"),
        Index("duration_median", "Median duration", "Median dur.", "s", "", lasting=True),
        Index("unsettled", "Share of movements that never settled", "Never settled", "1", "", lasting=True),
    )
}
"""All indices of an angle."""


def indices_along(along: Coordinate) -> Mapping[str, Index]:
    """The same of an angle or of a place: names stay, units and words follow."""
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
    """Values of one index."""

    index: Index
    participants: tuple[str, ...]  # participants, conditions: Participants with a value in all of these conditions
    conditions: tuple[str, ...]
    values: np.ndarray  # (n, k)

    def column(self, condition: str) -> np.ndarray:
        """Values in one condition, shape (n,)."""
        return self.values[:, self.conditions.index(condition)]


def cell_means(
    movements: Sequence[Measured], of: str, direction: str = "", *, spread: bool = False
) -> dict[tuple, float]:
    """Means by (participant, condition, cell) of the value `of` movements that are alike, in one `direction` or both
    (""); with `spread` their standard deviations (n - 1), which a single movement has not.
    """
    sums: dict[tuple, list[float]] = {}
    for m in movements:
        value = m.values.get(of, np.nan)
        if np.isfinite(value) and direction in ("", m.cell[1]):
            sums.setdefault((m.participant, m.condition, m.cell), []).append(value)
    if spread:
        return {key: float(np.std(each, ddof=1)) for key, each in sums.items() if len(each) > 1}
    return {key: float(np.mean(each)) for key, each in sums.items()}


def lasting_cells(lasted: Sequence[Lasted], name: str) -> dict[tuple, float]:
    """By (participant, condition, cell) the median duration [s] of movements that are alike, or the share of them that
    never settled; of a median that was not reached the longest time seen. Empty where every movement settled and `name`
    is "unsettled"."""
    cells: dict[tuple, list[Lasted]] = {}
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
    movements: Sequence[Measured],
    index: Index,
    participants: Sequence[str],
    conditions: Sequence[str],
    control: str,
    lasted: Sequence[Lasted] = (),
) -> IndexTable | None:
    """Values of `index` of those `participants` who have it under all `conditions`; None where nobody has.

    One over `control` does not have that as a column, nor does one that needs a robot. `movements` are all there
    are, and `lasted` how long each was seen.
    """
    if index.lasting:
        means = lasting_cells(lasted, index.name)
    else:
        means = cell_means(movements, index.of, index.direction, spread=index.spread)
    recorded = [c for c in conditions if any(key[1] == c for key in means)]
    # Without a robot there is no interaction: a condition that nobody has it in is no column.
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
    """Straight lines through amplitude and mean velocity, and through amplitude and duration."""

    condition: str
    direction: str
    participants: tuple[str, ...]
    velocity_r2: tuple[float, ...]  # Of each participant's own line, over the means of each amplitude
    # velocity_slope, velocity_intercept: Of the line through the means over participants [1/s], [rad/s]
    velocity_slope: float
    velocity_intercept: float
    group_r2: float  # Of that line
    duration_r2: tuple[float, ...]
    duration_slope: float  # duration_slope, duration_intercept: [s/rad], [s]
    duration_intercept: float
    points: tuple[tuple[float, float, float], ...]  # Means over participants
    people: tuple[tuple[tuple[float, float, float], ...], ...]  # Each participant's own points
    unit: str = "rad"  # Or "m": all that is [rad] here is then [m]


def isochrony(
    movements: Sequence[Measured],
    participants: Sequence[str],
    conditions: Sequence[str],
    along: Coordinate = COORDINATES["rad"],
) -> tuple[Isochrony, ...]:
    """Isochrony of every condition and direction with at least three amplitudes; `movements` of `participants` under
    `conditions`, `along` an angle or a place.
    """

    def si(amplitudes: Sequence[float]) -> np.ndarray:
        return np.asarray(amplitudes) / along.factor

    velocity, duration = cell_means(movements, "vmean"), cell_means(movements, "duration")
    found = []
    for condition in conditions:
        for direction in (UP, DOWN):
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
    """Amplitudes [deg or mm] with the person's mean velocity and duration; None with fewer than three."""
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
    """Slope, intercept and R² of a straight line by least squares through x and y, each of shape (n,); R² is NaN where
    y is constant.
    """
    slope, intercept = np.polyfit(x, y, 1)
    spread = float(np.sum((y - y.mean()) ** 2))
    rest = float(np.sum((y - slope * x - intercept) ** 2))
    return float(slope), float(intercept), 1.0 - rest / spread if spread > 0.0 else float("nan")
