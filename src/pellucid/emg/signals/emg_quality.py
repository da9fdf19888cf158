"""Checks of an EMG recording. Every fault names the file, the channel, the finding and the expectation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from ...files.fault import Fault
from ...files.recording import Recording
from .emg_findings import EmgFinding, emg_quality


@dataclass(frozen=True)
class QualityThresholds:
    """Thresholds beyond which an EMG recording has a fault."""

    mains_hz: tuple[float, float] = (50.0, 60.0)  # Frequencies of the mains in the world
    mains_search_s: float = 4.0  # Seconds of a recording that tell 50 from 60 Hz
    # Hum is found where one frequency of the mains has this many times the other's share of the power. EMG without hum
    # has much the same share of both. Chosen by judgement.
    min_hum_ratio: float = 2.0
    # Share of the power above which the mains is all there is: an electrode is an antenna then
    max_mains_share: float = 0.8
    # An attached electrode has less mains hum than this (RMS). At rest even little hum is most of the power.
    max_attached_mains_v: float = 20e-6
    min_reported_mains_v: float = 5e-6  # Mains hum with a smaller RMS is not reported, whatever its share of the power
    min_work_contrast: float = 2.0  # A muscle is at work if its envelope exceeds that of rest by this factor
    max_envelope: float = 1.2  # Relative envelope above which the maximal contraction was none
    # Relative envelope below which a whole recording stays where the maximum was an artefact's
    min_envelope_peak: float = 0.02
    # Share of the way from rest to a maximal contraction that a relaxed muscle stays below
    max_relaxed_share: float = 0.05
    rate_tolerance: float = 0.01  # Share by which rates of files, or durations of a trial's files, may differ


EMG_LIMITS = QualityThresholds()


def find_mains(recording: Recording) -> float:
    """Return the frequency of the mains [Hz] that a recording's raw EMG shows more of, with its harmonics."""
    shares = _hum_shares([recording])
    return max(EMG_LIMITS.mains_hz, key=lambda f: shares[f])


def find_hum(recordings: Sequence[Recording]) -> float | None:
    """Return the frequency of the mains [Hz] whose hum the raw EMG of some recordings has; None without clear hum."""
    shares = _hum_shares(recordings)
    most, least = max(EMG_LIMITS.mains_hz, key=lambda f: shares[f]), min(shares.values())
    return most if shares[most] > EMG_LIMITS.min_hum_ratio * least else None


def _hum_shares(recordings: Sequence[Recording]) -> dict[float, float]:
    """Return the largest share of the power that any channel of raw EMG has at each frequency of the mains."""
    found = dict.fromkeys(EMG_LIMITS.mains_hz, 0.0)
    for recording in recordings:
        part = slice(0, round(EMG_LIMITS.mains_search_s * recording.fs))
        raw = [c.samples[part] for n, c in recording.channels.items() if n.startswith("emg.") and c.unit == "V"]
        for x in (x for x in raw if np.isfinite(x).all()):
            found = {f: max(share, hum_share(x, recording.fs, f)) for f, share in found.items()}
    return found


def inspect_emg(recording: Recording, *, notches: Sequence[float] | None = None) -> list[Fault]:
    """Return the faults of the EMG channels of one file, those that reject the file first.

    `notches` [Hz] are the frequencies that the study's chain removes; None if study.toml cannot set a notch.
    """
    mains = find_mains(recording)
    faults: list[Fault] = []
    raw = {n: c.samples for n, c in recording.channels.items()
           if n.startswith("emg.") and c.unit == "V" and np.isfinite(c.samples).all()}  # fmt: skip
    findings = emg_quality(np.column_stack([*raw.values()]), rate=recording.fs, channels=list(raw)) if raw else ()
    for name, channel in recording.channels.items():
        if not name.startswith("emg."):
            continue
        x = channel.samples
        missing = np.flatnonzero(~np.isfinite(x))
        if missing.size:
            found = f"{missing.size} missing samples (NaN), the first at index {missing[0]}"
            faults.append(_fault("refuse", "missing_samples", recording, name, found, "a number in every sample"))
        elif channel.unit == "V":
            own = [one for one in findings if one.channel == name]
            faults += _raw_faults(recording, name, x, mains, notches, own)
        else:
            faults += _relative_faults(recording, name, x)
    return sorted(faults, key=lambda fault: fault.severity != "refuse")


