"""Catalogue of the indices of transparency.

An index states its words, its unit, the direction that is worse, the meaning of a percentage, its computation from
movements and its place in reports. Tables, tests, certificates, pages and predictions read this catalogue. A new index
of a movement's angle therefore needs only one entry.

Functions below the catalogue compute smoothness, end-point errors and interaction of a movement.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache

import numpy as np

from .._errors import RecordingError
from ..numerics.motion import tangential_speed
from ..units import COORDINATES_BY_UNIT, Coordinate
from .design_columns import DIRECTION_DOWN, DIRECTION_UP
from .movements import Kinematics, Movement
from .survival import Survival


class Worse(Enum):
    """Direction of change of an index that speaks against a robot; the margin of a certificate lies on that side."""

    IF_MORE = "less is never worse, so that a margin has an upper end only"
    EITHER_WAY = "a change in either direction is one, so that a margin has two ends"


class PercentOf(Enum):
    """Meaning of a percentage of an index or of its change."""

    THE_CONTROL = "the mean of the control condition, because all values are above 0"
    ALL_MOVEMENTS = "all movements: the value is a share itself, shown in %"
    OVER_CONTROL = "each participant's value in control: the value is the ratio to it less 1, which is 0 for control"
    NOTHING_AT_ALL = "nothing, because the scale has no zero; changes are in the unit of the index"


PERCENTAGE_POINTS = "percentage points"
"""Unit of a change of a share that is shown in %."""


class CutOff(Enum):
    """Contribution to an index of a movement that had not ended when the next target came."""

    NO_VALUE = "nothing: the index is of movements that ended"
    COUNTED_SETTLED = "it is counted as one that never settled, so that the value is known"
    SEEN_DURATION = "the duration that was seen; a mean that includes one has no upper bound"
    AT_LEAST_SEEN = "it lasted longer than was seen; a target that got no movement counts as never reached"


@dataclass(frozen=True)
class Tile:
    """Tile of an index at the top of a page."""

    label: str
    after_unit: str = ""  # words after the unit of a value that control does not have


@dataclass(frozen=True, kw_only=True)
class Index:
    """One index of transparency.

    Places count from 1 and give an order; 0 means that the index is not shown there. ``of`` names the value of a
    movement that the index is made from; several indices may share one value.
    """

    name: str  # name in ids and in study.toml
    words: str  # full name
    short: str  # short name for narrow tables
    unit: str  # SI unit along an angle, as plain text
    worse: Worse  # direction of change that speaks against a robot
    percent_of: PercentOf  # meaning of a percentage of it
    of: str = ""  # key of the movement's value from which it is made; empty: made from durations alone
    of_movement: Callable[[Kinematics, Movement], float] | None = None  # gives the value; None: made of other data
    of_curve: Callable[[Survival], float] | None = None  # value from the settling curve of alike movements
    direction: str = ""  # ``"up"`` or ``"down"``; ``""`` for both
    spread: bool = False  # True: standard deviation of similar movements instead of their mean
    cut_off: CutOff = CutOff.NO_VALUE  # contribution of a movement that was cut off
    needs_unsettled: bool = False  # True: without a value where every movement of the study settled
    needs_robot: bool = False  # True: without a robot there is none, so that no change is a share of control's
    is_positive: bool = False  # True: every movement has a value above 0, so that a 0 in a table is a missing value
    leads: bool = False  # True: the headline of an assessment tells its change
    sentence_words: str = ""  # beginning of its sentence in the paragraph where ``words`` would not say it
    paragraph_place: int = 0  # place among those the paragraph describes; of the others it says whether they differ
    panel_place: int = 0  # place among the panels that draw every participant
    delay_place: int = 0  # place among those that depend on the delay between markers and EMG
    tile: Tile | None = None  # tile at the top of the page
    has_table: bool = False  # whether the terminal shows a table of its own; a report has one for every index
    tries_rules: bool = False  # whether other filters and rules for movements are tried on it
    is_planned: bool = False  # whether the number of participants needed is computed
    along: str = "rad"  # unit of the coordinate of movement, "rad" or "m"

    @property
    def lasting(self) -> bool:
        """Whether it is made from how long movements lasted, including those that never settled."""
        return self.of_curve is not None

    @property
    def over_control(self) -> bool:
        """Whether a value is the ratio to the control's value less 1, which is 0 for control."""
        return self.percent_of is PercentOf.OVER_CONTROL

    @property
    def scaled(self) -> bool:
        """Whether a change in % is meaningful: all values are above 0, and control has a robot to exert them.

        What a sensor shows of an interaction without a robot is its noise.
        """
        return self.percent_of is PercentOf.THE_CONTROL and not self.needs_robot

    @property
    def shown(self) -> tuple[float, str]:
        """Factor and unit of the index in tables and figures."""
        if self.percent_of is PercentOf.ALL_MOVEMENTS:
            return 100.0, "%"
        along = COORDINATES_BY_UNIT.get(self.unit)
        return (1.0, self.unit) if along is None else (along.factor, along.shown)

    @property
    def change_unit(self) -> str:
        """Unit of a change in tables and figures that is not relative to control."""
        return PERCENTAGE_POINTS if self.percent_of is PercentOf.ALL_MOVEMENTS else self.shown[1]


