"""Raw surface EMG as electrodes would pick it up from muscles whose excitation is known.

A muscle's signal is noise with the spectrum of many motor units; its amplitude is proportional to the excitation. The
recording chain adds cross-talk from the other channels, mains hum, motion artefacts of the cables, amplifier noise, and
a converter with a quantum and a range.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .shared_tables import EmgTable

PIECE_SAMPLE_COUNT = 1 << 14
"""Number of samples that are computed at a time, chosen so that their arrays stay in a processor's cache."""


@dataclass(frozen=True)
class Electrodes:
    """Channels of one EMG amplifier, and their defects."""

    gains: tuple[float, ...]  # RMS of each channel at full excitation [V]
    # Table ``[emg]`` of a rig's file: rate, clock_drift, band, median_frequency, baseline, hum, hum_frequency,
    # harmonics, artefact, artefact_band, crosstalk, quantum, full_range; SI
    table: Mapping | EmgTable
    rate: float | None = None  # sampling rate [Hz]; the table's rate if None
    detached: Mapping[int, float] = field(default_factory=dict)  # time at which a channel's electrode comes off [s]
    clipped: Mapping[int, float] = field(default_factory=dict)  # range of a channel that clips early [V]

    @property
    def fs(self) -> float:
        """Return the sampling rate [Hz]."""
        return float(self.rate or self.table["rate"])


def motor_unit_noise(
    n: int, channels: int, fs: float, table: Mapping | EmgTable, rng: np.random.Generator
) -> np.ndarray:
    r"""Draw noise of unit variance with the spectrum of a surface EMG interference pattern.

    The power spectrum is :math:`f^2 / ((f^2 + f_l^2)(f^2 + f_h^2)^2)` with :math:`f_h = 2 f_l` [1]_. :math:`f_l` is
    solved so that the pattern has the stated median frequency; the amplifier's band limits it.

    Parameters
    ----------
    n : int
        Number of samples.
    channels : int
        Number of independent channels.
    fs : float
        Sampling rate [Hz].
    table : mapping
        Keys ``median_frequency`` and ``band``, the amplifier's lower and upper corner [Hz].
    rng : numpy.random.Generator

    Returns
    -------
    ndarray
        Shape (channels, n).

    References
    ----------
    .. [1] E. Shwedyk, R. Balasubramanian, R. N. Scott, "A nonstationary model for the electromyogram", IEEE
       Transactions on Biomedical Engineering 24(5), 1977.
    """
    from scipy.fft import next_fast_len

    size = next_fast_len(max(n, 2), real=True)
    f = np.fft.rfftfreq(size, 1.0 / fs)
    low, high = table["band"]

    def power(f: np.ndarray, corner: float) -> np.ndarray:
        square = f * f
        fourth = square * square  # a power of 4 takes ten times as long
        pattern = square / ((square + corner**2) * (square + 4.0 * corner**2) ** 2)
        return pattern * (fourth / (fourth + low**4)) / (1.0 + fourth / high**4)

    grid = np.linspace(0.5, 1000.0, 2000)
    corner = float(table["median_frequency"])
    for _ in range(20):
        share = np.cumsum(power(grid, corner))
        corner *= table["median_frequency"] / np.interp(0.5 * share[-1], share, grid)
    shape = np.sqrt(power(f, corner))
    # Divide by the expected power of the shaped noise. The variance is 1 on average over draws, not in each draw.
    weight = np.full(len(f), 2.0)
    weight[0] = 1.0
    if size % 2 == 0:
        weight[-1] = 1.0
    shape /= np.sqrt(np.sum(weight * shape**2) / size)
    noise = rng.standard_normal((channels, size))
    # One channel after another, because a spectrum takes as much memory as its noise. SciPy would keep a plan of each
    # length.
    for row in noise:
        np.fft.irfft(np.fft.rfft(row) * shape, size, out=row)
    return noise[:, :n]


def _pieces(n: int) -> Iterator[slice]:
    """Divide `n` samples into slices of at most `PIECE_SAMPLE_COUNT`."""
    return (slice(first, min(first + PIECE_SAMPLE_COUNT, n)) for first in range(0, n, PIECE_SAMPLE_COUNT))


def _lines(weights: np.ndarray, step: float, part: slice) -> np.ndarray:
    """Return sums of sines, Im(sum_k weights[:, k - 1] exp(2 pi i k step t)), of the samples t in `part`.

    `weights` have the shape (channels, harmonics). Steps of many samples times single ones take few sines and one
    product of matrices.
    """
    many = 128
    order = 2.0 * np.pi * step * np.arange(1, weights.shape[1] + 1)
    coarse = weights[:, None, :] * np.exp(1j * np.arange(part.start, part.stop, many)[:, None] * order)
    fine = np.exp(1j * order[:, None] * np.arange(many))
    found = np.concatenate([coarse.real, coarse.imag], axis=2) @ np.concatenate([fine.imag, fine.real])
    return found.reshape(len(weights), -1)[:, : part.stop - part.start]


