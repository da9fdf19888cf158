"""Find echoes: a measurement that is its own command, late, or a signal that is computed from others in the log.

A sensor adds what nobody commanded: its noise, friction, the person. A channel that a delay, a gain and a short filter
of the command explain to the last digits is no measurement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

KIND = "echoed"


@dataclass(frozen=True)
class EchoLimits:
    """When a channel repeats another one, or is the sum of others."""

    # A channel that is late echoes its command if both correlate at least this much at one delay. Chosen by
    # judgement: a torque loop with a sensor on a moving joint stays below.
    min_late_echo_correlation: float = 0.999
    # The same without a delay. A fast current loop follows its command this closely, but not to the last digits.
    min_prompt_echo_correlation: float = 0.99999
    # A channel is late from this many samples on. Loops are faster.
    min_late_samples: int = 3
    # The longest delay that is tried [samples].
    max_echo_delay_samples: int = 400
    # The longest delay that is tried, as a share of the log.
    max_echo_delay_share: float = 0.1
    # Shorter logs are not searched: two slow signals are alike in them.
    min_echo_samples: int = 100
    # Samples are copies if they differ by at most this share of the largest one, which rounding in a file may
    # cause.
    copy_tolerance: float = 1e-6
    # A channel is computed from others if at least this share of its samples, and all that are not at a limit, are
    # their sum.
    min_copied_share: float = 0.4
    # Share of the samples that are not at a limit in which a computed channel is the sum.
    min_sum_share: float = 0.999
    # Number of rows over which sums are compared before whole channels are. Few enough that a sum which is broken
    # in one row of a thousand fits in them.
    projected_rows: int = 16
    # Number of choices of such rows. A sum that is broken in one row of a thousand misses all of them with a
    # probability of 4e-6.
    projection_count: int = 3
    # Number of sums that are compared in whole channels at most; more fit only where many channels are equal.
    max_compared_sums: int = 200


ECHO_LIMITS = EchoLimits()


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
    if known.sum() < ECHO_LIMITS.min_echo_samples or n < ECHO_LIMITS.min_echo_samples:
        return None
    y, u = (np.where(known, each[:n], np.median(each[:n][known])) for each in (measured, command))
    if y.std() == 0.0 or u.std() == 0.0:
        return None
    furthest = int(min(ECHO_LIMITS.max_echo_delay_samples, ECHO_LIMITS.max_echo_delay_share * n))
    spectrum = np.conj(np.fft.rfft(u - u.mean(), 2 * n)) * np.fft.rfft(y - y.mean(), 2 * n)
    alike = np.fft.irfft(spectrum)[: furthest + 1]
    delay = int(np.argmax(np.abs(alike)))
    late, early = y[delay:], u[: n - delay]
    correlation = float(np.corrcoef(late, early)[0, 1])
    late_enough = delay >= ECHO_LIMITS.min_late_samples
    if abs(correlation) < (
        ECHO_LIMITS.min_late_echo_correlation if late_enough else ECHO_LIMITS.min_prompt_echo_correlation
    ):
        return None
    return Echo(delay, correlation, float(np.polyfit(early, late, 1)[0]))


def find_computed(channels: np.ndarray, own: int) -> Computed | None:
    """Return of which others among `channels`, shape (m, n), the channel `own` is the sum, cut at its extremes.

    One channel is tried first, then each pair. Returns None if it is no such sum. The time grows with m log m, because
    only channels and pairs are compared whose weighted sums over a few rows fit that of the channel.
    """
    x = channels[own]
    known = np.isfinite(x)
    if known.sum() < ECHO_LIMITS.min_echo_samples or np.ptp(x[known]) == 0.0:
        return None
    low, high = float(x[known].min()), float(x[known].max())
    inside = known & (x > low) & (x < high)
    if inside.sum() < ECHO_LIMITS.min_copied_share * known.sum() or not inside.any():
        return None
    size = ECHO_LIMITS.copy_tolerance * max(abs(low), abs(high))
    rows = np.flatnonzero(inside)
    for chosen in _probable_sums(channels, own, rows, size):
        total = channels[list(chosen)].sum(axis=0)
        with np.errstate(invalid="ignore"):
            same = np.abs(np.clip(total, low, high) - x) <= size
        share = float(same[inside].mean())
        if share > ECHO_LIMITS.min_sum_share and any(np.ptp(channels[i]) for i in chosen):
            return Computed(tuple(sorted(chosen)), share)
    return None


def _probable_sums(channels: np.ndarray, own: int, rows: np.ndarray, size: float) -> list[tuple[int, ...]]:
    """Return other channels, then pairs of them, whose sum may be the channel `own` in nearly all `rows`."""
    rng = np.random.default_rng(0)
    found: dict[tuple[int, ...], None] = {}
    for _ in range(ECHO_LIMITS.projection_count):
        chosen = rng.choice(rows, min(ECHO_LIMITS.projected_rows, len(rows)), replace=False)
        weights = rng.uniform(0.5, 1.5, len(chosen)) * rng.choice((-1.0, 1.0), len(chosen))
        tolerance = size * float(np.abs(weights).sum())
        sums = channels[:, chosen] @ weights
        wanted, sums[own] = float(sums[own]), np.nan
        found |= dict.fromkeys(
            (int(i),) for i in np.flatnonzero(np.abs(sums - wanted) <= tolerance)[: ECHO_LIMITS.max_compared_sums]
        )
        order = np.argsort(sums, kind="stable")[: np.count_nonzero(np.isfinite(sums))]
        first = np.searchsorted(sums[order], wanted - sums[order] - tolerance)
        last = np.searchsorted(sums[order], wanted - sums[order] + tolerance, side="right")
        pairs: list[tuple[int, ...]] = []
        for place in np.flatnonzero(last > first):
            i, most = int(order[place]), int(first[place]) + ECHO_LIMITS.max_compared_sums
            pairs += [(i, int(k)) for k in order[first[place] : min(int(last[place]), most)] if k < i]
            if len(pairs) > ECHO_LIMITS.max_compared_sums:
                break
        found |= dict.fromkeys(pairs)
    return sorted(found, key=lambda each: (len(each), each))[: ECHO_LIMITS.max_compared_sums]
