"""Find efforts beyond the range of their sensor: the motion shows that there was more than the sensor could record.

A drive at its limit and a sensor at the end of its range both leave a channel that does not exceed one value. At a
drive's limit the recorded effort is the effort that acted, and the motion agrees with it. Beyond a sensor's range the
motion needs more than was recorded. A regression on the samples far from the largest effort predicts the others: the
sensor ended where the prediction goes on and the record does not, unless a regression on all samples describes the
record there better than an end does. The end may be sharp, noisy or gradual.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .watched import WatchedRecording, find_runs

KIND = "sensor_range"

MEASURED_EFFORTS = ("torque", "force", "current")
"""Efforts that a sensor measures, by the first part of their channels' names; a program sets a duty or a voltage."""


@dataclass(frozen=True)
class RangeLimits:
    """When an effort ends where the range of its sensor does."""

    # Position and effort are averaged over this time, three times [s]. Averages are linear, so that both sides
    # agree; they pass what drives and limbs do below 10 Hz.
    smoothing_s: float = 0.02
    # Shorter recordings are not examined.
    min_samples: int = 400
    # The regression takes at most this many samples, evenly spread.
    max_fitted_rows: int = 40_000
    # The regression takes samples whose effort is below this share of the largest effort. The smaller share is for
    # sensors whose range ends gradually.
    core_shares: tuple[float, ...] = (0.85, 0.6)
    # At least this share of the samples are below it: a motion that is mostly beyond the range predicts nothing.
    min_core_share: float = 0.3
    # The regression explains at least this share of the variance, or the motion is not the only cause of the
    # effort.
    min_explained_share: float = 0.9
    # The prediction exceeds the largest effort by this many times the residual (RMS) of the regression.
    min_residual_ratio: float = 3.0
    # The prediction exceeds the largest effort by this share of it. Less than that changes no parameter much, and a
    # model that lacks something errs by as much.
    min_range_share: float = 0.03
    # At least this many samples are beyond the range.
    min_beyond_samples: int = 8
    # They are in at least this many stretches: once may be a push from outside.
    min_beyond_runs: int = 2
    # Beyond the range the recorded effort grows by less than this share of what the prediction grows by.
    max_slope: float = 0.5
    # Beyond the range the recorded effort stays above this share of the largest effort, in all but a tenth of it.
    min_recorded_share: float = 0.9
    # The effort is at its end if it is within this share of its range of the largest effort.
    plateau_share: float = 0.01
    # At the end of a sensor's range at least this share of the samples is predicted beyond the end. At a drive's
    # limit the effort that acted is what was recorded, and the prediction errs to both sides.
    min_plateau_beyond_share: float = 0.75
    # Where the prediction is beyond the end, the end differs from the record by less than this share of what a
    # regression on all samples does (RMS).
    max_end_error_share: float = 0.7
    # Samples are cut out where the prediction exceeds the record by this share of the margin that shows an end.
    cut_margin_share: float = 0.5
    # Cuts are widened by this time, over which the averages mix what is within the range with what is beyond [s].
    cut_bridge_s: float = 0.03
    # Predictions are computed for blocks of this many samples, which saves memory.
    block_samples: int = 200_000


RANGE_LIMITS = RangeLimits()


@dataclass(frozen=True)
class SensorEnd:
    """An end of an effort sensor's range."""

    value: float  # recorded effort at the end, in the channel's unit
    predicted: float  # largest effort that the motion shows beyond it
    runs: tuple[tuple[int, int], ...]  # first and last sample of each stretch beyond it

    @property
    def samples(self) -> int:
        """Number of samples beyond the end."""
        return sum(last - first + 1 for first, last in self.runs)


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for each stretch in which a drive's effort is beyond the range of its sensor."""
    for drive, end in find_sensor_ends(watched):
        if drive in watched.accepted:
            continue
        unit = watched.recording.channels[drive].unit_words
        for first, last in end.runs:
            found = f"{last - first + 1} samples {describe_end(end, unit)}"
            yield make_cut(watched.recording, KIND, drive, first=first, last=last, found=found)


def describe_end(end: SensorEnd, unit: str) -> str:
    """Return what a sensor's end is, as the end of a sentence that begins with a number; `unit` begins with a blank."""
    return (
        f"beyond the end of the sensor's range at {end.value:.4g}{unit}, where the motion shows up to "
        f"{end.predicted:.4g}{unit}"
    )


