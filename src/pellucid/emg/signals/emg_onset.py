r"""Onset of muscle activity: bursts detected by their energy relative to rest, and the interval of each onset.

**Bursts.** Raw EMG passes a band-pass and the Teager-Kaiser operator [1]_ [2]_, which weighs amplitude by frequency,

.. math::  \psi_n = x_n^2 - x_{n-1} x_{n+1},

is smoothed and compared with two thresholds [3]_: a level (mean of rest plus `height` standard deviations) and a
duration (`shortest`). A muscle is active where the smoothed energy exceeds both.

**Change point.** Around each beginning the band-passed samples are taken for Gaussian, with the standard deviation
:math:`\sigma_0` before :math:`t_0`, at least that of rest, and one that rises to the burst's within r after it. EMG
adds to noise in power, so that variances add: an amplitude that rises evenly is the exponent p = 2, one that begins
slowly 3.
Samples of EMG are alike for :math:`\kappa = \sum_k \rho_k^2` of them, so that many count as one:

.. math::
   \ell(t_0, r, p, \sigma_0, \sigma_1) = -\frac{1}{\kappa} \sum_n \Big(\log\sigma_n + \frac{x_n^2}{2\sigma_n^2}\Big),
   \qquad \sigma_n^2 = \sigma_0^2 + (\sigma_1^2 - \sigma_0^2)\,\mathrm{clip}\Big(\frac{t_n - t_0}{r}, 0, 1\Big)^p.

The profile of this likelihood over r, p and both deviations is largest at the onset. The interval contains every
:math:`t_0` whose profile lies within half the quantile of :math:`\chi^2_2` of the largest: the joint confidence region
of onset and rise. A sum over r and p would favour slow rises, which many :math:`t_0` fit a little. :math:`\kappa` has
two lower bounds from energies over 50 ms. One is the burst's own, which varies more than Gaussian samples if few motor
units fire. The other is that of all samples about the likeliest rise, which shows where no tried shape fits.
The end of a burst is the onset of the same samples backwards.

.. [1] S. Solnik, P. Rider, K. Steinweg, P. DeVita, T. Hortobagyi, "Teager-Kaiser energy operator signal conditioning
   improves EMG onset detection", European Journal of Applied Physiology 110, 2010.
.. [2] J. F. Kaiser, "On a simple algorithm to calculate the energy of a signal", ICASSP, 1990.
.. [3] P. Bonato, T. D'Alessio, M. Knaflitz, "A statistical method for the measurement of muscle activation intervals
   from surface myoelectric signal during gait", IEEE Transactions on Biomedical Engineering 45, 1998.

Onsets of muscles from arrays of raw EMG.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal, stats
from scipy.fft import irfft, next_fast_len, rfft

from ..._errors import RecordingError
from ...numerics.filters import runs
from .emg_chain import settling_samples, with_surroundings
from .emg_findings import EmgFinding, dropouts, emg_quality, envelope_words

ENVELOPE_CAUSE = "an envelope, not raw EMG"
"""Cause of a missed onset where a channel is no raw EMG."""

OTHER_CAUSE = "EMG unsuitable for onset detection"
"""Cause of a missed onset where samples, rate or duration do not suffice."""


class UnseenOnsetError(RecordingError):
    """No onset can be detected in a channel: the message, and its `cause` in few words."""

    def __init__(self, message: str, cause: str = OTHER_CAUSE) -> None:
        super().__init__(message)
        self.cause = cause


@dataclass(frozen=True)
class OnsetSettings:
    """Settings of the search for bursts and their change points."""

    bandpass_hz: tuple[float, float] = (30.0, 300.0)  # Band of the band-pass before the energy operator, as published
    energy_lowpass_hz: float = 50.0  # Cut-off of the zero-phase low-pass on the energy [Hz], as published
    height: float = 15.0  # Default threshold of the energy, in standard deviations of rest above its mean
    min_burst_s: float = 0.025  # The energy must stay above its threshold for at least this time to count as a burst
    min_pause_s: float = 0.1  # Shorter pauses belong to one burst
    # A burst that crosses the threshold earlier than this in a recording began before it
    min_first_onset_s: float = 0.05
    rest_s: float = 0.5  # Length of the quietest stretch, which stands for rest by default
    # Smallest ratio of the RMS of activity to that of rest; below it a recording has no rest, or no activity
    min_contrast: float = 2.0
    search_before_s: float = 0.6  # The change point is searched up to this time before the threshold crossing
    search_after_s: float = 0.3  # The change point is searched up to this time after the threshold crossing
    fitted_s: float = 1.2  # Samples up to this time after the threshold crossing are fitted
    max_block_s: float = 0.002  # Squares are summed over blocks of about this length: an onset is found no finer
    # Powers of time with which the variance rises that an onset is tried with. At 2 the amplitude rises evenly. At 3 it
    # begins slowly, as where the first motor units are small.
    rise_exponents: tuple[float, float] = (2.0, 3.0)
    # Number of levels before the rise that an onset is tried with, from that of rest to half the burst's. A muscle may
    # be more active between two bursts than at rest.
    floor_count: int = 4
    dispersion_block_s: float = 0.05  # Length of the blocks whose energies show how much a burst varies
    min_dispersion_blocks: int = 6  # With fewer blocks in a burst their energies say nothing


ONSET_SEARCH = OnsetSettings()


RISE_TIMES_S = (0.0, *(float(rise) for rise in np.geomspace(0.02, 0.8, 15)))
"""Rise times that an onset is tried with. Neighbours are 30 % apart: a coarser grid moves the onset between them."""

PLATEAU_FACTORS = np.geomspace(0.7, 1.4, 4)
"""Levels after the rise that an onset is tried with, relative to the burst's RMS."""


