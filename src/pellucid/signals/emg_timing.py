"""Do EMG and motion run on one clock? Muscles become active just before a limb accelerates, never a second later."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import signal, stats

from .filters import zero_phase_lowpass
from .movements import Kinematics

LEAD = (-0.1, 0.4)
"""By how much [s] activity may lead the motion, at least and at most: an electromechanical delay, a burst's length,
and what noise may add."""

SEARCHED = 3.0
"""Leads looked for, either way [s]."""

RATE = 50.0
"""Of the comparison [Hz]."""

CLEAR = 0.2
"""Correlation from which on a lead counts as found ..."""

CHANCE = 3.0
"""... in a long record; in one of T seconds the square root of this over T: noise was found to reach 0.27 in 24 s."""

CLEAR_PART = 0.3
"""Of a short part of a record, next to what the others say."""

BETTER = 1.3
"""How many times better than any lead within `LEAD` another has to be to be believed."""

SLOW = 1.0
"""Seconds over which a running mean is taken away: what a limb's weight costs at rest follows its angle."""

PART = 20.0
"""Seconds in which a lead is looked for, to see it change: a handful of movements ..."""

NEAR = 0.2
"""... each within this [s] of what a straight line over the record says."""

FASTEST = 0.02
"""Drifts looked for, either way [s/s]."""

PARTED = 0.1
"""Clocks that part by less than this [s] over a record are one: EMG's advance, as published."""


@dataclass(frozen=True)
class EmgLead:
    """By how much activity leads the motion."""

    lead: float  # Positive where EMG comes first [s]
    correlation: float  # Between activity and what motion explains of it, at that lead
    plausible: bool  # False where the signals agree clearly, and clearly better at a lead that no muscle has


@dataclass(frozen=True)
class EmgDrift:
    """How EMG's clock runs apart from the motion's."""

    drift: float  # drift, error: By how much the lead grows, and its standard error [s/s]
    error: float
    seconds: float  # That both recorded
    parts: int  # In which a lead was seen

    @property
    def total(self) -> float:
        """By how much the clocks part over what both recorded [s]."""
        return self.drift * self.seconds

    @property
    def clear(self) -> bool:
        """Whether it is more than one in a thousand records shows by chance, and enough to matter."""
        beyond = float(stats.t.isf(0.5e-3, self.parts - 2)) * self.error
        return abs(self.drift) > beyond and abs(self.total) > PARTED


def emg_lead(time: np.ndarray, activity: np.ndarray, motion: Kinematics) -> EmgLead | None:
    """Compare activity with what it is there for: weight, speed and acceleration. `time` (m,) [s]; `activity` (m,)."""
    both = _compared(time, activity, motion)
    if both is None:
        return None
    x, y = both
    longest = int(min(SEARCHED, 0.25 * len(x) / RATE) * RATE)
    scores = np.sqrt(_explained(x, y, longest))
    leads = np.arange(-longest, longest + 1) / RATE
    best = int(np.argmax(scores))
    inside = (leads >= LEAD[0]) & (leads <= LEAD[1])
    clear = max(CLEAR, np.sqrt(CHANCE * RATE / len(x)))
    elsewhere = not inside[best] and scores[best] > clear and scores[best] > BETTER * max(scores[inside].max(), 0.0)
    return EmgLead(float(leads[best]), float(scores[best]), not elsewhere)


def emg_drift(time: np.ndarray, activity: np.ndarray, motion: Kinematics) -> EmgDrift | None:
    """How fast the lead of activity over the motion changes.

    What motion explains in short parts, each at its own lag, is added up along straight lines over time; the line with
    the largest sum is made finer by the best lag of every part next to it.
    """
    both = _compared(time, activity, motion)
    if both is None or len(both[0]) < 120.0 * RATE:
        return None
    x, y = both
    count = int(min(len(x) / RATE / PART, 24))
    edges = np.linspace(0, len(x), count + 1).astype(int)
    longest = int(SEARCHED * RATE)
    parts = np.array([_explained(x[a:b], y[a:b], longest) for a, b in pairwise(edges)])
    middle = 0.5 * (edges[:-1] + edges[1:]) / RATE
    at, seconds = middle - middle.mean(), len(x) / RATE
    steepest = min(FASTEST, 2.0 / seconds)
    most = int(np.ceil(0.5 * steepest * seconds * RATE)) + 1
    wide = np.pad(parts, ((0, 0), (most, most)))
    lags, rows = np.arange(-longest, longest + 1), np.arange(count)[:, None]
    best = (-np.inf, 0.0, 0.0)
    for drift in np.arange(-steepest, steepest, 1.0 / RATE / seconds):
        shift = np.rint(drift * at * RATE).astype(int)
        total = wide[rows, lags + longest + most + shift[:, None]].sum(axis=0)
        top = int(np.argmax(total))
        best = max(best, (float(total[top]), drift, lags[top] / RATE))
    _, drift, lead = best
    found = [_best_near(part, lead + drift * t, longest) for part, t in zip(parts, at, strict=True)]
    seen = np.array([height > CLEAR_PART**2 for _, height in found])
    if seen.sum() < max(4, 0.5 * count):
        return None
    lag = np.array([each for each, _ in found])[seen]
    t = at[seen] - at[seen].mean()
    slope = float(t @ (lag - lag.mean()) / (t @ t))
    rest = lag - lag.mean() - slope * t
    error = float(np.sqrt(rest @ rest / (len(t) - 2) / (t @ t)))
    return EmgDrift(slope, error, seconds, len(t))


def _compared(time: np.ndarray, activity: np.ndarray, motion: Kinematics) -> tuple[np.ndarray, np.ndarray] | None:
    """Envelopes, shape (n, g), and what moves them, shape (n, 5), at `RATE` and without what is slow."""
    low = max(time[0], motion.time[0])
    high = min(time[-1], motion.time[-1])
    if high - low < 10.0:
        return None
    activity = activity.reshape(len(time), -1)
    fs = (len(time) - 1) / (time[-1] - time[0])
    even = np.arange(low, high, 1.0 / RATE)
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
    """Lag of the highest share within `NEAR` of a lead [s], between samples by a parabola, and its height."""
    centre, reach = round(lead * RATE) + longest, int(NEAR * RATE)
    low, high = max(centre - reach, 1), min(centre + reach + 1, len(part) - 1)
    if high <= low:
        return lead, -np.inf
    top = low + int(np.argmax(part[low:high]))
    before, here, after = part[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    between = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (top - longest + float(np.clip(between, -1.0, 1.0))) / RATE, float(here)


def _without_slow(x: np.ndarray) -> np.ndarray:
    n = int(SLOW * RATE)
    padded = np.pad(x, (n // 2, n - n // 2), mode="edge")
    sums = np.concatenate(([0.0], np.cumsum(padded)))
    return x - (sums[n:] - sums[:-n])[: len(x)] / n