def find_sensor_ends(watched: WatchedRecording) -> Iterator[tuple[str, SensorEnd]]:
    """Yield each drive's effort with an end of its sensor's range that the motion of all joints shows."""
    recording = watched.recording
    positions = [p for p in watched.drives if p in recording]
    if not positions or not recording.advances or len(recording) < RANGE_LIMITS.min_samples:
        return
    motions = [watched.samples(p) for p in positions]
    for drive in watched.drives.values():
        if drive.partition(".")[0] not in MEASURED_EFFORTS:
            continue
        command = f"desired_{drive}"
        for end in sensor_ends(watched.samples(drive), motions, recording.fs):
            if command not in recording or _is_exceeded(recording[command], end):
                yield drive, end


def _is_exceeded(command: np.ndarray, end: SensorEnd) -> bool:
    """Whether the command asked for more than the end: an effort that was asked for no further is no sensor's end."""
    sign = np.sign(end.value)
    beyond = np.concatenate([command[first : last + 1] for first, last in end.runs])
    return float(np.nanmax(sign * beyond, initial=-np.inf)) > (1.0 + RANGE_LIMITS.min_range_share) * abs(end.value)


def sensor_ends(effort: np.ndarray, positions: Sequence[np.ndarray], rate: float) -> tuple[SensorEnd, ...]:
    """Return the ends of an effort sensor's range, the upper one first, that the motion shows.

    `effort`, and each of `positions`, has shape (n,), with NaN in samples that are unusable, at a `rate` [Hz].
    """
    prepared = _prepare(effort, positions, rate)
    if prepared is None:
        return ()
    found = {share: _regression(prepared, share) for share in RANGE_LIMITS.core_shares}
    tried = [(sign, share, f) for sign in (1.0, -1.0) for share, f in found.items() if f is not None]
    told = {(sign, share): f for sign, share, f in tried if _exceeds_plateau(sign, prepared, f[0])}
    ends: dict[float, SensorEnd] = {}
    for (sign, share), beyond in _samples_beyond(prepared, told).items():
        if sign not in ends and beyond >= RANGE_LIMITS.min_beyond_samples:
            end = _end(sign, prepared, share, rate, told[sign, share])
            ends |= {} if end is None else {sign: end}
    return tuple(ends.values())


@dataclass(frozen=True)
class Averaged:
    """A joint's averaged position, of which velocity and acceleration are computed for some samples at a time."""

    position: np.ndarray  # (n,)
    rate: float  # sampling rate [Hz]
    usual_speed: float  # root mean square of the velocity

    @classmethod
    def of(cls, position: np.ndarray, rate: float) -> Averaged:
        """Return the motion along an averaged `position`, (n,), sampled at a `rate` [Hz]."""
        made, n = cls(position, rate, 0.0), len(position)
        squares = sum(float(v @ v) for v in (made.velocity(block) for block in _blocks(n)))
        return cls(position, rate, max(float(np.sqrt(squares / n)), np.finfo(float).tiny))

    def velocity(self, rows: np.ndarray) -> np.ndarray:
        """Return the velocity in some samples, the indices `rows` (m,), by central differences; (m,)."""
        last = len(self.position) - 1
        if rows[0] > 0 and rows[-1] < last and rows[-1] - rows[0] == len(rows) - 1:  # consecutive samples
            q = self.position[rows[0] - 1 : rows[-1] + 2]
            return (q[2:] - q[:-2]) / 2 * self.rate
        after, before = np.minimum(rows + 1, last), np.maximum(rows - 1, 0)
        return (self.position[after] - self.position[before]) / (after - before) * self.rate

    def acceleration(self, rows: np.ndarray) -> np.ndarray:
        """Return the acceleration in these samples, (m,)."""
        last = len(self.position) - 1
        after, before = np.minimum(rows + 1, last), np.maximum(rows - 1, 0)
        return (self.velocity(after) - self.velocity(before)) / (after - before) * self.rate


@dataclass(frozen=True)
class _Prepared:
    """An effort and the motions of all joints, averaged alike; every array has shape (n,)."""

    effort: np.ndarray  # as recorded
    recorded: np.ndarray  # averaged
    motions: tuple[Averaged, ...]  # motion of each joint
    usable: np.ndarray  # mask of the samples whose averages contain no unusable sample
    top: dict[float, float]  # largest averaged effort of either sign

    @property
    def half(self) -> float:
        """Half the range of the effort."""
        return 0.5 * sum(self.top.values())

    def columns(self, rows: np.ndarray) -> np.ndarray:
        """Return the columns of the motion in some samples, the indices `rows` (m,), shape (m, 1 + 6 j)."""
        if len(self.effort) > RANGE_LIMITS.block_samples:
            return _columns(self.motions, rows)
        return self._every_column if len(rows) == len(self.effort) else self._every_column[rows]

    @cached_property
    def _every_column(self) -> np.ndarray:
        """The columns in all samples: every regression of a short recording uses them."""
        return _columns(self.motions, np.arange(len(self.effort)))


