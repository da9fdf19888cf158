"""Find how columns of a table explain each other: derivatives, efforts of motions, commands that are followed.

Gravity's weight also decides the unit of an angle, and repeated motions with another effort show a payload.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class EffortLimits:
    """When a motion explains an effort, a column follows a command, or rests at a limit."""

    # A column is a joint's effort if the joint's motion explains at least this share of its variance.
    min_effort_share: float = 0.25
    # One unit of an angle is decided against another if gravity then leaves less than this share of what it leaves
    # in the other unit. Simulated joints with little weight reach 0.85.
    max_left_ratio: float = 0.9
    # Units are compared in so many blocks of a recording.
    weighed_blocks: int = 20
    # One unit is decided against another if it leaves less in at least so many blocks: by chance in 1 of 5,000.
    min_won_blocks: int = 18
    # The decided unit makes the joint turn by at least this angle: less hardly bends the sine, as a spring does not
    # [rad].
    min_weighed_angle: float = 0.5
    # Friction turns over at speeds of the usual one over these: at a creep, and at once. With one alone, what
    # friction leaves hides how gravity differs between units.
    friction_sharpness: tuple[float, ...] = (1.0, 10.0)
    # A turn is decided only if one that is longer or shorter by this factor fits worse: else the true one is none
    # of the candidates, as after a gear. Without it, a third of simulated angles behind gears got a wrong unit.
    near_turn: float = 1.1
    # The sign of an effort is looked for in this many blocks. In at least this share of them inertia and friction are
    # negative, each with an effect of at least this share of the effort's spread.
    sign_blocks: int = 8
    min_reversed_share: float = 0.85
    min_sign_share: float = 0.03
    # Fits take at most this many rows, evenly spread.
    max_rows: int = 4_000
    # Two columns are a command and its measurement if they correlate at least so, at the best shift.
    min_following_correlation: float = 0.9
    # A measurement follows its command with a slope within this of 1; a saturated drive follows by less.
    max_scale_error: float = 0.5
    # Of two columns that may both be measured, one is the other's command if they correlate at least so, if its
    # roughness is at most this share of the other's, if it leads in all but so many blocks of the recording, and if
    # their means differ by at most this share of their spread: both have one zero.
    min_leading_correlation: float = 0.98
    max_leading_roughness: float = 0.9
    leading_blocks: int = 8
    max_lost_blocks: int = 1
    max_zero_difference: float = 0.3
    # The measurement may come later by at most this share of the recording.
    max_shift_share: float = 0.02
    # A column that changes in less than this share of its rows is stepped: a program set it.
    max_stepped_share: float = 0.15
    # A channel rests at its limit if it stays there for so many rows.
    min_limit_rows: int = 4
    # A largest number is a limit if a channel rests there at least so often.
    min_limit_runs: int = 3
    # A column rests on a level if it does not change for so many rows.
    min_level_rows: int = 20
    # A program set a column that rests on levels other than 0 for at least this share of its rows.
    min_level_share: float = 0.15
    # Signs that an effort has lost are found again in at most so many rounds.
    sign_rounds: int = 20
    # Either sign holds at least in this share of the samples.
    min_each_sign_share: float = 0.1
    # With its signs, the motion leaves at most this share of the effort's variance.
    max_signed_left: float = 0.15
    # Without them it leaves at least this many times as much.
    min_unsigned_ratio: float = 3.0
    # The size of an effort that passes through 0 is at most this share of its largest one in 1 of 100 samples. Chosen
    # by judgement.
    max_least_size: float = 0.25
    # Inertia is told from the rest of an effort if it explains at least this share of its variance.
    min_inertia_share: float = 0.02
    # The spread of an effort accelerates usual joints by as much as this [rad/s^2; m/s^2], and no machine beyond the
    # wider range: a telescope on the one side, a galvanometer without a load on the other.
    usual_accelerations: tuple[float, ...] = (0.1, 1e5)
    possible_accelerations: tuple[float, ...] = (1e-2, 1e6)


EFFORT_LIMITS = EffortLimits()

FULL_TURNS = {"deg": 360.0, "rad": 2.0 * math.pi, "turn": 1.0}
"""One turn in each unit of an angle that gravity may decide."""


@dataclass(frozen=True)
class MotionSamples:
    """Position, velocity and acceleration of one joint in its own units, smoothed alike, each shape (n,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    width: int  # rows over which running means were taken
    recorded: np.ndarray  # position as it was recorded


def motion_samples(position: np.ndarray, time: np.ndarray) -> MotionSamples:
    """Return a joint's motion from positions, shape (n,), at times that do not fall [s]."""
    rate = len(time) / max(float(time[-1] - time[0]), 1e-9)
    # An odd width shifts nothing in time, so that means of means stay beside means.
    width = max(1, min(round(rate / 25.0), len(time) // 50)) | 1
    smooth = running_mean(position, width)
    grid = np.arange(len(smooth)) / rate
    velocity = np.gradient(smooth, grid)
    recorded = np.nan_to_num(position, nan=float(np.nanmedian(position)))
    return MotionSamples(smooth, velocity, np.gradient(velocity, grid), width, recorded)


def running_mean(values: np.ndarray, width: int) -> np.ndarray:
    """Return running means over `width` rows, three times, with the ends repeated, shape (n,)."""
    known = np.nan_to_num(values, nan=float(np.nanmedian(values)))
    if width <= 1:
        return known
    for _ in range(3):
        padded = np.concatenate((np.full(width // 2, known[0]), known, np.full(width - 1 - width // 2, known[-1])))
        sums = np.cumsum(np.concatenate(([0.0], padded)))
        known = (sums[width:] - sums[:-width]) / width
    return known


def effort_share(effort: np.ndarray, motion: MotionSamples, radians_per_unit: float | None) -> float:
    """Return the share of an effort's variance, shape (n,), that a joint's motion explains.

    Inertia, both kinds of friction and a constant explain it, and gravity where `radians_per_unit` is given.
    """
    power, residuals = _residuals(effort, motion, radians_per_unit)
    return 1.0 - float(residuals @ residuals) / power if power > 0.0 else 0.0


def is_reversed(effort: np.ndarray, motion: MotionSamples) -> bool:
    """Whether an effort, shape (n,), shows a joint's inertia and friction as negative, nearly throughout.

    Each block of the recording is fitted by itself with inertia, friction, a constant and what is linear in the
    position.
    """
    limits = EFFORT_LIMITS
    target = running_mean(effort, motion.width)
    end = min(3 * motion.width + 2, len(target) // 10) if motion.width > 1 else 0
    n = len(target)
    signs = []
    for rows in np.array_split(np.arange(end, n - end), limits.sign_blocks):
        rows = rows[:: max(1, len(rows) // limits.max_rows)]
        columns = [motion.acceleration[rows], motion.velocity[rows], motion.position[rows]]
        scales = [float(np.std(x)) for x in columns]
        if len(rows) < 20 or min(scales) <= 0.0:
            return False
        parts = [(x - x.mean()) / scale for x, scale in zip(columns, scales, strict=True)]
        matrix, seen = np.column_stack(parts), target[rows] - target[rows].mean()
        answer = np.linalg.lstsq(matrix, seen, rcond=None)[0]
        spread = float(np.std(seen))
        signs.append(answer[:2] < -limits.min_sign_share * spread)
    return bool(np.mean(np.all(signs, axis=1)) >= limits.min_reversed_share)


def is_magnitude(effort: np.ndarray, motion: MotionSamples, radians_per_unit: float | None) -> bool:
    """Whether an effort, shape (n,), is the size of one without its sign.

    It is never negative, and the motion explains it far better with the signs that the motion itself gives it. Where a
    sign was lost the size comes near 0: one that never does has an offset, such as the middle of a converter's range.
    """
    known = effort[np.isfinite(effort)]
    if not len(known) or known.min() < 0.0 or known.max() <= 0.0:
        return False
    if np.quantile(known, 0.01) > EFFORT_LIMITS.max_least_size * known.max():
        return False
    matrix, target = _regression(effort, motion, radians_per_unit)
    left = _left(matrix, target)
    unsigned = float(left @ left) / max(float(np.sum((target - target.mean()) ** 2)), 1e-300)
    best = 1.0
    for k in range(matrix.shape[1]):
        signed = target * np.where(matrix[:, k] < 0.0, -1.0, 1.0)
        for _ in range(EFFORT_LIMITS.sign_rounds):
            guessed = signed - _left(matrix, signed)
            again = target * np.where(guessed < 0.0, -1.0, 1.0)
            if np.array_equal(again, signed):
                break
            signed = again
        left = _left(matrix, signed)
        # A sign that hardly changes is none that was lost.
        if EFFORT_LIMITS.min_each_sign_share < np.mean(signed < 0.0) < 1.0 - EFFORT_LIMITS.min_each_sign_share:
            best = min(best, float(left @ left) / max(float(np.sum((signed - signed.mean()) ** 2)), 1e-300))
    return best < EFFORT_LIMITS.max_signed_left and unsigned > EFFORT_LIMITS.min_unsigned_ratio * best


def acceleration_scale(effort: np.ndarray, motion: MotionSamples) -> float | None:
    """Return the acceleration that an effort's spread gives by the inertia that it shows, in the position's unit.

    It depends on the unit of time but not on that of the effort. None if inertia explains too little of `effort`, shape
    (n,), in addition to friction and a polynomial in the position.
    """
    target = running_mean(effort, motion.width)
    place = (motion.position - motion.position.mean()) / (float(np.ptp(motion.position)) or 1.0)
    speed = np.tanh(EFFORT_LIMITS.friction_sharpness[1] * motion.velocity / _usual(motion.velocity))
    columns = [motion.acceleration, motion.velocity, speed, *(place**k for k in range(4))]
    end = 3 * motion.width + 2
    rows = slice(end, len(target) - end, max(1, len(target) // EFFORT_LIMITS.max_rows))
    matrix, seen = np.column_stack(columns)[rows], target[rows]
    scales = np.linalg.norm(matrix, axis=0)
    power = float(np.sum((seen - seen.mean()) ** 2))
    if len(seen) < 50 or power <= 0.0 or scales.min() <= 0.0:
        return None
    matrix = matrix / scales
    inertia = float(np.linalg.lstsq(matrix, seen, rcond=None)[0][0]) / scales[0]
    left, without = _left(matrix, seen), _left(matrix[:, 1:], seen)
    gained = float(without @ without - left @ left) / power
    return float(np.std(seen)) / inertia if inertia > 0.0 and gained >= EFFORT_LIMITS.min_inertia_share else None


def is_usual_acceleration(value: float) -> bool:
    """Whether efforts accelerate usual joints by as much [rad/s^2; m/s^2]."""
    low, high = EFFORT_LIMITS.usual_accelerations
    return low <= value <= high


def is_possible_acceleration(value: float) -> bool:
    """Whether efforts accelerate any machine by as much [rad/s^2; m/s^2]."""
    low, high = EFFORT_LIMITS.possible_accelerations
    return low <= value <= high


def _residuals(effort: np.ndarray, motion: MotionSamples, radians_per_unit: float | None) -> tuple[float, np.ndarray]:
    """Return the power of an effort, and what the joint's motion leaves of it in some rows, shape (k,)."""
    matrix, target = _regression(effort, motion, radians_per_unit)
    return float(np.sum((target - target.mean()) ** 2)), _left(matrix, target)


def _left(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    return target - matrix @ np.linalg.lstsq(matrix, target, rcond=None)[0]


def _regression(
    effort: np.ndarray, motion: MotionSamples, radians_per_unit: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns by which a motion explains an effort, scaled, (k, p), and the effort, (k,), in some rows."""
    target = running_mean(effort, motion.width)
    speed = motion.velocity / _usual(motion.velocity)
    friction = [running_mean(np.tanh(speed * edge), motion.width) for edge in EFFORT_LIMITS.friction_sharpness]
    columns = [motion.acceleration, motion.velocity, *friction, np.ones(len(target))]
    if radians_per_unit is not None:
        # The mean of the sine, and not the sine of the mean: they differ where the joint turns fast.
        angle = motion.recorded * radians_per_unit
        columns += [running_mean(np.sin(angle), motion.width), running_mean(np.cos(angle), motion.width)]
    # Means at the ends repeat the last value: the kink there would look like an acceleration.
    end = min(3 * motion.width + 2, len(target) // 10) if motion.width > 1 else 0
    rows = slice(end, len(target) - end, max(1, len(target) // EFFORT_LIMITS.max_rows))
    matrix = np.column_stack(columns)[rows]
    scales = np.linalg.norm(matrix, axis=0)
    return matrix / np.where(scales > 0.0, scales, 1.0), target[rows]


@dataclass(frozen=True)
class WeighedTurns:
    """What gravity leaves of an effort, by candidates for the numbers that make one turn."""

    span: float  # range of the numbers
    turns: Mapping[str, float]  # numbers in one turn, by the candidates' names
    left: Mapping[str, np.ndarray]  # left share of the effort in each block, by name; "none" is without gravity
    near: float  # least share left with a turn a little longer or shorter than the best candidate's

    @property
    def best(self) -> str:
        """Candidate that leaves the least."""
        return min(self.turns, key=self.left_share)

    def left_share(self, name: str) -> float:
        """Return the share of the effort that a candidate leaves."""
        return float(np.sum(self.left[name]))

    def beats(self, name: str, other: str) -> bool:
        """Whether a candidate is better than another one, in the whole and nearly everywhere."""
        won = int(np.sum(self.left[name] < self.left[other]))
        is_less = self.left_share(name) < EFFORT_LIMITS.max_left_ratio * self.left_share(other)
        return is_less and won >= EFFORT_LIMITS.min_won_blocks

    def is_decided(self, others: Mapping[str, float] | None = None) -> bool:
        """Whether the best candidate is better than all `others`, and than none, and turns the joint far enough.

        If it is one of them, it must also be better than a turn that is a little longer or shorter.
        """
        compared = self.turns if others is None else others
        rivals = [other for other in compared if other != self.best]
        angle = 2.0 * math.pi * self.span / self.turns[self.best]
        explains = self.left_share(self.best) <= 1.0 - EFFORT_LIMITS.min_effort_share
        explains = explains and angle >= EFFORT_LIMITS.min_weighed_angle
        is_true_turn = self.best not in compared or self.left_share(self.best) < self.near
        return explains and is_true_turn and all(self.beats(self.best, other) for other in (*rivals, "none"))


def weigh_turns(effort: np.ndarray, motion: MotionSamples, turns: Mapping[str, float]) -> WeighedTurns | None:
    """Fit inertia, friction and gravity once for each candidate in `turns`; None for an effort that is constant.

    `turns` are the numbers in one turn, by the candidates' names. `effort` has shape (n,).
    """
    shares = {name: _left_shares(effort, motion, turn) for name, turn in {"none": None, **turns}.items()}
    left = {name: share for name, share in shares.items() if share is not None}
    if len(left) < len(shares):
        return None
    best = min(turns, key=lambda name: float(np.sum(left[name])))
    near = [
        _left_shares(effort, motion, turns[best] * factor)
        for factor in (EFFORT_LIMITS.near_turn, 1.0 / EFFORT_LIMITS.near_turn)
    ]
    least = min(float(np.sum(share)) for share in near if share is not None)
    return WeighedTurns(float(np.ptp(motion.recorded)), dict(turns), left, least)


def _left_shares(effort: np.ndarray, motion: MotionSamples, turn: float | None) -> np.ndarray | None:
    """Return the share of an effort that a turn of so many numbers leaves in each block; None for a constant effort."""
    power, residuals = _residuals(effort, motion, None if turn is None else 2.0 * math.pi / turn)
    if power <= 0.0:
        return None
    return np.array([float(part @ part) / power for part in np.array_split(residuals, EFFORT_LIMITS.weighed_blocks)])


def _usual(values: np.ndarray) -> float:
    return float(np.quantile(np.abs(values), 0.3)) or float(np.max(np.abs(values))) or 1.0


@dataclass(frozen=True)
class FollowedCommand:
    """Two columns of which one follows the other."""

    command: str
    measured: str
    slope: float  # slope of the measurement over the command
    why: str  # reason, for a comment in study.toml


def find_command(a: tuple[str, np.ndarray], b: tuple[str, np.ndarray]) -> FollowedCommand | None:
    """Return which of two named columns, shape (n,) each, is the other's command; None if neither follows the other.

    The measurement is later, or rougher: encoders have quanta and currents have ripple, a command has neither.
    """
    (name_a, x), (name_b, y) = a, b
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if len(x) < 50 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return None
    stride = max(1, len(x) // 8_000)
    lag, correlation = _best_lag(x[::stride] - x.mean(), y[::stride] - y.mean())
    if correlation < EFFORT_LIMITS.min_following_correlation:
        return None
    slope = float(np.std(y) / np.std(x))
    if not 1.0 - EFFORT_LIMITS.max_scale_error <= slope <= 1.0 / (1.0 - EFFORT_LIMITS.max_scale_error):
        return None
    rough_x, rough_y = roughness(x), roughness(y)
    if lag != 0:
        late = name_b if lag > 0 else name_a
        first = name_a if lag > 0 else name_b
        why = f'"{late}" follows "{first}" with a delay of {abs(lag) * stride} samples'
    elif rough_x < 0.5 * rough_y or rough_y < 0.5 * rough_x:
        first, late = (name_a, name_b) if rough_x < rough_y else (name_b, name_a)
        why = f'"{first}" has no noise, and "{late}" follows it'
    else:
        return None
    return FollowedCommand(first, late, slope if first == name_a else 1.0 / slope, why)


def find_leader(a: tuple[str, np.ndarray], b: tuple[str, np.ndarray]) -> FollowedCommand | None:
    """Return which of two named columns, shape (n,) each, leads the other and is smoother; None if neither does.

    A controlled joint moves after its command. A filtered copy of a measurement is smoother, but it does not lead.
    """
    good = np.isfinite(a[1]) & np.isfinite(b[1])
    lags: list[float] = []
    x, y = a[1][good], b[1][good]
    if len(x) < 50 * EFFORT_LIMITS.leading_blocks or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return None
    spread = float(np.std(x))
    is_alike = abs(float(np.mean(x) - np.mean(y))) <= EFFORT_LIMITS.max_zero_difference * spread
    correlation, gain = float(np.corrcoef(x, y)[0, 1]), float(np.std(y)) / spread
    if not is_alike or abs(gain - 1.0) > EFFORT_LIMITS.max_scale_error:
        return None
    if correlation < EFFORT_LIMITS.min_leading_correlation:
        return None
    for one, other in zip(
        np.array_split(x, EFFORT_LIMITS.leading_blocks), np.array_split(y, EFFORT_LIMITS.leading_blocks), strict=True
    ):
        # The difference of both holds the derivative times the lag; at the same time, it would hold none.
        shape = np.column_stack([np.gradient(0.5 * (one + other)), 0.5 * (one + other), np.ones(len(one))])
        lags.append(float(np.linalg.lstsq(shape, one - other, rcond=None)[0][0]))
    for sign, (first, early), (late, follower) in ((1.0, a, b), (-1.0, b, a)):
        lost = sum(sign * lag <= 0.0 for lag in lags)
        is_smoother = roughness(early[good]) <= EFFORT_LIMITS.max_leading_roughness * roughness(follower[good])
        if lost <= EFFORT_LIMITS.max_lost_blocks and is_smoother:
            why = f'"{late}" follows "{first}" with a delay of {abs(float(np.median(lags))):.2g} samples and more noise'
            return FollowedCommand(first, late, gain if first == a[0] else 1.0 / gain, why)
    return None


def roughness(values: np.ndarray) -> float:
    """Return the size of third differences relative to the spread: noise and quanta, without slow motion."""
    spread = float(np.std(values))
    return float(np.median(np.abs(np.diff(values, 3)))) / spread if spread > 0.0 and len(values) > 4 else 0.0


def is_stepped(values: np.ndarray) -> bool:
    """Whether a column rests on levels and changes in few rows, as a program's command does."""
    known = values[np.isfinite(values)]
    if len(known) < 20:
        return False
    changes = float(np.mean(np.diff(known) != 0.0))
    return 0.0 < changes < EFFORT_LIMITS.max_stepped_share


def is_set_by_program(values: np.ndarray) -> bool:
    """Whether a column rests exactly on several levels for a good part of the time, as no measurement does."""
    known = values[np.isfinite(values)]
    edges = np.flatnonzero(np.diff(known) != 0.0)
    if len(edges) < 2:
        return False
    starts, ends = np.concatenate(([0], edges + 1)), np.concatenate((edges + 1, [len(known)]))
    long = ends - starts >= EFFORT_LIMITS.min_level_rows
    levels = np.unique(known[starts[long]])
    resting = float(np.sum((ends - starts)[long & (known[starts] != 0.0)]))
    return len(levels) >= 2 and resting > EFFORT_LIMITS.min_level_share * len(known)


def find_resting_limit(recordings: Sequence[np.ndarray]) -> float | None:
    """Return the magnitude at which a channel rests again and again, None if it rests at none.

    A drive that reaches its limit stays there for some samples, and at the same largest number each time.
    """
    largest = max((float(np.nanmax(np.abs(x))) for x in recordings if np.isfinite(x).any()), default=0.0)
    if largest == 0.0:
        return None
    runs = 0
    for values in recordings:
        at = np.abs(np.abs(values) - largest) <= 1e-9 * largest
        edges = np.flatnonzero(np.diff(np.concatenate(([False], at, [False])).astype(int)))
        runs += int(np.sum(edges[1::2] - edges[::2] >= EFFORT_LIMITS.min_limit_rows))
    return largest if runs >= EFFORT_LIMITS.min_limit_runs else None


def _best_lag(x: np.ndarray, y: np.ndarray) -> tuple[int, float]:
    """Return by how many rows `y` is later than `x`, and the correlation there."""
    reach = max(1, int(EFFORT_LIMITS.max_shift_share * len(x)))
    size = 2 ** int(np.ceil(np.log2(2 * len(x))))
    product = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
    around = np.concatenate((product[-reach:], product[: reach + 1]))
    at = int(np.argmax(around))
    return at - reach, float(around[at] / (np.linalg.norm(x) * np.linalg.norm(y)))


@dataclass(frozen=True)
class DerivativeLimits:
    """When a column is the derivative of another, and when a motion is repeated."""

    # Only this many rows of a table are compared, those with the most motion.
    max_compared_rows: int = 40_000
    # A column is another one's derivative if it correlates with that one's difference quotient at least so.
    min_correlation: float = 0.9
    # A pair with a ratio that no two units have, such as counts and rad/s, needs at least this correlation.
    min_correlation_without_units: float = 0.998
    # Correlations tie if they differ by at most this.
    max_tied_difference: float = 0.004
    # A ratio is one of `UNIT_RATIOS` if it is within this share of it: filters and delays lower the ratio by some
    # percent.
    ratio_tolerance: float = 0.08
    # Two motions are the same if they correlate at least so, at the best shift.
    min_same_motion: float = 0.97
    # Efforts differ if one's spread is at least so many times the other's.
    min_effort_ratio: float = 1.08
    # Motions are resampled to at most so many rows before they are compared.
    compared_rows: int = 4000


DERIVATIVE_LIMITS = DerivativeLimits()

UNIT_RATIOS = (
    ("rad", "rad/s", 1.0), ("deg", "deg/s", 1.0), ("deg", "rad/s", math.pi / 180.0), ("rad", "deg/s", 180.0 / math.pi),
    ("rad", "rpm", 30.0 / math.pi), ("deg", "rpm", 1.0 / 6.0), ("turn", "turn/s", 1.0), ("turn", "rpm", 60.0),
    ("turn", "rad/s", 2.0 * math.pi), ("turn", "deg/s", 360.0), ("rad", "turn/s", 0.5 / math.pi),
    ("deg", "turn/s", 1.0 / 360.0), ("m", "mm/s", 1000.0), ("mm", "m/s", 0.001), ("m", "m/s", 1.0),
    ("mm", "mm/s", 1.0),
)  # fmt: skip
"""Units of a column and of its derivative, with the ratio of the recorded to the computed derivative."""


@dataclass(frozen=True)
class DerivativePair:
    """A column that is the derivative of another."""

    of: str  # column that is differentiated
    by: str  # column that is its derivative
    ratio: float  # recorded derivative over the computed one, per second of the table's clock
    correlation: float  # correlation of both

    @property
    def units(self) -> tuple[tuple[str, str], ...]:
        """Pairs of units that fit the ratio, such as ``("deg", "rad/s")``."""
        return tuple(
            (a, b)
            for a, b, ratio in UNIT_RATIOS
            if abs(abs(self.ratio) / ratio - 1.0) < DERIVATIVE_LIMITS.ratio_tolerance
        )


def find_derivatives(
    columns: Mapping[str, np.ndarray], time: np.ndarray, kinship: Callable[[str, str], float] | None = None
) -> list[DerivativePair]:
    """Return the pairs of columns of which one is the other's derivative, best first; each column is one's derivative
    once.

    Both are smoothed alike before they are compared, so that noise of difference quotients does not hide a pair. The
    correlation of a difference quotient with the column must exceed that of the column itself, which a decaying
    exponential would also fulfil.

    Parameters
    ----------
    columns : mapping of ndarray
        Columns, each shape (n,), without counters and clocks.
    time : ndarray, shape (n,)
        Times [s]; rows whose time falls back are not used.
    kinship : callable, optional
        How closely the names of a position and of its derivative are related. It decides between positions that
        correlate alike, such as both sides of a gear.
    """
    names = [name for name, x in columns.items() if np.isfinite(x).mean() > 0.98 and np.ptp(x[np.isfinite(x)]) > 0.0]
    if len(names) < 2 or len(time) < 50:
        return []
    rows = _busiest_rows([columns[name] for name in names], len(time))
    times = time[rows]
    # Stamps of arrival fall back: only a row later than all rows before it has a slope.
    keep = np.isfinite(times) & (times > np.fmax.accumulate(np.concatenate(([-np.inf], times[:-1]))))
    times = times[keep]
    if len(times) < 50:
        return []
    matrix = np.column_stack([np.nan_to_num(columns[name][rows][keep]) for name in names])
    slopes = np.gradient(matrix, times, axis=0)
    width = max(3, len(times) // 2000)
    level, slope = _smoothed(matrix, width), _smoothed(slopes, width)
    correlation = _correlations(slope, level)
    own = np.abs(_correlations(level, level))
    found = []
    for j, by in enumerate(names):
        strengths = np.abs(correlation[:, j]).copy()
        strengths[j] = 0.0
        i = int(np.argmax(strengths))
        if kinship is not None:
            alike = np.flatnonzero(strengths >= strengths[i] - DERIVATIVE_LIMITS.max_tied_difference)
            i = max(alike, key=lambda k: (kinship(names[k], by), strengths[k]))
        if strengths[i] < DERIVATIVE_LIMITS.min_correlation or own[i, j] > 0.6:
            continue
        centred = slope[:, i] - slope[:, i].mean()
        ratio = float(centred @ (level[:, j] - level[:, j].mean()) / (centred @ centred))
        pair = DerivativePair(names[i], by, ratio, float(correlation[i, j]))
        # Friction makes an effort resemble a velocity; then the ratio is none of units, and the fit is worse.
        if pair.units or abs(pair.correlation) > DERIVATIVE_LIMITS.min_correlation_without_units:
            found.append(pair)
    return sorted(found, key=lambda pair: -abs(pair.correlation))


def _busiest_rows(columns: list[np.ndarray], n: int) -> slice:
    """Return the rows, at most `DERIVATIVE_LIMITS.max_compared_rows`, in which the columns vary most."""
    if n <= DERIVATIVE_LIMITS.max_compared_rows:
        return slice(0, n)
    best, start = -1.0, 0
    for first in range(0, n - DERIVATIVE_LIMITS.max_compared_rows + 1, DERIVATIVE_LIMITS.max_compared_rows // 2):
        part = [column[first : first + DERIVATIVE_LIMITS.max_compared_rows : 20] for column in columns]
        total = sum(
            float(np.nanstd(x) / (np.nanstd(column[::20]) or 1.0)) for x, column in zip(part, columns, strict=True)
        )
        if total > best:
            best, start = total, first
    return slice(start, start + DERIVATIVE_LIMITS.max_compared_rows)


def _smoothed(matrix: np.ndarray, width: int) -> np.ndarray:
    """Return running means of `width` rows, twice, so that quanta and noise lose most of their power."""
    for _ in range(2):
        sums = np.cumsum(np.vstack([np.zeros((1, matrix.shape[1])), matrix]), axis=0)
        matrix = (sums[width:] - sums[:-width]) / width
    return matrix


def _correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    norms = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)[None, :]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num((a.T @ b) / norms)


@dataclass(frozen=True)
class RepeatedMotion:
    """Two recordings of one motion with different efforts."""

    lighter: str  # recording with the smaller effort
    heavier: str  # recording with the larger effort
    correlation: float  # correlation of both motions at the best shift
    ratio: float  # spread of the larger effort over that of the smaller one


def find_repeated_motion(
    first: tuple[str, np.ndarray, np.ndarray], second: tuple[str, np.ndarray, np.ndarray]
) -> RepeatedMotion | None:
    """Return whether two recordings repeat a motion with another effort; None if they do not.

    Each is its name, positions and efforts, shape (n,), at one rate.
    """
    (name_a, position_a, effort_a), (name_b, position_b, effort_b) = first, second
    n = max(len(position_a), len(position_b))
    if min(len(position_a), len(position_b)) < 0.6 * n:
        return None
    stride = max(1, n // DERIVATIVE_LIMITS.compared_rows)
    a, b = (running_mean(x, stride)[::stride] for x in (position_a, position_b))
    a, b = a - a.mean(), b - b.mean()
    size = 2 ** int(np.ceil(np.log2(len(a) + len(b))))
    product = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    correlation = float(product.max() / (np.linalg.norm(a) * np.linalg.norm(b) or 1.0))
    if correlation < DERIVATIVE_LIMITS.min_same_motion or abs(np.std(a) / np.std(b) - 1.0) > 0.1:
        return None
    spread_a, spread_b = (float(np.std(running_mean(x, max(stride, 5)))) for x in (effort_a, effort_b))
    if min(spread_a, spread_b) <= 0.0:
        return None
    ratio = spread_b / spread_a
    if ratio >= DERIVATIVE_LIMITS.min_effort_ratio:
        return RepeatedMotion(name_a, name_b, correlation, ratio)
    if 1.0 / ratio >= DERIVATIVE_LIMITS.min_effort_ratio:
        return RepeatedMotion(name_b, name_a, correlation, 1.0 / ratio)
    return None
