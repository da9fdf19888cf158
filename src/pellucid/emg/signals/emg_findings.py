"""Defects of EMG: the checks behind arrays, files, studies and pages.

Each check looks for one cause by an effect on the signal that a muscle does not have:

- **dropout**: values that repeat for longer than the converter's steps explain, or that are missing;
- **dead**: less than an amplifier's noise;
- **saturation**: runs at the largest value;
- **mains**: a narrow line at 50 or 60 Hz that stands out from its neighbours and is not small relative to the signal;
- **heartbeat**: one waveform, the same each time, at the rate of a heart, with a complex of tens of milliseconds;
- **motion**: power below the muscle's band, from electrodes or cables that move;
- **mvc_artefact**: single short peaks far above all else, which would be mistaken for the muscle's maximum;
- **normalised_per_trial**: a relative envelope whose largest value is exactly 1, its own maximum;
- **exchanged**: two channels that fit each other's place in another recording of the same electrodes, not their own;
- **envelope**: an envelope or rectified EMG among channels of raw EMG;
- **clock**: times with gaps;
- **unit**: an amplitude that is impossible for EMG in the stated unit.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..._errors import PellucidError
from ...numerics.arguments import with_checked_arguments
from ...numerics.filters import runs
from .exchanged import electrode_places, exchanged_pairs

EMG_UNITS = {"V": 1.0, "mV": 1e-3, "µV": 1e-6, "uV": 1e-6, "1": 1.0, "%": 0.01, "": 1.0}
"""Units of EMG, with their size in V, or in maxima; "" if it is not known."""

_TRIED_UNITS = (("mV", 1e-3), ("µV", 1e-6), ("V", 1.0))
"""Units in which samples of an impossible size are tried, the likelier first."""

RELATIVE_UNITS = ("1", "%")
"""Units of envelopes in maxima."""

FINDING_KINDS = (
    "dropout", "dead", "mains", "heartbeat", "motion", "saturation", "exchanged", "normalised_per_trial",
    "mvc_artefact", "envelope", "clock", "unit",
)  # fmt: skip
"""Kinds of findings."""


NOTCH_QUALITY = 10.0
"""Quality factor of the notches that keep hum from looking like a heartbeat."""


@dataclass(frozen=True)
class FindingThresholds:
    """Thresholds beyond which EMG has a finding."""

    min_dropout_s: float = 0.02  # Shortest run of one value that is a dropout
    # Probability of so long a run anywhere in a recording, by the share of equal neighbours elsewhere
    max_run_chance: float = 1e-6
    short_run_s: float = 0.01  # Runs up to this long tell the share of equal neighbours
    # An envelope may rest at one value. It is held there if it does so for this long [s], and for this many times as
    # long as in every other stretch. With more such stretches than this, the muscle rests by itself. Chosen by
    # judgement; a walker's recorded envelopes repeat a value at most twice.
    min_held_envelope_s: float = 1.0
    min_held_envelope_ratio: float = 5.0
    max_held_envelope_count: int = 3
    min_rms_v: float = 0.3e-6  # Smaller RMS: not even an amplifier's noise
    min_relative_rms: float = 2e-3  # The same as a share of the other channels' median RMS, where no unit is known
    min_saturated_run: int = 3  # Samples in a row at the largest value
    max_saturated_share: float = 1e-3  # Share of samples that may be in such runs
    min_line_ratio: float = 20.0  # Power of the mains' line over that of its neighbours, as densities
    min_mains_share: float = 0.03  # Least share of the power that the mains' lines have
    min_mains_v: float = 3e-6  # Mains with a smaller RMS is not reported
    heart_rates_hz: tuple[float, float] = (0.6, 2.6)  # Rates of hearts
    # Correlation of the single complexes with their mean; bursts of a muscle, aligned at their peaks, stay below
    min_complex_similarity: float = 0.80
    # The same without the samples at the peak, where bursts that are aligned there resemble each other
    min_side_similarity: float = 0.75
    peak_half_s: float = 0.015  # Time on either side of a peak that is left out of it
    min_complex_count: int = 6
    max_interval_variation: float = 0.3  # Relative median deviation of the intervals between complexes
    # Share of a complex's power, from 4 to 40 Hz, that lies above 12 Hz; a moved cable has less
    min_complex_high_share: float = 0.3
    motion_band_hz: tuple[float, float] = (1.0, 12.0)  # Band of moved electrodes, below a muscle's
    max_motion_share: float = 0.35  # Share of the power from 1 Hz on that may lie in this band
    min_motion_v: float = 10e-6  # Smaller RMS in this band is not reported
    motion_window_s: float = 0.4  # A single movement of a cable is looked for in windows of this length
    # It has at least this many times the RMS that the muscle has there above the band, and that the band has elsewhere
    min_motion_ratio: float = 1.0
    min_motion_rise: float = 6.0
    min_peak_ratio: float = 4.0  # A short peak over this quantile of magnitudes
    peak_quantile: float = 0.99
    beside_peak_s: float = 0.01  # Time on either side of a peak that is the artefact's, too
    # No other sample reaches this share of it; where few motor units fire, their largest potentials do
    max_share_of_peak: float = 0.5
    min_gap_steps: float = 1.5  # A step of a clock of more usual steps is a gap
    max_gap_share: float = 0.05  # With more of them the clock is uneven throughout
    max_rate_error: float = 0.01  # Share by which a clock's rate may differ from the stated one
    max_peak_s: float = 0.03  # Longest duration of such a peak
    max_peak_share: float = 5e-3  # Share of samples above the ratio; more are bursts of the muscle
    max_muscle_v: float = 0.02  # Larger RMS of most channels: the unit is another one
    min_muscle_v: float = 1e-8  # The same for smaller RMS; from here to `min_rms_v` nothing is connected
    min_carrier_share: float = 0.02  # Share of the power, from 0.5 Hz on, that raw EMG has above 20 Hz at least


FINDING_LIMITS = FindingThresholds()


@dataclass(frozen=True)
class EmgFinding:
    """Something that is wrong with a channel of EMG.

    Attributes
    ----------
    channel : int or str
        Number of the column, or its name.
    kind : str
        One of `FINDING_KINDS`.
    start, end : float
        First and last time at which it was found [s].
    size : float
        Its size: seconds of a dropout, RMS in the stated unit of hum, heartbeat, motion and a dead channel, share of
        samples that are saturated, ratio of a peak or of units.
    consequence : str
        What it does to envelope, onset or torque, in a sentence.
    found : str
        What was found, in words.
    """

    channel: int | str
    kind: str
    start: float
    end: float
    size: float
    consequence: str
    found: str

    def __str__(self) -> str:
        return f"{self.channel}, {self.start:.2f} to {self.end:.2f} s: {self.kind}, {self.found}. {self.consequence}"


CONSEQUENCES = {
    "dropout": "Envelope and estimated torque fall to 0 there, and an onset may be missed.",
    "dead": "The channel contains no EMG: exclude it.",
    "mains": "The envelope at rest is too large, and onsets are detected late; a notch filter removes the hum.",
    "heartbeat": "Each beat looks like a burst of the muscle; a high-pass filter at 30 Hz removes most of it.",
    "motion": "The envelope shows moving cables; a high-pass filter at 20 Hz removes most of it.",
    "saturation": "The envelope is too small where the muscle is strongest.",
    "normalised_per_trial": "Trials cannot be compared: normalise all of them by one maximal contraction.",
    "mvc_artefact": "The maximum of this recording is an artefact, and all envelopes scaled by it become too small.",
    "exchanged": "Envelope, onset and torque are those of the other muscle: exchange the two names.",
    "envelope": "No onset can be found, and filters for raw EMG spoil it; it is an envelope already.",
    "clock": "Filters smooth over the gap, and times after it are wrong unless the gap is kept.",
    "unit": "Checks and default limits in volts do not apply: state the unit of the file.",
}
"""Consequence of each kind."""


@with_checked_arguments
def emg_quality(
    emg: ArrayLike,
    *,
    rate: float,
    channels: Sequence[str] | None = None,
    unit: str = "V",
    time: ArrayLike | None = None,
    reference: ArrayLike | None = None,
) -> tuple[EmgFinding, ...]:
    """Return what is wrong with EMG, channel by channel.

    Parameters
    ----------
    emg : array_like, shape (n,) or (n, channels)
        Raw EMG, or envelopes in maxima with the unit ``"1"`` or ``"%"``. Missing samples are NaN.
    rate : float
        Sampling rate [Hz].
    channels : sequence of str, optional
        Names of the channels; numbers from 0 by default.
    unit : {"V", "mV", "µV", "1", "%", ""}
        Unit of the values; "" if it is not known: sizes are then compared with the other channels alone.
    time : array_like, shape (n,), optional
        Times of the samples [s]. With them, lost samples and a clock of another rate are findings of the channel
        ``"time"``.
    reference : array_like, shape (k, channels), optional
        Raw EMG of the same electrodes in another recording, at the same rate. With it, exchanged channels are findings.

    Returns
    -------
    tuple of EmgFinding
        The clock's first, then in the order of the channels; empty if nothing is wrong.

    Raises
    ------
    PellucidError
        If there are no samples, values are no numbers, or shape, rate, names, unit, times or reference do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> emg = 1e-4 * np.random.default_rng(0).standard_normal((4000, 2))
    >>> emg[1000:2000, 1] = emg[1000, 1]
    >>> [(one.channel, one.kind, one.start, one.end) for one in pl.emg_quality(emg, rate=2000.0)]
    [(1, 'dropout', 0.5, 1.0)]
    """
    values = _checked_emg(emg, rate, channels, unit)
    named: Sequence[int | str] = range(values.shape[1]) if channels is None else list(channels)
    found: list[EmgFinding] = []
    typical = float(np.median([_rms(x) for x in values.T]))
    is_wrong_unit = unit not in (*RELATIVE_UNITS, "") and not _is_muscle_sized(typical * EMG_UNITS[unit])
    if time is not None:
        found += clock_findings("time", _checked_times(time, len(values)), rate)
    swapped: dict[int | str, EmgFinding] = {}
    if reference is not None and unit not in RELATIVE_UNITS:
        beside = _checked_emg(reference, rate, channels, unit)
        if beside.shape[1] != values.shape[1]:
            raise PellucidError(
                f"emg_quality: found a reference of {beside.shape[1]} channels, expected {values.shape[1]} as in emg"
            )
        pairs = exchanged_pairs(electrode_places(values, rate), electrode_places(beside, rate))
        swapped = exchanged_findings(pairs, named, len(values) / rate)
    is_raw = unit not in RELATIVE_UNITS and any(map(_is_centred, values.T))
    for name, x in zip(named, values.T, strict=True):
        # Where no channel is raw, all may be envelopes, or raw EMG with the offset of a converter.
        said = envelope_words(x, rate) if is_raw and np.ptp(x) > 0.0 else ""
        is_smooth = bool(said) or unit in RELATIVE_UNITS or is_envelope(x, rate)
        found += _channel_findings(name, x, rate, unit, typical, is_wrong_unit, is_smooth)
        if said:
            found.append(EmgFinding(name, "envelope", 0.0, len(x) / rate, 1.0, CONSEQUENCES["envelope"], said))
        found += [swapped[name]] if name in swapped else []
    return tuple(found)


def exchanged_findings(
    pairs: Sequence[tuple[int, int]], named: Sequence[int | str], end: float, beside: str = "the reference"
) -> dict[int | str, EmgFinding]:
    """Return the findings of exchanged channels, by channel; `end` is the duration of their recording [s]."""
    found = {}
    for i, j in pairs:
        for own, other in ((i, j), (j, i)):
            said = f"it has the signal of {named[other]} in {beside}, and {named[other]} has the signal of this channel"
            found[named[own]] = EmgFinding(named[own], "exchanged", 0.0, end, 1.0, CONSEQUENCES["exchanged"], said)
    return found


def own_maximum_finding(name: int | str, x: np.ndarray, rate: float, unit: str) -> EmgFinding | None:
    """Return the finding of a relative channel, (n,), whose largest value is exactly its maximum; None of others."""
    known = x[np.isfinite(x)]
    top = float(np.max(known)) if len(known) else 0.0
    one = 1.0 if unit == "1" else 100.0
    if abs(top - one) > max(_converter_step(known), 1e-9 * one):
        return None
    kind = "normalised_per_trial"
    said = f"its largest value is exactly {one:g}{' %' if unit == '%' else ''}: it was divided by its own maximum"
    return EmgFinding(name, kind, 0.0, len(x) / rate, top, CONSEQUENCES[kind], said)


def own_maximum_channels(recordings: Sequence[tuple[Collection[str], Collection[str]]]) -> list[set[str]]:
    """Return, for each of several recordings, the channels whose largest value is that of this recording alone.

    Each has the names of all its relative channels, and of those that reach exactly their maximum. If one of several
    recordings reaches it and the others do not, it is the maximum of all of them.
    """
    made = []
    for _, reached in recordings:
        own = set()
        for name in reached:
            others = [each for names, each in recordings if name in names]
            if len(others) == 1 or sum(name in each for each in others) > 1:
                own.add(name)
        made.append(own)
    return made


def _checked_times(time: ArrayLike, n: int) -> np.ndarray:
    try:
        values = np.asarray(time, float)
    except (TypeError, ValueError):
        raise PellucidError("emg_quality: found times that are no numbers, expected seconds of shape (n,)") from None
    if values.shape != (n,):
        raise PellucidError(f"emg_quality: found times of shape {values.shape}, expected ({n},) as of the samples")
    return values


def _checked_emg(emg: ArrayLike, rate: float, channels: Sequence[str] | None, unit: str) -> np.ndarray:
    try:
        values = np.asarray(emg, float)
    except (TypeError, ValueError):
        raise PellucidError(
            "emg_quality: found values that are no numbers, expected EMG of shape (n, channels)"
        ) from None
    values = values[:, None] if values.ndim == 1 else values
    if values.ndim != 2 or not values.size:
        raise PellucidError(f"emg_quality: found EMG of shape {values.shape}, expected (n, channels) with samples")
    if not (np.isfinite(rate) and rate > 0.0):
        raise PellucidError(f"emg_quality: found rate = {rate!r}, expected a sampling rate above 0 Hz")
    if channels is not None and len(channels) != values.shape[1]:
        raise PellucidError(
            f"emg_quality: found {len(channels)} names of {values.shape[1]} channels, expected one of each"
        )
    if unit not in EMG_UNITS:
        raise PellucidError(f"emg_quality: found unit = {unit!r}, expected one of {', '.join(EMG_UNITS)}")
    return values


def _is_muscle_sized(volts: float) -> bool:
    return volts == 0.0 or FINDING_LIMITS.min_muscle_v <= volts <= FINDING_LIMITS.max_muscle_v


def size_text(value: float, unit: str) -> str:
    """Return a size with its unit; volts in µV.

    >>> size_text(2.8e-5, "V"), size_text(0.03, "mV")
    ('28 µV', '0.03 mV')
    """
    return f"{1e6 * value:.3g} µV" if unit == "V" and value < 1e-3 else f"{value:.3g} {unit}".rstrip()


def _rms(x: np.ndarray) -> float:
    known = x[np.isfinite(x)]
    return float(np.std(known)) if len(known) else 0.0


def _is_centred(x: np.ndarray) -> bool:
    """Return whether samples, (n,), lie on both sides of 0, as those of raw EMG."""
    known = x[np.isfinite(x)]
    return len(known) > 0 and abs(float(known.mean())) < 0.5 * float(np.std(known))


def _channel_findings(
    name: int | str, x: np.ndarray, rate: float, unit: str, typical: float, is_wrong_unit: bool, is_smooth: bool
) -> list[EmgFinding]:
    """Return the findings of one channel, (n,); an envelope `is_smooth`."""
    end = len(x) / rate

    def whole(kind: str, size: float, said: str) -> EmgFinding:
        return EmgFinding(name, kind, 0.0, end, size, CONSEQUENCES[kind], said)

    is_relative = unit in RELATIVE_UNITS
    gone = dropouts(x, rate, is_envelope=is_smooth)
    found = []
    for part in gone:
        held = x[part.start]
        seconds = (part.stop - part.start) / rate
        kind = "missing" if not np.isfinite(held) else "held at 0" if held == 0.0 else "held at one value"
        said = f"{1e3 * seconds:.0f} ms {kind}"
        found.append(EmgFinding(name, "dropout", part.start / rate, part.stop / rate, seconds, CONSEQUENCES["dropout"],
                                said))  # fmt: skip
    there = np.isfinite(x)
    for part in gone:
        there[part] = False
    if is_relative:
        own_maximum = own_maximum_finding(name, x, rate, unit)
        return found if own_maximum is None else [*found, own_maximum]
    rms = _rms(x[there])
    is_unknown = is_wrong_unit or unit == ""
    least = FINDING_LIMITS.min_relative_rms * typical if is_unknown else FINDING_LIMITS.min_rms_v / EMG_UNITS[unit]
    if rms < least or rms == 0.0:
        return [whole("dead", rms, f"{size_text(rms, unit)} RMS")]
    if is_wrong_unit:
        likely = next((u for u, size in _TRIED_UNITS if u != unit and 1e-6 <= rms * size <= 2e-3), "")
        hint = f"; as {likely} it would be {size_text(rms * EMG_UNITS[likely], 'V')}" if likely else ""
        found.append(whole("unit", rms, f"{size_text(rms, unit)} RMS, but EMG has 1 µV to 2 mV{hint}"))
        return found
    # Limits in volts do not apply if the unit is unknown.
    scale = 0.0 if unit == "" else 1.0 / EMG_UNITS[unit]
    # Nothing that a dropout begins or ends with is a signal's.
    filled = np.where(there, x, 0.0 if not there.any() else float(np.mean(x[there])))
    filled = filled - float(np.mean(filled[there]))
    # An envelope may rest at its smallest value.
    at_end = (x == x[there].max()) | ((x == x[there].min()) & (not is_smooth))
    ends = [r for r in runs(at_end)
            if r.stop - r.start >= FINDING_LIMITS.min_saturated_run]  # fmt: skip
    share = sum(r.stop - r.start for r in ends) / len(x)
    if share > FINDING_LIMITS.max_saturated_share:
        said = f"{100.0 * share:.2g} % of samples in runs at the largest value"
        found.append(EmgFinding(name, "saturation", ends[0].start / rate, ends[-1].stop / rate, share,
                                CONSEQUENCES["saturation"], said))  # fmt: skip
    if is_smooth:
        return found
    mains, hum = mains_rms(filled, rate)
    if hum > max(FINDING_LIMITS.min_mains_v * scale, np.sqrt(FINDING_LIMITS.min_mains_share) * rms):
        found.append(whole("mains", hum, f"hum at {mains:g} Hz of {size_text(hum, unit)} RMS"))
    found += [*_slow_findings(name, filled, rate, unit, scale), *_peak_findings(name, filled, rate)]
    return found


def _converter_step(x: np.ndarray) -> float:
    """Return the step of the numbers with which samples, (n,), were stored: the least difference of two of them."""
    steps = np.diff(np.unique(x))
    return float(steps.min()) if len(steps) else 0.0


def envelope_words(x: np.ndarray, rate: float) -> str:
    """Return why a channel, (n,), that should be raw EMG is an envelope or rectified; "" if it is raw EMG."""
    known = x[np.isfinite(x)]
    if len(known) and known.min() >= 0.0:
        return "no sample below 0, as in an envelope"
    return "no carrier above 20 Hz, as in an envelope" if is_envelope(x, rate) else ""


def is_envelope(x: np.ndarray, rate: float) -> bool:
    """Return whether a channel, (n,), is an envelope or rectified, and no raw EMG with an offset."""
    is_known = np.isfinite(x)
    for part in _held_envelope_stretches(x, rate):
        is_known[part] = False
    known = x[is_known]
    if len(known) < 2.0 * rate or rate < 100.0:
        return False
    if known.min() >= 0.0 and known.min() < 0.2 * known.mean():
        return True
    if abs(float(known.mean())) < 0.5 * float(np.std(known)):
        return False
    frequency, density = scipy.signal.welch(known, rate, nperseg=round(2.0 * rate), detrend="constant")
    power = float(density[frequency >= 0.5].sum())
    return power > 0.0 and float(density[frequency > 20.0].sum()) < FINDING_LIMITS.min_carrier_share * power


def dropouts(x: np.ndarray, rate: float, *, is_envelope: bool = False) -> list[slice]:
    """Return stretches of a channel, (n,), that are missing, or held for longer than the converter's steps explain."""
    missing = [r for r in runs(~np.isfinite(x)) if r.stop - r.start >= 1]
    if is_envelope:
        return sorted([*missing, *_held_envelope_stretches(x, rate)], key=lambda r: r.start)
    held = _held_stretches(x)
    short = round(FINDING_LIMITS.short_run_s * rate)
    long_samples = sum(r.stop - r.start for r in held if r.stop - r.start > short)
    pairs = sum(r.stop - r.start - 1 for r in held if r.stop - r.start <= short)
    chance = min(max((pairs + 1.0) / max(len(x) - long_samples, 2), 1e-3), 0.999)
    needed = np.log(FINDING_LIMITS.max_run_chance / max(len(x), 2)) / np.log(chance)
    least = max(FINDING_LIMITS.min_dropout_s * rate, needed, 3.0)
    kept = [r for r in held if r.stop - r.start >= least]
    return sorted([*missing, *kept], key=lambda r: r.start)


