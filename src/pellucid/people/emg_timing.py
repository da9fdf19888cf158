"""Do EMG and motion run on one clock? Muscles become active just before a limb accelerates, never a second later."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import signal, stats

from ..numerics.filters import zero_phase_lowpass
from .movements import Kinematics

PLAUSIBLE_LEAD_S = (-0.1, 0.4)
"""Leads of activity over motion that are physiologically plausible: the electromechanical delay, the length of a burst,
and the error of the estimate."""

MAX_SEARCHED_LEAD_S = 3.0
"""Leads are searched up to this time in either direction."""

COMPARISON_RATE_HZ = 50.0
"""Rate at which activity and motion are compared."""

MIN_LEAD_CORRELATION = 0.2
"""Smallest correlation at which a lead counts as found in a long record."""

CHANCE_CORRELATION_TIME_S = 3.0
"""In a record of T seconds the correlation must also exceed the square root of this time over T. Noise alone reached
0.27 in 24 s."""

MIN_PART_CORRELATION = 0.3
"""Smallest correlation at which a lead counts as found in a short part of a record."""

MIN_IMPLAUSIBLE_GAIN = 1.3
"""An implausible lead is reported only if its correlation exceeds that of every plausible lead by this factor."""

RUNNING_MEAN_S = 1.0
"""Length of the running mean that is subtracted, because the effort that holds a limb's weight follows its angle."""

PART_LENGTH_S = 20.0
"""Length of the parts in which leads are searched to find a drift: a few movements each."""

MAX_PART_DEVIATION_S = 0.2
"""The lead of a part may differ from a straight line over the record by at most this time."""

MAX_SEARCHED_DRIFT = 0.02
"""Drifts are searched up to this size in either direction [s/s]."""

MIN_TOTAL_DRIFT_S = 0.1
"""Clocks that drift apart by less than this over a record count as one: the published advance of EMG."""


@dataclass(frozen=True)
class EmgLead:
    """The time by which muscle activity leads the motion."""

    lead: float  # positive where EMG comes first [s]
    correlation: float  # correlation between activity and its regression on motion, at that lead
    plausible: bool  # False where the signals agree clearly better at an implausible lead


@dataclass(frozen=True)
class EmgDrift:
    """Drift of the EMG's clock against the clock of the motion."""

    drift: float  # change of the lead per time [s/s]
    error: float  # standard error of the drift [s/s]
    seconds: float  # duration that both recorded [s]
    parts: int  # number of parts in which a lead was found

    @property
    def total(self) -> float:
        """Total drift over the duration that both recorded [s]."""
        return self.drift * self.seconds

    @property
    def clear(self) -> bool:
        """Whether the drift is significant (p < 0.001) and large enough to matter."""
        beyond = float(stats.t.isf(0.5e-3, self.parts - 2)) * self.error
        return abs(self.drift) > beyond and abs(self.total) > MIN_TOTAL_DRIFT_S


def emg_lead(time: np.ndarray, activity: np.ndarray, motion: Kinematics) -> EmgLead | None:
    """Compare activity with what it is there for: weight, speed and acceleration. `time` (m,) [s]; `activity` (m,)."""
    both = _compared(time, activity, motion)
    if both is None:
        return None
    x, y = both
    longest = int(min(MAX_SEARCHED_LEAD_S, 0.25 * len(x) / COMPARISON_RATE_HZ) * COMPARISON_RATE_HZ)
    scores = np.sqrt(_explained(x, y, longest))
    leads = np.arange(-longest, longest + 1) / COMPARISON_RATE_HZ
    best = int(np.argmax(scores))
    inside = (leads >= PLAUSIBLE_LEAD_S[0]) & (leads <= PLAUSIBLE_LEAD_S[1])
    clear = max(MIN_LEAD_CORRELATION, np.sqrt(CHANCE_CORRELATION_TIME_S * COMPARISON_RATE_HZ / len(x)))
    elsewhere = (
        not inside[best]
        and scores[best] > clear
        and scores[best] > MIN_IMPLAUSIBLE_GAIN * max(scores[inside].max(), 0.0)
    )
    return EmgLead(float(leads[best]), float(scores[best]), not elsewhere)