@dataclass(frozen=True)
class ChangePoint:
    """The time of an onset or end, with its interval."""

    time: float  # most likely time [s]
    low: float  # lower end of the interval [s]
    high: float  # upper end of the interval [s]


@dataclass(frozen=True)
class Burst:
    """One burst of muscle activity."""

    onset: ChangePoint
    end: ChangePoint
    crossed: float  # time at which the energy crossed its threshold [s]
    rms: float  # RMS of the band-passed samples in the burst [V]
    seen: bool = True  # whether the onset lies in the recording; False where the recording begins within the burst

    @property
    def duration(self) -> float:
        """Time from onset to end [s]."""
        return self.end.time - self.onset.time


@dataclass(frozen=True, eq=False)
class Activations:
    """Bursts of one muscle in one recording of raw EMG."""

    bursts: tuple[Burst, ...]
    rest: tuple[float, float]  # stretch that was used as rest [s]
    rest_rms: float  # RMS of the band-passed samples at rest [V]
    energy: np.ndarray = field(repr=False)  # (n,) smoothed energy [V^2]
    level: float  # threshold of the energy [V^2]
    # stretches with artefacts, in which an interval need not cover an onset, and a burst may be none
    doubtful: tuple[EmgFinding, ...] = ()

    @property
    def active(self) -> float:
        """Total duration of all bursts [s]."""
        return float(sum(burst.duration for burst in self.bursts))


def activations(
    time: np.ndarray,
    samples: np.ndarray,
    *,
    rest: tuple[float, float] | None = None,
    height: float = ONSET_SEARCH.height,
    shortest: float = ONSET_SEARCH.min_burst_s,
    pause: float = ONSET_SEARCH.min_pause_s,
    level: float = 0.95,
    inside: slice | None = None,
) -> Activations:
    """Bursts of raw EMG. `time` (n,) [s]; `samples` (n,) [V]; `rest` [s]; `level` is the intervals' probability;
    bursts are those `inside`, with what lies around it filtered as well."""
    made = _energy(time, samples, rest, height, inside)
    both = _one_way(made.raw, made.fs, made.own, made.still)
    crossed = _bursts(made.energy > made.level, made.fs, shortest, pause)
    # A beginning lies behind the end of the burst before, an end before the beginning of the next.
    edges = [0, *(round(0.5 * (a[1] + b[0])) for a, b in pairwise(crossed)), len(made.time) - 1]
    found = [
        _burst(made.time, made.passed, both, each, around, made.fs, level)
        for each, around in zip(crossed, pairwise(edges), strict=False)  # without a burst a pair is left over
    ]
    resting = made.time[made.still]
    own = np.asarray(samples, float)[slice(0, len(time)) if inside is None else inside]
    return Activations(
        tuple(found), (float(resting[0]), float(resting[-1])), made.rest_rms, made.energy, made.level,
        _doubtful_stretches(made.time, own, made.fs),
    )  # fmt: skip


DOUBTFUL_KINDS = ("motion", "heartbeat", "mvc_artefact", "dropout", "saturation", "mains")
"""Kinds of findings that move onsets, or make bursts that are none."""


def _doubtful_stretches(time: np.ndarray, samples: np.ndarray, fs: float) -> tuple[EmgFinding, ...]:
    """Return the stretches of raw EMG, (n,) [V], whose onsets artefacts may move, at the times of the recording."""
    found = (one for one in emg_quality(samples, rate=fs) if one.kind in DOUBTFUL_KINDS)
    return tuple(replace(one, start=time[0] + one.start, end=time[0] + one.end) for one in found)


