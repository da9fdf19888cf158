"""What a robot answers at its commissioning: sign, gain and delay of its drive, the start-up test and the probe.

Sign, gain and delay come from starts of a robot that nobody wears, whose inertia is identified. With a smooth window φ
that is 0 at both ends, the balance of a joint that slides needs no derivative of its position q:

    J ∫ q φ'' = g ∫ u(t − d) φ − c ∫ sign(q') φ + b ∫ q φ' − k ∫ φ,

with effort u that was asked for, gain g, delay d, friction c and b, and what gravity is where the start began, k. All
are found by least squares over all windows of all starts, d by a search. The reading of a drive per unit of effort
follows from both integrals, for these do not depend on its lag. The work of the start-up test and the answers of the
probe are the supervisor's own numbers: the log is played through the controller again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from .._errors import PellucidError
from .instruments import MAX_WAVE_DIFFERENCE
from .supervised import TEST_SAMPLE_BOUNDS, SupervisedLaw

START_COUNT = 10
"""Number of starts of a commissioning; fewer do where the mean of their results is known within `MAX_GAIN_ERROR`."""

MIN_STARTS = 3
"""Smallest number of starts of which a spread can be told."""

WINDOW_S = 0.016
"""Duration of a window over which the balance is taken: shorter than half a wave of the start-up test."""

MEAN_S = 0.016
"""Time over which the speed is averaged that says whether the joint slides."""

AFTER_WAVE_S = 0.1
"""Time after the wave in which a joint still slides."""

LONGEST_DELAY_S = 0.03
"""Largest delay of a drive that is looked for."""

DELAY_STEP_S = 0.25e-3
"""Distance of the delays that are tried."""

MIN_SLIDING_SHARE = 0.1
"""A joint slides from this share of its largest speed in the start on [1]."""

MAX_UNEXPLAINED_SHARE = 0.02
"""Largest share of the squared balance that may be left: more where a rotor swings before a soft transmission [1].

What the encoder's steps and noise leave is allowed in addition.
"""

ROUNDING_RATIO = 1.5
"""Variance that rounding by an encoder has in the band of a window, at most, over that of white rounding [1].

A slow joint goes through the steps regularly. It was 1.43 at most in 368 logs of simulated rigid robots with 13 to 16
bits.
"""

MAX_GAIN_ERROR = 0.15
"""Largest relative difference of the measured gain from the stated one of a drive that is right, and of what its
measurement reads from what it gives [1]."""

MIN_WORN_INERTIA = 1.05
"""Smallest inertia of a robot with its wearer over that of the robot alone that starts can show [1].

With the lab's wearers, whose limb is held by straps, starts show no gain at all.
"""

MIN_PROBE_WINDOWS = 20
"""Smallest number of windows of a moving joint from which the probe's answers are taken."""

MAX_EFFORT_DIFFERENCE = 0.02
"""Largest difference of the logged effort from that of the controller on the same positions, over its limit [1]."""


MIN_SIGN_WORK_SHARE = 0.02
"""Work of a wave's first half over that on a free joint below which its sign is unknown [1].

A drive that gives nothing within it, or a joint that is held, does none."""

MIN_SECOND_WAY_SHARE = 0.8
"""Smallest of a wave's two peaks over the other one [1]; a wave that was broken off has less."""


@dataclass(frozen=True)
class StartLog:
    """What a controller read and asked for from one start on, once a period."""

    name: str  # where it is from
    time: np.ndarray  # shape (n,) [s]
    position: np.ndarray  # shape (n,) [rad or m]
    effort: np.ndarray  # asked for in each period, shape (n,) [N m or N]
    others: Mapping[str, np.ndarray] = field(default_factory=dict)  # further sensors by name, each shape (n,)


