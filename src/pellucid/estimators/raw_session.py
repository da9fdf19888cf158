"""Whether raw EMG is still that of the electrodes that were fitted: spectrum, mains, rails and cross-talk of channels.

Envelopes forget all of these. A spectrum hardly changes with effort, and falls by a fifth with fatigue. An electrode
that moved, dried or lost its contact, another filter or another gain change it, or the mains in it, or how often it
meets its rails.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from .._errors import IdentificationError
from ..signals.filters import runs
from .emg_session import ChannelChange

BAND = (20.0, 450.0)
"""Of surface EMG [Hz]."""

MAINS = (50.0, 60.0)
"""Of the world [Hz]."""

SLOWER = 1.4
"""Times by which a median frequency may change: fatigue comes to 1.3."""

HUM = 0.15
"""By how much the mains' share of the power may rise."""

RAILS = 5e-4
"""Share of samples in runs at the largest value from which a channel that had none meets its rails."""

ONE = 0.5
"""Correlation of raw signals from which two electrodes hear one muscle."""

CLOSER = 0.35
"""By how much Fisher's z of it may rise before."""

PIECE = 0.5
"""Seconds of which one spectrum is taken."""

ACTIVE = 4.0
"""Times the power at rest that a muscle at work exceeds."""

SHORTEST = 4.0
"""Seconds without which a spectrum is none."""


@dataclass(frozen=True, eq=False)
class RawChannels:
    """What raw channels of recordings are like, all with the same muscles.

    What changes is of the kind ``"spectrum"``, ``"hum"``, ``"saturation"``, or ``"shared"`` by two electrodes.
    """

    muscles: tuple[str, ...]
    # (k,) Median frequency [Hz], NaN of a muscle that did nothing; hum, rails: (k,) Shares of power and of samples
    median: np.ndarray
    hum: np.ndarray
    rails: np.ndarray
    together: np.ndarray  # (k, k) Correlation of raw signals, the mains left out

    @classmethod
    def of(cls, recordings: Sequence[tuple[Mapping[str, np.ndarray], float]]) -> RawChannels:
        """Of recordings' channels by muscle, each (n,) [V], with their rate [Hz]."""
        muscles = tuple(recordings[0][0])
        if any(set(channels) != set(muscles) for channels, _ in recordings):
            raise IdentificationError("raw channels: found other muscles in some recordings, expected the same in each")
        seconds = [len(next(iter(channels.values()))) / fs for channels, fs in recordings]
        weights = np.array(seconds) / sum(seconds)
        found = [_signature(np.array([channels[m] for m in muscles]), fs) for channels, fs in recordings]
        median = np.array([_weighted(weights, column) for column in np.transpose([each[0] for each in found])])
        return cls(muscles, median, *(np.tensordot(weights, [each[i] for each in found], 1) for i in (1, 2, 3)))

    def changes(self, now: RawChannels) -> tuple[ChannelChange, ...]:
        """Channels that are not as here."""
        made = []
        for k, muscle in enumerate(self.muscles):
            ratio = now.median[k] / self.median[k]
            if np.isfinite(ratio) and not 1.0 / SLOWER <= ratio <= SLOWER:
                found, expected = f"a median frequency of {now.median[k]:.0f} Hz", f"{self.median[k]:.0f} Hz, as fitted"
                made.append(ChannelChange(muscle, "spectrum", found, f"{expected}, within {SLOWER:g} times"))
            if now.hum[k] - self.hum[k] > HUM:
                found = f"{100.0 * now.hum[k]:.0f} % of the power at the mains' frequencies"
                made.append(ChannelChange(muscle, "hum", found, f"about {100.0 * self.hum[k]:.0f} %, as fitted"))
            if now.rails[k] > RAILS and now.rails[k] > 5.0 * self.rails[k]:
                found = f"{100.0 * now.rails[k]:.2g} % of the samples in runs at the largest value"
                made.append(ChannelChange(muscle, "saturation", found, f"{100.0 * self.rails[k]:.2g} %, as fitted"))
            z, before = (np.arctanh(np.clip(np.abs(c.together[k]), 0.0, 0.9999)) for c in (now, self))
            close = (z > np.arctanh(ONE)) & (z - before > CLOSER) & (np.arange(len(z)) != k)
            if close.any():
                i = int(np.argmax(np.where(close, z, -1.0)))
                found = f"a raw signal as that of {self.muscles[i]} (correlation {now.together[i, k]:.2f})"
                expected = f"{self.together[i, k]:.2f}, as fitted: cross-talk, or one electrode?"
                # Which of the two hears the other cannot be told.
                made.append(ChannelChange(muscle, "shared", found, expected, self.muscles[i]))
        return tuple(made)


