r"""Reference trajectories that excite a joint's parameters.

Multisines follow the finite Fourier series that is standard in robot identification [1]_; `point_to_point` moves with
bounded acceleration between random targets, so that inertia shows while the velocity changes and friction while it does
not [2]_.

A swept sine of constant amplitude, with its exact velocity and acceleration.

The pulsation is to grow as :math:`\omega(t) = \omega_0 + c\,t/T`. Two signals go by that description:

.. math::
   \text{integrated:}\quad \phi &= \int_0^t \omega = \omega_0 t + \tfrac{c}{2T} t^2, & \dot\phi &= \omega(t) \\
   \text{literal:}\quad \phi &= \omega(t)\,t = \omega_0 t + \tfrac{c}{T} t^2, & \dot\phi &= \omega_0 + 2 c\,t/T

The literal one sweeps twice as far as the law says. It is here because papers print it [3]_ and some labs ran it; a
protocol of one's own wants the integrated one.

Sums of sines with random phases, which separate linear response, noise and non-linear distortion [4]_.

.. math::  r_m(t) = c + \sum_{k \in L} A_k \cos(2\pi k t / T + \phi_{mk}), \qquad \phi_{mk} \sim U[0, 2\pi)

Every realisation m has the same lines L and amplitudes, and its own phases. Only noise changes from period to period;
distortion also changes from realisation to realisation. Lines without excitation show non-linear distortion directly:
even lines that of even powers, odd lines that of odd powers.

Small slow reversals of growing size: the motion that shows presliding friction.

Contacts that give before they slip look like springs in strokes shorter than their travel, and like friction in longer
ones. A series of growing strokes around several angles shows both regimes and the transition
[5]_. It needs an encoder some ten times finer than the travel, strokes so slow that inertia is small compared with
friction, and the largest stroke several travels wide. Under a position controller without integral action the joint
follows only once the controller's effort exceeds friction, so that references grow until it does: from a hundredth of a
degree in stiff loops up to a few degrees in soft ones. For an effort instead of a position, the same series grows
from 0.1 to 1.5 times the friction's level.

.. [1] J. Swevers, C. Ganseman, D. B. Tukel, J. De Schutter, H. Van Brussel, "Optimal robot excitation and
   identification", IEEE Trans. Robot. Autom. 13, 1997.
.. [2] M. Gautier, "Dynamic identification of robots with power model", Proc. IEEE ICRA, 1997.
.. [3] D. Verdel et al., "An identification-based method improving the transparency of a robotic upper limb
   exoskeleton", Robotica, 2021, eq. 5: T = 25 s, start 1 rad/s, growth 3 rad/s.
.. [4] R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., Wiley, 2012, ch. 4.
.. [5] V. Lampaert, J. Swevers, F. Al-Bender, "Modification of the Leuven integrated friction model structure", IEEE
   Trans. Automatic Control 47(4), 2002.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError, PellucidError


def multisine(
    duration: float,
    fs: float,
    *,
    fundamental: float,
    harmonics: int,
    amplitude: float,
    centre: float,
    rng: np.random.Generator,
) -> np.ndarray:
    r"""Return a periodic position, shape (n,): harmonics with random phases and amplitudes falling as 1 / harmonic.

    .. math::  q(t) = q_0 + \sum_k \frac{A}{k} \sin(2\pi k f_0 t + \phi_k)

    scaled so that the largest excursion from the centre is `amplitude`, and eased in over half a period so that it
    starts at rest.

    `duration`, `fs` [s], [Hz]; `fundamental` [Hz]; `amplitude`, `centre` [rad or m]; gives (n,) [rad or m].
    """
    time = np.arange(round(duration * fs)) / fs
    order = np.arange(1, harmonics + 1)
    phases = rng.uniform(0.0, 2.0 * np.pi, harmonics)
    shape = np.sin(2.0 * np.pi * fundamental * time[:, None] * order + phases) @ (1.0 / order)
    ease = np.clip(time * 2.0 * fundamental, 0.0, 1.0)
    ease = ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
    return centre + amplitude * ease * shape / np.abs(shape).max()


def point_to_point(
    duration: float,
    fs: float,
    *,
    low: float,
    high: float,
    velocity: float,
    acceleration: float,
    dwell: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return a position, shape (n,), that moves between random targets with trapezoidal velocity and rests at each.

    `duration`, `fs` [s], [Hz]; `low`, `high` [rad or m]; `velocity`, `acceleration` [rad/s or m/s; per second];
    `dwell` [s]; gives (n,) [rad or m].
    """
    n = round(duration * fs)
    pieces, here, filled = [np.full(round(dwell * fs), 0.5 * (low + high))], 0.5 * (low + high), round(dwell * fs)
    while filled < n:
        target = rng.uniform(low, high)
        # A move shorter than a fifth of the range shows little: take the far end instead.
        if abs(target - here) < 0.2 * (high - low):
            target = high if here < 0.5 * (low + high) else low
        move = trapezoid(target - here, velocity * rng.uniform(0.2, 1.0), acceleration, fs)
        pieces += [here + move, np.full(round(dwell * fs), target)]
        filled += len(move) + round(dwell * fs)
        here = target
    return np.concatenate(pieces)[:n]


