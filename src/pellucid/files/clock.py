"""Recover the times at which samples were taken: remove packets delivered twice, and smooth time stamps that jitter.

A packet that was delivered twice makes two rows with the same samples, the second stamped at the same time or a little
later. The second row is excluded. Stamps that jitter are smoothed over a window of neighbours, so that drift, pauses
and changes of rate stay as they were stamped. The chosen window makes the positions agree best with the recorded
velocities, or makes them smoothest over time if there are none.

A clock that only loses samples has steps of whole periods, and its stamps stay. Positions alone cannot show that they
are right: a filter that runs once for each packet makes them even over the packets that arrived.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .cut import MAX_EVEN_JITTER


@dataclass(frozen=True)
class ClockLimits:
    """When a row is a packet again, and when time stamps that jitter are smoothed."""

    # A row with the samples of the row before is the same packet again if it comes within this share of a usual
    # step.
    max_repeat_step_share: float = 0.5
    # Candidate windows for smoothing stamps [samples].
    smoothing_windows: tuple[int, ...] = (8, 16, 32, 64, 128, 256, 512)
    # Stamps are smoothed only if positions then deviate from their neighbours, or from the integral of the recorded
    # velocity, by this share less. Position noise alone makes the smoothness differ by less.
    min_smoothness_gain: float = 0.05
    # Number of samples over which the change of a position is compared with the integral of its velocity. It
    # exceeds the memory of a filter that runs once for each packet, whose lost samples a shorter comparison would
    # overlook.
    velocity_span: int = 64
    # A recorded velocity judges the stamps only if its integral leaves at most this share of the changes of the
    # position unexplained. Another one has a fault of its own, which the check of velocities reports.
    max_velocity_mismatch: float = 0.5
    # Stamps within this many usual steps of a straight line may be those of an even clock, rounded to whole steps.
    # Lost samples take stamps farther from it.
    max_rounding_steps: float = 1.0
    # A line through the neighbours on one side replaces the line through both sides if it leaves less than this
    # share of the variance: between the two sides the rate changes, or samples are missing.
    one_sided_share: float = 0.5
    # A clock that rolls over advances everywhere else in at least this share of its steps.
    min_rising_share: float = 0.97
    # A clock that rolls over advances at the jump by at most this many usual steps.
    max_rollover_steps: float = 50.0
    # A clock that rolls over falls by at least this share of its range.
    min_rollover_fall_share: float = 0.5


CLOCK_LIMITS = ClockLimits()

BLOCK_SAMPLES = 100_000
"""Time steps are examined in blocks of this size, which saves memory."""


def step_range(time: np.ndarray) -> tuple[float, float]:
    """Return the shortest and the longest step of a time, (n,); NaN without steps, or if a time is missing."""
    blocks = (np.diff(time[i : i + BLOCK_SAMPLES + 1]) for i in range(0, len(time) - 1, BLOCK_SAMPLES))
    ends = np.array([(steps.min(), steps.max()) for steps in blocks] or [(np.nan, np.nan)])
    return float(ends[:, 0].min()), float(ends[:, 1].max())


@dataclass(frozen=True)
class SampleClock:
    """Estimated times at which samples were taken.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Time of each sample [s], read-only; the stamps themselves if `window` is 0.
    window : int
        Number of samples over which stamps were smoothed; 0 if they were not smoothed.
    moved : float
        Root mean square of the changes of the stamps [s].
    farthest : float
        Largest change of a stamp [s].
    """

    time: np.ndarray
    window: int = 0
    moved: float = 0.0
    farthest: float = 0.0


MAX_RESTART_SHARE = 0.01
"""A clock has started again where it falls by more than this share of its period, to within this share above its
lowest number. Stamps of packets that arrive out of order fall by less, and anywhere. Chosen by judgement."""


def unwrap_clock(values: np.ndarray, period: float) -> np.ndarray:
    """Return the stamps of a clock that starts again, (n,), later by one more `period` after each start; NaN stays.

    A counter rolls over after its period. Trials may be shorter: the rest of the period is a gap before the
    next one.
    """
    known = np.flatnonzero(np.isfinite(values))
    stamps = np.array(values, float)
    if len(known) > 1:
        x = stamps[known]
        starts = (np.diff(x) < -MAX_RESTART_SHARE * period) & (x[1:] <= x.min() + MAX_RESTART_SHARE * period)
        starts |= np.diff(x) < -0.5 * period
        stamps[known] += period * np.concatenate(([0], np.cumsum(starts)))
    return stamps


CLOCK_PERIODS = (
    *(float(2**bits) for bits in (8, 10, 12, 15, 16, 24, 31, 32)),
    *(1e3, 1e4, 1e5, 1e6, 1e9, 60.0, 3600.0, 86400.0, 86_400_000.0),
)
"""Numbers after which clocks start again: counters of some bits, a second, a minute, an hour and a day."""


def find_clock_period(values: np.ndarray) -> float | None:
    """Return the number after which a clock, shape (n,), starts again at 0; None if it does not.

    Everywhere else it advances. At the jump it advances by a usual step, if the period is added. One jump is enough
    where the period is one that clocks have.
    """
    known = values[np.isfinite(values)]
    if len(known) < 20 or known.min() < 0.0:
        return None
    steps = np.diff(known)
    falls = np.flatnonzero(steps < -CLOCK_LIMITS.min_rollover_fall_share * float(np.ptp(known)))
    rest = np.delete(steps, falls)
    positive = rest[rest > 0.0]
    if not len(falls) or len(positive) < 10 or np.mean(rest >= 0.0) < CLOCK_LIMITS.min_rising_share:
        return None
    usual = float(np.median(positive))
    largest = CLOCK_LIMITS.max_rollover_steps * usual
    fallen = -steps[falls]
    fitting = [
        period
        for period in CLOCK_PERIODS
        if known.max() <= period and np.all(period - fallen > -1e-9 * period) and np.all(period - fallen <= largest)
    ]
    if fitting:
        return min(fitting, key=lambda period: abs(float(np.median(period - fallen)) - usual))
    # An unknown period shows itself by equal jumps, of which each ends near 0.
    is_alike = len(falls) >= 3 and float(np.ptp(fallen)) <= 3.0 * usual and np.all(known[falls + 1] <= largest)
    return float(np.mean(fallen)) + usual if is_alike else None


def first_deliveries(time: np.ndarray, samples: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return a mask of the rows that do not repeat the packet before, shape (n,) bool.

    `time` holds the stamps, (n,) [s], and `samples` every channel, (n,).
    """
    first = np.ones(len(time), dtype=bool)
    shortest, longest = step_range(time)
    if not samples or len(time) < 3 or not 0.0 <= shortest <= longest < np.inf:
        return first
    if shortest > CLOCK_LIMITS.max_repeat_step_share * longest:
        return first  # as below, without a median
    steps = np.diff(time)
    positive = steps[steps > 0.0]
    if not positive.size or steps.min() > CLOCK_LIMITS.max_repeat_step_share * float(np.median(positive)):
        return first
    repeats = np.ones(len(steps), dtype=bool)
    for values in samples.values():
        repeats &= (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
        if not repeats.any():
            return first
    # A packet may come three times: its age counts from its first delivery.
    starts = np.maximum.accumulate(np.where(np.append(True, ~repeats), np.arange(len(time)), 0))
    usual = np.diff(time[np.append(True, ~repeats)])
    usual = float(np.median(usual[usual > 0.0])) if np.any(usual > 0.0) else 0.0
    age = time - time[starts]
    first[1:] = ~(repeats & (age[1:] <= CLOCK_LIMITS.max_repeat_step_share * usual))
    return first


def loses_samples_only(time: np.ndarray, spans: Sequence[slice], near: np.ndarray, step: float) -> bool:
    """Return whether the steps of `time`, (n,) [s], are whole numbers of the usual `step` [s] because samples are lost.

    The `spans` and the mask `near` are those of `sample_clock`. Stamps of an even clock that were rounded to whole
    steps have such steps, too, but stay close to a straight line.
    """
    steps = np.diff(time)[near] / step
    if not steps.size or np.quantile(np.abs(steps - np.maximum(np.round(steps), 1.0)), 0.99) > MAX_EVEN_JITTER:
        return False
    for span in _without_gaps(spans, near):
        index = np.arange(span.stop - span.start)
        line = np.polyval(np.polyfit(index, time[span], 1), index) if len(index) > 2 else time[span]
        if np.abs(time[span] - line).max() > CLOCK_LIMITS.max_rounding_steps * step:
            return True
    return False


def sample_clock(
    time: np.ndarray,
    positions: np.ndarray,
    velocities: np.ndarray,
    spans: Sequence[slice],
    near: np.ndarray,
    *,
    always: bool = False,
) -> SampleClock:
    """Estimate the clock of samples stamped at `time`, (n,) [s], by `positions`, (n, k), and their velocities.

    `velocities`, (n, k), hold NaN for a position without a recorded velocity. The `spans` have no break. The mask
    `near`, (n - 1,), marks the stamps that the next one follows without a gap; no stamp is smoothed across a gap. With
    `always`, the best window is used even if it makes nothing better.
    """
    spans = _without_gaps(spans, near)
    trusted = _velocities_that_follow(time, positions, velocities, spans)

    def mismatch(tried: np.ndarray) -> float:
        if not trusted.any():
            return _roughness(tried, positions, spans)
        return float(np.mean(_velocity_mismatch(tried, positions[:, trusted], velocities[:, trusted], spans)))

    recorded = mismatch(time)
    best, clock = np.inf if always else (1.0 - CLOCK_LIMITS.min_smoothness_gain) * recorded, SampleClock(time)
    for window in CLOCK_LIMITS.smoothing_windows if np.isfinite(recorded) and (recorded > 0.0 or always) else ():
        smoothed = np.array(time)
        for span in spans:
            smoothed[span] = _smooth_stamps(time[span], window)
        found = mismatch(smoothed)
        if found < best:
            moved = smoothed - time
            smoothed.flags.writeable = False
            best = found
            clock = SampleClock(
                smoothed, window, float(np.sqrt(np.mean((moved - moved.mean()) ** 2))), float(np.abs(moved).max())
            )
    return clock


def _without_gaps(spans: Sequence[slice], near: np.ndarray) -> list[slice]:
    """Return the parts of `spans` between their gaps."""
    made = []
    for span in spans:
        gaps = span.start + 1 + np.flatnonzero(~near[span.start : span.stop - 1])
        ends = [span.start, *gaps.tolist(), span.stop]
        made += [slice(first, stop) for first, stop in pairwise(ends)]
    return made


def _velocities_that_follow(
    time: np.ndarray, positions: np.ndarray, velocities: np.ndarray, spans: Sequence[slice]
) -> np.ndarray:
    """Return a mask of the positions, (k,) bool, whose recorded velocity explains how they change."""
    follows = np.zeros(positions.shape[1], dtype=bool)
    for i in np.flatnonzero(np.isfinite(velocities).any(axis=0)):
        changes = _over_spans(positions[:, i], spans)
        spread = float(np.nanmean(np.abs(changes))) if np.isfinite(changes).any() else 0.0
        (left,) = _velocity_mismatch(time, positions[:, [i]], velocities[:, [i]], spans)
        follows[i] = spread > 0.0 and left <= CLOCK_LIMITS.max_velocity_mismatch * spread
    return follows


def _velocity_mismatch(
    time: np.ndarray, positions: np.ndarray, velocities: np.ndarray, spans: Sequence[slice]
) -> np.ndarray:
    """Return how far changes of positions, (n, k), are from the integral of their velocities on average, (k,).

    A velocity's scale and delay are fitted, because another check reports them. A velocity without a comparison gives
    NaN.
    """
    found = np.full(positions.shape[1], np.nan)
    steps = np.diff(time)
    for i in range(positions.shape[1]):
        moved = 0.5 * steps * (velocities[1:, i] + velocities[:-1, i])
        integral = np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(moved), moved, 0.0))])
        change = _over_spans(positions[:, i], spans)
        # To first order, a delay adds the change of the velocity.
        expected = np.column_stack([_over_spans(x, spans) for x in (integral, velocities[:, i])])
        known = np.isfinite(change) & np.isfinite(expected).all(axis=1)
        if known.any() and expected[known].any():
            scale = np.linalg.lstsq(expected[known], change[known], rcond=None)[0]
            found[i] = float(np.mean(np.abs(change[known] - expected[known] @ scale)))
    return found