@dataclass(frozen=True)
class DriveCheck:
    """Sign, gain and delay of a drive, from starts of a robot that nobody wears."""

    sign: int  # 1 where an effort moves the joint as stated, -1 where it is reversed
    gain: float  # effort given over effort asked for, its size; NaN where the motion does not show it [1]
    gain_spread: float  # standard deviation over starts, or of the mean where that is larger [1]
    delay: float  # from the command to the effort [s]; NaN where the gain is
    starts: int
    reading: float = math.nan  # measured effort over effort asked for; NaN without a measurement [1]
    coarse_steps: float = math.nan  # steps of the encoder in the wave, where they are too few to show the gain [1]

    @property
    def is_right(self) -> bool:
        """Whether the motion shows that the drive gives what it is asked for."""
        return self.sign > 0 and abs(self.gain - 1.0) <= MAX_GAIN_ERROR

    @property
    def is_read_right(self) -> bool:
        """Whether the drive's measurement, if there is one, reads what the motion or else the command shows."""
        given = self.gain if math.isfinite(self.gain) else 1.0
        return not abs(self.reading / given - 1.0) > MAX_GAIN_ERROR

    @property
    def is_open(self) -> bool:
        """Whether the sign is right and the motion does not show the gain."""
        return self.sign > 0 and math.isnan(self.gain)


@dataclass(frozen=True)
class Answers:
    """Reference values of the start-up test and the probe."""

    start_up: float | None  # mean work of the test's wave [J]; None where there is no test
    start_up_spread: float  # standard deviation over starts [J]
    probe: tuple[float, ...] | None  # answers to the three waves, shape (6,) [1]; None where too little moved
    probe_windows: int
    starts: int
    notes: tuple[str, ...] = ()  # why an answer is not told
    wave: float = math.nan  # amplitude of the test's wave [N m or N]
    window: float = math.nan  # duration of the probe's windows [s]


def mean_error(spread: float, count: int) -> float:
    """Return half of the 95 % interval of the mean of `count` values with a standard deviation `spread`."""
    from scipy.special import stdtrit

    return float(stdtrit(count - 1, 0.975)) * spread / math.sqrt(count)


def require_enough(name: str, mean: float, spread: float, count: int) -> None:
    """Raise a PellucidError if fewer than `START_COUNT` starts leave the mean of a result too uncertain."""
    error = mean_error(spread, count) / abs(mean)
    if count < START_COUNT and error > MAX_GAIN_ERROR:
        raise PellucidError(
            f"commission: found {count} starts that tell the {name} within {100.0 * error:.0f} %, expected "
            f"{START_COUNT} starts, or at most {100.0 * MAX_GAIN_ERROR:.0f} %"
        )


def shows_empty_robot(empty: DriveCheck, worn: Sequence[StartLog], inertia: float) -> bool | None:
    """Return whether `worn` starts show the inertia of the robot that nobody wears; None where they do not say.

    A limb adds its inertia, by which the gain of the drive appears smaller, or swings before its straps, so that one
    rigid body explains the motion no longer.
    """
    if not math.isfinite(empty.gain):
        return None
    try:
        found = drive_check(worn, inertia)
    except PellucidError:
        return None
    if not math.isfinite(found.gain):
        return None if math.isfinite(found.coarse_steps) else False
    return empty.gain / found.gain < MIN_WORN_INERTIA


