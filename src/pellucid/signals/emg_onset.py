r"""When a muscle becomes active: bursts by energy against rest, and how sure the beginning of each is.

**Bursts.** Raw EMG passes a band-pass and the Teager-Kaiser operator [1]_ [2]_, which weighs amplitude by frequency,

.. math::  \psi_n = x_n^2 - x_{n-1} x_{n+1},

is smoothed, and is held against two thresholds [3]_: its level (mean of rest and `height` standard deviations) and how
long it stays above (`shortest`). Where the smoothed energy passes, a muscle is active.

**Change point.** Around each beginning the band-passed samples are taken for Gaussian, with the standard deviation
:math:`\sigma_0` before :math:`t_0`, at least that of rest, and one that rises to the burst's within r after it.
Samples of EMG are alike for :math:`\kappa = \sum_k \rho_k^2` of them, so that many count as one:

.. math::
   \log p(t_0, r, \sigma_1 \mid x) = -\frac{1}{\kappa} \sum_n \Big(\log\sigma_n + \frac{x_n^2}{2\sigma_n^2}\Big),
   \qquad \sigma_n = \sigma_0 + (\sigma_1 - \sigma_0)\,\mathrm{clip}\Big(\frac{t_n - t_0}{r}, 0, 1\Big).

Summed over r and both deviations this is what is known of :math:`t_0`: its median is the onset, its quantiles the
interval. The end of a burst is the onset of the same samples backwards.

.. [1] S. Solnik, P. Rider, K. Steinweg, P. DeVita, T. Hortobagyi, "Teager-Kaiser energy operator signal conditioning
   improves EMG onset detection", European Journal of Applied Physiology 110, 2010.
.. [2] J. F. Kaiser, "On a simple algorithm to calculate the energy of a signal", ICASSP, 1990.
.. [3] P. Bonato, T. D'Alessio, M. Knaflitz, "A statistical method for the measurement of muscle activation intervals
   from surface myoelectric signal during gait", IEEE Transactions on Biomedical Engineering 45, 1998.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import signal
from scipy.fft import irfft, next_fast_len, rfft

from .._errors import RecordingError
from .filters import runs

BAND = (30.0, 300.0)
"""Of the band-pass before the energy [Hz], as published."""

SMOOTHED = 50.0
"""Cut-off of the zero-phase low-pass on the energy [Hz], as published."""

HEIGHT = 15.0
"""Standard deviations of rest above its mean, where nobody says how many."""

SHORTEST = 0.025
"""Time above the level that makes a burst [s]."""

PAUSE = 0.1
"""Of a muscle [s]; shorter ones are within one burst."""

BEGUN = 0.05
"""A burst that passes so soon in a recording [s] had begun before it."""

REST = 0.5
"""Of the quietest stretch that stands for rest where nobody says which one does [s]."""

CONTRAST = 2.0
"""RMS of activity over that of rest, below which there is no rest, or no activity."""

REACH = 0.2
"""How far from the energy's beginning the change is looked for [s]."""

RISES = (0.0, 0.02, 0.04, 0.07, 0.1, 0.13, 0.16, 0.2, 0.25, 0.32)
"""Times that activity may take to rise [s]."""

PLATEAUS = np.geomspace(0.7, 1.4, 4)
"""Activity after the rise that is looked at, over the burst's RMS."""

FLOORS = 4
"""Levels before the rise that are looked at, from that of rest to half the burst's: between two bursts a muscle may
hold what it did not hold at rest."""


@dataclass(frozen=True)
class ChangePoint:
    """When something begins, and between which times with a stated probability."""

    time: float  # time, low, high: [s]
    low: float
    high: float


@dataclass(frozen=True)
class Burst:
    """One stretch of activity."""

    onset: ChangePoint
    end: ChangePoint
    crossed: float  # When the energy passed its level [s]
    rms: float  # Of the band-passed samples within [V]
    seen: bool = True  # Whether its beginning is: not where the recording begins within it

    @property
    def duration(self) -> float:
        """[s]"""
        return self.end.time - self.onset.time


@dataclass(frozen=True, eq=False)
class Activations:
    """What one muscle's raw EMG does over one recording."""

    bursts: tuple[Burst, ...]
    rest: tuple[float, float]  # Stretch that stood for rest [s]
    rest_rms: float  # Of the band-passed samples there [V]
    energy: np.ndarray  # (n,) Smoothed [V^2]
    level: float  # That it has to pass [V^2]

    @property
    def active(self) -> float:
        """Seconds of activity in all."""
        return float(sum(burst.duration for burst in self.bursts))


