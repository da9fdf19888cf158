r"""Sums of sines with random phases, which separate linear response, noise and non-linear distortion [1]_.

.. math::  r_m(t) = c + \sum_{k \in L} A_k \cos(2\pi k t / T + \phi_{mk}), \qquad \phi_{mk} \sim U[0, 2\pi)

Every realisation m has the same lines L and amplitudes, and phases of its own. Over periods only noise changes; over
realisations what is not linear changes too. Lines that are left out show what a non-linearity puts there: at even ones
what even powers make, at odd ones what odd powers make.

.. [1] R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., Wiley, 2012, ch. 4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import PellucidError

MULTISINE_NAME = "random_phase_multisine"
"""Name of this motion in study.toml, as the `protocol` of a recording."""

LINE_CHOICES = ("full", "odd", "odd_random")
"""Excited lines: all harmonics in the band, the odd ones, or the odd ones less a random one of each group."""

LINE_GROUP_SIZE = 4
"""Number of odd lines in a group; with ``"odd_random"`` one of each group is left out."""

PEAK_OVERSAMPLING = 4
"""Peaks are sought on a grid this many times finer than the samples."""


@dataclass(frozen=True, eq=False)
class RandomPhaseMultisine:
    """Periodic references that differ in their phases alone."""

    rate: float  # sampling rate [Hz]
    samples: int  # number of samples N of one period
    lines: np.ndarray  # (k,) excited harmonics of the period
    amplitude: np.ndarray  # (k,) amplitudes of the sines, in the reference's unit
    phases: np.ndarray  # (m, k) [rad]
    periods: int  # number of measured periods
    settle: int  # number of periods before those, for easing in and transients

    @property
    def period(self) -> float:
        """Duration of one period [s]."""
        return self.samples / self.rate

    @property
    def realisations(self) -> int:
        """Number of realisations."""
        return len(self.phases)

    @property
    def frequency(self) -> np.ndarray:
        """Frequencies of the excited lines, (k,) [Hz]."""
        return self.lines / self.period

    @property
    def left_out(self) -> np.ndarray:
        """Harmonics within the band that are not excited, shape (d,)."""
        return np.setdiff1d(np.arange(self.lines[0], self.lines[-1] + 1), self.lines)

    def one_period(self, realisation: int) -> np.ndarray:
        """Return one period of a realisation about 0, shape (N,)."""
        return self._waves(realisation, self.samples)

    def reference(self, realisation: int, centre: float = 0.0) -> np.ndarray:
        """Return the reference to follow, (n,): rest at `centre`, `settle` periods, then `periods` measured ones."""
        wave = np.tile(self.one_period(realisation), self.settle + self.periods)
        if self.settle:
            u = np.minimum(np.arange(len(wave)) / self.samples, 1.0)
            wave = wave * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        return centre + wave

    def _waves(self, realisation: int, points: int) -> np.ndarray:
        spectrum = np.zeros(points // 2 + 1, complex)
        spectrum[self.lines] = 0.5 * points * self.amplitude * np.exp(1j * self.phases[realisation])
        return np.fft.irfft(spectrum, points)

    @property
    def peak(self) -> float:
        """Largest excursion of all realisations, also between samples."""
        return max(
            float(np.abs(self._waves(m, PEAK_OVERSAMPLING * self.samples)).max()) for m in range(self.realisations)
        )


def random_phase_multisine(
    rate: float,
    *,
    low: float,
    high: float,
    resolution: float,
    rms: float,
    seed: int,
    peak: float | None = None,
    lines: str = "odd_random",
    realisations: int = 7,
    periods: int = 4,
    settle: int = 1,
    fall: float = 0.0,
) -> RandomPhaseMultisine:
    """Draw references from a band, an RMS and a seed.

    `rate` is the sampling rate, `low` to `high` the band, and `resolution` one over the period [Hz]. `rms` is that of
    the excursion; it is lowered if a realisation would exceed `peak`. Amplitudes fall with frequency to the power
    `fall`.
    """
    for name, value in {"rate": rate, "resolution": resolution, "rms": rms}.items():
        if not (np.isfinite(value) and value > 0.0):
            raise PellucidError(f"multisine: found {name} {value}, expected a finite number > 0")
    if not 0.0 < low < high < 0.5 * rate:
        raise PellucidError(f"multisine: found a band of {low:g} to {high:g} Hz at {rate:g} Hz, expected it below half")
    if peak is not None and not peak > 0.0:
        raise PellucidError(f"multisine: found peak {peak}, expected a number > 0")
    if lines not in LINE_CHOICES:
        raise PellucidError(f"multisine: found lines {lines!r}, expected one of {', '.join(LINE_CHOICES)}")
    if realisations < 1 or periods < 2 or settle < 0:
        raise PellucidError(
            f"multisine: found {realisations} realisations, {periods} periods, {settle} to settle; expected at least "
            "1, 2 and 0: noise shows from period to period"
        )
    samples = round(rate / resolution)
    # The band is rounded outwards by less than a line: 0.1 Hz at a resolution of 0.1 Hz is line 1.
    every = np.arange(np.ceil(low * samples / rate - 1e-6), np.floor(high * samples / rate + 1e-6) + 1).astype(int)
    every = every[every >= 1]
    rng = np.random.default_rng(seed)
    chosen = every if lines == "full" else every[every % 2 == 1]
    if lines == "odd_random":
        groups = [chosen[i : i + LINE_GROUP_SIZE] for i in range(0, len(chosen), LINE_GROUP_SIZE)]
        out = [group[rng.integers(LINE_GROUP_SIZE)] for group in groups if len(group) == LINE_GROUP_SIZE]
        chosen = np.setdiff1d(chosen, out)
    if len(chosen) < 2:
        raise PellucidError(
            f"multisine: found {len(chosen)} lines within {low:g} to {high:g} Hz, expected two at least: a finer "
            "resolution or a wider band"
        )
    shape = (chosen / chosen[0]) ** -fall
    shape *= rms / np.sqrt(0.5 * np.sum(shape**2))
    phases = rng.uniform(0.0, 2.0 * np.pi, (realisations, len(chosen)))
    made = RandomPhaseMultisine(rate, samples, chosen, shape, phases, periods, settle)
    if peak is not None and made.peak > peak:
        shape = shape * (peak / made.peak)
        made = RandomPhaseMultisine(rate, samples, chosen, shape, phases, periods, settle)
    return made
