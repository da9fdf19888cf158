"""Raw surface EMG as electrodes would pick it up from muscles whose excitation is known.

A muscle's signal is noise with the spectrum of many motor units, as strong as the excitation. On its way come the other
channel's cross-talk, mains hum, the cables' motion, the amplifier's own noise, and a converter with a range.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

PIECE_SAMPLE_COUNT = 1 << 14
"""Samples that are made at a time: as many as stay in a processor's cache."""


@dataclass(frozen=True)
class Electrodes:
    """Channels of one amplifier, and what is wrong with them."""

    gains: tuple[float, ...]  # Of each channel: RMS at full excitation [V]
    # A rig's ``[emg]``: rate, band, median_frequency, baseline, hum, hum_frequency, harmonics, artefact, artefact_band,
    # crosstalk, quantum, full_range; SI
    table: Mapping
    rate: float | None = None  # [Hz]; the table's if left out
    detached: Mapping[int, float] = field(default_factory=dict)  # By channel, from when its electrode is off [s]
    clipped: Mapping[int, float] = field(default_factory=dict)  # By channel, a range below the converter's [V]

    @property
    def fs(self) -> float:
        """Samples per second [Hz]."""
        return float(self.rate or self.table["rate"])


def motor_unit_noise(n: int, channels: int, fs: float, table: Mapping, rng: np.random.Generator) -> np.ndarray:
    r"""Noise of unit variance with the spectrum of an interference pattern, shape (channels, n).

    The power is :math:`f^2 / ((f^2 + f_l^2)(f^2 + f_h^2)^2)` with :math:`f_h = 2 f_l`, scaled to the median frequency,
    between the amplifier's corners [1]_.

    `fs` [Hz]; `table` [Hz]; gives (channels, n).

    References
    ----------
    .. [1] E. Shwedyk, R. Balasubramanian, R. N. Scott, "A nonstationary model for the electromyogram", IEEE
       Transactions on Biomedical Engineering 24(5), 1977.
    """
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

    size = next_fast_len(max(n, 2), real=True)
    f = rfftfreq(size, 1.0 / fs)
    low, high = table["band"]

    def power(f: np.ndarray, corner: float) -> np.ndarray:
        pattern = f**2 / ((f**2 + corner**2) * (f**2 + 4.0 * corner**2) ** 2)
        return pattern * (f**4 / (f**4 + low**4)) / (1.0 + (f / high) ** 4)

    grid = np.linspace(0.5, 1000.0, 2000)
    corner = float(table["median_frequency"])
    for _ in range(20):
        share = np.cumsum(power(grid, corner))
        corner *= table["median_frequency"] / np.interp(0.5 * share[-1], share, grid)
    shape = np.sqrt(power(f, corner))
    # Mean power of what irfft makes of white noise under this shape: unit variance by design, not of each draw.
    weight = np.full(len(f), 2.0)
    weight[0] = 1.0
    if size % 2 == 0:
        weight[-1] = 1.0
    shape /= np.sqrt(np.sum(weight * shape**2) / size)
    spectrum = rfft(rng.standard_normal((channels, size)), axis=1, overwrite_x=True)
    spectrum *= shape
    return irfft(spectrum, size, axis=1, overwrite_x=True)[:, :n]


def _pieces(n: int) -> Iterator[slice]:
    return (slice(first, min(first + PIECE_SAMPLE_COUNT, n)) for first in range(0, n, PIECE_SAMPLE_COUNT))


class EmgSynthesis:
    """EMG of one trial, period by period as a controller gets it, or all of it at once; both give the same samples.
    `time` (k,) [s]; `quantum` [V]; `period` [s]."""

    def __init__(self, electrodes: Electrodes, periods: int, period: float, rng: np.random.Generator) -> None:
        table, fs = electrodes.table, electrodes.fs
        channels = len(electrodes.gains)
        drift = 1.0 + table["clock_drift"]
        n = int(np.floor((periods * period - 1e-9) * fs / drift)) + 1
        self.time = np.arange(n) / fs
        true = self.time * drift
        # A sample belongs to the period in which it is taken, and reaches the controller at that period's end.
        self._of_period = np.minimum((true / period + 1e-9).astype(int), periods - 1)
        self._periods = periods
        carrier = motor_unit_noise(n, channels, fs, table, rng)
        carrier *= np.asarray(electrodes.gains)[:, None]
        phases = [rng.uniform(0.0, 2.0 * np.pi, (channels, 1)) for _ in table["harmonics"]]
        # Every cable lies differently: in the mains' field, and in the way of the leg.
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
            mains = np.zeros((channels, len(true[part])))
            for i, (size, phase) in enumerate(zip(table["harmonics"], phases, strict=True)):
                mains += size * np.sin(2.0 * np.pi * (i + 1) * table["hum_frequency"] * true[part] + phase)
            hum = scale * mains
            whole = hum + background[:, part]
            for channel, begin in electrodes.detached.items():
                # An open input is an aerial: much mains, and no muscle.
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
        """Samples taken during period `k`; periods one after another. `acceleration` [rad/s^2]; gives [V]."""
        if self._samples is None:
            self._first = np.searchsorted(self._of_period, np.arange(self._periods + 1)).tolist()
            self._samples = list(zip(*(x.T.tolist() for x in self._ingredients), strict=True))
        self._swing = self._pole * acceleration + (1.0 - self._pole) * self._swing
        made = []
        for carrier, attached, background in self._samples[self._first[k] : self._first[k + 1]]:
            muscles = [c * a for c, a in zip(carrier, amplitude, strict=True)]
            total = sum(muscles)
            sample = []
            for i, own in enumerate(muscles):
                picked = (own + self._crosstalk * (total - own)) * attached[i]
                counts = round((picked + background[i] + self._cable[i] * self._swing) / self.quantum)
                limit = self._limits[i]
                sample.append(self.quantum * (limit if counts > limit else max(counts, -limit)))
            made.append(tuple(sample))
        return made

    def whole(self, amplitude: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """All samples of the trial. `amplitude` (periods, channels); `acceleration` (periods,) [rad/s^2]; gives (k,
        channels)."""
        from scipy.signal import lfilter

        swing = lfilter([self._pole], [1.0, self._pole - 1.0], acceleration)
        carrier, attached, background = self._ingredients
        amplitude, cable = np.asarray(amplitude, float), np.array(self._cable)[:, None]
        limit = np.array(self._limits)[:, None]
        counts = np.empty(carrier.shape)
        for part in _pieces(carrier.shape[1]):
            when = self._of_period[part]
            muscles = carrier[:, part] * amplitude[when].T
            picked = (muscles + self._crosstalk * (muscles.sum(axis=0) - muscles)) * attached[:, part]
            volts = picked + background[:, part] + cable * swing[when]
            np.clip(np.round(volts / self.quantum), -limit, limit, out=counts[:, part])
        return counts.T
