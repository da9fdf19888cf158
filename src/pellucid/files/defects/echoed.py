"""Find echoes: a measurement that is its own command, late, or a signal that is computed from others in the log.

A sensor adds what nobody commanded: its noise, friction, the person. A channel that a delay, a gain and a short filter
of the command explain to the last digits is no measurement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

KIND = "echoed"

MIN_LATE_ECHO_CORRELATION = 0.999
"""A channel that is late echoes its command if both correlate at least this much at one delay. Chosen by judgement: a
torque loop with a sensor on a moving joint stays below."""

MIN_PROMPT_ECHO_CORRELATION = 0.99999
"""The same without a delay. A fast current loop follows its command this closely, but not to the last digits."""

MIN_LATE_SAMPLES = 3
"""A channel is late from this many samples on. Loops are faster."""

MAX_ECHO_DELAY_SAMPLES = 400
"""The longest delay that is tried [samples]."""

MAX_ECHO_DELAY_SHARE = 0.1
"""The longest delay that is tried, as a share of the log."""

MIN_ECHO_SAMPLES = 100
"""Shorter logs are not searched: two slow signals are alike in them."""

COPY_TOLERANCE = 1e-6
"""Samples are copies if they differ by at most this share of the largest one, which rounding in a file may cause."""

MIN_COPIED_SHARE = 0.4
"""A channel is computed from others if at least this share of its samples, and all that are not at a limit, are their
sum."""

MIN_SUM_SHARE = 0.999
"""Share of the samples that are not at a limit in which a computed channel is the sum."""

PROJECTED_ROWS = 16
"""Number of rows over which sums are compared before whole channels are. Few enough that a sum which is broken in one
row of a thousand fits in them."""

PROJECTION_COUNT = 3
"""Number of choices of such rows. A sum that is broken in one row of a thousand misses all of them with a probability
of 4e-6."""

MAX_COMPARED_SUMS = 200
"""Number of sums that are compared in whole channels at most; more fit only where many channels are equal."""


@dataclass(frozen=True)
class Echo:
    """A command that a channel repeats."""

    delay: int  # samples by which the channel is late
    correlation: float  # correlation at this delay
    gain: float  # channel over command


@dataclass(frozen=True)
class Computed:
    """Channels whose sum, cut at limits, a channel is."""

    sources: tuple[int, ...]  # indices of the channels that are added
    share: float  # share of the samples that are the sum, not the limit


def find_echo(measured: np.ndarray, command: np.ndarray) -> Echo | None:
    """Return how a channel `measured` repeats a `command`, each (n,); None if it does not."""
    n = min(len(measured), len(command))
    known = np.isfinite(measured[:n]) & np.isfinite(command[:n])
    if known.sum() < MIN_ECHO_SAMPLES or n < MIN_ECHO_SAMPLES:
        return None
    y, u = (np.where(known, each[:n], np.median(each[:n][known])) for each in (measured, command))
    if y.std() == 0.0 or u.std() == 0.0:
        return None
    furthest = int(min(MAX_ECHO_DELAY_SAMPLES, MAX_ECHO_DELAY_SHARE * n))
    spectrum = np.conj(np.fft.rfft(u - u.mean(), 2 * n)) * np.fft.rfft(y - y.mean(), 2 * n)
    alike = np.fft.irfft(spectrum)[: furthest + 1]
    delay = int(np.argmax(np.abs(alike)))
    late, early = y[delay:], u[: n - delay]
    correlation = float(np.corrcoef(late, early)[0, 1])
    late_enough = delay >= MIN_LATE_SAMPLES
    if abs(correlation) < (MIN_LATE_ECHO_CORRELATION if late_enough else MIN_PROMPT_ECHO_CORRELATION):
        return None
    return Echo(delay, correlation, float(np.polyfit(early, late, 1)[0]))


def find_computed(channels: np.ndarray, own: int) -> Computed | None:
    """Return of which others among `channels`, shape (m, n), the channel `own` is the sum, cut at its extremes.

    One channel is tried first, then each pair. Returns None if it is no such sum. The time grows with m log m, because
    only channels and pairs are compared whose weighted sums over a few rows fit that of the channel.
    """
    x = channels[own]
    known = np.isfinite(x)
    if known.sum() < MIN_ECHO_SAMPLES or np.ptp(x[known]) == 0.0:
        return None
    low, high = float(x[known].min()), float(x[known].max())
    inside = known & (x > low) & (x < high)
    if inside.sum() < MIN_COPIED_SHARE * known.sum() or not inside.any():
        return None
    size = COPY_TOLERANCE * max(abs(low), abs(high))
    rows = np.flatnonzero(inside)
    for chosen in _probable_sums(channels, own, rows, size):
        total = channels[list(chosen)].sum(axis=0)
        with np.errstate(invalid="ignore"):
            same = np.abs(np.clip(total, low, high) - x) <= size
        share = float(same[inside].mean())
        if share > MIN_SUM_SHARE and any(np.ptp(channels[i]) for i in chosen):
            return Computed(tuple(sorted(chosen)), share)
    return None


def _probable_sums(channels: np.ndarray, own: int, rows: np.ndarray, size: float) -> list[tuple[int, ...]]:
    """Return other channels, then pairs of them, whose sum may be the channel `own` in nearly all `rows`."""
    rng = np.random.default_rng(0)
    found: dict[tuple[int, ...], None] = {}
    for _ in range(PROJECTION_COUNT):
        chosen = rng.choice(rows, min(PROJECTED_ROWS, len(rows)), replace=False)
        weights = rng.uniform(0.5, 1.5, len(chosen)) * rng.choice((-1.0, 1.0), len(chosen))
        tolerance = size * float(np.abs(weights).sum())
        sums = channels[:, chosen] @ weights
        wanted, sums[own] = float(sums[own]), np.nan
        found |= dict.fromkeys(
            (int(i),) for i in np.flatnonzero(np.abs(sums - wanted) <= tolerance)[:MAX_COMPARED_SUMS]
        )
        order = np.argsort(sums, kind="stable")[: np.count_nonzero(np.isfinite(sums))]
        first = np.searchsorted(sums[order], wanted - sums[order] - tolerance)
        last = np.searchsorted(sums[order], wanted - sums[order] + tolerance, side="right")
        pairs: list[tuple[int, ...]] = []
        for place in np.flatnonzero(last > first):
            i, most = int(order[place]), int(first[place]) + MAX_COMPARED_SUMS
            pairs += [(i, int(k)) for k in order[first[place] : min(int(last[place]), most)] if k < i]
            if len(pairs) > MAX_COMPARED_SUMS:
                break
        found |= dict.fromkeys(pairs)
    return sorted(found, key=lambda each: (len(each), each))[:MAX_COMPARED_SUMS]