def _held_stretches(x: np.ndarray) -> list[slice]:
    """Return the stretches of a channel, (n,), in which a value repeats."""
    return [slice(r.start - 1, r.stop) for r in runs(np.concatenate([[False], x[1:] == x[:-1]]))]


def _held_envelope_stretches(x: np.ndarray, rate: float) -> list[slice]:
    """Return the stretches in which an envelope, (n,), is held; [] of a channel that is constant or often at rest."""
    longest = sorted(_held_stretches(x), key=lambda r: r.start - r.stop)
    lengths = [*(r.stop - r.start for r in longest), 1]
    if lengths[0] == len(x):
        return []
    count = 0
    for i in range(min(len(longest), FINDING_LIMITS.max_held_envelope_count)):
        if lengths[i] < FINDING_LIMITS.min_held_envelope_s * rate:
            break
        if lengths[i] >= FINDING_LIMITS.min_held_envelope_ratio * lengths[i + 1]:
            count = i + 1
    return longest[:count]


def mains_rms(x: np.ndarray, rate: float) -> tuple[float, float]:
    """Return the frequency of the mains [Hz] that a channel, (n,), shows more of, and the RMS of its lines."""
    if len(x) < 2.0 * rate:
        return 50.0, 0.0
    frequency, density = scipy.signal.welch(x, rate, nperseg=min(len(x), round(2.0 * rate)), detrend="linear")
    step = frequency[1] - frequency[0]
    best = (50.0, 0.0)
    for mains in (50.0, 60.0):
        power = 0.0
        for line in mains * np.arange(1, 6):
            if line > 0.45 * rate:
                break
            near = np.abs(frequency - line) <= 1.01
            around = (np.abs(frequency - line) > 2.0) & (np.abs(frequency - line) <= 8.0)
            level = float(np.median(density[around]))
            if float(density[near].max()) > FINDING_LIMITS.min_line_ratio * level:
                power += float(np.sum(np.maximum(density[near] - level, 0.0))) * step
        best = max(best, (mains, float(np.sqrt(power))), key=lambda each: each[1])
    return best