def emg_drift(time: np.ndarray, activity: np.ndarray, motion: Kinematics) -> EmgDrift | None:
    """How fast the lead of activity over the motion changes.

    What motion explains in short parts, each at its own lag, is added up along straight lines over time; the line with
    the largest sum is made finer by the best lag of every part next to it.
    """
    both = _compared(time, activity, motion)
    if both is None or len(both[0]) < 120.0 * COMPARISON_RATE_HZ:
        return None
    x, y = both
    count = int(min(len(x) / COMPARISON_RATE_HZ / PART_LENGTH_S, 24))
    edges = np.linspace(0, len(x), count + 1).astype(int)
    longest = int(MAX_SEARCHED_LEAD_S * COMPARISON_RATE_HZ)
    parts = np.array([_explained(x[a:b], y[a:b], longest) for a, b in pairwise(edges)])
    middle = 0.5 * (edges[:-1] + edges[1:]) / COMPARISON_RATE_HZ
    at, seconds = middle - middle.mean(), len(x) / COMPARISON_RATE_HZ
    steepest = min(MAX_SEARCHED_DRIFT, 2.0 / seconds)
    most = int(np.ceil(0.5 * steepest * seconds * COMPARISON_RATE_HZ)) + 1
    wide = np.pad(parts, ((0, 0), (most, most)))
    lags, rows = np.arange(-longest, longest + 1), np.arange(count)[:, None]
    best = (-np.inf, 0.0, 0.0)
    for drift in np.arange(-steepest, steepest, 1.0 / COMPARISON_RATE_HZ / seconds):
        shift = np.rint(drift * at * COMPARISON_RATE_HZ).astype(int)
        total = wide[rows, lags + longest + most + shift[:, None]].sum(axis=0)
        top = int(np.argmax(total))
        best = max(best, (float(total[top]), drift, lags[top] / COMPARISON_RATE_HZ))
    _, drift, lead = best
    found = [_best_near(part, lead + drift * t, longest) for part, t in zip(parts, at, strict=True)]
    seen = np.array([height > MIN_PART_CORRELATION**2 for _, height in found])
    if seen.sum() < max(4, 0.5 * count):
        return None
    lag = np.array([each for each, _ in found])[seen]
    t = at[seen] - at[seen].mean()
    slope = float(t @ (lag - lag.mean()) / (t @ t))
    rest = lag - lag.mean() - slope * t
    error = float(np.sqrt(rest @ rest / (len(t) - 2) / (t @ t)))
    return EmgDrift(slope, error, seconds, len(t))


def _compared(time: np.ndarray, activity: np.ndarray, motion: Kinematics) -> tuple[np.ndarray, np.ndarray] | None:
    """Envelopes, shape (n, g), and what moves them, shape (n, 5), at `COMPARISON_RATE_HZ` and without what is slow."""
    low = max(time[0], motion.time[0])
    high = min(time[-1], motion.time[-1])
    if high - low < 10.0:
        return None
    activity = activity.reshape(len(time), -1)
    fs = (len(time) - 1) / (time[-1] - time[0])
    even = np.arange(low, high, 1.0 / COMPARISON_RATE_HZ)
    # Thinned by block means first: an envelope needs no anti-aliasing sharper than that.
    block = max(int(fs / 200.0), 1)
    n = len(activity) // block * block
    thin = activity[:n].reshape(-1, block, activity.shape[1]).mean(axis=1)
    at = time[:n].reshape(-1, block).mean(axis=1)
    envelopes = [np.interp(even, at, zero_phase_lowpass(each, 6.0, 2, fs / block)) for each in thin.T]
    angle, velocity, acceleration = (
        np.interp(even, motion.time, each) for each in (motion.angle, motion.velocity, motion.acceleration)
    )
    causes = np.sin(angle), velocity, np.abs(velocity), acceleration, np.abs(acceleration)
    x, y = (np.column_stack([_without_slow(each) for each in group]) for group in (envelopes, causes))
    return (x, y) if x.std(axis=0).min() > 0.0 and np.linalg.matrix_rank(y) == y.shape[1] else None


def _explained(x: np.ndarray, y: np.ndarray, longest: int) -> np.ndarray:
    """Share of the envelopes' variance that motion explains, with x that many samples earlier, at all lags up to
    `longest` either way; the mean over envelopes.

    Both have hardly a mean once what is slow is gone: one product of spectra gives all lags of a covariance.
    """
    overlap = len(x) - np.abs(np.arange(-longest, longest + 1))
    inverse = np.linalg.inv(y.T @ y / len(y))
    shares = []
    for envelope in x.T:
        products = [signal.correlate(cause, envelope, method="fft") for cause in y.T]
        c = np.array([each[len(x) - 1 - longest : len(x) + longest] for each in products]) / overlap
        shares.append(np.einsum("il,ij,jl->l", c, inverse, c) / np.var(envelope))
    return np.mean(shares, axis=0)


def _best_near(part: np.ndarray, lead: float, longest: int) -> tuple[float, float]:
    """Lag of the highest share within `MAX_PART_DEVIATION_S` of a lead [s], between samples by a parabola, and its
    height."""
    centre, reach = round(lead * COMPARISON_RATE_HZ) + longest, int(MAX_PART_DEVIATION_S * COMPARISON_RATE_HZ)
    low, high = max(centre - reach, 1), min(centre + reach + 1, len(part) - 1)
    if high <= low:
        return lead, -np.inf
    top = low + int(np.argmax(part[low:high]))
    before, here, after = part[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    between = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (top - longest + float(np.clip(between, -1.0, 1.0))) / COMPARISON_RATE_HZ, float(here)


def _without_slow(x: np.ndarray) -> np.ndarray:
    n = int(RUNNING_MEAN_S * COMPARISON_RATE_HZ)
    padded = np.pad(x, (n // 2, n - n // 2), mode="edge")
    sums = np.concatenate(([0.0], np.cumsum(padded)))
    return x - (sums[n:] - sums[:-n])[: len(x)] / n
