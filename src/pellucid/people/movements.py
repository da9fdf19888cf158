"""Detection of point-to-point movements in a recorded angle: onset, end and speed of each, and rejected ones.

A record is cut into stretches with one movement each: from one step of the target to the next, or, without a target,
from the middle of one rest to the middle of the next. The angle is low-passed without delay and differentiated; a
movement lasts from the first to the last sample of its stretch whose speed is above a share of its largest, 5 % in the
published rule [1]_. Speed has no sign: an overshoot and its correction backwards belong to the movement. The duration
is thus the time to rest. The number of corrections and the time after the first arrival are computed too
(`MOVEMENT_DEFINITIONS` names each). A filter at 3 Hz makes fast movements longer and lowers their peaks; a sensitivity
analysis with other filters reports this effect.

A low-pass without delay rings: it answers a movement that is short for its cut-off with motions in the opposite
direction, before and after it. Such a motion counts if it is faster than what the filter leaves of a one-way movement
that lasts as long, or if the angle itself moves back as far: the angle before the filter does not ring.

Two motions belong to a neighbour: one against the direction of the target that was under way when the target came ends
the movement before, and one towards the next target that is fastest after that target came begins the next movement.

One-way movements go from a start line to a target line (`one_way_movements`). Where pointing is aimed at a line and
nobody says when a movement ends, the end is the last rest before the return: a corrected end belongs to the movement
that it corrects, and so does the time that it took. This rule stands where the pointer is carried back, or lifted off,
after each movement; the others stand where there are targets or rests between.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
   transparency of a robotic upper limb exoskeleton", Robotica 39, 2021, section 4.3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, zip_longest
from typing import Literal

import numpy as np

from .. import _core
from .._errors import RecordingError
from ..files.optical import OpticalRecording
from ..numerics.even_times import even_times
from ..numerics.filters import central_difference, runs, zero_phase_lowpass
from ..units import COORDINATES_BY_UNIT


@dataclass(frozen=True)
class MovementBounds:
    """Thresholds by which stretches are cut, and movements found in them or refused."""

    # A movement must have at least this many samples, so that its largest speed can be located
    min_movement_samples: int = 8
    # A second peak of the speed counts as a rival if it reaches this share of the largest
    min_rival_peak_share: float = 0.8
    # Two rival peaks are separate if the speed between them falls below this share of the largest. Then no peak is
    # clear.
    max_valley_share: float = 0.5
    # A stretch with less than this share of the intended travel contains no movement, or one in the other direction
    min_travel_share: float = 0.5
    # Where no target is recorded, a motion that soon follows a movement and travels less than this share of it is its
    # correction. That is what an overshoot of a third leaves; people's are smaller.
    max_correction_share: float = 1.0 / 3.0
    # It follows within this time of the movement. People correct an error that they see after 0.1 to 0.3 s, and a slow
    # motion is above the threshold for less than it lasts
    max_correction_delay_s: float = 0.5
    # A motion backwards counts if it is this many times as fast as the ringing of a movement of minimum jerk. The
    # speeds of people are not of minimum jerk: of one-way movements with a stylus at 3 Hz the ringing reaches 1.4
    # times that.
    ringing_margin: float = 1.5
    # A slower motion backwards counts, too, if the angle before the filter goes back by this share of what it goes
    # after the filter: 0 of ringing, about 1 of a correction
    min_unfiltered_share: float = 0.5
    # The angle before the filter is averaged over this time where a motion backwards begins and ends
    unfiltered_average_s: float = 0.05
    # Ringing follows a movement, or precedes it, within this many periods of the cut-off frequency
    max_ringing_gap_periods: float = 0.5
    min_rest_s: float = 0.15  # Shorter rests do not separate movements where there is no target
    # Missing samples for up to this time are interpolated; a movement that touches a longer loss is excluded
    max_bridged_gap_s: float = 0.1
    # Target steps closer together than this are one step, which a screen or a filter spread out
    max_merged_step_s: float = 0.05


MOVEMENT_BOUNDS = MovementBounds()

MOVEMENT_DEFINITIONS: Mapping[str, str] = {
    "duration": "Time to rest: from the first to the last sample whose speed is above 5 % of its largest, corrections "
    "in either direction included (Verdel et al. 2021). The primary time.",
    "first_arrival": "Time to the first arrival: from the first sample above 5 % until the speed first falls below it, "
    "or the direction reverses, after its largest value (the primary submovement of Meyer et al. 1988).",
    "after_arrival": "Time after the first arrival: the time to rest less the time to the first arrival, 0 without a "
    "correction.",
    "corrections": "Number of corrections: motions above 5 % in one direction between the first arrival and rest.",
}
"""Definitions of when a movement ends, by the name of the value that each gives, in sentences."""


@dataclass(frozen=True)
class MovementRule:
    """How an angle record becomes movements."""

    lowpass: float = 3.0  # Cut-off of the zero-phase Butterworth filter [Hz]
    order: int = 4  # order of one pass of the filter
    threshold: float = 0.05  # share of the largest speed at which a movement begins and ends
    # ``"all"``: first and last sample above it, as published; ``"peak"``: the run of samples above it that holds the
    # largest
    ends: Literal["all", "peak"] = "all"


@dataclass(frozen=True, eq=False)
class Kinematics:
    """A filtered angle with its derivatives."""

    time: np.ndarray  # (n,) [s], even
    angle: np.ndarray  # angle, velocity, acceleration: (n,) [rad], [rad/s], [rad/s^2]
    velocity: np.ndarray
    acceleration: np.ndarray
    lost: np.ndarray  # (n,) Samples that were missing for longer than is bridged
    unfiltered: np.ndarray  # (n,) The angle before the low-pass [rad]
    fs: float  # [Hz]
    unit: str = "rad"  # Or "m", of a place in place of an angle: all that is [rad] here is then [m]


class NoAngle(RecordingError):
    """A recording without a sample of its angle."""


@dataclass(frozen=True)
class Stretch:
    """Time with one movement in it: [begin, end) in seconds; how far it was to go, signed, and where to [rad], where
    that is known."""

    begin: float
    end: float
    amplitude: float | None = None
    goal: float | None = None


@dataclass(frozen=True)
class Movement:
    """One movement."""

    first: int  # first, last: Its first and last sample
    last: int
    start: float  # start, duration: [s]
    duration: float
    direction: int  # 1 along +angle, -1 against it
    amplitude: float | None  # As labelled, without sign [rad]
    travel: float  # As measured, between its ends, without sign [rad]
    reach: float  # As measured, from the rest before to the rest after it, along its direction [rad]
    peak_velocity: float  # largest speed [rad/s]
    mean_velocity: float  # travel over duration [rad/s]
    peak_time: float  # time of the largest speed, as a share of the duration
    peak_acceleration: float  # largest along its direction, while it moves in that direction [rad/s^2]
    goal: float | None = None  # The target's angle [rad]
    lasted: float = 0.0  # [s] as seen: `duration`, and where it had not `settled` until its stretch was over
    first_arrival: float = 0.0  # Time from its start to the end of the run of samples with the largest speed [s]
    corrections: int = 0  # Motions after the first arrival, each in one direction
    settled: bool = True  # Whether it had been at rest for `min_rest_s` when its stretch was over

    @property
    def after_arrival(self) -> float:
        """Time from the first arrival to rest [s]."""
        return self.duration - self.first_arrival


@dataclass(frozen=True)
class NoMovement:
    """A stretch from which no movement was taken, and why.

    `kind` is ``"lost"``, ``"still"``, ``"direction"``, ``"no_peak"``, ``"too_few_samples"`` or ``"unfinished"``.
    """

    stretch: Stretch
    kind: str
    found: str
    expected: str
    lasted: float = float("nan")  # time from the start of an unfinished movement to the end of its stretch [s]


def kinematics(
    time: np.ndarray, angle: np.ndarray, rule: MovementRule, *, where: str = "", unit: str = "rad"
) -> Kinematics:
    """Filter an angle and differentiate it twice. `time`, `angle` (n,) [s], [rad] or another `unit`."""
    time, angle = np.asarray(time, float), np.asarray(angle, float)
    seen = np.isfinite(angle) & np.isfinite(time)
    if seen.sum() < 2 or np.any(np.diff(time[np.isfinite(time)]) <= 0.0):
        raise (NoAngle if seen.sum() < 2 else RecordingError)(
            f"{where or 'angle'}: found {int(seen.sum())} finite samples, expected at least 2 at increasing times"
        )
    steps = np.diff(time)
    is_even = np.max(steps) < 1.5 * np.min(steps)  # then no step needs their median
    fs = 1.0 / float(np.mean(steps if is_even else steps[steps < 1.5 * np.median(steps)]))
    even = even_times(time, fs, 0.5)
    known = time[seen]
    filled = np.interp(even, known, angle[seen])
    lost = np.zeros(len(even), bool)
    gaps = np.flatnonzero(np.diff(known) > MOVEMENT_BOUNDS.max_bridged_gap_s + 1.5 / fs)
    begins, ends = (-np.inf, *known[gaps], known[-1]), (known[0], *known[gaps + 1], np.inf)
    for begin, part in zip(begins, map(slice, *(np.searchsorted(even, each) for each in (begins, ends))), strict=True):
        lost[part] = even[part] - begin > 0.5 / fs
    return _filtered(even, filled, lost, fs, unit, rule, where)


def with_filter(motion: Kinematics, rule: MovementRule, *, where: str = "") -> Kinematics:
    """Return a motion with its angle filtered by another rule."""
    return _filtered(motion.time, motion.unfiltered, motion.lost, motion.fs, motion.unit, rule, where)


def _filtered(
    even: np.ndarray, filled: np.ndarray, lost: np.ndarray, fs: float, unit: str, rule: MovementRule, where: str
) -> Kinematics:
    try:
        smooth = zero_phase_lowpass(filled, rule.lowpass, rule.order, fs)
    except ValueError as error:
        raise RecordingError(f"{where or 'angle'}: {error}") from None
    velocity = central_difference(smooth, fs)
    return Kinematics(even, smooth, velocity, central_difference(velocity, fs), lost, filled, fs, unit)


def target_stretches(time: np.ndarray, target: np.ndarray) -> list[Stretch]:
    """Stretches from one step of the target to the next, the last one to the end of the record. `time`, `target`
    (n,) [s], [rad]."""
    known = np.isfinite(target)
    time, target = time[known], target[known]
    at = np.flatnonzero(np.diff(target) != 0.0) + 1
    if not len(at):
        return []
    groups = np.split(at, np.flatnonzero(np.diff(time[at]) > MOVEMENT_BOUNDS.max_merged_step_s) + 1)
    begins = [float(time[group[0]]) for group in groups]
    heights = [float(target[group[-1]] - target[group[0] - 1]) for group in groups]
    goals = [float(target[group[-1]]) for group in groups]
    ends = [*begins[1:], float(time[-1]) + 1e-9]
    return [Stretch(*each) for each in zip(begins, ends, heights, goals, strict=True) if each[2] != 0.0]


def rest_stretches(
    motion: Kinematics, rule: MovementRule, *, least: float, amplitude: float | None = None
) -> list[Stretch]:
    """Stretches between rests, where no target was recorded.

    A movement is a run of speeds above the rule's share of the record's largest, in one direction; runs less than
    `min_rest_s` apart in the same direction are one, a correction belongs to the movement that it follows within
    `max_correction_delay_s`, and what covers less than `least` is no movement.

    `least` [rad]; `amplitude` [rad].
    """
    top = float(np.quantile(np.abs(motion.velocity), 0.999))
    if top == 0.0:
        return []
    found: list[list] = []
    for sign in (1, -1):
        for run in runs(sign * motion.velocity > rule.threshold * top):
            found.append([run.start, run.stop, sign])
    found.sort()
    joined: list[list] = []
    for start, stop, sign in found:
        if joined and joined[-1][2] == sign and (start - joined[-1][1]) / motion.fs < MOVEMENT_BOUNDS.min_rest_s:
            joined[-1][1] = stop
        else:
            joined.append([start, stop, sign])
    # What a filter or a tremor makes between movements is no movement, and divides none.
    kept = _with_corrections(motion, [m for m in joined if _travel(motion, m) >= least])
    middles = [0.5 * (a[1] + b[0]) for a, b in pairwise(kept)]
    edges = [0.0, *middles, float(len(motion.time))]
    begin = motion.time[0]
    return [
        Stretch(begin + low / motion.fs, begin + high / motion.fs, _as_labelled(amplitude, sign))
        for low, high, (_, _, sign) in zip(edges[:-1], edges[1:], kept, strict=True)
    ]


def _travel(motion: Kinematics, run: Sequence[int]) -> float:
    """Return how far a run from one sample to another goes, without sign [rad]."""
    return float(abs(motion.angle[run[1] - 1] - motion.angle[run[0]]))


def _with_corrections(motion: Kinematics, found: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the movements (start, stop, sign) among runs in one direction, in their order.

    A small run, which travels less than `max_correction_share` of its neighbour, is part of it: one that soon follows a
    larger run is its correction, one without a rest before it is a start in the wrong direction.
    """
    kept: list[list[int]] = []
    size = 0.0  # travel of the last movement's largest run
    for start, stop, sign in found:
        own = _travel(motion, (start, stop))
        rest = (start - kept[-1][1]) / motion.fs if kept else np.inf
        if own < MOVEMENT_BOUNDS.max_correction_share * size and rest < MOVEMENT_BOUNDS.max_correction_delay_s:
            kept[-1][1] = stop
            continue
        if rest >= MOVEMENT_BOUNDS.min_rest_s:
            kept.append([start, stop, sign])
        elif size < MOVEMENT_BOUNDS.max_correction_share * own:
            kept[-1][1:] = stop, sign
        else:
            kept.append([start, stop, sign])
        size = own
    return kept