class EmgSynthesis:
    """The EMG of one trial, computed period by period as a controller gets it, or all at once.

    Both ways give the same samples.

    Parameters
    ----------
    electrodes : Electrodes
    periods : int
        Number of control periods.
    period : float
        Control period [s].
    rng : numpy.random.Generator

    Attributes
    ----------
    time : ndarray
        Time of each sample by the amplifier's clock, shape (k,) [s].
    quantum : float
        Quantum of the converter [V].
    """

    def __init__(self, electrodes: Electrodes, periods: int, period: float, rng: np.random.Generator) -> None:
        table, fs = electrodes.table, electrodes.fs
        channels = len(electrodes.gains)
        drift = 1.0 + table["clock_drift"]
        n = int(np.floor((periods * period - 1e-9) * fs / drift)) + 1
        self.time = np.arange(n) / fs
        true = self.time * drift
        # A sample belongs to the period in which it is taken, and reaches the controller at that period's end.
        self._period_of_sample = np.minimum((true / period + 1e-9).astype(int), periods - 1)
        self._periods = periods
        carrier = motor_unit_noise(n, channels, fs, table, rng)
        carrier *= np.asarray(electrodes.gains)[:, None]
        harmonics = np.array(table["harmonics"], float)
        mains = harmonics * np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, (len(harmonics), channels)).T)
        # Every cable has its own position: mains hum and motion artefacts differ between channels.
        scale = table["hum"] * rng.uniform(0.5, 1.5, (channels, 1))
        background = rng.standard_normal((channels, n))
        background *= table["baseline"]
        cable = rng.uniform(0.6, 1.4, channels) * rng.choice([-1.0, 1.0], channels)
        self._cable = (table["artefact"] * cable).tolist()
        self._pole = 1.0 - float(np.exp(-2.0 * np.pi * table["artefact_band"] * period))
        self._swing = 0.0
        self._crosstalk = float(table["crosstalk"])
        attached = np.ones((channels, n)) if electrodes.detached else np.broadcast_to(1.0, (channels, n))
        for part in _pieces(n):
            hum = _lines(scale * mains, table["hum_frequency"] * drift / fs, part)
            whole = hum + background[:, part]
            for channel, begin in electrodes.detached.items():
                # An open amplifier input acts as an antenna: it picks up much mains hum and no muscle signal.
                off = true[part] >= begin
                attached[channel, part][off] = 0.0
                whole[channel, off] += 30.0 * hum[channel, off] + 5.0 * background[channel, part][off]
            background[:, part] = whole
        ranges = np.full(channels, float(table["full_range"]))
        for channel, limit in electrodes.clipped.items():
            ranges[channel] = limit
        self.quantum = float(table["quantum"])
        self._limits = np.floor(ranges / self.quantum).tolist()
        self._ingredients = carrier, attached, background
        self._samples: list | None = None

    def period(self, k: int, amplitude: Sequence[float], acceleration: float) -> list[tuple[float, ...]]:
        """Return the samples that are taken during period `k` [V], each with one number per channel.

        Periods must be asked for in order, because the cables' motion is filtered over time. `amplitude` is the
        excitation of each muscle [1], `acceleration` the limb's [rad/s^2].
        """
        if self._samples is None:
            self._first = np.searchsorted(self._period_of_sample, np.arange(self._periods + 1)).tolist()
            self._samples = list(zip(*(x.T.tolist() for x in self._ingredients), strict=True))
        self._swing = self._pole * acceleration + (1.0 - self._pole) * self._swing
        made = []
        for carrier, attached, background in self._samples[self._first[k] : self._first[k + 1]]:
            muscles = [c * a for c, a in zip(carrier, amplitude, strict=True)]
            total = sum(muscles)
            sample = []
            for i, muscle in enumerate(muscles):
                picked = (muscle + self._crosstalk * (total - muscle)) * attached[i]
                counts = round((picked + background[i] + self._cable[i] * self._swing) / self.quantum)
                limit = self._limits[i]
                sample.append(self.quantum * (limit if counts > limit else max(counts, -limit)))
            made.append(tuple(sample))
        return made

    def whole(self, amplitude: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return all samples of the trial as counts of the converter, shape (k, channels); to be called once, last.

        `amplitude` is the excitation of each muscle in each period, shape (periods, channels) [1]; `acceleration` the
        limb's, shape (periods,) [rad/s^2].
        """
        from scipy.signal import lfilter

        swing = lfilter([self._pole], [1.0, self._pole - 1.0], acceleration)
        carrier, attached, background = self._ingredients
        # The counts take the place of the carrier, which has the size of a recording.
        counts = carrier
        del self._ingredients
        amplitude, cable = np.asarray(amplitude, float), np.array(self._cable)[:, None]
        limit = np.array(self._limits)[:, None]
        for part in _pieces(carrier.shape[1]):
            period_index = self._period_of_sample[part]
            muscles = carrier[:, part] * amplitude[period_index].T
            picked = (muscles + self._crosstalk * (muscles.sum(axis=0) - muscles)) * attached[:, part]
            volts = picked + background[:, part] + cable * swing[period_index]
            np.clip(np.round(volts / self.quantum), -limit, limit, out=counts[:, part])
        return counts.T
