"""Find efforts beyond the range of their sensor: the motion shows that there was more than the sensor could record.

A drive at its limit and a sensor at the end of its range both leave a channel that does not exceed one value. At a
drive's limit the recorded effort is the effort that acted, and the motion agrees with it. Beyond a sensor's range the
motion needs more than was recorded. A regression on the samples far from the largest effort predicts the others: the
sensor ended where the prediction goes on and the record does not. The end may be sharp, noisy or gradual.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .watched import WatchedRecording, find_runs

KIND = "sensor_range"

MEASURED_EFFORTS = ("torque", "force", "current")
"""Efforts that a sensor measures, by the first part of their channels' names; a program sets a duty or a voltage."""

SMOOTHING_S = 0.02
"""Position and effort are averaged over this time, three times [s]. Averages are linear, so that both sides agree; they
pass what drives and limbs do below 10 Hz."""

MIN_SAMPLES = 400
"""Shorter recordings are not examined."""

MAX_FITTED_ROWS = 40_000
"""The regression takes at most this many samples, evenly spread."""

CORE_SHARES = (0.85, 0.6)
"""The regression takes samples whose effort is below this share of the largest effort. The smaller share is for
sensors whose range ends gradually."""

MIN_CORE_SHARE = 0.3
"""At least this share of the samples are below it: a motion that is mostly beyond the range predicts nothing."""

MIN_EXPLAINED_SHARE = 0.9
"""The regression explains at least this share of the variance, or the motion is not the only cause of the effort."""

MIN_RESIDUAL_RATIO = 3.0
"""The prediction exceeds the largest effort by this many times the residual (RMS) of the regression."""

MIN_RANGE_SHARE = 0.03
"""The prediction exceeds the largest effort by this share of it. Less than that changes no parameter much, and a model
that lacks something errs by as much."""

MIN_BEYOND_SAMPLES = 8
"""At least this many samples are beyond the range."""

MIN_BEYOND_RUNS = 2
"""They are in at least this many stretches: once may be a push from outside."""

MAX_SLOPE = 0.5
"""Beyond the range the recorded effort grows by less than this share of what the prediction grows by."""

MIN_RECORDED_SHARE = 0.9
"""Beyond the range the recorded effort stays above this share of the largest effort, in all but a tenth of it."""

PLATEAU_SHARE = 0.01
"""The effort is at its end if it is within this share of its range of the largest effort."""

MIN_PLATEAU_BEYOND_SHARE = 0.75
"""At the end of a sensor's range at least this share of the samples is predicted beyond the end. At a drive's limit the
effort that acted is what was recorded, and the prediction errs to both sides."""

CUT_MARGIN_SHARE = 0.5
"""Samples are cut out where the prediction exceeds the record by this share of the margin that shows an end."""

CUT_BRIDGE_S = 0.03
"""Cuts are widened by this time, over which the averages mix what is within the range with what is beyond [s]."""

BLOCK_SAMPLES = 200_000
"""Predictions are computed for blocks of this many samples, which saves memory."""


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
        unit = watched.recording.channels[drive].unit
        for first, last in end.runs:
            found = f"{last - first + 1} samples {describe_end(end, unit)}"
            yield make_cut(watched.recording, KIND, drive, first=first, last=last, found=found)


def describe_end(end: SensorEnd, unit: str) -> str:
    """Return what a sensor's end is, as the end of a sentence that begins with a number of samples."""
    unit = "" if unit == "1" else f" {unit}"
    return (
        f"beyond the end of the sensor's range at {end.value:.4g}{unit}, where the motion shows up to "
        f"{end.predicted:.4g}{unit}"
    )


def find_sensor_ends(watched: WatchedRecording) -> Iterator[tuple[str, SensorEnd]]:
    """Yield each drive's effort with an end of its sensor's range that the motion of all joints shows."""
    recording = watched.recording
    positions = [p for p in watched.drives if p in recording]
    if not positions or not recording.advances or len(recording) < MIN_SAMPLES:
        return
    motions = [np.where(watched.usable, recording[p], np.nan) for p in positions]
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
    return float(np.nanmax(sign * beyond, initial=-np.inf)) > (1.0 + MIN_RANGE_SHARE) * abs(end.value)


def sensor_ends(effort: np.ndarray, positions: Sequence[np.ndarray], rate: float) -> tuple[SensorEnd, ...]:
    """Return the ends of an effort sensor's range, the upper one first, that the motion shows.

    `effort`, and each of `positions`, has shape (n,), with NaN in samples that are unusable, at a `rate` [Hz].
    """
    prepared = _prepare(effort, positions, rate)
    if prepared is None:
        return ()
    found = []
    for sign in (1.0, -1.0):
        ends = (_end(sign, prepared, share, rate) for share in CORE_SHARES)
        end = next((e for e in ends if e is not None), None)
        if end is not None:
            found.append(end)
    return tuple(found)


@dataclass(frozen=True)
class _Prepared:
    """An effort and the motions of all joints, averaged alike; every array has shape (n,)."""

    effort: np.ndarray  # as recorded
    recorded: np.ndarray  # averaged
    motions: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]  # position, velocity, acceleration of each joint
    usable: np.ndarray  # mask of the samples whose averages contain no unusable sample
    top: dict[float, float]  # largest averaged effort of either sign

    @property
    def half(self) -> float:
        """Half the range of the effort."""
        return 0.5 * sum(self.top.values())