MOVEMENT_DURATION = Index(
    name="duration", words="Mean duration", short="Mean duration", unit="s",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL, is_positive=True,
    of="duration", of_movement=lambda motion, movement: movement.duration, cut_off=CutOff.SEEN_DURATION,
    has_table=True, tries_rules=True, is_planned=True,
)  # fmt: skip
PEAK_VELOCITY = Index(
    name="vmax", words="Peak velocity", short="Peak velocity", unit="rad/s",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL, is_positive=True,
    of="vmax", of_movement=lambda motion, movement: movement.peak_velocity,
    paragraph_place=3, panel_place=3, tile=Tile("Peak velocity"), has_table=True, tries_rules=True, is_planned=True,
)  # fmt: skip
MEAN_VELOCITY = Index(
    name="vmean", words="Mean velocity", short="Mean velocity", unit="rad/s",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL, is_positive=True,
    of="vmean", of_movement=lambda motion, movement: movement.mean_velocity, tries_rules=True,
)  # fmt: skip
PEAK_ACCELERATION = Index(
    name="acceleration", words="Peak acceleration", short="Peak acceleration", unit="rad/s^2",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL, is_positive=True,
    of="acceleration", of_movement=lambda motion, movement: movement.peak_acceleration,
    panel_place=4, tries_rules=True,
)  # fmt: skip
PEAK_TIME_UP = Index(
    name="peak_time_up", words="Relative time to peak velocity upwards", short="Peak time, upwards", unit="1",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL,
    of="peak_time", of_movement=lambda motion, movement: movement.peak_time, direction=DIRECTION_UP,
    panel_place=5, tries_rules=True, is_planned=True,
)  # fmt: skip
PEAK_TIME_DOWN = Index(
    name="peak_time_down", words="Relative time to peak velocity downwards", short="Peak time, downwards", unit="1",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL,
    of="peak_time", of_movement=lambda motion, movement: movement.peak_time, direction=DIRECTION_DOWN,
    panel_place=6, tries_rules=True, is_planned=True,
)  # fmt: skip
SIGNED_END_ERROR = Index(
    name="end_error", words="Signed end-point error", short="End-point bias", unit="rad",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.NOTHING_AT_ALL, of="end_error",
)  # fmt: skip
ABSOLUTE_END_ERROR = Index(
    name="end_absolute", words="Absolute end-point error", short="End-point error", unit="rad",
    worse=Worse.IF_MORE, percent_of=PercentOf.THE_CONTROL, of="end_absolute",
    paragraph_place=4, panel_place=8, has_table=True, is_planned=True,
)  # fmt: skip
VARIABLE_END_ERROR = Index(
    name="end_spread", words="Variable end-point error", short="End-point spread", unit="rad",
    worse=Worse.IF_MORE, percent_of=PercentOf.THE_CONTROL, of="end_error", spread=True, panel_place=9,
)  # fmt: skip
SPECTRAL_ARC_LENGTH = Index(
    name="sparc", words="Spectral arc length", short="Spectral arc length", unit="1",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.NOTHING_AT_ALL, of="sparc", panel_place=7,
)  # fmt: skip
LOG_DIMENSIONLESS_JERK = Index(
    name="ldlj", words="Log dimensionless jerk", short="Log dimensionless jerk", unit="1",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.NOTHING_AT_ALL, of="ldlj",
)  # fmt: skip
EMG_LEVEL = Index(
    name="emg_level", words="EMG level", short="EMG level", unit="1",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL, of="emg_level",
    paragraph_place=7, panel_place=10, delay_place=2, has_table=True, tries_rules=True, is_planned=True,
)  # fmt: skip
EMG_PER_ACCELERATION = Index(
    name="emgacc", words="EMG/Acc", short="EMG per acceleration", unit="1",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.OVER_CONTROL, of="emg_per_acc", direction=DIRECTION_UP,
    sentence_words="EMG over acceleration (EMG/Acc)",
    paragraph_place=5, panel_place=11, delay_place=1, tile=Tile("EMG/Acc"), has_table=True, tries_rules=True,
    is_planned=True,
)  # fmt: skip
RMS_INTERACTION_TORQUE = Index(
    name="torque_rms", words="RMS interaction torque", short="Root-mean-square torque", unit="N*m",
    worse=Worse.IF_MORE, percent_of=PercentOf.THE_CONTROL, of="torque_rms", needs_robot=True,
    paragraph_place=6, panel_place=12, tile=Tile("Interaction", " RMS"), has_table=True,
)  # fmt: skip
PEAK_INTERACTION_TORQUE = Index(
    name="torque_peak", words="Peak interaction torque", short="Peak torque", unit="N*m",
    worse=Worse.IF_MORE, percent_of=PercentOf.THE_CONTROL, of="torque_peak", needs_robot=True,
)  # fmt: skip
WORK_AGAINST_ROBOT = Index(
    name="work", words="Work against the robot", short="Work against robot", unit="J",
    worse=Worse.IF_MORE, percent_of=PercentOf.THE_CONTROL, of="work", needs_robot=True, panel_place=13,
)  # fmt: skip
# The mean duration is not in the paragraph and the median is, because movements that were cut off distort a mean.
MEDIAN_DURATION = Index(
    name="duration_median", words="Median duration", short="Median duration", unit="s",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL, is_positive=True,
    of=MOVEMENT_DURATION.of, of_curve=lambda curve: curve.bounded_median, cut_off=CutOff.AT_LEAST_SEEN,
    leads=True,
    paragraph_place=1, panel_place=1, tile=Tile("Median duration"), has_table=True, tries_rules=True, is_planned=True,
)  # fmt: skip
TIME_AFTER_ARRIVAL = Index(
    name="after_arrival", words="Time after the first arrival", short="After arrival", unit="s",
    worse=Worse.IF_MORE, percent_of=PercentOf.NOTHING_AT_ALL,
    of="after_arrival", of_movement=lambda motion, movement: movement.after_arrival, cut_off=CutOff.SEEN_DURATION,
)  # fmt: skip
CORRECTION_COUNT = Index(
    name="corrections", words="Corrections of a movement", short="Corrections", unit="1",
    worse=Worse.IF_MORE, percent_of=PercentOf.NOTHING_AT_ALL,
    of="corrections", of_movement=lambda motion, movement: float(movement.corrections), cut_off=CutOff.SEEN_DURATION,
)  # fmt: skip
UNSETTLED_SHARE = Index(
    name="unsettled", words="Share of movements that never settled", short="Never settled", unit="1",
    worse=Worse.IF_MORE, percent_of=PercentOf.ALL_MOVEMENTS,
    of_curve=lambda curve: curve.cut, cut_off=CutOff.COUNTED_SETTLED, needs_unsettled=True,
    paragraph_place=2, panel_place=2, has_table=True,
)  # fmt: skip
NORMALISED_JERK = Index(
    name="normalised_jerk", words="Normalised jerk", short="Normalised jerk", unit="1",
    worse=Worse.EITHER_WAY, percent_of=PercentOf.THE_CONTROL, of="normalised_jerk",
)  # fmt: skip