def contrast_faults(recording: Recording, envelopes: Mapping[str, np.ndarray]) -> list[Fault]:
    """Muscles whose envelope hardly differs between rest and activity of a recording that should have both.
    `envelopes` (n,)."""
    found = []
    for muscle, envelope in envelopes.items():
        rest, active = np.quantile(envelope, (0.05, 0.95))
        ratio = active / rest if rest > 0.0 else np.inf
        if ratio < EMG_LIMITS.min_work_contrast:
            expected = EMG_LIMITS.min_work_contrast
            said = f"an envelope in activity only {ratio:.3g} times that at rest"
            channel = f"emg.{muscle}"
            found.append(_fault("note", "low_contrast", recording, channel, said, f"at least {expected:g} times"))
    return found


def relaxed_faults(
    recording: Recording,
    envelopes: Mapping[str, np.ndarray],
    rest: Mapping[str, float],
    maximum: Mapping[str, float],
) -> list[Fault]:
    """Return faults of muscles that are active in a recording of a relaxed wearer. `envelopes` (n,)."""
    found = []
    for muscle, envelope in envelopes.items():
        span = maximum[muscle] - rest[muscle]
        limit = rest[muscle] + EMG_LIMITS.max_relaxed_share * span
        active = envelope > limit
        # A twitch that the envelope spreads over a second is no contraction.
        if span > 0.0 and np.mean(active) > 0.05:
            top = 100.0 * (float(np.quantile(envelope, 0.95)) - rest[muscle]) / span
            share = 100.0 * np.mean(active)
            said = f"activity of {top:.3g} % of a maximal contraction, during {share:.3g} % of the trial"
            expected = f"less than {100.0 * EMG_LIMITS.max_relaxed_share:g} %, because the wearer should be relaxed"
            found.append(_fault("refuse", "not_relaxed", recording, f"emg.{muscle}", said, expected))
    return found


def resting_level(envelopes: Sequence[np.ndarray]) -> float:
    """A muscle's envelope at rest: the smallest tenth percentile over recordings that have rest in them. `envelopes`
    (n,)."""
    return min(float(np.quantile(envelope, 0.1)) for envelope in envelopes)


def swapped_faults(
    recording: Recording, flexor: str, extensor: str, envelopes: Mapping[str, np.ndarray], torque: np.ndarray
) -> list[Fault]:
    """Return the fault of interchanged electrodes of flexor and extensor. `envelopes` (n,); `torque` (n,) [N m]."""
    if np.std(torque) == 0.0 or any(np.std(envelopes[m]) == 0.0 for m in (flexor, extensor)):
        return []
    pull, push = (float(np.corrcoef(envelopes[m], torque)[0, 1]) for m in (flexor, extensor))
    if not (pull < -0.3 and push > 0.3):
        return []
    found = f"a correlation with the torque of {pull:.2f} for the flexor and {push:.2f} for the extensor ({extensor})"
    expected = "the opposite signs; the two channels are probably interchanged"
    return [_fault("refuse", "swapped_channels", recording, f"emg.{flexor}", found, expected)]


FINDING_FAULTS = {
    "dead": ("refuse", "detached_electrode", "at least the noise of an amplifier"),
    "unit": ("warn", "unit", "an amplitude possible for EMG"),
    "saturation": ("refuse", "clipped", "EMG within the range of the amplifier"),
    "dropout": ("warn", "dropout", "a signal that changes from sample to sample"),
    "heartbeat": ("note", "heartbeat", "EMG without an electrocardiogram"),
    "motion": ("note", "motion", "little power below the frequency band of EMG"),
    "mvc_artefact": ("note", "mvc_artefact", "peaks of a size possible for a muscle"),
}
"""Severity and kind of the fault for each finding, and the expectation."""


