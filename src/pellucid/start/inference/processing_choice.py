"""Propose low-pass, decimation and dead band from the spectrum and the quantum of a position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from ...files.cut import BRIDGED_LOWPASS_PERIODS, MAX_MISSING_SHARE, MIN_GAP_STEP_RATIO
from ...files.defects.watched import find_runs
from ...numerics.filters import zero_phase_lowpass
from ...numerics.motion import Filtering, settling_samples, shortest
from ...study.study_file import Processing
from .angle_units import find_quantum


@dataclass(frozen=True)
class ProcessingLimits:
    """How the processing of a new study is chosen."""

    # The acceleration's spectrum ends where it has fallen to this many times its floor.
    floor_margin: float = 4.0
    # After decimation the rate is at least this many times the low-pass.
    min_rate_over_lowpass: float = 6.0
    # The low-pass is at most this share of the sampling rate.
    max_lowpass_share: float = 0.2
    # The dead band is at least this share of the largest speed, where friction takes a sign for certain.
    dead_band_share: float = 0.02
    # The spectrum is computed over losses of up to so many sampling periods, by interpolation. A longer loss can
    # hide motion within reach of a low-pass of a twentieth of the sampling rate, and parts the samples. Chosen by
    # judgement.
    max_bridged_periods: int = 10
    # Steps of a clock with losses are whole periods within this share of one, so that they are counted without doubt.
    max_step_jitter: float = 0.25
    # A spectrum is computed between long losses only if one stretch has so many samples.
    min_spectrum_samples: int = 64
    # Share of the samples that has to lie between unbridged losses far enough apart for a regression. The low-pass
    # is lowered, so that longer losses are bridged, and less is thinned, until it is reached. Chosen by judgement.
    min_kept_share: float = 0.8
    # Above this share of missing samples, or of samples between losses that are too close for a regression, a
    # recording has other faults than losses.
    max_missing_share: float = MAX_MISSING_SHARE
    # The allowed share exceeds what is missing by this share, for losses are not spread evenly.
    cut_share_margin: float = 0.1
    # Fewest samples that are left out at each border.
    min_trim_samples: int = 20


PROCESSING_LIMITS = ProcessingLimits()


@dataclass(frozen=True)
class ProcessingChoice:
    """Processing for a regression, with its reasons and the spectrum that they come from."""

    lowpass: float  # cut-off [Hz]
    decimate: int  # one of so many samples is kept
    dead_band: float  # speed below which samples are left out [unit of the position per second]
    trim: int  # samples left out at each border
    why: str  # reason, for a comment in study.toml
    frequency: np.ndarray  # frequencies of the spectrum, shape (f,) [Hz]
    acceleration_power: np.ndarray  # power of the computed acceleration, shape (f,)
    smoothed_power: np.ndarray  # the same, smoothed, from which the low-pass is chosen, shape (f,)
    floor: int  # index of the smallest smoothed power above the motion: the noise floor
    cut: float  # frequency from which on the smoothed power is near its floor [Hz]
    peak: float = 0.0  # frequency of the most motion [Hz]
    resample: float | None = None  # rate to interpolate to [Hz], None unless a clock loses samples now and then
    cut_share: float | None = None  # share of a recording that may be cut, None unless more than usual is missing


def find_lost_periods(time: np.ndarray, position: np.ndarray, rate: float) -> np.ndarray | None:
    """Return how many sampling periods each step of a clock lasts, shape (n - 1,); None unless samples are lost.

    `time`, (n,) [s], are the stamps of `position`, (n,), and `rate` [Hz] is the rate without losses. Steps of a clock
    that loses samples are nearly whole periods. So are those of an even clock that was rounded, but there the position
    moves over a long step as far as over any other.
    """
    if len(time) < 4 or not np.isfinite(time).all():
        return None
    steps = np.diff(time) * rate
    periods = np.maximum(np.round(steps), 1.0)
    long = steps > MIN_GAP_STEP_RATIO
    limit = PROCESSING_LIMITS.max_step_jitter
    if steps.min() <= 0.0 or not long.any() or np.quantile(np.abs(steps - periods)[~long], 0.99) > limit:
        return None
    short = long & (periods <= PROCESSING_LIMITS.max_bridged_periods)
    if short.any() and np.quantile(np.abs(steps - periods)[short], 0.9) > limit:
        return None
    moved = np.diff(position)
    pace = 0.5 * (moved[:-2] / periods[:-2] + moved[2:] / periods[2:])
    inner = short[1:-1] & np.isfinite(pace) & np.isfinite(moved[1:-1])
    by_stamps = np.abs(moved[1:-1] - pace * periods[1:-1])[inner].sum()
    by_rows = np.abs(moved[1:-1] - pace)[inner].sum()
    return None if by_rows < by_stamps else periods


def choose_processing(position: np.ndarray, rate: float, periods: np.ndarray | None = None) -> ProcessingChoice:
    """Return a proposal for a position, shape (n,), sampled at `rate` [Hz].

    It is sampled evenly, or its steps last `periods`, (n - 1,), as `find_lost_periods` returns them. Missing samples
    are NaN. The power of the acceleration falls while motion ends, and rises again where quanta and noise,
    differentiated twice, outweigh it. The low-pass stands at the fall's end.
    """
    from scipy.signal import welch  # it loads all of scipy.stats

    known = position[np.isfinite(position)]
    if periods is None and len(known) < len(position):
        periods = np.ones(len(position) - 1)
    parts = [known] if periods is None else _even_parts(position, periods)
    longest = max(len(part) for part in parts)
    length = int(min(longest, max(256, 2 ** int(np.log2(max(rate * 4.0, 256.0))))))
    parts = [part for part in parts if len(part) >= length]
    spectra = [welch(part - part.mean(), rate, nperseg=length) for part in parts]
    frequency = spectra[0][0][1:]
    power = np.average([power[1:] for _, power in spectra], axis=0, weights=[len(part) for part in parts])
    acceleration = power * (2.0 * np.pi * frequency) ** 4
    smooth = _smoothed(acceleration)
    peak = int(np.argmax(smooth * (frequency < 0.25 * rate) / (1.0 + frequency) ** 4))
    lowest = peak + int(np.argmin(smooth[peak:])) if peak < len(smooth) - 2 else peak
    above = smooth[peak : lowest + 1] > PROCESSING_LIMITS.floor_margin * smooth[lowest]
    end = peak + int(np.flatnonzero(above)[-1]) + 1 if above.any() else lowest
    cut = float(frequency[min(end, len(frequency) - 1)])
    lowpass = _rounded(min(max(cut, 4.0 * float(frequency[peak])), PROCESSING_LIMITS.max_lowpass_share * rate))
    speed = np.concatenate([np.abs(np.gradient(zero_phase_lowpass(part, lowpass, 4, rate))) * rate for part in parts])
    quantum = find_quantum(known) or 0.0
    # A quantum that passes the filter once is a speed of about quantum times the cut-off.
    dead_band = _rounded(
        max(PROCESSING_LIMITS.dead_band_share * float(np.quantile(speed, 0.99)), 2.0 * quantum * lowpass)
    )
    why = (
        f"the spectrum of the acceleration falls to {PROCESSING_LIMITS.floor_margin:g} times its noise floor at "
        f"{cut:.3g} Hz; above, quantization and noise of the position dominate"
    )
    if lowpass != _rounded(cut):
        limit = "four times the frequency of most motion" if lowpass > cut else "a share of the sampling rate"
        why += f"; the low-pass of {lowpass:g} Hz is limited by {limit}"
    return ProcessingChoice(
        lowpass, _decimation(lowpass, rate), dead_band, _trim(lowpass, rate), why, frequency, acceleration, smooth,
        lowest, cut, peak=float(frequency[peak]),
    )  # fmt: skip


def bridge_losses(choice: ProcessingChoice, tables: Sequence[np.ndarray], rate: float) -> ProcessingChoice:
    """Return a choice that resamples over the short losses of clocks, so that enough samples are left between cuts.

    `tables` holds the periods of each table's steps, (n - 1,), as `find_lost_periods` returns them. Interpolation
    bridges losses of half a period of the low-pass, so that the low-pass is lowered where losses are longer and
    frequent.
    """
    tried = [choice.lowpass]
    for lost in range(2, PROCESSING_LIMITS.max_bridged_periods + 1):
        lowpass = _rounded(BRIDGED_LOWPASS_PERIODS * rate / (lost + 0.5))
        if 4.0 * choice.peak <= lowpass < choice.lowpass:
            tried.append(lowpass)
    shares = [_kept_share(tables, lowpass, rate) for lowpass in tried]
    best = next(
        (i for i, share in enumerate(shares) if share >= PROCESSING_LIMITS.min_kept_share), int(np.argmax(shares))
    )
    lowpass = tried[best]
    if not any(np.any((p > 1.0) & (p <= _bridged_periods(lowpass, rate))) for p in tables):
        return choice
    why = choice.why
    if best:
        why += f"; {lowpass:g} Hz is lower, so that lost samples can be interpolated"
    return replace(
        choice, lowpass=lowpass, decimate=_decimation(lowpass, rate), trim=_trim(lowpass, rate), why=why, resample=rate
    )


def cut_missing(choice: ProcessingChoice, tables: Sequence[np.ndarray], rate: float) -> ProcessingChoice:
    """Return a choice that allows the missing samples of recordings to be cut, if enough is left between them.

    `tables` holds the rows without a sample of each table, (n,) bool, at `rate` [Hz]; short losses that are bridged
    are not cut. A stretch between losses needs some rows after thinning, so that less is thinned where losses are
    frequent.
    """
    limits = PROCESSING_LIMITS
    if choice.resample is not None:
        tables = [_unbridged(rows, _bridged_periods(choice.lowpass, rate)) for rows in tables]
    share = max((float(np.mean(part)) for rows in tables for part in np.array_split(rows, 2) if len(part)), default=0.0)
    if not Processing.model_fields["cut_share"].default < share <= limits.max_missing_share:
        return choice
    thinned = next(
        (k for k in range(choice.decimate, 1, -1) if _sound_share(tables, choice, k) >= limits.min_kept_share), 1
    )
    if _sound_share(tables, choice, thinned) < 1.0 - limits.max_missing_share:
        return choice
    return replace(choice, decimate=thinned, cut_share=round(share + limits.cut_share_margin, 1))


def _unbridged(rows: np.ndarray, longest: float) -> np.ndarray:
    """Return `rows`, (n,) bool, without the runs that are bridged: the rows around one are `longest` apart at most."""
    kept = rows.copy()
    for first, length in zip(*find_runs(rows), strict=True):
        if length + 1 <= longest and first > 0 and first + length < len(rows):
            kept[first : first + length] = False
    return kept


def _sound_share(tables: Sequence[np.ndarray], choice: ProcessingChoice, decimate: int) -> float:
    """Return the share of samples that lie in stretches long enough for a regression between missing ones."""
    fewest = shortest(Filtering(choice.lowpass, 4, decimate, 0.0, choice.trim))
    lengths = np.concatenate([find_runs(~rows)[1] for rows in tables])
    return float(lengths[lengths >= fewest].sum() / max(lengths.sum(), 1))


def _kept_share(tables: Sequence[np.ndarray], lowpass: float, rate: float) -> float:
    """Return the share of time that lies in stretches long enough for a regression with a low-pass [Hz]."""
    fewest = shortest(Filtering(lowpass, 4, _decimation(lowpass, rate), 0.0, _trim(lowpass, rate)))
    kept = whole = 0.0
    for periods in tables:
        cut = (periods > 1.0) & (periods > _bridged_periods(lowpass, rate))
        lasts = np.array([part.sum() for part in np.split(np.where(cut, 0.0, periods), np.flatnonzero(cut))])
        kept += float(lasts[lasts >= fewest].sum())
        whole += float(lasts.sum())
    return kept / whole if whole > 0.0 else 0.0


def _bridged_periods(lowpass: float, rate: float) -> float:
    """Return the longest loss that a study bridges at a low-pass [Hz], in sampling periods."""
    return BRIDGED_LOWPASS_PERIODS * rate / lowpass


def _decimation(lowpass: float, rate: float) -> int:
    return max(1, int(rate / (PROCESSING_LIMITS.min_rate_over_lowpass * lowpass)))


def _trim(lowpass: float, rate: float) -> int:
    return max(PROCESSING_LIMITS.min_trim_samples, settling_samples(lowpass, rate))


def _even_parts(position: np.ndarray, periods: np.ndarray) -> list[np.ndarray]:
    """Return a position, (n,), on an even grid between long losses, interpolated over short ones."""
    row = np.concatenate(([0.0], np.cumsum(periods)))
    finite = np.isfinite(position)
    row, known = row[finite], position[finite]
    parts = []
    for part in np.split(np.arange(len(row)), 1 + np.flatnonzero(np.diff(row) > PROCESSING_LIMITS.max_bridged_periods)):
        if len(part) >= 4:
            grid = np.arange(row[part[0]], row[part[-1]] + 1.0)
            parts.append(CubicSpline(row[part], known[part])(grid))
    return parts if max(map(len, parts), default=0) >= PROCESSING_LIMITS.min_spectrum_samples else [known]


def _smoothed(power: np.ndarray) -> np.ndarray:
    """Return a spectrum as running geometric means over a sixth of an octave, so that single lines do not decide."""
    logs = np.log(np.maximum(power, 1e-300))
    out = np.empty_like(logs)
    sums = np.concatenate(([0.0], np.cumsum(logs)))
    for i in range(len(logs)):
        half = max(1, round(0.06 * i))
        low, high = max(0, i - half), min(len(logs), i + half + 1)
        out[i] = (sums[high] - sums[low]) / (high - low)
    return np.exp(out)


def _rounded(value: float) -> float:
    """Return a number rounded to two digits, 0 for none."""
    if value <= 0.0 or not np.isfinite(value):
        return 0.0
    exponent = int(np.floor(np.log10(value)))
    return float(np.round(value / 10.0 ** (exponent - 1)) * 10.0 ** (exponent - 1))
