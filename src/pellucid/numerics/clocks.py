"""Two instruments on two clocks: the delay between them, roughly or finer than a sample, and how their clocks drift."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._errors import RecordingError
from .uncertainty import correlation_length

MIN_SHARED_SAMPLES = 20
"""Two records are aligned only if they overlap by at least this many samples."""


@dataclass(frozen=True)
class Alignment:
    """How one signal lies against another: late(t + delay) = gain * early(t) + offset."""

    # delay, delay_error: How much later the second instrument's clock, or its signal, is, and the standard error [s]
    delay: float
    delay_error: float
    gain: float  # gain, offset: Between the two signals
    offset: float
    correlation: float  # Once aligned
    at: float  # Middle of the stretch compared, on the first clock [s]


class _Centred(NamedTuple):
    """A signal without its mean, (n,), and the root of its sum of squares."""

    values: np.ndarray
    norm: float

    @classmethod
    def of(cls, signal: np.ndarray) -> _Centred:
        values = signal - signal.mean() if len(signal) else signal
        return cls(values, float(np.sqrt(values @ values)))


def best_delay(
    time: np.ndarray,
    signal: np.ndarray,
    other: Callable[[np.ndarray], np.ndarray],
    delays: np.ndarray,
    *,
    span: tuple[float, float] = (-np.inf, np.inf),
    either_sense: bool = True,
    fewest: int = MIN_SHARED_SAMPLES,
) -> float | None:
    """The one of `delays`, (k,) [s], at which `other`, of times, correlates best with a `signal`, (n,), at `time` [s]
    and so much later; of either sense or of one; the other is known within `span` [s]. None without an overlap of
    `fewest` samples."""
    best: tuple[float, float | None] = (-np.inf, None)
    whole = _Centred.of(signal)
    for delay in delays:
        at = time + delay
        inside = (at > span[0]) & (at < span[1])
        shared = int(np.count_nonzero(inside))
        if shared < fewest:
            continue
        overlaps = shared == len(at)
        a, b = whole if overlaps else _Centred.of(signal[inside]), _Centred.of(other(at if overlaps else at[inside]))
        if a.norm > 0.0 and b.norm > 0.0:
            found = float(a.values @ b.values) / (a.norm * b.norm)
            # A short overlap correlates too easily.
            score = (abs(found) if either_sense else found) * np.sqrt(shared / len(at))
            best = (score, float(delay)) if score > best[0] else best
    return best[1]


def align(
    time: np.ndarray, rate: np.ndarray, other_time: np.ndarray, other_rate: np.ndarray, *, longest: float
) -> Alignment:
    """Delay of another instrument's record of the same rate, by least squares over delay, gain and offset.

    A grid over the delays finds the right swing, least squares on a cubic spline the fraction of a sample. The standard
    error allows for coloured misfit.

    `time`, `rate` (n,) [s]; `other_time`, `other_rate` (m,); `longest` [s].
    """
    inside = (time >= other_time[0] + longest) & (time <= other_time[-1] - longest) & np.isfinite(rate)
    if inside.sum() < MIN_SHARED_SAMPLES:
        raise RecordingError(
            f"alignment: the records share {inside.sum()} samples at every delay up to {longest:g} s, expected at "
            f"least {MIN_SHARED_SAMPLES}: record longer with both instruments"
        )
    from scipy.interpolate import CubicSpline  # loads slowly, and most studies have one clock
    from scipy.optimize import least_squares

    t, y = time[inside], rate[inside]
    if np.std(y) == 0.0 or np.std(other_rate) == 0.0:
        raise RecordingError(
            "alignment: one of the two signals is constant, so that it has no delay; expected a recorded motion in "
            "both"
        )
    spline = CubicSpline(other_time, other_rate)
    step = 0.5 * min(float(np.median(np.diff(time))), float(np.median(np.diff(other_time))))
    delays = np.arange(-longest, longest + 0.5 * step, step)
    first = best_delay(t, y, _looked_up(spline, t, delays), delays)
    if first is None:
        raise RecordingError(
            "alignment: one of the two signals is constant while both were recorded, so that it has no delay; record "
            "motion with both instruments at the same time"
        )
    gain, offset = np.polyfit(y, spline(t + first), 1)

    def misfit(x):
        return spline(t + x[0]) - x[1] * y - x[2]

    best = least_squares(misfit, [first, gain, offset], x_scale=[step, abs(gain) or 1.0, np.std(other_rate)])
    delay, gain, offset = best.x
    correlation = float(np.corrcoef(spline(t + delay), y)[0, 1])
    if abs(correlation) < 0.5:
        raise RecordingError(
            f"alignment: the best correlation within {longest:g} s is {correlation:.2f}, expected 0.5 or more: "
            "these are not two records of one motion; check both channels and the time between the starts of both files"
        )
    variance = np.mean(best.fun**2) * correlation_length(best.fun)
    error = float(np.sqrt(variance * np.linalg.pinv(best.jac.T @ best.jac)[0, 0]))
    return Alignment(float(delay), error, float(gain), float(offset), correlation, 0.5 * float(t[0] + t[-1]))


def _looked_up(
    signal: Callable[[np.ndarray], np.ndarray], time: np.ndarray, delays: np.ndarray
) -> Callable[[np.ndarray], np.ndarray]:
    """Return a `signal` for `time`, (n,), plus any of `delays`, (k,): all in equal steps, it is computed but once."""
    steps, step = np.diff(time), float(delays[1] - delays[0])
    many = round(float(steps[0]) / step)
    if many < 1 or np.max(np.abs(steps - many * step)) > 1e-9 * step:
        return signal
    begin = float(time[0] + delays[0])
    known = signal(begin + step * np.arange(many * (len(time) - 1) + len(delays)))
    return lambda at: known[round((at[0] - begin) / step) :: many][: len(at)]


def clock_drift(first: Alignment, second: Alignment) -> tuple[float, float]:
    """How much faster the other clock runs, from two alignments."""
    apart = second.at - first.at
    if apart == 0.0:
        raise RecordingError(
            "alignment: found two stretches at the same time, expected different times to estimate the clock's drift"
        )
    return (second.delay - first.delay) / apart, float(np.hypot(first.delay_error, second.delay_error)) / abs(apart)
