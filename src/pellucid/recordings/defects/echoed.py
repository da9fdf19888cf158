"""Find echoes: a measurement that is its own command, late, or a signal that is computed from others in the log.

A sensor adds what nobody commanded: its noise, friction, the person. A channel that a delay, a gain and a short filter
of the command explain to the last digits is no measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
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


def find_computed(x: np.ndarray, others: Sequence[np.ndarray]) -> Computed | None:
    """Return of which channels among `others`, each (n,), a channel `x`, (n,), is the sum, cut at its extremes.

    One channel is tried first, then each pair. Returns None if `x` is no such sum.
    """
    known = np.isfinite(x)
    if known.sum() < MIN_ECHO_SAMPLES or np.ptp(x[known]) == 0.0:
        return None
    low, high = float(x[known].min()), float(x[known].max())
    inside = known & (x > low) & (x < high)
    size = COPY_TOLERANCE * max(abs(low), abs(high))
    choices = [(i,) for i in range(len(others))] + [(i, k) for i in range(len(others)) for k in range(i)]
    for chosen in choices:
        total = np.sum([others[i] for i in chosen], axis=0)
        with np.errstate(invalid="ignore"):
            same = np.abs(np.clip(total, low, high) - x) <= size
        share = float(same[inside].mean()) if inside.any() else 0.0
        if share > 0.999 and inside.sum() >= MIN_COPIED_SHARE * known.sum() and any(np.ptp(others[i]) for i in chosen):
            return Computed(tuple(sorted(chosen)), share)
    return None