def drive_check(starts: Sequence[StartLog], inertia: float) -> DriveCheck:
    """Return sign, gain and delay of a drive from starts of a robot with an `inertia` [kg m^2 or kg].

    Raises
    ------
    PellucidError
        If there are fewer than `MIN_STARTS` in which the joint moves, or whose wave is whole.
    """
    if not inertia > 0.0:
        raise PellucidError(f"commission: found an inertia of {inertia:g}, expected a known one above 0")
    moved = [start for start in map(_wave_alone, starts) if start is not None]
    if len(moved) < MIN_STARTS:
        raise PellucidError(
            f"commission: found {len(moved)} starts in which an effort moves the joint, expected at least {MIN_STARTS}"
        )
    work = float(np.median([_first_work(start, inertia) for start in moved]))
    if abs(work) < MIN_SIGN_WORK_SHARE:
        raise PellucidError(
            f"commission: found that the first half of the wave does {100 * work:.2g} % of the work that it does on a "
            f"free joint, expected at least {100 * MIN_SIGN_WORK_SHARE:g} % either way: check that the drive gives "
            "effort within the wave, that nothing blocks the joint, and the log's columns and units"
        )
    sign = 1 if work > 0.0 else -1
    whole = [start for start in moved if _is_whole(start)]
    if len(whole) < MIN_STARTS and sign < 0:
        return DriveCheck(sign, math.nan, math.nan, math.nan, len(moved))
    if len(whole) < MIN_STARTS:
        raise PellucidError(
            f"commission: found {len(whole)} of {len(moved)} starts with a whole wave, expected at least {MIN_STARTS}: "
            "the others were stopped, or their log lacks periods. The supervisor's fault says why; check the drive and "
            "its measurement"
        )
    windows = [one for one in map(_windows, whole) if one.first.size]
    if not windows:
        return DriveCheck(sign, math.nan, math.nan, math.nan, len(whole))
    step, noise = _encoder(whole)
    weights = _row_weights(windows, inertia, noise)

    def rows_at(delay: float) -> list[np.ndarray]:
        return [weight @ _rows(w, inertia, delay) for weight, w in zip(weights, windows, strict=True)]

    delays = np.arange(0.0, LONGEST_DELAY_S, DELAY_STEP_S)
    costs = [_solved(rows_at(delay))[1] for delay in delays]
    best = int(np.argmin(costs))
    delay = float(delays[best])
    if 0 < best < len(delays) - 1:
        before, at, after = costs[best - 1 : best + 2]
        bend = before - 2.0 * at + after
        delay += DELAY_STEP_S * (0.5 * (before - after) / bend if bend > 0.0 else 0.0)
    rows = rows_at(delay)
    found, left = _solved(rows)
    gain, mean_left = sign * float(found[0]), left / sum(map(len, rows))
    each = [_solved([one])[0][0] for one in rows]
    # The delay is found from the same positions, and starts from one position repeat the encoder's rounding.
    repeats = len(windows) / len({float(w.start.position[0]) for w in windows})
    right = _design(rows)
    later = np.concatenate(rows_at(delay + DELAY_STEP_S))[:, 1] - right[:, 0]
    error = math.sqrt(min(mean_left, 1.0) * repeats) * _first_deviation(np.column_stack((right, later)))
    spread = max(error, float(np.std(each, ddof=1)))
    # Three standard deviations decide whether the gain is right.
    if 3.0 * error > max(MAX_GAIN_ERROR * abs(gain), min(abs(gain - 1.0) - MAX_GAIN_ERROR, abs(gain))):
        steps = float(np.median([np.ptp(start.position) for start in whole])) / step
        return DriveCheck(sign, math.nan, spread, math.nan, len(whole), coarse_steps=steps)
    if mean_left > 1.0 or gain < 0.0:
        gain = delay = math.nan
    else:
        require_enough("gain", gain, spread, len(whole))
        if mean_error(spread, len(whole)) > MAX_GAIN_ERROR * gain:
            gain = delay = math.nan
    return DriveCheck(sign, gain, spread, delay, len(whole))


def _encoder(starts: Sequence[StartLog]) -> tuple[float, float]:
    """Return the smallest step of an encoder, and the standard deviation of its rounding and its noise at rest."""
    steps = np.abs(np.concatenate([np.diff(start.position) for start in starts]))
    rest = np.concatenate([np.diff(start.position[: np.flatnonzero(start.effort)[0]]) for start in starts])
    step = float(steps[steps > 0.0].min())
    return step, math.sqrt(ROUNDING_RATIO * step**2 / 12.0 + float(np.sum(rest**2)) / max(2 * rest.size, 1))


def _row_weights(windows: Sequence[_Windows], inertia: float, noise: float) -> list[np.ndarray]:
    """Return matrices that make the largest errors of the rows of each start independent, with a variance of 1.

    They are those of the model and those of the `noise` of positions, which windows share where they overlap.
    """
    effects = []
    for w in windows:
        effect = np.zeros((len(w.first), len(w.start.position)))
        np.put_along_axis(effect, w.first[:, None] + np.arange(len(w.bend)), w.bend * inertia * w.period, axis=1)
        effects.append(effect)
    sides = np.concatenate([_rows(w, inertia, 0.0)[:, 0] for w in windows])
    model = MAX_UNEXPLAINED_SHARE * float(np.mean(sides**2))
    return [np.linalg.inv(np.linalg.cholesky(noise**2 * one @ one.T + model * np.eye(len(one)))) for one in effects]