def _slow_findings(name: int | str, x: np.ndarray, rate: float, unit: str, scale: float) -> list[EmgFinding]:
    """Return a heartbeat or moved electrodes of a channel, (n,): both lie below most of a muscle's band."""
    if rate < 100.0 or len(x) < 2.0 * rate:
        return []
    x = without_short_peaks(x, rate)
    low, high = FINDING_LIMITS.motion_band_hz
    sos = scipy.signal.butter(2, [4.0, min(40.0, 0.45 * rate)], "bandpass", fs=rate, output="sos")
    slow = scipy.signal.sosfiltfilt(sos, x)
    for mains in (50.0, 60.0):
        if mains < 0.45 * rate:
            slow = scipy.signal.filtfilt(*scipy.signal.iirnotch(mains, NOTCH_QUALITY, rate), slow)
    beat = heartbeat(slow, rate)
    if beat is not None:
        first, last, size = beat
        said = f"complexes of {size_text(size, unit)}, alike, at the rate of a heart"
        return [EmgFinding(name, "heartbeat", first, last, size, CONSEQUENCES["heartbeat"], said)]
    band = scipy.signal.sosfiltfilt(scipy.signal.butter(2, [low, high], "bandpass", fs=rate, output="sos"), x)
    above = scipy.signal.sosfiltfilt(scipy.signal.butter(2, low, "highpass", fs=rate, output="sos"), x)
    rms, whole = float(np.std(band)), float(np.std(above))
    if rms**2 > FINDING_LIMITS.max_motion_share * whole**2 and rms > FINDING_LIMITS.min_motion_v * scale:
        strong = np.flatnonzero(np.abs(band) > 2.0 * rms)
        first, last = (float(strong[0] / rate), float((strong[-1] + 1) / rate)) if len(strong) else (0.0, len(x) / rate)
        # Beside its lower edge a band-pass passes more than the high-pass does.
        share = min(rms**2 / whole**2, 1.0)
        said = f"{100.0 * share:.0f} % of the power lies below {high:g} Hz ({size_text(rms, unit)} RMS)"
        return [EmgFinding(name, "motion", first, last, rms, CONSEQUENCES["motion"], said)]
    return _single_movements(name, band, above - band, rate, unit, scale)