def _as_labelled(amplitude: float | None, sign: int) -> float | None:
    """A record's label holds for movements in its direction; those back to the start are not labelled."""
    return amplitude if amplitude is not None and np.sign(amplitude) == sign else None


def movements(
    motion: Kinematics, stretches: Sequence[Stretch], rule: MovementRule
) -> tuple[list[Movement], list[NoMovement]]:
    """The movement in each stretch."""
    found: list[Movement] = []
    left_out: list[NoMovement] = []
    edges = np.array([(stretch.begin, stretch.end) for stretch in stretches]).reshape(-1, 2)
    parts = np.searchsorted(motion.time, edges - 1e-9).tolist()
    for (low, high), stretch, following in zip_longest(parts, stretches, stretches[1:]):
        outcome = _movement(motion, low, high, stretch, following, rule)
        if isinstance(outcome, NoMovement):
            left_out.append(_told_of_loss(motion, outcome))
        else:
            found.append(outcome)
    return found, left_out


def _movement(
    motion: Kinematics, low: int, high: int, stretch: Stretch, following: Stretch | None, rule: MovementRule
) -> Movement | NoMovement:
    """The movement in a stretch, the samples [low, high), of which `following` is the next one."""
    least = MOVEMENT_BOUNDS.min_movement_samples
    if high - low < least:
        return NoMovement(stretch, "too_few_samples", f"{high - low} samples", f"at least {least}")
    went = motion.angle[high - 1] - motion.angle[low]
    direction = int(np.sign(stretch.amplitude if stretch.amplitude is not None else went)) or 1
    if stretch.amplitude is not None and direction * went < MOVEMENT_BOUNDS.min_travel_share * abs(stretch.amplitude):
        kind = "direction" if direction * went < -0.2 * abs(stretch.amplitude) else "still"
        along = COORDINATES_BY_UNIT[motion.unit]
        moved = f"{along.factor * direction * went:.3g} {along.shown} towards the target"
        return NoMovement(stretch, kind, moved, f"{along.factor * abs(stretch.amplitude):.3g} {along.shown}")
    low, high = _own_samples(motion, low, high, direction, following, rule)
    velocity = motion.velocity[low:high]
    if low >= high or not velocity.any():
        return NoMovement(stretch, "still", "no motion", "a movement")
    shares = rule.threshold, MOVEMENT_BOUNDS.min_rival_peak_share, MOVEMENT_BOUNDS.max_valley_share
    peak, *main_ends, first, last, has_backward, second, valley = _core.main_movement(velocity, *shares)
    main, speed = slice(*main_ends), np.abs(velocity)
    ahead = velocity if velocity[peak] > 0.0 else -velocity
    top, seen = float(speed[peak]), speed
    if rule.ends != "all":
        first, last = main.start, main.stop - 1
    elif has_backward:
        seen = _without_ringing(speed, ahead, main, motion, low, rule)
        moving = np.flatnonzero(seen > rule.threshold * top)
        first, last = int(moving[0]), int(moving[-1])
    n = int(np.count_nonzero(motion.lost[low + first : low + last + 1]))
    if n:
        return NoMovement(stretch, "lost", f"{n} missing samples in a movement", "an angle throughout")
    if last - first + 1 < least:
        return NoMovement(stretch, "too_few_samples", f"{last - first + 1} samples", f"at least {least}")
    if last == high - low - 1 and speed[-1] > 2.0 * rule.threshold * top:
        share = 100.0 * speed[-1] / top
        lasted = (last - first) / motion.fs
        found = f"{share:.0f} % of the largest speed at its end"
        return NoMovement(stretch, "unfinished", found, "a rest after it", lasted)
    if peak in (0, len(speed) - 1):
        return NoMovement(stretch, "no_peak", "the largest speed at its border", "a speed that rises and falls")
    if second > MOVEMENT_BOUNDS.min_rival_peak_share and valley < MOVEMENT_BOUNDS.max_valley_share:
        # A correction backwards is no second movement, however fast it is.
        said = f"a second peak of {100 * second:.0f} % with {100 * valley:.0f} % in between"
        return NoMovement(stretch, "no_peak", said, "one clear peak of the speed")
    duration, rest = (last - first) / motion.fs, (high - 1 - low - last) / motion.fs
    # What rests divide has settled; where targets do, the next may come before it has.
    settled = stretch.goal is None or rest >= MOVEMENT_BOUNDS.min_rest_s
    travel = direction * (motion.angle[low + last] - motion.angle[low + first])
    later, corrections = slice(main.stop, last + 1), 0
    if main.stop <= last:
        ways = np.where(seen[later] > rule.threshold * top, np.sign(ahead[later]), 0.0)
        begins = ways != 0.0
        begins[1:] &= ways[1:] != ways[:-1]
        corrections = int(np.count_nonzero(begins))
    # The braking of a correction backwards is no acceleration of the movement.
    inside = slice(low + first, low + last + 1)
    inwards = motion.velocity[inside] > 0.0 if direction > 0 else motion.velocity[inside] < 0.0
    accelerations = motion.acceleration[inside][inwards]
    if not len(accelerations):
        return NoMovement(stretch, "direction", "no motion in the direction of its travel", "some")
    return Movement(
        first=low + first,
        last=low + last,
        start=float(motion.time[low + first]),
        duration=duration,
        direction=direction,
        amplitude=None if stretch.amplitude is None else abs(stretch.amplitude),
        travel=float(travel),
        reach=float(direction * went),
        peak_velocity=top,
        mean_velocity=float(travel / duration),
        peak_time=(peak - first) / (last - first),
        peak_acceleration=float(accelerations.max() if direction > 0 else -accelerations.min()),
        goal=stretch.goal,
        lasted=duration if settled else duration + rest,
        first_arrival=(main.stop - 1 - first) / motion.fs,
        corrections=corrections,
        settled=settled,
    )