# A new index comes last: an index's place here is its random stream, so that a place in between would move intervals.
INDICES: Mapping[str, Index] = {
    index.name: index
    for index in (
        MOVEMENT_DURATION, PEAK_VELOCITY, MEAN_VELOCITY, PEAK_ACCELERATION, PEAK_TIME_UP, PEAK_TIME_DOWN,
        SIGNED_END_ERROR, ABSOLUTE_END_ERROR, VARIABLE_END_ERROR, SPECTRAL_ARC_LENGTH, LOG_DIMENSIONLESS_JERK,
        EMG_LEVEL, EMG_PER_ACCELERATION, RMS_INTERACTION_TORQUE, PEAK_INTERACTION_TORQUE, WORK_AGAINST_ROBOT,
        MEDIAN_DURATION, UNSETTLED_SHARE, TIME_AFTER_ARRIVAL, CORRECTION_COUNT,
        NORMALISED_JERK,
    )
}  # fmt: skip
"""All indices of an angle by name."""

SHOWN_INDICES: tuple[Index, ...] = tuple(sorted(INDICES.values(), key=lambda index: not index.lasting))
"""All indices in the order in which tables show them: those of how long movements lasted come first."""


def index_names(place: Callable[[Index], int]) -> tuple[str, ...]:
    """Return the names of the indices with a `place` above 0 (or True), in its order, then in that of tables."""
    return tuple(index.name for index in sorted(SHOWN_INDICES, key=place) if place(index))