def _first_deviation(right: np.ndarray) -> float:
    """Return the standard deviation of the first of the solutions of least squares for errors with a variance of 1."""
    scale = np.linalg.norm(right, axis=0)
    scale[scale == 0.0] = 1.0
    return float(np.linalg.norm(np.linalg.pinv(right / scale, rcond=1e-9)[0]) / scale[0])


def _is_whole(start: StartLog) -> bool:
    """Return whether a wave pushes both ways; a limit of the effort's rate makes the second way weaker."""
    least = min(start.effort.max(), -start.effort.min())
    return bool(least >= MIN_SECOND_WAY_SHARE * np.abs(start.effort).max())


def _first_work(start: StartLog, inertia: float) -> float:
    """Return the work of a wave's first half over that on a free joint [1], beyond what the joint's own motion does.

    A joint that sinks before the wave goes on sinking. The work of the second half may be negative where the drive is
    late.
    """
    pushed = np.flatnonzero(start.effort)
    first = int(pushed[0])
    turned = np.flatnonzero(start.effort[first:] * start.effort[first] < 0.0)
    end = first + int(turned[0]) if turned.size else int(pushed[-1]) + 1
    impulse = float(np.sum(start.effort[first : end - 1]) * np.median(np.diff(start.time)))
    free = impulse**2 / (2.0 * inertia)
    half = first // 2
    sunk = start.position[first] - start.position[half]
    drift = float(sunk / (start.time[first] - start.time[half])) if first > half else 0.0
    return (float(np.sum(start.effort[first : end - 1] * np.diff(start.position[first:end]))) - impulse * drift) / free


def _wave_alone(start: StartLog) -> StartLog | None:
    """Return the part of a start in which its first wave moves the joint; None where there is none."""
    pushed = np.flatnonzero(start.effort)
    if pushed.size == 0:
        return None
    period = float(np.median(np.diff(start.time)))
    first = int(pushed[0])
    rests = np.flatnonzero(start.effort[first:] == 0.0)
    last = first + (int(rests[0]) if rests.size else len(start.effort) - first)
    end = min(last + round(AFTER_WAVE_S / period), len(start.time))
    kept = slice(max(first - round(2.0 * WINDOW_S / period), 0), end)
    cut = replace(start, time=start.time[kept], position=start.position[kept], effort=start.effort[kept], others={})
    return cut if np.ptp(cut.position) > 0.0 and len(cut.time) > 4 * round(WINDOW_S / period) else None


@dataclass(frozen=True)
class _Windows:
    start: StartLog
    period: float
    first: np.ndarray  # first sample of each window, shape (w,)
    shape: np.ndarray  # φ, shape (k,)
    slope: np.ndarray  # φ', shape (k,) [1/s]
    bend: np.ndarray  # φ'', shape (k,) [1/s^2]
    way: np.ndarray  # sign of the motion, shape (w,)