def _single_movements(
    name: int | str, band: np.ndarray, rest: np.ndarray, rate: float, unit: str, scale: float
) -> list[EmgFinding]:
    """Return stretches in which a cable moved: its `band`, (n,), is far larger there than elsewhere, and than `rest`.

    `rest`, (n,), is what lies above the band.
    """
    count = max(2, round(FINDING_LIMITS.motion_window_s * rate))
    window = np.full(count, 1.0 / count)
    low, high = (np.sqrt(np.maximum(scipy.signal.oaconvolve(x**2, window, "same"), 0.0)) for x in (band, rest))
    usual = float(np.median(low))
    is_moved = (
        (low > FINDING_LIMITS.min_motion_rise * usual)
        & (low > FINDING_LIMITS.min_motion_ratio * high)
        & (low > FINDING_LIMITS.min_motion_v * scale)
    )
    # The filter of the band has not settled at the ends.
    edge = round(rate / FINDING_LIMITS.motion_band_hz[0])
    is_moved[:edge] = is_moved[len(is_moved) - edge :] = False
    found = []
    for part in runs(is_moved):
        size = float(low[part].max())
        said = f"a movement of {size_text(size, unit)} RMS below {FINDING_LIMITS.motion_band_hz[1]:g} Hz"
        first, last = part.start / rate, part.stop / rate
        found.append(EmgFinding(name, "motion", first, last, size, CONSEQUENCES["motion"], said))
    return found