def _prepare(effort: np.ndarray, positions: Sequence[np.ndarray], rate: float) -> _Prepared | None:
    width, n = max(1, round(RANGE_LIMITS.smoothing_s * rate)), len(effort)
    known = np.isfinite(effort)
    for q in positions:
        known &= np.isfinite(q)
    usable = known.copy() if known.all() else np.convolve(~known, np.ones(4 * width + 1), "same") < 0.5
    usable[: 3 * width] = usable[max(n - 3 * width, 0) :] = False
    if usable.sum() < RANGE_LIMITS.min_samples:
        return None
    recorded = _averaged(effort, known, width)
    motions = tuple(Averaged.of(_averaged(q, known, width), rate) for q in positions)
    low, high = np.quantile(recorded[usable], [0.001, 0.999], overwrite_input=True).tolist()
    prepared = _Prepared(effort, recorded, motions, usable, {1.0: high, -1.0: -low})
    return prepared if prepared.half > 0.0 else None


def agrees_at_limit(effort: np.ndarray, positions: Sequence[np.ndarray], rate: float) -> bool:
    """Return whether the motion needs no more than the largest efforts, as where a drive reaches its limit.

    The arguments are those of `sensor_ends`. False also where the motion does not explain the effort.
    """
    prepared = _prepare(effort, positions, rate)
    if prepared is None:
        return False
    explained = _regression(prepared, RANGE_LIMITS.core_shares[0]) is not None
    return explained and not sensor_ends(effort, positions, rate)