def _raw_faults(
    recording: Recording, name: str, x: np.ndarray, mains: float, notches: Sequence[float] | None,
    findings: Sequence[EmgFinding],
) -> list[Fault]:  # fmt: skip
    faults = []
    for one in findings:
        if one.kind == "mains":
            share = hum_share(x - x.mean(), recording.fs, mains)
            hum = np.sqrt(share) * float(np.std(x))
            if share > EMG_LIMITS.max_mains_share and hum > EMG_LIMITS.max_attached_mains_v:
                found = f"{100.0 * share:.3g} % of the power at the mains frequency of {mains:g} Hz"
                expected = "EMG; the electrode is probably detached"
                faults.append(_fault("refuse", "detached_electrode", recording, name, found, expected))
            elif hum > EMG_LIMITS.min_reported_mains_v and mains not in (notches or ()):
                notch = f'set mains = "{mains:g} Hz" in study.toml to remove it'
                remedy = "check electrodes and cables" if notches is None else notch
                found = f"{100.0 * share:.3g} % of the power at the mains frequency of {mains:g} Hz"
                faults.append(_fault("note", "mains_hum", recording, name, found, f"less hum; {remedy}"))
        elif one.kind in FINDING_FAULTS:
            severity, kind, expected = FINDING_FAULTS[one.kind]
            found = f"{one.found} ({one.start:.2f} to {one.end:.2f} s)"
            faults.append(_fault(severity, kind, recording, name, found, expected))
    return faults


def hum_share(samples: np.ndarray, fs: float, mains: float = 50.0) -> float:
    """Share of the power above 10 Hz that lies within 1 Hz of the mains and its next four harmonics. `samples` (n,)
    [V]; `fs`, `mains` [Hz]."""
    if len(samples) < fs or fs <= 2.0 * (mains + 1.0):
        return 0.0
    frequency, power = signal.welch(samples, fs, nperseg=min(len(samples), round(2.0 * fs)), detrend="linear")
    harmonics = mains * np.arange(1, 6)
    near = np.min(np.abs(frequency[:, None] - harmonics), axis=1) <= 1.0
    total = power[frequency >= 10.0].sum()
    return float(power[near].sum() / total) if total > 0.0 else 0.0


def _relative_faults(recording: Recording, name: str, x: np.ndarray) -> list[Fault]:
    top = float(np.max(x))
    if top > EMG_LIMITS.max_envelope:
        found, expected = (
            f"{top:.3g} times the maximal contraction",
            f"at most {EMG_LIMITS.max_envelope:g}; normalise again",
        )
        # A held-out recording does not define the scale, so that it is reported and used as it is.
        severity = "refuse" if recording.use == "fit" else "warn"
        return [_fault(severity, "normalisation", recording, name, found, expected)]
    if top == float(np.min(x)):
        return [
            _fault("refuse", "detached_electrode", recording, name, f"the constant value {top:g}", "an EMG envelope")
        ]
    if top < EMG_LIMITS.min_envelope_peak:
        found = f"at most {100.0 * top:.2g} % of the maximal contraction"
        expected = f"more than {100 * EMG_LIMITS.min_envelope_peak:g} % somewhere, or the muscle's own maximum"
        return [_fault("note", "normalisation", recording, name, found, expected)]
    return []


def channel_fault(
    severity: str, kind: str, file: str, recording: str, channel: str, found: str, expected: str, end: str = ""
) -> Fault:
    """Return a fault of one channel of a recording in a file. Its message has an `end` that `expected` has not."""
    message = f"{file} (recording {recording}), channel {channel}: found {found}, expected {expected}{end}"
    return Fault(severity, kind, file, channel, found, expected, message)


def _fault(severity: str, kind: str, recording: Recording, channel: str, found: str, expected: str) -> Fault:
    """Return a fault of one channel of a recording in its own file."""
    return channel_fault(severity, kind, recording.path.name, recording.name, channel, found, expected)