def clock_findings(name: str, time: np.ndarray, nominal: float | None = None) -> list[EmgFinding]:
    """Return where a clock of times, (n,) [s], lost samples, and a rate that is not the `nominal` one [Hz].

    Samples behind a gap keep their times: a gap stays one.
    """
    steps = np.diff(time[np.isfinite(time)])
    usual = float(np.median(steps)) if len(steps) else 0.0
    if not usual > 0.0:
        return []
    found = []
    gaps = np.flatnonzero(steps > FINDING_LIMITS.min_gap_steps * usual)
    if 0 < len(gaps) <= FINDING_LIMITS.max_gap_share * len(steps):
        lost = round(float(np.sum(steps[gaps] / usual - 1.0)))
        rate = len(steps) / float(steps.sum())
        said = (
            f"{lost} samples lost in {len(gaps)} gap{'s' if len(gaps) > 1 else ''} of up to {steps[gaps].max():.3g} s: "
            f"{1.0 / usual:.5g} Hz between gaps, {rate:.5g} Hz in all"
        )
        first, last = float(time[gaps[0]]), float(time[gaps[-1] + 1])
        found.append(EmgFinding(name, "clock", first, last, float(steps[gaps].sum()), CONSEQUENCES["clock"], said))
    if nominal and abs(1.0 / (usual * nominal) - 1.0) > FINDING_LIMITS.max_rate_error:
        said = f"{1.0 / usual:.5g} Hz, where the file states {nominal:.5g} Hz"
        first, last = float(time[0]), float(time[-1])
        found.append(EmgFinding(name, "clock", first, last, 1.0 / usual, CONSEQUENCES["clock"], said))
    return found