def leading_index() -> Index:
    """Return the index whose change the headline of an assessment tells."""
    return next(index for index in SHOWN_INDICES if index.leads)


def indices_along(along: Coordinate) -> Mapping[str, Index]:
    """Return all indices along an angle or a position; names stay, units and words change."""
    return _indices_along(along.unit)


@cache
def _indices_along(unit: str) -> Mapping[str, Index]:
    along = COORDINATES_BY_UNIT[unit]
    if along.unit == "rad":
        return INDICES
    units = {"N*m": along.effort}
    words = {"torque": "force", "Torque": "Force", "upwards": "forwards", "downwards": "backwards"}

    def of(index: Index) -> Index:
        said = [index.words, index.short]
        for one, other in words.items():
            said = [text.replace(one, other) for text in said]
        unit = units.get(index.unit, index.unit.replace("rad", along.unit))
        return replace(index, words=said[0], short=said[1], unit=unit, along=along.unit)

    return {name: of(index) for name, index in INDICES.items()}


SPECTRUM_OVERSAMPLING_POWER = 4
"""The spectrum is sampled 2 to this power times finer than the movement's own length gives (zero padding)."""

MIN_SPEED_VARIATION = 1e-9
"""A speed that varies by less than this share of its largest is constant: rounding reaches 1e-13 of it."""


def smoothness(motion: Kinematics, movement: Movement) -> dict[str, float]:
    """Return SPARC, LDLJ and the normalised jerk of a movement: ``sparc``, ``ldlj`` and ``normalised_jerk``."""
    velocity, speed = _checked(motion.velocity[movement.first : movement.last + 1])
    power = _squared_jerk(velocity, motion.fs)
    return {
        "sparc": spectral_arc_length(velocity, motion.fs),
        "ldlj": _log_jerk(speed, power, motion.fs),
        "normalised_jerk": _relative_jerk(speed, power, motion.fs),
    }


def spectral_arc_length(velocity: np.ndarray, fs: float, *, highest: float = 10.0, least: float = 0.05) -> float:
    """Return the SPARC of the speed of one movement.

    `velocity` (n,), or (n, d) of a point; `fs` [Hz]; `highest` frequency [Hz]; `least` spectrum [1].
    """
    _, speed = _checked(velocity)
    n = 2 ** (int(np.ceil(np.log2(len(speed)))) + SPECTRUM_OVERSAMPLING_POWER)
    spectrum = np.abs(np.fft.rfft(speed, n))
    frequency = np.fft.rfftfreq(n, 1.0 / fs)
    spectrum = (spectrum / spectrum[0])[frequency <= highest]
    last = np.flatnonzero(spectrum >= least)[-1]
    spectrum, width = spectrum[: last + 1], max(int(last), 1)
    return -float(np.sum(np.hypot(1.0 / width, np.diff(spectrum))))


def log_dimensionless_jerk(velocity: np.ndarray, fs: float) -> float:
    """Return the LDLJ of one movement. `velocity` (n,), or (n, d) of a point; `fs` [Hz]."""
    velocity, speed = _checked(velocity)
    return _log_jerk(speed, _squared_jerk(velocity, fs), fs)


def _log_jerk(speed: np.ndarray, power: float, fs: float) -> float:
    duration = (len(speed) - 1) / fs
    return -float(np.log(duration**3 / np.max(speed) ** 2 * power))


