"""Checks of an EMG recording. Every fault names the file, the channel, the finding and the expectation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...files.fault import Fault
from ...files.recording import Recording
from .emg_findings import EmgFinding, emg_quality, mains_rms


@dataclass(frozen=True)
class QualityThresholds:
    """Thresholds beyond which an EMG recording has a fault."""

    mains_search_s: float = 4.0  # Seconds of a recording that tell 50 from 60 Hz
    # Share of the power above which the mains is all there is: an electrode is an antenna then
    max_mains_share: float = 0.8
    # An attached electrode has less mains hum than this (RMS). At rest even little hum is most of the power.
    max_attached_mains_v: float = 20e-6
    min_work_contrast: float = 2.0  # A muscle is at work if its envelope exceeds that of rest by this factor
    max_envelope: float = 1.2  # Relative envelope above which the maximal contraction was none
    # Relative envelope below which a whole recording stays where the maximum was an artefact's
    min_envelope_peak: float = 0.02
    # Share of the way from rest to a maximal contraction that a relaxed muscle stays below
    max_relaxed_share: float = 0.05
    rate_tolerance: float = 0.01  # Share by which rates of files, or durations of a trial's files, may differ


EMG_LIMITS = QualityThresholds()

ENVELOPE_SCALE_KIND = "normalisation"
"""Kind of the fault of relative envelopes that are too large, or too small, for shares of a maximal contraction."""


def find_hum(recordings: Sequence[Recording]) -> float | None:
    """Return the frequency of the mains [Hz] whose hum the raw EMG of some recordings has; None without clear hum."""
    shares: dict[float, float] = {}
    for recording in recordings:
        part = slice(0, round(EMG_LIMITS.mains_search_s * recording.fs))
        raw = [c.samples[part] for n, c in recording.channels.items() if n.startswith("emg.") and c.unit == "V"]
        for x in (x for x in raw if np.isfinite(x).all() and np.std(x) > 0.0):
            mains, hum = mains_rms(x, recording.fs)
            shares[mains] = max(shares.get(mains, 0.0), (hum / float(np.std(x))) ** 2)
    most = max(shares, key=lambda f: shares[f], default=None)
    return most if most is not None and shares[most] > 0.0 else None


def inspect_emg(recording: Recording, *, notches: Sequence[float] | None = None) -> list[Fault]:
    """Return the faults of the EMG channels of one file, those that reject the file first.

    `notches` [Hz] are the frequencies that the study's chain removes; None if study.toml cannot set a notch.
    """
    faults: list[Fault] = []
    whole, findings = recording.uncut or recording, _findings_within(recording)
    for name, channel in recording.channels.items():
        if not name.startswith("emg."):
            continue
        x = channel.samples
        missing = np.flatnonzero(~np.isfinite(x))
        if missing.size:
            found = f"{missing.size} missing samples (NaN), the first at index {missing[0]}"
            faults.append(_fault("refuse", "missing_samples", recording, name, found, "a number in every sample"))
        own = [one for one in findings if one.channel == name and not (missing.size and one.kind == "dropout")]
        if channel.unit == "V":
            faults += _raw_faults(recording, name, whole[name], notches, own)
        elif not missing.size:
            faults += [*_relative_faults(recording, name, x), *_raw_faults(recording, name, whole[name], notches, own)]
    return sorted(faults, key=lambda fault: fault.severity != "refuse")


def _findings_within(recording: Recording) -> list[EmgFinding]:
    """Return the findings of the whole file that lie in a recording, which may be a part of the file."""
    whole = recording.uncut or recording
    first = float(recording.time[0] - whole.time[0])
    last = float(recording.time[-1] - whole.time[0])
    found: list[EmgFinding] = []
    for unit in ("V", "1"):
        emg = {n: c for n, c in whole.channels.items() if n.startswith("emg.")}
        own = {n: c.samples for n, c in emg.items() if (c.unit == "V") == (unit == "V")}
        if own and len(whole) > 1:
            samples = np.column_stack([*own.values()])
            found += emg_quality(samples, rate=whole.fs, channels=list(own), unit=unit)
    return [one for one in found if one.end > first and one.start <= last]


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
    "exchanged": ("warn", "exchanged", "the same electrodes as in the other recordings"),
    "heartbeat": ("note", "heartbeat", "EMG without an electrocardiogram"),
    "motion": ("note", "motion", "little power below the frequency band of EMG"),
    "mvc_artefact": ("note", "mvc_artefact", "peaks of a size possible for a muscle"),
}
"""Severity and kind of the fault for each finding, and the expectation."""


def _raw_faults(
    recording: Recording, name: str, x: np.ndarray, notches: Sequence[float] | None, findings: Sequence[EmgFinding]
) -> list[Fault]:
    """Return the faults of `findings`, which a channel of the whole file, (n,), has."""
    faults = []
    for one in findings:
        if one.kind == "mains":
            share = min((one.size / float(np.nanstd(x))) ** 2, 1.0)
            if share > EMG_LIMITS.max_mains_share and one.size > EMG_LIMITS.max_attached_mains_v:
                found = f"{one.found}, {100.0 * share:.3g} % of the power"
                expected = "EMG; the electrode is probably detached"
                faults.append(_fault("refuse", "detached_electrode", recording, name, found, expected))
                continue
            mains = mains_rms(np.where(np.isfinite(x), x, 0.0), recording.fs)[0]
            remedy = f'set mains = "{mains:g} Hz" in study.toml to remove it'
            if notches is None:
                remedy = "check electrodes and cables"
            elif mains in notches:
                remedy = "the notch of the filter chain removes it"
            faults.append(_fault("note", "mains_hum", recording, name, one.found, f"less hum; {remedy}"))
        elif one.kind in FINDING_FAULTS:
            severity, kind, expected = FINDING_FAULTS[one.kind]
            found = f"{one.found} ({one.start:.2f} to {one.end:.2f} s)"
            faults.append(_fault(severity, kind, recording, name, found, expected))
    return faults


def _relative_faults(recording: Recording, name: str, x: np.ndarray) -> list[Fault]:
    top = float(np.max(x))
    if top > EMG_LIMITS.max_envelope:
        found, expected = (
            f"{top:.3g} times the maximal contraction",
            f"at most {EMG_LIMITS.max_envelope:g}; normalise again",
        )
        # A held-out recording does not define the scale, so that it is reported and used as it is.
        severity = "refuse" if recording.use == "fit" else "warn"
        return [_fault(severity, ENVELOPE_SCALE_KIND, recording, name, found, expected)]
    if top == float(np.min(x)):
        return [
            _fault("refuse", "detached_electrode", recording, name, f"the constant value {top:g}", "an EMG envelope")
        ]
    if top < EMG_LIMITS.min_envelope_peak:
        found = f"at most {100.0 * top:.2g} % of the maximal contraction"
        expected = f"more than {100 * EMG_LIMITS.min_envelope_peak:g} % somewhere, or the muscle's own maximum"
        return [_fault("note", ENVELOPE_SCALE_KIND, recording, name, found, expected)]
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