def short_peaks(x: np.ndarray, rate: float) -> list[slice]:
    """Return single short peaks far above everything else of a channel, (n,): no muscle makes them."""
    size = np.abs(x)
    usual = float(np.quantile(size, FINDING_LIMITS.peak_quantile)) if len(x) else 0.0
    if usual == 0.0:
        return []
    above = np.flatnonzero(size > FINDING_LIMITS.min_peak_ratio * usual)
    if not len(above) or len(above) > FINDING_LIMITS.max_peak_share * len(x):
        return []
    gap = FINDING_LIMITS.max_peak_s * rate
    groups = np.split(above, np.flatnonzero(np.diff(above) > gap) + 1)
    if any(g[-1] - g[0] > gap for g in groups):
        return []
    peaks = [slice(int(g[0]), int(g[-1]) + 1) for g in groups]
    others, beside = np.array(size), round(FINDING_LIMITS.max_peak_s * rate)
    for part in peaks:
        others[max(part.start - beside, 0) : part.stop + beside] = 0.0
    return [part for part in peaks if others.max() < FINDING_LIMITS.max_share_of_peak * size[part].max()]


def without_short_peaks(x: np.ndarray, rate: float) -> np.ndarray:
    """Return a channel of raw EMG, (n,), in which short peaks are 0: a maximum of the rest is the muscle's."""
    mean = float(np.mean(x)) if np.isfinite(x).all() and len(x) else 0.0
    peaks = short_peaks(x - mean, rate) if np.isfinite(x).all() else []
    if not peaks:
        return x
    made, beside = np.array(x), round(FINDING_LIMITS.beside_peak_s * rate)
    for part in peaks:
        made[max(part.start - beside, 0) : part.stop + beside] = mean
    return made