def _prepare(effort: np.ndarray, positions: Sequence[np.ndarray], rate: float) -> _Prepared | None:
    width, n = max(1, round(SMOOTHING_S * rate)), len(effort)
    known = np.isfinite(effort)
    for q in positions:
        known &= np.isfinite(q)
    usable = np.convolve(~known, np.ones(4 * width + 1), "same") < 0.5
    usable[: 3 * width] = usable[max(n - 3 * width, 0) :] = False
    if usable.sum() < MIN_SAMPLES:
        return None
    recorded = _averaged(effort, known, width)
    motions = []
    for q in positions:
        smooth = _averaged(q, known, width)
        v = np.gradient(smooth) * rate
        motions.append((smooth, v, np.gradient(v) * rate))
    top = {sign: float(np.quantile(sign * recorded[usable], 0.999)) for sign in (1.0, -1.0)}
    prepared = _Prepared(effort, recorded, tuple(motions), usable, top)
    return prepared if prepared.half > 0.0 else None


def agrees_at_limit(effort: np.ndarray, positions: Sequence[np.ndarray], rate: float) -> bool:
    """Return whether the motion needs no more than the largest efforts, as where a drive reaches its limit.

    The arguments are those of `sensor_ends`. False also where the motion does not explain the effort.
    """
    prepared = _prepare(effort, positions, rate)
    if prepared is None:
        return False
    told = [_predicted(sign, prepared, share) for sign in (1.0, -1.0) for share in CORE_SHARES[:1]]
    return all(predicted is not None for predicted in told) and not sensor_ends(effort, positions, rate)


def _predicted(sign: float, of: _Prepared, share: float) -> tuple[np.ndarray, float] | None:
    """Return the effort that the motion needs, shape (n,), and the error of the regression (RMS).

    The regression leaves out the largest efforts of one `sign` and of the other. None where it explains too little.
    """
    bound, top = (1.0 - share) * of.half, of.top[sign]
    core = of.usable & (sign * of.recorded < top - bound) & (sign * of.recorded > top - 2.0 * of.half + bound)
    if core.sum() < max(MIN_SAMPLES // 2, MIN_CORE_SHARE * of.usable.sum()):
        return None
    rows = np.flatnonzero(core)[:: max(1, int(core.sum()) // MAX_FITTED_ROWS)]
    matrix = _columns(of.motions, rows)
    scale = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    values = np.linalg.lstsq(matrix / scale, of.recorded[rows], rcond=1e-8)[0] / scale
    error = float(np.sqrt(np.mean((of.recorded[rows] - matrix @ values) ** 2)))
    if not error**2 <= (1.0 - MIN_EXPLAINED_SHARE) * float(np.var(of.recorded[rows])):
        return None
    n = len(of.recorded)
    blocks = (np.arange(a, min(a + BLOCK_SAMPLES, n)) for a in range(0, n, BLOCK_SAMPLES))
    return np.concatenate([_columns(of.motions, block) @ values for block in blocks]), error


def _end(sign: float, of: _Prepared, share: float, rate: float) -> SensorEnd | None:
    """Return the end of the range on the side of `sign`; None if the motion shows none."""
    told = _predicted(sign, of, share)
    if told is None:
        return None
    (predicted, error), half, top, usable, recorded = told, of.half, of.top[sign], of.usable, of.recorded
    margin = max(MIN_RESIDUAL_RATIO * error, MIN_RANGE_SHARE * half)
    beyond = usable & (sign * predicted > top + margin)
    if beyond.sum() < MIN_BEYOND_SAMPLES:
        return None
    if np.mean(sign * recorded[beyond] >= top - (1.0 - MIN_RECORDED_SHARE) * half) < MIN_RECORDED_SHARE:
        return None
    at_end = usable & (sign * recorded >= top - 2.0 * PLATEAU_SHARE * half)
    if np.mean(sign * predicted[at_end] > top) < MIN_PLATEAU_BEYOND_SHARE:
        return None
    spread = predicted[beyond] - predicted[beyond].mean()
    slope = float(spread @ recorded[beyond]) / max(float(spread @ spread), np.finfo(float).tiny)
    if slope > MAX_SLOPE:
        return None
    over = usable & (sign * (predicted - recorded) > CUT_MARGIN_SHARE * margin)
    over &= sign * predicted > top - (1.0 - share) * half
    wide = np.convolve(over, np.ones(2 * max(1, round(CUT_BRIDGE_S * rate)) + 1), "same") > 0.5
    firsts, lengths = find_runs(wide)
    cut = tuple(
        (int(a), int(a + length - 1))
        for a, length in zip(firsts, lengths, strict=True)
        if beyond[a : a + length].any()
    )
    if len(cut) < MIN_BEYOND_RUNS:
        return None
    value = float(np.median(of.effort[beyond]))
    return SensorEnd(value, sign * float(np.max(sign * predicted[beyond])), cut)


def _columns(motions: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]], rows: np.ndarray) -> np.ndarray:
    """Return columns of gravity, springs, friction and inertia of all j joints in m samples, shape (m, 1 + 6 j)."""
    made = [np.ones(len(rows))]
    for position, velocity, acceleration in motions:
        q, v, a = position[rows], velocity[rows], acceleration[rows]
        usual = max(float(np.sqrt(np.mean(velocity**2))), np.finfo(float).tiny)
        made += [q, np.sin(q), np.cos(q), v, np.tanh(v / (0.05 * usual)), a]
    return np.column_stack(made)


def _averaged(x: np.ndarray, known: np.ndarray, width: int) -> np.ndarray:
    """Return running means over `width` samples, three times, with unknown samples interpolated, shape (n,)."""
    place = np.arange(len(x))
    smooth = x if known.all() else np.interp(place, place[known], x[known])
    for _ in range(3):
        padded = np.concatenate((np.full(width // 2, smooth[0]), smooth, np.full(width - 1 - width // 2, smooth[-1])))
        sums = np.cumsum(np.concatenate(([0.0], padded)))
        smooth = (sums[width:] - sums[:-width]) / width
    return smooth