def _windows(start: StartLog) -> _Windows:
    period = float(np.median(np.diff(start.time)))
    size = max(round(WINDOW_S / period), 8)
    x = np.arange(1, size) / size
    shape = np.sin(math.pi * x) ** 4
    slope = 4.0 * np.sin(math.pi * x) ** 3 * np.cos(math.pi * x) * math.pi / (size * period)
    bend = (math.pi / (size * period)) ** 2 * (
        12.0 * (np.sin(math.pi * x) * np.cos(math.pi * x)) ** 2 - 4.0 * np.sin(math.pi * x) ** 4
    )
    # A rotor swings before a soft transmission: what slides is the mean.
    width = max(round(MEAN_S / period), 1)
    speeds = np.convolve(np.gradient(start.position, period), np.ones(width) / width, "same")
    least = MIN_SLIDING_SHARE * np.abs(speeds).max()
    first, way = [], []
    for i in range(0, len(start.position) - size, max(size // 4, 1)):
        own = speeds[i : i + size]
        if np.abs(own).min() > least and (np.all(own > 0.0) or np.all(own < 0.0)):
            first.append(i + 1)
            way.append(float(np.sign(own[0])))
    return _Windows(start, period, np.array(first, int), shape, slope, bend, np.array(way))


def _rows(windows: _Windows, inertia: float, delay: float) -> np.ndarray:
    """Return the balance of every window as rows: left side, effort, friction, viscous friction, gravity, (w, 5)."""
    start, size = windows.start, len(windows.shape)
    index = windows.first[:, None] + np.arange(size)
    position = start.position[index] - start.position[windows.first][:, None]
    times = start.time[index] - delay
    # The command is held for a period.
    held = np.clip(np.searchsorted(start.time, times, "right") - 1, 0, None)
    share = np.clip((times - start.time[held]) / windows.period, 0.0, 1.0)
    ahead = np.clip(held + 1, None, len(start.effort) - 1)
    effort = start.effort[held] * (1.0 - share) + start.effort[ahead] * share
    dt = windows.period
    return np.column_stack((
        inertia * dt * (position @ windows.bend),
        dt * (effort @ windows.shape),
        -windows.way * dt * windows.shape.sum(),
        dt * (position @ windows.slope),
        np.full(len(windows.first), -dt * windows.shape.sum()),
    ))  # fmt: skip


def _solved(rows: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """Return gain, friction and gravity of each start by least squares, and the sum of squares that is left."""
    left, right = np.concatenate([one[:, 0] for one in rows]), _design(rows)
    scale = np.linalg.norm(right, axis=0)
    scale[scale == 0.0] = 1.0
    found = np.linalg.lstsq(right / scale, left, rcond=1e-9)[0] / scale
    return found, float(np.sum((left - right @ found) ** 2))


def _design(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return the right sides of the balance: friction is everywhere the same, gravity that of each start."""
    return np.concatenate([
        np.column_stack((one[:, 1:4], *(one[:, 4] * (i == k) for k in range(len(rows)))))
        for i, one in enumerate(rows)
    ])  # fmt: skip


def drive_reading(starts: Sequence[StartLog]) -> float:
    """Return what a drive's measurement reads per effort asked for [1].

    Its integral is that of r u, with an offset o t. Lag and delay add shares of u and of its rate to that.

    Raises
    ------
    PellucidError
        If a start has no column ``drive``.
    """
    sides, rows = [], []
    for start in starts:
        if "drive" not in start.others:
            raise PellucidError(f"{start.name}: found no column drive, expected the measurement that study.toml states")
        time = start.time - start.time[0]
        step = np.diff(time, prepend=0.0)
        lags = (start.effort, np.gradient(start.effort))
        row = np.column_stack((np.cumsum(start.effort * step), *lags, time))
        side = np.cumsum(start.others["drive"] * step)
        rows.append(row - row.mean(axis=0))
        sides.append(side - side.mean())
    return float(np.linalg.lstsq(np.concatenate(rows), np.concatenate(sides), rcond=None)[0][0])


def answers(law: SupervisedLaw, starts: Sequence[StartLog], other_waves: Sequence[StartLog] = ()) -> Answers:
    """Return the responses to a robot's start-up test and probe, by replaying its starts through its control law.

    The probe's response is computed from starts whose efforts agree with the commands of the law, and the work of the
    start-up test from starts whose test wave agrees with the law's: of `other_waves` where `starts` have too few.

    Raises
    ------
    PellucidError
        If a log lacks a sensor of the law.
    """
    probed, windows = [], []
    notes: dict[str, None] = {}
    played = [(start, *_replayed(law, start)) for start in starts]
    for start, asked, (answer, count) in played:
        is_own = float(np.abs(asked - start.effort).max()) <= MAX_EFFORT_DIFFERENCE * law.values["effort_limit"]
        if count and is_own:
            probed.append(answer)
            windows.append(count)
        elif not is_own:
            notes["efforts differ from those of the exported controller: the probe's response was not computed"] = None
    probe = None
    if sum(windows) >= MIN_PROBE_WINDOWS:
        probe = tuple(map(float, np.average(probed, axis=0, weights=windows)))
    works, said = _wave_works(law, played)
    if len(works) < MIN_STARTS and other_waves:
        works, said = _wave_works(law, [(start, *_replayed(law, start)) for start in other_waves])
    notes |= said
    wave = law.supervision["test_effort"]
    mean = float(np.mean(works)) if len(works) >= MIN_STARTS and wave > 0.0 else None
    spread = float(np.std(works, ddof=1)) if len(works) > 1 else 0.0
    if mean is not None:
        require_enough("work of the start-up wave", mean, spread, len(works))
    if probe is None and law.supervision["probe_effort"] > 0.0:
        notes["too little motion while the controller was running to compute the probe's response"] = None
    window = law.supervision["probe_samples"] * law.values["period"]
    return Answers(mean, spread, probe, int(sum(windows)), len(works), tuple(notes), wave, window)


def _replayed(law: SupervisedLaw, start: StartLog) -> tuple[np.ndarray, tuple[Sequence[float], int]]:
    """Return the efforts that a law asks for on the readings of a start, and its probe's response and windows."""
    running, asked = law.start(), np.empty(len(start.time))
    missing = [name for name in law.sensors[1:] if name not in start.others and name in _required(law)]
    if missing:
        raise PellucidError(f"{start.name}: found no column {missing[0]}, expected it because the law reads it")
    sensors = [start.others.get(name) for name in law.sensors[1:]]
    drive, joint = start.others.get("drive"), start.others.get("joint")
    for k, time in enumerate(start.time):
        others = [None if one is None else float(one[k]) for one in sensors]
        asked[k] = running.step(
            float(time), float(start.position[k]), *others,
            drive=None if drive is None else float(drive[k]), joint=None if joint is None else float(joint[k]),
        )  # fmt: skip
    return asked, running.probe_answer


def _wave_works(
    law: SupervisedLaw, played: Sequence[tuple[StartLog, np.ndarray, object]]
) -> tuple[list[float], dict[str, None]]:
    """Return the works of the start-up waves of starts, with the efforts that the law asks for, and notes."""
    works, notes = [], dict[str, None]()
    wave, half = law.supervision["test_effort"], round(law.supervision["test_samples"])
    for start, asked, _ in played:
        work = _wave_work(law, start)
        # The law's own wave is that of the replay, which a limit of its rate makes smaller.
        peak, own = _first_peak(start.effort, half), _first_peak(asked, half) or wave
        if wave > 0.0 and abs(peak - own) > MAX_WAVE_DIFFERENCE * own:
            said = f"the wave of a start has an amplitude of {peak:.3g}, that of the exported controller {own:.3g}"
            notes[f"{said}: the response of the start-up test was not computed"] = None
        elif work is not None:
            works.append(work)
    if 0 < len(works) < MIN_STARTS:
        notes[f"only {len(works)} starts with a whole wave: the response of the start-up test was not computed"] = None
    return works, notes


def _first_peak(effort: np.ndarray, half: int) -> float:
    """Return the largest effort within the first `half` samples from where it begins; 0 without any."""
    pushed = np.flatnonzero(effort)
    return float(np.abs(effort[pushed[0] :][:half]).max()) if pushed.size else 0.0


def _required(law: SupervisedLaw) -> tuple[str, ...]:
    """Return the names of the sensors without which a law does nothing."""
    optional = {"interaction": law.sensed, "muscle": law.emg}
    return tuple(name for name in law.sensors if optional.get(name, True))


def _wave_work(law: SupervisedLaw, start: StartLog) -> float | None:
    """Return the work of the start-up wave of one start [J], as the core counts it; None where there was no wave."""
    half, period = round(law.supervision["test_samples"]), law.values["period"]
    pushed = np.flatnonzero(start.effort)
    if pushed.size == 0 or pushed[0] + 2 * half >= len(start.time) or pushed[0] < 2:
        return None
    first = int(pushed[0])
    resting = start.position[max(first - 64, 0) : first + 1]
    drift = float(resting[-1] - resting[0]) / (len(resting) - 1) / period if len(resting) > 1 else 0.0
    moved = np.diff(start.position[first : first + 2 * half + 1]) - drift * period
    work = np.cumsum(start.effort[first : first + 2 * half] * moved)
    middle = float(work[half - 1])
    hardly = abs(middle) < law.supervision["test_least"]
    return float(work[-1]) - middle if hardly else middle


class Robot(Protocol):
    """A robot that is commissioned: it is read and told an effort once a period."""

    def read(self) -> tuple[float, Mapping[str, float]]:
        """Wait for the next reading; return its time on the robot's clock [s] and sensors by name, SI."""
        ...

    def write(self, effort: float, *, enable: bool) -> None:
        """Ask for an effort [N m or N]; without `enable` the drive must have no power."""
        ...


DRIVE_WAVE_FACTOR = 2
"""Duration of the wave that shows the gain of a drive, over that of the start-up test [1].

A rotor before a soft transmission follows a wave of frequency f too readily, by about the square of f over the
resonance: a wave of twice the duration has a quarter of that error.
"""

EMPTY_START_S = 1.2
"""Time of one start of a robot that nobody wears."""

MOVED_S = 20.0
"""Time for which a wearer at ease moves the joint with the law running."""

WHATEVER_IT_SHOWS = {
    "test_least": -1e9, "test_most": math.inf, "range_min": -math.inf, "range_max": math.inf,
    "drive_expected": 0.0, "drive_delay": math.inf,
}  # fmt: skip
"""Supervisor's numbers for starts that nobody wears: the whole wave is played, wherever the joint hangs, whatever the
drive measures."""

PAUSE_S = 0.3
"""Time without power between two starts."""


def record_starts(robot: Robot, law: SupervisedLaw, count: int, *, worn: bool, wave_factor: int = 1) -> list[StartLog]:
    """Start a `law` on a robot `count` times, and return what was read and asked for.

    Where nobody wears the robot, each start ends with its wave, whatever that shows; the wave is longer than the law's
    by `wave_factor`. Of a `worn` one the last goes on for `MOVED_S`.
    """
    half_wave = min(wave_factor * law.supervision["test_samples"], TEST_SAMPLE_BOUNDS[1])
    played = law if worn else law.changed(**WHATEVER_IT_SHOWS, test_samples=half_wave)
    period = law.values["period"]
    made = []
    for number in range(count):
        seconds = MOVED_S if worn and number == count - 1 else EMPTY_START_S
        made.append(_record_start(robot, played, f"start {number + 1}", round(seconds / period), wave_alone=not worn))
        for _ in range(round(PAUSE_S / period)):
            robot.read()
            robot.write(0.0, enable=False)
    return made


def _record_start(robot: Robot, law: SupervisedLaw, name: str, periods: int, *, wave_alone: bool) -> StartLog:
    running = law.start()
    times, efforts = np.empty(periods), np.zeros(periods)
    read: dict[str, list[float]] = {}
    for k in range(periods):
        time, said = robot.read()
        times[k] = time
        sensors = [said.get(sensor) for sensor in law.sensors]
        effort = running.step(time, *sensors, drive=said.get("drive"), joint=said.get("joint"))
        ended = wave_alone and running.mode != "start_up"
        efforts[k] = 0.0 if ended else effort
        robot.write(efforts[k], enable=running.enable and not ended)
        for sensor, value in said.items():
            read.setdefault(sensor, [math.nan] * k).append(value)
    robot.write(0.0, enable=False)
    if not efforts.any() and running.fault != "none":
        raise PellucidError(
            f"{name}: found the fault {running.fault} before any effort, expected none: check the sensors and that the "
            "robot is at rest"
        )
    whole = {sensor: np.array(values) for sensor, values in read.items() if len(values) == periods}
    if "position" not in whole:
        raise PellucidError(
            f"{name}: found periods without a position, expected one in each: check the encoder and its connection"
        )
    position = whole.pop("position")
    return StartLog(name, times, position, efforts, whole)