def require_activity(
    time: np.ndarray,
    samples: np.ndarray,
    *,
    rest: tuple[float, float] | None = None,
    height: float = ONSET_SEARCH.height,
    inside: slice | None = None,
) -> None:
    """Raise the errors of `activations` without searching any onset, which takes most of its time."""
    _energy(time, samples, rest, height, inside)


WEAK_CAUSE = f"activity below {ONSET_SEARCH.min_contrast:g} times the RMS of rest"
"""Cause of a missed onset where a muscle is hardly more active than at rest."""


@dataclass(frozen=True, eq=False)
class _Energy:
    """Energy of raw EMG with its threshold, and what it was made of."""

    fs: float  # rate [Hz]
    time: np.ndarray  # (n,) [s]
    raw: np.ndarray  # (m,) samples with what lies around them, without their mean [V]
    own: slice  # samples of the recording in `raw`
    passed: np.ndarray  # (n,) band-passed samples [V]
    energy: np.ndarray  # (n,) smoothed energy [V^2]
    still: slice  # samples at rest
    rest_rms: float  # RMS of the band-passed samples at rest [V]
    level: float  # threshold of the energy [V^2]


def _energy(
    time: np.ndarray, samples: np.ndarray, rest: tuple[float, float] | None, height: float, inside: slice | None
) -> _Energy:
    """Return the energy of raw EMG; raise a RecordingError where no rest and no activity can be told."""
    time, samples = np.asarray(time, float), np.asarray(samples, float)
    inside = slice(0, len(time)) if inside is None else inside
    part = time[inside]
    fs = (len(part) - 1) / (part[-1] - part[0])
    _require(part, samples[inside], fs)
    band = signal.butter(3, ONSET_SEARCH.bandpass_hz, "bandpass", fs=fs, output="sos")
    smoothing = signal.butter(2, ONSET_SEARCH.energy_lowpass_hz, fs=fs, output="sos")
    around = with_surroundings(samples, inside, settling_samples(band) + settling_samples(smoothing))
    own = slice(inside.start - around.start, inside.stop - around.start)
    raw, time = samples[around] - samples[inside].mean(), part
    passed = _both_ways(band, raw, "odd")
    energy = np.maximum(_both_ways(smoothing, np.abs(teager_kaiser(passed)), "even"), 0.0)[own]
    passed, samples = passed[own], samples[inside]
    still = _stretch(time, rest) if rest is not None else _quietest(energy, fs, dropouts(samples, fs))
    rest_rms = float(np.sqrt(np.mean(passed[still] ** 2)))
    spread = float(np.std(energy[still]))
    passes = float(np.mean(energy[still])) + height * spread
    busy = float(np.sqrt(np.quantile(_mean_square(passed, fs), 0.95)))
    if not rest_rms > 0.0 or np.ptp(samples[still]) == 0.0:
        raise RecordingError("found no signal during rest, expected at least the noise of an amplifier")
    if busy < ONSET_SEARCH.min_contrast * rest_rms:
        raise UnseenOnsetError(
            f"found activity of {busy / rest_rms:.3g} times the RMS of rest ({time[still][0]:.4g} to "
            f"{time[still][-1]:.4g} s), expected at least {ONSET_SEARCH.min_contrast:g} times: a recording with "
            "rest and with activity",
            WEAK_CAUSE,
        )
    return _Energy(fs, time, raw, own, passed, energy, still, rest_rms, passes)


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
    low, high = ONSET_SEARCH.bandpass_hz
    if not fs > 2.0 * high:
        raise RecordingError(
            f"found a rate of {fs:.4g} Hz, expected raw EMG at more than {2.0 * high:g} Hz: onset is detected between "
            f"{low:g} and {high:g} Hz"
        )
    if time[-1] - time[0] < 2.0 * ONSET_SEARCH.rest_s:
        raise RecordingError(
            f"found {time[-1] - time[0]:.3g} s of EMG, expected at least {2.0 * ONSET_SEARCH.rest_s:g} s"
        )
    said = envelope_words(samples, fs)
    if said:
        raise UnseenOnsetError(f"found {said}, expected raw EMG", ENVELOPE_CAUSE)


def _stretch(time: np.ndarray, rest: tuple[float, float]) -> slice:
    first, last = np.searchsorted(time, rest)
    if last - first < 0.1 / (time[1] - time[0]):
        raise RecordingError(
            f"found {max(last - first, 0)} samples of rest between {rest[0]:g} and {rest[1]:g} s, expected 0.1 s of it "
            f"within {time[0]:.4g} to {time[-1]:.4g} s"
        )
    return slice(int(first), int(last))