def _signature(x: np.ndarray, fs: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Median frequencies, shares of the mains and at the rails, and correlations, of `x` (k, n) [V] at `fs` [Hz]."""
    k, n = x.shape
    if n < SHORTEST * fs:
        raise IdentificationError(f"raw channels: found {n / fs:.2g} s, expected at least {SHORTEST:g} s of each")
    x = x - x.mean(axis=1, keepdims=True)
    rails = np.array([_at_rails(each) for each in x])
    size = min(n, round(fs))
    # Of the mains' two frequencies the one that more is of; both are left out of spectra.
    f, own = signal.welch(x, fs, nperseg=size, axis=-1)
    line = np.min([np.abs(f - m * h) for m in MAINS for h in range(1, 10)], axis=0) <= 1.5
    band = (f >= BAND[0]) & (f <= min(BAND[1], 0.45 * fs))
    total = own[:, band].sum(axis=1)
    hum = np.zeros(k)
    for m in MAINS:
        near = np.min([np.abs(f - m * h) for h in range(1, 6)], axis=0) <= 1.5
        # What the muscle has there is what it has beside the lines.
        beside = own[:, band & ~line].mean(axis=1, keepdims=True)
        above = np.maximum(own[:, band & near] - beside, 0.0).sum(axis=1)
        hum = np.maximum(hum, above / np.maximum(total, 1e-300))
    kept = band & ~line
    median = np.array([_median_frequency(each, fs) for each in x])
    together = np.eye(k)
    for i in range(k):
        for j in range(i):
            _, both = signal.csd(x[i], x[j], fs, nperseg=size)
            scale = np.sqrt(own[i, kept].sum() * own[j, kept].sum())
            together[i, j] = together[j, i] = float(both[kept].real.sum() / scale) if scale > 0.0 else 0.0
    return median, hum, rails, together


def _median_frequency(x: np.ndarray, fs: float) -> float:
    """Of the quarter of the seconds in which a muscle is most active [Hz]; NaN where it is hardly more so than else."""
    f, _, power = signal.spectrogram(x, fs, nperseg=round(PIECE * fs), detrend="constant")
    line = np.min([np.abs(f - m * h) for m in MAINS for h in range(1, 10)], axis=0) <= 0.75 / PIECE
    kept = (f >= BAND[0]) & (f <= min(BAND[1], 0.45 * fs))
    loud = power[kept & ~line].sum(axis=0)
    rest, work = np.quantile(loud, (0.25, 0.75))
    if not work > ACTIVE * rest:
        return np.nan
    mean = power[:, loud >= work].mean(axis=1)
    # What the muscle has at the mains' frequencies is what it has beside them.
    mean[line] = np.interp(f[line], f[~line], mean[~line])
    share = np.cumsum(mean[kept])
    return float(np.interp(0.5 * share[-1], share, f[kept]))


def _weighted(weights: np.ndarray, values: np.ndarray) -> float:
    """Mean of what is known; NaN of nothing."""
    known = np.isfinite(values)
    return float(np.average(values[known], weights=weights[known])) if known.any() else np.nan


def _at_rails(x: np.ndarray) -> float:
    """Share of samples in runs of three and more at the largest or the smallest value."""
    ends = runs((x == x.max()) | (x == x.min()))
    return sum(r.stop - r.start for r in ends if r.stop - r.start >= 3) / len(x)