def _regression(of: _Prepared, share: float) -> tuple[np.ndarray, float] | None:
    """Return the factors of the columns of motion that give the effort it needs, (1 + 6 j,), and their error (RMS).

    The regression leaves out the largest efforts of both signs alike. None where it explains too little.
    """
    bound = (1.0 - share) * of.half
    low, high = bound - of.top[-1.0], of.top[1.0] - bound
    core = of.usable & (of.recorded > low)
    core &= of.recorded < high
    least = RANGE_LIMITS.min_core_share * np.count_nonzero(of.usable)
    if np.count_nonzero(core) < max(RANGE_LIMITS.min_samples // 2, least):
        return None
    values, error, variance = _fit(of, core)
    if not error**2 <= (1.0 - RANGE_LIMITS.min_explained_share) * variance:
        return None
    return values, error


def _fit(of: _Prepared, fitted: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return the factors of the columns that fit the samples in a mask best, their error (RMS) and the variance."""
    rows = np.flatnonzero(fitted)
    rows = rows[:: max(1, len(rows) // RANGE_LIMITS.max_fitted_rows)]
    matrix = of.columns(rows)
    scale = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    values = np.linalg.lstsq(matrix / scale, of.recorded[rows], rcond=1e-8)[0] / scale
    error = float(np.sqrt(np.mean((of.recorded[rows] - matrix @ values) ** 2)))
    return values, error, float(np.var(of.recorded[rows]))


def _predict(of: _Prepared, values: np.ndarray) -> np.ndarray:
    """Return the effort that the motion needs in all n samples by the columns' factors, (n,)."""
    return np.concatenate([of.columns(block) @ values for block in _blocks(len(of.recorded))])


def _blocks(n: int) -> Iterator[np.ndarray]:
    """Yield the indices of `n` samples, `RANGE_LIMITS.block_samples` at a time."""
    for first in range(0, n, RANGE_LIMITS.block_samples):
        yield np.arange(first, min(first + RANGE_LIMITS.block_samples, n))


def _margin(error: float, half: float) -> float:
    """Return by how much a prediction with an `error` exceeds the range of which `half` is half, where it ends."""
    return max(RANGE_LIMITS.min_residual_ratio * error, RANGE_LIMITS.min_range_share * half)


def _samples_beyond(
    of: _Prepared, told: dict[tuple[float, float], tuple[np.ndarray, float]]
) -> dict[tuple[float, float], int]:
    """Return for each regression, by its sign and share, how many usable samples it predicts beyond the range."""
    if not told:
        return {}
    signs = np.array([sign for sign, _ in told])
    values = np.column_stack([sign * values for (sign, _), (values, _) in told.items()])
    ends = [of.top[sign] + _margin(error, of.half) for (sign, _), (_, error) in told.items()]
    counts = np.zeros(len(signs), int)
    for block in _blocks(len(of.recorded)):  # the columns of a block serve all regressions
        beyond = of.columns(block) @ values > ends
        if beyond.any():  # as good as never, and a sum over few columns takes as long as the columns
            counts += np.sum(beyond & of.usable[block, None], axis=0)
    return dict(zip(told, counts.tolist(), strict=True))


def _exceeds_plateau(sign: float, of: _Prepared, values: np.ndarray) -> bool:
    """Return whether the motion needs more than the range in enough of the few samples at its end of a `sign`.

    It rejects nearly every regression before all samples of a long recording are predicted.
    """
    top, step = of.top[sign], RANGE_LIMITS.block_samples
    at_end = np.flatnonzero(of.usable & (sign * of.recorded >= top - 2.0 * RANGE_LIMITS.plateau_share * of.half))
    parts = (at_end[i : i + step] for i in range(0, len(at_end), step))
    beyond = sum(np.count_nonzero(sign * (of.columns(rows) @ values) > top) for rows in parts)
    return beyond >= RANGE_LIMITS.min_plateau_beyond_share * len(at_end)


def _end(
    sign: float, of: _Prepared, share: float, rate: float, told: tuple[np.ndarray, float]
) -> SensorEnd | None:
    """Return the end of the range on the side of `sign` by the regression that was `told`; None if there is none."""
    (values, error), half, top, usable, recorded = told, of.half, of.top[sign], of.usable, of.recorded
    margin = _margin(error, half)
    predicted = _predict(of, values)
    beyond = (sign * predicted > top + margin) & usable
    least = RANGE_LIMITS.min_recorded_share
    if np.mean(sign * recorded[beyond] >= top - (1.0 - least) * half) < least:
        return None
    spread = predicted[beyond] - predicted[beyond].mean()
    slope = float(spread @ recorded[beyond]) / max(float(spread @ spread), np.finfo(float).tiny)
    if slope > RANGE_LIMITS.max_slope:
        return None
    # Gravity and friction turn around at the end of a slow swing, which a regression on all samples explains as well.
    past = usable & (sign * predicted > top)
    of_end, of_all = recorded[past] - sign * top, (recorded - _predict(of, _fit(of, usable)[0]))[past]
    if of_end @ of_end > RANGE_LIMITS.max_end_error_share**2 * (of_all @ of_all):
        return None
    over = usable & (sign * (predicted - recorded) > RANGE_LIMITS.cut_margin_share * margin)
    over &= sign * predicted > top - (1.0 - share) * half
    wide = np.convolve(over, np.ones(2 * max(1, round(RANGE_LIMITS.cut_bridge_s * rate)) + 1), "same") > 0.5
    firsts, lengths = find_runs(wide)
    cut = tuple(
        (int(a), int(a + length - 1))
        for a, length in zip(firsts, lengths, strict=True)
        if beyond[a : a + length].any()
    )
    if len(cut) < RANGE_LIMITS.min_beyond_runs:
        return None
    value = float(np.median(of.effort[beyond]))
    return SensorEnd(value, sign * float(np.max(sign * predicted[beyond])), cut)


def _columns(motions: Sequence[Averaged], rows: np.ndarray) -> np.ndarray:
    """Return columns of gravity, springs, friction and inertia of all j joints in m samples, shape (m, 1 + 6 j)."""
    made = [np.ones(len(rows))]
    for motion in motions:
        q, v, a = motion.position[rows], motion.velocity(rows), motion.acceleration(rows)
        made += [q, np.sin(q), np.cos(q), v, np.tanh(v / (0.05 * motion.usual_speed)), a]
    return np.column_stack(made)


def _averaged(x: np.ndarray, known: np.ndarray, width: int) -> np.ndarray:
    """Return running means over `width` samples, three times, with unknown samples interpolated, shape (n,)."""
    place = np.flatnonzero(known) if not known.all() else None
    smooth = x if place is None else np.interp(np.arange(len(x)), place, x[place])
    before, n = width // 2, len(x)
    for _ in range(3):
        made = np.empty(n)
        for rows in _blocks(n):
            first, stop = rows[0] - before, rows[-1] + width - before
            around = smooth[max(first, 0) : stop]
            if first < 0 or stop > n:
                around = np.pad(around, (max(-first, 0), max(stop - n, 0)), "edge")
            sums = np.zeros(len(around) + 1)
            np.cumsum(around, out=sums[1:])
            np.divide(sums[width:] - sums[:-width], width, out=made[rows[0] : rows[-1] + 1])
        smooth = made
    return smooth