def _over_spans(samples: np.ndarray, spans: Sequence[slice]) -> np.ndarray:
    """Return the changes of `samples`, (n,), over `velocity_span` samples within each span, one after the other."""
    parts = [
        samples[span][CLOCK_LIMITS.velocity_span :] - samples[span][: -CLOCK_LIMITS.velocity_span] for span in spans
    ]
    return np.concatenate(parts) if parts else np.empty(0)


def _roughness(time: np.ndarray, positions: np.ndarray, spans: Sequence[slice]) -> float:
    """Return the mean distance of positions, (n, k), from the straight line between neighbours; NaN without any."""
    inside = np.zeros(len(time), dtype=bool)
    for span in spans:
        inside[span.start + 1 : span.stop - 1] = True
    inner = inside[1:-1]
    width = time[2:] - time[:-2]
    share = np.divide(time[1:-1] - time[:-2], width, out=np.full(len(width), 0.5), where=width > 0.0)
    off = np.abs(positions[1:-1] - positions[:-2] - share[:, None] * (positions[2:] - positions[:-2]))[inner]
    off = off[np.isfinite(off)]
    return float(off.mean()) if off.size else np.nan


def _smooth_stamps(time: np.ndarray, window: int) -> np.ndarray:
    """Return stamps, (n,), on straight lines through `window` neighbours each; the stamps themselves if the result
    would not increase."""
    n = len(time)
    if n < 4:
        return time
    index = np.arange(n)
    step, first = np.polyfit(index, time, 1)
    off = time - (first + step * index)
    half = max(window // 2, 2)
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, n)
    value, variance = _local_lines(off, index, low, high)
    chosen = np.array(value)
    for low, high in ((np.maximum(index - window, 0), index + 1), (index, np.minimum(index + window + 1, n))):
        one_value, one_variance = _local_lines(off, index, low, high)
        better = (high - low > half) & (one_variance < CLOCK_LIMITS.one_sided_share * variance)
        chosen = np.where(better, one_value, chosen)
        variance = np.where(better, one_variance / CLOCK_LIMITS.one_sided_share, variance)
    for candidate in (chosen, value):
        smoothed = candidate + first + step * index
        if np.all(np.diff(smoothed) > 0.0):
            return smoothed
    return time


def _local_lines(
    off: np.ndarray, index: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit a line to samples `low` to before `high` of `off`, (n,), for each sample; return its value and the residual
    variance, shape (n,) each."""

    def sums(values: np.ndarray) -> np.ndarray:
        total = np.concatenate([[0.0], np.cumsum(values)])
        return total[high] - total[low]

    count = (high - low).astype(float)
    # Exact sums of x = j - i over the window, from its ends.
    a, b = (low - index).astype(float), (high - 1 - index).astype(float)
    x = 0.5 * (a + b) * count
    xx = (b * (b + 1.0) * (2.0 * b + 1.0) - (a - 1.0) * a * (2.0 * a - 1.0)) / 6.0
    y, yy = sums(off), sums(off**2)
    xy = sums(index * off) - index * y
    spread = xx - x * x / count
    slope = np.divide(xy - x * y / count, spread, out=np.zeros(len(off)), where=spread > 0.0)
    value = (y - slope * x) / count
    left = yy - y * y / count - slope * slope * spread
    return value, np.maximum(left, 0.0) / np.maximum(count - 2.0, 1.0)