def _without_ringing(
    speed: np.ndarray, ahead: np.ndarray, main: slice, motion: Kinematics, low: int, rule: MovementRule
) -> np.ndarray:
    """Return the speed (n,), set to 0 in motions next to the `main` run that may be ringing of the filter.

    `ahead` is the velocity in the direction of the main run; `low` is the first of these samples in `motion`.
    """
    top = float(speed[main].max())
    back = (ahead < 0.0) & (speed > rule.threshold * top)
    fs = motion.fs
    limit = MOVEMENT_BOUNDS.ringing_margin * ringing_share((main.stop - 1 - main.start) / fs * rule.lowpass, rule)
    if limit <= rule.threshold:
        return speed
    kept = speed.copy()
    reach = MOVEMENT_BOUNDS.max_ringing_gap_periods / rule.lowpass * fs
    for run in runs(back):
        gap = max(run.start - main.stop, main.start - run.stop)
        slow = gap <= reach and speed[run].max() <= limit * top
        if slow and not _moves_unfiltered(motion, slice(low + run.start, low + run.stop)):
            kept[run] = 0.0
    return kept


def _moves_unfiltered(motion: Kinematics, run: slice) -> bool:
    """Return whether the angle before the filter goes the way of a run after the filter."""
    half = max(round(0.5 * MOVEMENT_BOUNDS.unfiltered_average_s * motion.fs), 0)

    def at(sample: int) -> float:
        return float(np.mean(motion.unfiltered[max(sample - half, 0) : sample + half + 1]))

    went = float(motion.angle[run.stop - 1] - motion.angle[run.start])
    return (at(run.stop - 1) - at(run.start)) / went >= MOVEMENT_BOUNDS.min_unfiltered_share if went else False