def trapezoid(distance: float, velocity: float, acceleration: float, fs: float) -> np.ndarray:
    """Return a move from rest to rest with constant velocity between constant accelerations, (n,) [rad or m].

    `distance` [rad or m]; `velocity`, `acceleration` [rad/s or m/s; per second]; `fs` [Hz].
    """
    size = abs(distance)
    velocity = min(velocity, np.sqrt(size * acceleration))
    ramp = velocity / acceleration
    total = size / velocity + ramp
    time = np.arange(1, round(total * fs) + 1) / fs
    rising = 0.5 * acceleration * np.minimum(time, ramp) ** 2
    cruising = velocity * np.clip(time - ramp, 0.0, total - 2.0 * ramp)
    braking = np.clip(time - (total - ramp), 0.0, ramp)
    return np.sign(distance) * np.minimum(
        rising + cruising + velocity * braking - 0.5 * acceleration * braking**2, size
    )


def swept_sine(
    duration: float, fs: float, *, amplitude: float, start: float, growth: float, literal: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position A sin(phi), velocity and acceleration, (n,) each, [rad or m] and per second.

    `duration` [s]; `fs` [Hz]; `amplitude` [rad or m]; `start`, `growth` [rad/s]. The derivatives are analytic.
    """
    if not duration > 0.0 or not fs > 0.0:
        raise PellucidError(f"swept sine: duration {duration} s at {fs} Hz; both must be positive")
    time = np.arange(round(duration * fs)) / fs
    bend = (1.0 if literal else 0.5) * growth / duration  # rad/s^2; half the pulsation's slope
    phase = (start + bend * time) * time
    pulsation = start + 2.0 * bend * time
    sine, cosine = np.sin(phase), np.cos(phase)
    return (
        amplitude * sine,
        amplitude * pulsation * cosine,
        amplitude * (2.0 * bend * cosine - pulsation**2 * sine),
    )


MULTISINE_NAME = "random_phase_multisine"
"""Name of this motion in study.toml, as the `protocol` of a recording."""

LINE_CHOICES = ("full", "odd", "odd_random")
"""Excited lines: all harmonics in the band, the odd ones, or the odd ones less a random one of each group."""

LINE_GROUP_SIZE = 4
"""Number of odd lines in a group; with ``"odd_random"`` one of each group is not excited."""

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


REVERSALS_NAME = "reversals"
"""Name of this motion in study.toml, as the `protocol` of a recording."""

MOVE_DURATION_S = 1.0
"""Time for the move to the next centre, including a rest in its last fifth [s]."""


def reversals(
    duration: float,
    fs: float,
    *,
    smallest: float,
    largest: float,
    frequency: float,
    centres: Sequence[float],
) -> np.ndarray:
    """Return a position or an effort, (n,): whole sines around each of the `centres` in turn.

    Each sine is larger than the last by the same factor.

    `duration`, `fs` [s], [Hz]; `smallest`, `largest` amplitude and `centres` [rad or m]; `frequency` [Hz]; gives (n,).
    """
    share = duration / max(len(centres), 1)
    strokes = int((share - MOVE_DURATION_S) * frequency)
    if len(centres) == 0 or strokes < 3 or not 0.0 < smallest < largest:
        raise IdentificationError(
            f"reversals: found {len(centres)} centres, {strokes} strokes around each, of {smallest:g} to {largest:g}; "
            "expected at least 1 centre, 3 strokes and a largest stroke above the smallest: give more time or centres"
        )
    sizes = np.geomspace(smallest, largest, strokes)
    ends = np.round(np.linspace(0.0, duration * fs, len(centres) + 1)).astype(int)
    pieces, here = [], centres[0]
    for centre, first, last in zip(centres, ends, ends[1:], strict=False):
        time = np.arange(last - first) / fs
        ease = np.clip(time / (0.8 * MOVE_DURATION_S), 0.0, 1.0)
        turns = np.maximum(time - MOVE_DURATION_S, 0.0) * frequency
        size = np.append(sizes, 0.0)[np.minimum(turns.astype(int), strokes)]
        moved = (centre - here) * ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
        pieces.append(here + moved + size * np.sin(2.0 * np.pi * turns))
        here = centre
    return np.concatenate(pieces)