def activations(
    time: np.ndarray,
    samples: np.ndarray,
    *,
    rest: tuple[float, float] | None = None,
    height: float = HEIGHT,
    shortest: float = SHORTEST,
    pause: float = PAUSE,
    level: float = 0.95,
) -> Activations:
    """Bursts of raw EMG. `time` (n,) [s]; `samples` (n,) [V]; `rest` [s]; `level` is the intervals' probability."""
    time, samples = np.asarray(time, float), np.asarray(samples, float)
    fs = (len(time) - 1) / (time[-1] - time[0])
    _require(time, samples, fs)
    passed = signal.sosfiltfilt(signal.butter(3, BAND, "bandpass", fs=fs, output="sos"), samples - samples.mean())
    smoothing = signal.butter(2, SMOOTHED, fs=fs, output="sos")
    energy = signal.sosfiltfilt(smoothing, np.abs(teager_kaiser(passed)))
    still = _stretch(time, rest) if rest is not None else _quietest(energy, fs)
    rest_rms = float(np.sqrt(np.mean(passed[still] ** 2)))
    spread = float(np.std(energy[still]))
    passes = float(np.mean(energy[still])) + height * spread
    busy = float(np.sqrt(np.quantile(_mean_square(passed, fs), 0.95)))
    if not rest_rms > 0.0 or np.ptp(samples[still]) == 0.0:
        raise RecordingError("found a rest without any signal, expected an amplifier's own noise there at least")
    if busy < CONTRAST * rest_rms:
        raise RecordingError(
            f"found activity of {busy / rest_rms:.3g} times the RMS of rest ({time[still][0]:.4g} to "
            f"{time[still][-1]:.4g} s), expected at least {CONTRAST:g} times: a recording with rest and with activity"
        )
    both = _one_way(samples - samples.mean(), fs, still)
    crossed = _bursts(energy > passes, fs, shortest, pause)
    # A beginning lies behind the end of the burst before, an end before the beginning of the next.
    edges = [0, *(round(0.5 * (a[1] + b[0])) for a, b in pairwise(crossed)), len(time) - 1]
    found = [
        _burst(time, passed, both, each, around, fs, level)
        for each, around in zip(crossed, pairwise(edges), strict=True)
    ]
    return Activations(tuple(found), (float(time[still][0]), float(time[still][-1])), rest_rms, energy, passes)


def teager_kaiser(x: np.ndarray) -> np.ndarray:
    """Energy of `x`, (n,), by its next neighbours, (n,) [its square]; at the ends their neighbours' value."""
    energy = np.empty_like(x)
    energy[1:-1] = x[1:-1] ** 2 - x[:-2] * x[2:]
    energy[0], energy[-1] = energy[1], energy[-2]
    return energy


def _require(time: np.ndarray, samples: np.ndarray, fs: float) -> None:
    missing = np.flatnonzero(~np.isfinite(samples))
    if missing.size:
        raise RecordingError(
            f"found {missing.size} missing samples (NaN), the first at {time[missing[0]]:.6g} s, expected a number in "
            "every sample"
        )
    if not fs > 2.0 * BAND[1]:
        raise RecordingError(
            f"found a rate of {fs:.4g} Hz, expected raw EMG at more than {2.0 * BAND[1]:g} Hz: onset is found between "
            f"{BAND[0]:g} and {BAND[1]:g} Hz"
        )
    if time[-1] - time[0] < 2.0 * REST:
        raise RecordingError(f"found {time[-1] - time[0]:.3g} s, expected at least {2.0 * REST:g} s")
    if np.min(samples) >= 0.0:
        raise RecordingError("found no sample below 0, as in an envelope, expected raw EMG")


def _stretch(time: np.ndarray, rest: tuple[float, float]) -> slice:
    first, last = np.searchsorted(time, rest)
    if last - first < 0.1 / (time[1] - time[0]):
        raise RecordingError(
            f"found {max(last - first, 0)} samples of rest between {rest[0]:g} and {rest[1]:g} s, expected 0.1 s of it "
            f"within {time[0]:.4g} to {time[-1]:.4g} s"
        )
    return slice(int(first), int(last))