def _quietest(energy: np.ndarray, fs: float, gone: Sequence[slice]) -> slice:
    """Where the largest energy within `ONSET_SEARCH.rest_s` is least: a mean would forgive a twitch.

    Dropouts, where samples are `gone`, are no rest of a muscle, unless nothing else is long enough.
    """
    from scipy.ndimage import maximum_filter1d

    n = round(ONSET_SEARCH.rest_s * fs)
    known = energy.copy()
    for part in gone:
        known[part] = np.inf
    if np.isfinite(maximum_filter1d(known, n)[n // 2 : len(known) - n + n // 2 + 1]).any():
        energy = known
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


def _both_ways(sections: np.ndarray, samples: np.ndarray, padtype: str) -> np.ndarray:
    """Run samples, (n,), through a filter both ways, extended at both ends for as long as it takes to settle."""
    padding = min(settling_samples(sections), len(samples) - 1)
    return signal.sosfiltfilt(sections, samples, padtype=padtype, padlen=padding)


def _one_way(samples: np.ndarray, fs: float, own: slice, still: slice) -> tuple[np.ndarray, np.ndarray]:
    """The `own` samples over the RMS of rest, passed forwards, and the same backwards from the end: a filter that runs
    both ways would bring a beginning forward, by its ringing."""
    sos = signal.butter(1, ONSET_SEARCH.bandpass_hz, "bandpass", fs=fs, output="sos")
    made = signal.sosfilt(sos, samples)[own], signal.sosfilt(sos, samples[::-1])[::-1][own]
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
        bool(first > ONSET_SEARCH.min_first_onset_s * fs),
    )


def _change(x: np.ndarray, before: int, first: int, last: int, fs: float, level: float) -> np.ndarray:
    """Return the lower end, the estimate and the upper end of the sample at which `x`, in RMS of rest, begins to rise.

    The search lies around `first`, the sample that crossed the threshold, and not ahead of `before`.
    """
    low = max(before, first - round(ONSET_SEARCH.search_before_s * fs))
    after = first + round(ONSET_SEARCH.fitted_s * fs)
    end = min(len(x), max(min(last + 1, after), first + round(ONSET_SEARCH.min_burst_s * fs)))
    block = max(1, round(ONSET_SEARCH.max_block_s * fs))
    count = (end - low) // block
    squares = (x[low : low + count * block] ** 2).reshape(count, block).sum(axis=1)
    places = np.arange(min((first - low + round(ONSET_SEARCH.search_after_s * fs)) // block, count - 1))
    burst = float(np.sqrt(np.mean(x[first:end] ** 2)))
    floors = np.geomspace(1.0, max(0.5 * burst, 1.0), ONSET_SEARCH.floor_count)
    size = next_fast_len(2 * count, real=True)
    spectrum = rfft(squares, size)
    since = (np.arange(count) + 0.5) * block / fs  # Time since the onset at the middle of each block [s]
    profile, likeliest = np.full(len(places), -np.inf), np.full(count, burst)
    for rise in RISE_TIMES_S:
        ramp = np.clip(since / max(rise, 0.5 * block / fs), 0.0, 1.0)
        for floor, shape in product(
            floors, ONSET_SEARCH.rise_exponents if rise > 0.0 else ONSET_SEARCH.rise_exponents[:1]
        ):
            plateaus = np.maximum(PLATEAU_FACTORS * burst, floor)[:, None]
            sigma = np.sqrt(floor**2 + (plateaus**2 - floor**2) * ramp**shape)
            # Less what the floor would have said of the same samples: of all places at once.
            gain, cost = 0.5 * (1.0 / floor**2 - 1.0 / sigma**2), block * np.log(sigma / floor)
            told = irfft(spectrum * np.conj(rfft(gain, size, axis=1)), size, axis=1)[:, places]
            all_floor = -count * block * np.log(floor) - 0.5 * squares.sum() / floor**2
            logs = all_floor + told - np.cumsum(cost, axis=1)[:, count - 1 - places]
            if logs.max() > profile.max():
                k, place = np.unravel_index(np.argmax(logs), logs.shape)
                likeliest = np.concatenate((np.full(place, floor), sigma[k, : count - place]))
            profile = np.maximum(profile, logs.max(axis=0))
    best = int(np.argmax(profile))
    alike = max(
        _alike(x[first:end]),
        _energy_dispersion(x[first : last + 1], fs),
        _fit_dispersion(squares, block * likeliest**2, block, fs),
    )
    # The joint region of onset and rise, projected on the onset: two parameters.
    inside = np.flatnonzero(profile >= profile[best] - 0.5 * alike * float(stats.chi2.isf(1.0 - level, 2)))
    return low + block * np.array([inside[0] - 0.5, best, inside[-1] + 0.5])


def _alike(x: np.ndarray) -> float:
    """Return how many neighbours count as one where squares are summed, at least 1."""
    x = x - x.mean()
    most = min(len(x) - 1, 40)
    if most < 2 or not np.any(x):
        return 1.0
    rho = np.array([x[: len(x) - k] @ x[k:] for k in range(1, most)]) / (x @ x)
    return float(1.0 + 2.0 * np.sum(rho**2))


def _energy_dispersion(x: np.ndarray, fs: float) -> float:
    """Return how many samples count as one by how much the energy of a burst varies from block to block.

    Independent Gaussian samples vary by their number alone. Motor units that fire a few times in a block vary more.
    Fewer than `ONSET_SEARCH.min_dispersion_blocks` blocks tell nothing: 1.
    """
    length = round(ONSET_SEARCH.dispersion_block_s * fs)
    count = len(x) // length
    if count < ONSET_SEARCH.min_dispersion_blocks:
        return 1.0
    energy = (x[: count * length] ** 2).reshape(count, length).mean(axis=1)
    return float(0.25 * length * np.mean(np.diff(np.log(np.maximum(energy, 1e-12))) ** 2))


def _fit_dispersion(squares: np.ndarray, expected: np.ndarray, block: int, fs: float) -> float:
    """Return how many samples count as one by how far energies lie from the likeliest rise.

    A rise that no tried shape follows leaves larger differences than Gaussian samples do, so that the interval widens.
    `squares`, (n,), are sums over blocks of `block` samples; `expected`, (n,), is what the rise says of them.
    """
    length = max(1, round(ONSET_SEARCH.dispersion_block_s * fs / block))
    count = len(squares) // length
    if count < ONSET_SEARCH.min_dispersion_blocks:
        return 1.0
    found, said = (each[: count * length].reshape(count, length).sum(axis=1) for each in (squares, expected))
    return float(0.5 * length * block * np.mean((found / said - 1.0) ** 2))


def onset(
    emg: ArrayLike | Mapping[str, ArrayLike],
    *,
    fs: float,
    rest: tuple[float, float] | None = None,
    level: float = 0.95,
    **thresholds: float,
) -> Activations | dict[str, Activations]:
    """Find the bursts of raw EMG, each onset and end with its interval.

    Parameters
    ----------
    emg : array_like, shape (n,), or mapping of str to array_like
        Raw EMG of one muscle [V], or of several by name.
    fs : float
        Sampling rate [Hz].
    rest : tuple of float, optional
        Beginning and end of a stretch of rest [s]; the quietest stretch by default.
    level : float
        Probability of the intervals.
    **thresholds : float
        ``height`` (standard deviations of rest), ``shortest`` (duration of a burst [s]) and ``pause`` between two
        bursts [s].

    Returns
    -------
    Activations, or dict of str to Activations
        ``.bursts`` have ``onset`` and ``end``, each with ``time``, ``low`` and ``high`` [s]. ``.doubtful`` names
        stretches with artefacts or a heartbeat, in which an interval need not cover an onset.

    Raises
    ------
    RecordingError
        If a sample is missing, the rate is too low for EMG, or there is no rest or no activity.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> found = onset(rng.standard_normal(t.size) * np.where((t > 1.0) & (t < 2.0), 1.0, 0.02), fs=1000.0)
    >>> burst = found.bursts[0]
    >>> burst.onset.low < 1.0 < burst.onset.high
    True
    """
    if not fs > 0.0:
        raise RecordingError(f"onset: found a sampling rate of {fs:g} Hz, expected one above 0")
    if isinstance(emg, Mapping):
        return {name: _onset(each, fs, rest, level, name, thresholds) for name, each in emg.items()}
    return _onset(emg, fs, rest, level, "", thresholds)


def _onset(emg: ArrayLike, fs: float, rest, level: float, name: str, thresholds) -> Activations:
    samples = np.asarray(emg, float)
    where = f"onset, {name}" if name else "onset"
    if samples.ndim != 1 or len(samples) < 2:
        raise RecordingError(f"{where}: found EMG of shape {samples.shape}, expected (n,), one muscle")
    try:
        return activations(np.arange(len(samples)) / fs, samples, rest=rest, level=level, **thresholds)
    except RecordingError as error:
        raise RecordingError(f"{where}: {error}") from None