def ringing_share(periods: float, rule: MovementRule) -> float:
    """Return how fast the filter of a `rule` makes a one-way movement go backwards, as a share of its peak speed.

    `periods` is the duration of the movement above the rule's threshold, filtered, in periods of the cut-off frequency.
    """
    durations, shares = _ringing(rule.order, rule.threshold)
    return float(np.interp(periods, durations, shares))


@lru_cache(maxsize=64)
def _ringing(order: int, threshold: float) -> tuple[np.ndarray, np.ndarray]:
    """Return filtered durations of movements of minimum jerk, and their ringing: (k,) each, at a cut-off of 1 Hz."""
    fs, rows = 50.0, []
    time = np.arange(-6.0, 6.0, 1.0 / fs)
    for duration in np.geomspace(0.2, 6.0, 30):
        s = np.clip(time / duration + 0.5, 0.0, 1.0)
        velocity = zero_phase_lowpass(s**2 * (1.0 - s) ** 2, 1.0, order, fs)
        inside = np.flatnonzero(velocity > threshold * velocity.max())
        rows.append(((inside[-1] - inside[0]) / fs, max(-float(velocity.min() / velocity.max()), 0.0)))
    durations, shares = np.array(rows).T
    return np.maximum.accumulate(durations), shares


def _own_samples(
    motion: Kinematics, low: int, high: int, direction: int, following: Stretch | None, rule: MovementRule
) -> tuple[int, int]:
    """Return the samples [low, high) of a stretch without what belongs to the movement before or after it.

    A motion against `direction` at its beginning ends the movement before. One at its end towards the target of the
    stretch that is `following` begins that movement, if it is fastest after that target came.
    """
    towards = direction * motion.velocity[low:high]
    limit = rule.threshold * float(towards.max())
    if -towards[0] > limit > 0.0:
        low += int(np.argmax(towards >= 0.0))
    if following is None or following.amplitude is None or np.sign(following.amplitude) == direction:
        return low, high
    if not 0 < high < len(motion.velocity) or not -towards[-1] > limit > 0.0:
        return low, high
    towards = direction * motion.velocity
    stop = high + int(np.argmax(towards[high:] >= 0.0)) if (towards[high:] >= 0.0).any() else len(towards)
    begin = low + int(np.flatnonzero(towards[low:high] >= 0.0)[-1]) + 1
    is_next = stop > high and np.min(towards[high:stop]) < np.min(towards[begin:high])
    return low, begin if is_next else high