def _quietest(energy: np.ndarray, fs: float) -> slice:
    """Where the largest energy within `REST` is least: a mean would forgive a twitch."""
    from scipy.ndimage import maximum_filter1d

    n = round(REST * fs)
    most = maximum_filter1d(energy, n)[n // 2 : len(energy) - n + n // 2 + 1]
    first = int(np.argmin(most))
    return slice(first, first + n)


def _mean_square(x: np.ndarray, fs: float) -> np.ndarray:
    n = max(1, round(0.1 * fs))
    return np.convolve(x**2, np.full(n, 1.0 / n), mode="valid")


def _bursts(above: np.ndarray, fs: float, shortest: float, pause: float) -> list[tuple[int, int]]:
    """First and last sample of stretches above, joined over pauses, that last."""
    joined: list[list[int]] = []
    for run in runs(above):
        if joined and run.start - joined[-1][1] < pause * fs:
            joined[-1][1] = run.stop - 1
        else:
            joined.append([run.start, run.stop - 1])
    return [(first, last) for first, last in joined if last - first + 1 >= shortest * fs]


def _one_way(samples: np.ndarray, fs: float, still: slice) -> tuple[np.ndarray, np.ndarray]:
    """Samples over the RMS of rest, passed forwards, and the same backwards from the end: a filter that runs both ways
    would bring a beginning forward, by its ringing."""
    sos = signal.butter(1, BAND, "bandpass", fs=fs, output="sos")
    made = signal.sosfilt(sos, samples), signal.sosfilt(sos, samples[::-1])[::-1]
    forward, backward = (x / np.sqrt(np.mean(x[still] ** 2)) for x in made)
    return forward, backward[::-1]


def _burst(
    time: np.ndarray,
    passed: np.ndarray,
    both: tuple[np.ndarray, np.ndarray],
    crossed: tuple[int, int],
    around: tuple[int, int],
    fs: float,
    level: float,
) -> Burst:
    (first, last), (before, after) = crossed, around
    n, index = len(time), np.arange(len(time))
    begins = np.interp(_change(both[0], before, first, last, fs, level), index, time)
    ends = np.interp(n - 1 - _change(both[1], n - 1 - after, n - 1 - last, n - 1 - first, fs, level), index, time)
    rms = float(np.sqrt(np.mean(passed[first : last + 1] ** 2)))
    return Burst(
        ChangePoint(float(begins[1]), float(begins[0]), float(begins[2])),
        ChangePoint(float(ends[1]), float(ends[2]), float(ends[0])),
        float(time[first]),
        rms,
        bool(first > BEGUN * fs),
    )


def _change(x: np.ndarray, before: int, first: int, last: int, fs: float, level: float) -> np.ndarray:
    """Lower quantile, median and upper one of where `x`, in RMS of rest, changes, in samples: near `first`, not ahead
    of `before`."""
    reach = round(REACH * fs)
    low = max(before, first - reach)
    end = min(len(x), max(min(last + 1, first + 2 * reach), first + round(SHORTEST * fs)))
    places = np.arange(min(first + reach, end - 1) - low)
    squares, n = x[low:end] ** 2, end - low
    burst = float(np.sqrt(np.mean(x[first:end] ** 2)))
    floors = np.geomspace(1.0, max(0.5 * burst, 1.0), FLOORS)
    size = next_fast_len(2 * n, real=True)
    spectrum = rfft(squares, size)
    logs = []
    for rise in RISES:
        ramp = np.clip(np.arange(1, n + 1) / max(rise * fs, 1.0), 0.0, 1.0)
        for floor in floors:
            plateaus = np.maximum(PLATEAUS * burst, floor)[:, None]
            sigma = floor + (plateaus - floor) * ramp
            # Less what the floor would have said of the same samples: of all places at once.
            gain, cost = 0.5 * (1.0 / floor**2 - 1.0 / sigma**2), np.log(sigma / floor)
            told = irfft(spectrum * np.conj(rfft(gain, size, axis=1)), size, axis=1)[:, places]
            all_floor = -n * np.log(floor) - 0.5 * squares.sum() / floor**2
            logs.append(all_floor + told - np.cumsum(cost, axis=1)[:, n - 1 - places])
    logs = np.concatenate(logs) / _alike(x[first:end])
    weight = np.exp(logs - logs.max()).sum(axis=0)
    total = np.concatenate(([0.0], np.cumsum(weight))) / weight.sum()
    tails = 0.5 * (1.0 - level)
    return low + np.interp((tails, 0.5, 1.0 - tails), total, np.arange(len(total)) - 0.5)


def _alike(x: np.ndarray) -> float:
    """How many neighbours count as one where squares are summed, at least 1."""
    x = x - x.mean()
    most = min(len(x) - 1, 40)
    if most < 2 or not np.any(x):
        return 1.0
    rho = np.array([x[: len(x) - k] @ x[k:] for k in range(1, most)]) / (x @ x)
    return float(1.0 + 2.0 * np.sum(rho**2))