def normalised_jerk(velocity: np.ndarray, fs: float) -> float:
    r"""Return the normalised jerk of one movement.

    Squared jerk over the movement, without units: :math:`\sqrt{\tfrac12 \int j^2\,dt\; T^5 / L^2}` with duration T and
    length of path L (H.-L. Teulings et al., "Parkinsonism reduces coordination of fingers, wrist, and arm in fine motor
    control", Exp. Neurol. 146, 1997). A whole movement of minimum jerk has 19.0.

    `velocity` (n,), or (n, d) of a point; `fs` [Hz].
    """
    velocity, speed = _checked(velocity)
    return _relative_jerk(speed, _squared_jerk(velocity, fs), fs)


def _relative_jerk(speed: np.ndarray, power: float, fs: float) -> float:
    duration, length = (len(speed) - 1) / fs, 0.5 * float(np.sum(speed[1:] + speed[:-1])) / fs
    return float(np.sqrt(0.5 * power * duration**5) / length)


def _squared_jerk(velocity: np.ndarray, fs: float) -> float:
    """Return the integral of the squared jerk of `velocity` (n, d) over one movement."""
    jerk = np.diff(velocity, 2, axis=0) * fs**2
    # The integral covers the samples that have a second difference: one sample at either end is missing.
    power = float(np.sum(jerk**2)) / fs
    if power == 0.0:
        raise RecordingError("smoothness: found a velocity without jerk, expected a movement")
    return power


def _checked(velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a movement's velocity and speed; refuse what is no movement."""
    velocity = np.asarray(velocity, float)
    if velocity.ndim not in (1, 2) or len(velocity) < 4 or not np.isfinite(velocity).all() or not velocity.any():
        raise RecordingError(
            f"smoothness: found a velocity of shape {velocity.shape}, expected at least 4 numbers, not all of them 0"
        )
    speed = tangential_speed(velocity)
    if np.ptp(speed) <= MIN_SPEED_VARIATION * np.max(speed):
        raise RecordingError(
            f"smoothness: found a constant speed of {np.max(speed):.3g}, expected one that rises and falls"
        )
    return velocity, speed


def target_zero(made: Sequence[tuple[Kinematics, Movement]]) -> float:
    """Return the angle at which a target at 0 lies [rad], from the ends of one participant's control movements.

    It is the mean of the medians of both directions; 0 if a direction has no movement to a target.
    """
    ends: dict[int, list[float]] = {1: [], -1: []}
    for motion, movement in made:
        if movement.goal is not None:
            ends[movement.direction].append(float(motion.angle[movement.last]) - movement.goal)
    if not all(ends.values()):
        return 0.0
    return float(np.mean([np.median(own) for own in ends.values()]))


def end_error(motion: Kinematics, movement: Movement, zero: float) -> dict[str, float]:
    """Return the signed and the absolute error of a `movement`'s end, ``end_error`` and ``end_absolute`` [rad].

    `motion` holds the angle, and a target at 0 lies at `zero`. The result is empty if the target is not known.
    """
    if movement.goal is not None:
        error = movement.direction * (float(motion.angle[movement.last]) - movement.goal - zero)
    elif movement.amplitude is not None:
        error = movement.reach - movement.amplitude
    else:
        return {}
    return {"end_error": error, "end_absolute": abs(error)}


@dataclass(frozen=True)
class Interaction:
    """Torque and work between robot and person over one movement."""

    rms: float  # RMS of the torque [N m]
    peak: float  # largest absolute torque [N m]
    resisted: float  # work of the person against the robot [J]
    assisted: float  # work of the robot on the person [J]


def interaction(torque: np.ndarray, velocity: np.ndarray, fs: float) -> Interaction:
    """Return the interaction over one movement. `torque` (n,) [N m]; `velocity` (n,) [rad/s]; `fs` [Hz]."""
    torque, velocity = np.asarray(torque, float), np.asarray(velocity, float)
    if torque.shape != velocity.shape or torque.ndim != 1 or not len(torque) or not np.isfinite(torque).all():
        raise RecordingError(
            f"interaction: found torque {torque.shape} and velocity {velocity.shape}, expected equal shapes, no NaN"
        )
    power = torque * velocity
    return Interaction(
        rms=float(np.sqrt(np.mean(torque**2))),
        peak=float(np.max(np.abs(torque))),
        resisted=float(-np.sum(np.minimum(power, 0.0)) / fs),
        assisted=float(np.sum(np.maximum(power, 0.0)) / fs),
    )