def heartbeat(slow: np.ndarray, rate: float) -> tuple[float, float, float] | None:
    """Return first and last time and height of a heart's complexes in a channel of 4 to 40 Hz, (n,); None without."""
    slowest, fastest = FINDING_LIMITS.heart_rates_hz
    height = np.abs(slow)
    spread = float(np.median(height)) / 0.6745
    if spread == 0.0:
        return None
    peaks, _ = scipy.signal.find_peaks(height, height=4.0 * spread, distance=max(1, round(0.7 * rate / fastest)))
    reach, wide = max(2, round(0.06 * rate)), round(0.15 * rate)
    peaks = peaks[(peaks >= wide) & (peaks < len(slow) - wide)]
    if len(peaks) < FINDING_LIMITS.min_complex_count:
        return None
    parts = np.array([slow[p - reach : p + reach + 1] for p in peaks])
    sign = np.sign(np.median(parts[:, reach])) or 1.0
    parts = parts[np.sign(parts[:, reach]) == sign]
    if len(parts) < FINDING_LIMITS.min_complex_count or len(parts) < 0.8 * len(peaks):
        return None
    peaks = peaks[np.sign(slow[peaks]) == sign]
    mean = np.median(parts, axis=0)
    alike = (parts @ mean) / (np.linalg.norm(parts, axis=1) * np.linalg.norm(mean))
    aside = np.abs(np.arange(-reach, reach + 1)) > FINDING_LIMITS.peak_half_s * rate
    sides = (parts[:, aside] @ mean[aside]) / (np.linalg.norm(parts[:, aside], axis=1) * np.linalg.norm(mean[aside]))
    intervals = np.diff(peaks) / rate
    middle = float(np.median(intervals))
    variation = float(np.median(np.abs(intervals - middle))) / middle
    complex_wave = np.median([slow[p - wide : p + wide + 1] for p in peaks], axis=0)
    power = np.abs(np.fft.rfft(complex_wave, round(rate))) ** 2
    frequency = np.fft.rfftfreq(round(rate), 1.0 / rate)
    band = (frequency >= 4.0) & (frequency <= 40.0)
    high = float(power[band & (frequency > 12.0)].sum() / power[band].sum())
    if (
        np.median(alike) < FINDING_LIMITS.min_complex_similarity
        or np.median(sides) < FINDING_LIMITS.min_side_similarity
        or not 1.0 / fastest <= middle <= 1.0 / slowest
        or variation > FINDING_LIMITS.max_interval_variation
        or high < FINDING_LIMITS.min_complex_high_share
    ):
        return None
    return float(peaks[0] / rate), float(peaks[-1] / rate), float(np.max(np.abs(mean)))


def _peak_findings(name: int | str, x: np.ndarray, rate: float) -> list[EmgFinding]:
    """Return single short peaks far above everything else of a channel, (n,)."""
    peaks = short_peaks(x, rate)
    if not peaks:
        return []
    ratio = float(np.abs(x).max() / np.quantile(np.abs(x), FINDING_LIMITS.peak_quantile))
    said = f"{len(peaks)} peak{'s' if len(peaks) > 1 else ''} up to {ratio:.1f} times all others"
    first, last = peaks[0].start / rate, peaks[-1].stop / rate
    return [EmgFinding(name, "mvc_artefact", first, last, ratio, CONSEQUENCES["mvc_artefact"], said)]