def _told_of_loss(motion: Kinematics, none: NoMovement) -> NoMovement:
    """What a straight line over a loss looks like is no movement's own fault."""
    inside = (motion.time >= none.stretch.begin) & (motion.time < none.stretch.end)
    n = int(motion.lost[inside].sum())
    if not n or none.kind == "lost":
        return none
    return NoMovement(none.stretch, "lost", f"{n} missing samples around a movement", "an angle throughout")


MIN_HORIZONTAL_SHARE = 0.1
"""Smallest mean horizontal share of the segment's direction; below it the sign of the angle is undefined."""


def segment_angle(optical: OpticalRecording, proximal: str, distal: str) -> np.ndarray:
    """Angle of the line from one marker to another, in the vertical plane in which it points on average.

    With u the segment's direction, g that of gravity and f the horizontal direction of the mean of u, q = atan2(u.f,
    u.g): 0 where the segment hangs, a quarter turn where it points forward. Motion out of the plane does not enter.

    Gives (n,) [rad].
    """
    for name in (proximal, distal):
        if name not in optical.markers:
            raise RecordingError(
                f"{optical.path.name}: found the markers {', '.join(optical.markers)}, expected {name} among them"
            )
    line = optical.markers[distal] - optical.markers[proximal]
    length = np.linalg.norm(line, axis=1)
    seen = np.isfinite(length)
    where = f"{optical.path.name}: markers {proximal} and {distal}"
    if not seen.any():
        raise NoAngle(f"{where}: found no frame that saw both, expected most")
    if np.median(length[seen]) < 1e-3:
        raise RecordingError(f"{where}: found them {1e3 * np.median(length[seen]):.2g} mm apart, expected a segment")
    whole = seen.all()
    direction = line / length[:, None] if whole else line[seen] / length[seen, None]
    mean = direction.mean(axis=0)
    level = mean - (mean @ optical.down) * optical.down
    share = float(np.linalg.norm(level))
    if share < MIN_HORIZONTAL_SHARE:
        raise RecordingError(
            f"{where}: found a segment that points {100 * share:.2g} % to a side on average, expected at least "
            f"{100 * MIN_HORIZONTAL_SHARE:.0f} %: without a side its angle has no sign"
        )
    found = np.unwrap(np.arctan2(direction @ (level / share), direction @ optical.down))
    if whole:
        return found
    angle = np.full(len(length), np.nan)
    angle[seen] = found
    return angle
