"""Do EMG and motion run on one clock? Muscles become active just before a limb accelerates, never a second later."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from .filters import zero_phase_lowpass
from .movements import Kinematics

LEAD = (-0.1, 0.4)
"""By how much [s] activity may lead the motion, at least and at most: an electromechanical delay, a burst's length,
and what noise may add."""

SEARCHED = 3.0
"""Leads looked for, either way [s]."""

RATE = 50.0
"""Of the comparison [Hz]."""

CLEAR = 0.3
"""Correlation from which on a lead counts as found."""

BETTER = 1.3
"""How many times better than any lead within `LEAD` another has to be to be believed."""

SLOW = 1.0
"""Seconds over which a running mean is taken away: what a limb's weight costs at rest follows its angle."""


@dataclass(frozen=True)
class EmgLead:
    """By how much activity leads the motion.

    Attributes
    ----------
    lead : float
        Positive where EMG comes first [s].
    correlation : float
        Between activity and size of the acceleration, at that lead.
    plausible : bool
        False where the signals agree clearly, and clearly better at a lead that no muscle has.
    """

    lead: float
    correlation: float
    plausible: bool


def emg_lead(time: np.ndarray, activity: np.ndarray, motion: Kinematics) -> EmgLead | None:
    """Compare activity with the size of the acceleration.

    Parameters
    ----------
    time, activity : ndarray, shape (m,)
        EMG's clock [s], and rectified EMG, summed over muscles, in any unit.
    motion : Kinematics
        On the recording's clock.

    Returns
    -------
    EmgLead or None
        None where both have less than ten seconds in common, or one of them does not change.
    """
    low = max(time[0], motion.time[0])
    high = min(time[-1], motion.time[-1])
    if high - low < 10.0:
        return None
    fs = (len(time) - 1) / (time[-1] - time[0])
    even = np.arange(low, high, 1.0 / RATE)
    # Thinned by block means first: an envelope needs no anti-aliasing sharper than that.
    block = max(int(fs / 200.0), 1)
    n = len(activity) // block * block
    thin = activity[:n].reshape(-1, block).mean(axis=1)
    at = time[:n].reshape(-1, block).mean(axis=1)
    envelope = np.interp(even, at, zero_phase_lowpass(thin, 6.0, 2, fs / block))
    effort = np.interp(even, motion.time, np.abs(motion.acceleration))
    x, y = _without_slow(envelope), _without_slow(effort)
    longest = int(min(SEARCHED, 0.25 * (high - low)) * RATE)
    lags = np.arange(-longest, longest + 1)
    # Both have hardly a mean once what is slow is gone: one product of spectra gives the covariance at every lag.
    products = signal.correlate(y, x, method="fft")[len(x) - 1 - longest : len(x) + longest]
    spread = float(np.std(x) * np.std(y))
    if spread == 0.0:
        return None
    scores = products / (len(x) - np.abs(lags)) / spread
    leads = lags / RATE
    best = int(np.argmax(scores))
    inside = (leads >= LEAD[0]) & (leads <= LEAD[1])
    elsewhere = not inside[best] and scores[best] > CLEAR and scores[best] > BETTER * max(scores[inside].max(), 0.0)
    return EmgLead(float(leads[best]), float(scores[best]), not elsewhere)


def _without_slow(x: np.ndarray) -> np.ndarray:
    n = int(SLOW * RATE)
    padded = np.pad(x, (n // 2, n - n // 2), mode="edge")
    sums = np.concatenate(([0.0], np.cumsum(padded)))
    return x - (sums[n:] - sums[:-n])[: len(x)] / n
