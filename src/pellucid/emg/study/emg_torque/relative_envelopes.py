"""Envelopes on a recording's clock, relative to maximal contractions or to the largest effort seen.

Find faults in a study's EMG recordings: in each file, against its trial, and against the movement.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...._errors import IdentificationError, RecordingError, listed_names
from ....files.fault import Fault
from ....files.recording import MAXIMAL_PROTOCOL, Recording
from ....models.estimates import Verdict
from ....study.results import ResultRow
from ....study.study import Study
from ...signals.emg_chain import EmgChain
from ...signals.emg_findings import without_short_peaks
from ...signals.emg_quality import EMG_LIMITS, channel_fault, contrast_faults, inspect_emg, swapped_faults
from ...signals.emg_scale import scale_interval
from ..muscle_channels import notch_frequencies, session_faults, study_chain
from .emg_torque_table import EmgTorqueTable
from .study_muscles import MAX_NAMED_RECORDINGS, find_used_muscles, unused_channels

ENVELOPE_SETTLING_S = 0.5
"""Duration at either end of a recording in which an envelope has not settled [s].

Chosen by judgement; no measurement is recorded.
"""

FLEXOR_NAME_PARTS = ("hamstring", "biceps", "semitendinosus", "semimembranosus", "brachialis", "brachioradialis")
"""Parts of the names of muscles that flex a knee or an elbow."""

EXTENSOR_NAME_PARTS = ("rectus", "vastus", "triceps", "quadriceps")
"""Parts of the names of muscles that extend a knee or an elbow."""


def emg_faults(study: Study) -> list[Fault]:
    """Return the faults of a study's EMG that affect a torque map. `study` [emg_torque]."""
    asked = study.table(EmgTorqueTable)
    chain, found = study_chain(study, asked), []
    rates: dict[tuple[str, str], float] = {}  # By file and recording
    windows = [entry.name for entry in study.config.recordings if entry.window is not None]
    for recording in study.recordings():
        stream = recording.stream_or_self(asked.emg)
        if not any(name.startswith("emg.") for name in stream.channels):
            continue
        whole = not any(recording.name == name or recording.name.startswith(f"{name}.") for name in windows)
        own = trial_faults(recording, stream, chain, whole=whole)
        found += own
        if not any(fault.severity == "refuse" for fault in own):
            if not any(fault.kind == "rate" for fault in own):
                rates[stream.path.name, recording.name] = _mean_rate(stream)
            if chain is not None:
                found += _envelope_faults(recording, stream, chain)
    found += session_faults(study, [recording.stream_or_self(asked.emg) for recording in study.recordings()])
    usual = float(np.median(list(rates.values()))) if rates else 0.0
    found += [
        channel_fault(
            "warn" if any(r.use == "fit" for r in recordings) else "note", "extra_channel",
            recording.stream_or_self(asked.emg).path.name, recording.name, f"emg.{muscle}", "it in this recording",
            "a channel of every fitted recording",
            f": it is not used, because {listed_names(lacking, MAX_NAMED_RECORDINGS)} "
            f"{'lacks' if len(lacking) == 1 else 'lack'} it",
        )
        for muscle, recordings, lacking in unused_channels(study)
        for recording in recordings
    ]  # fmt: skip
    wanted = f"{usual:.4g} Hz as in the study's other files"
    found += [
        channel_fault("note", "rate", *where, "time", f"{fs:.4g} Hz", wanted)
        for where, fs in rates.items()
        if abs(fs - usual) > EMG_LIMITS.rate_tolerance * usual
    ]
    return found


def trial_faults(
    recording: Recording, stream: Recording, chain: EmgChain | None = None, *, whole: bool = True
) -> list[Fault]:
    """Return the faults of one trial's EMG. `whole`: whether the trial covers its whole file."""
    found = inspect_emg(stream, notches=notch_frequencies(chain))
    if chain is not None:
        try:
            chain.require_rate(stream.fs, f"{stream.path.name} (recording {recording.name}), channel time")
        except RecordingError as error:
            found.append(
                Fault(
                    "refuse",
                    "rate",
                    stream.path.name,
                    "time",
                    f"{stream.fs:.5g} Hz",
                    "a rate its chain fits",
                    str(error),
                )
            )
    if whole and stream is not recording:
        found += _length_faults(recording, stream)
    return found


def _mean_rate(stream: Recording) -> float:
    """Return the mean sampling rate, gaps included [Hz]. Single steps may differ by ticks of another clock."""
    return (len(stream) - 1) / float(stream.time[-1] - stream.time[0])


def _length_faults(recording: Recording, stream: Recording) -> list[Fault]:
    """Return a fault if EMG does not end with its trial: it was then sampled at another rate than its times say."""
    trial, emg = (float(r.time[-1] - r.time[0]) for r in (recording, stream))
    beside = max(2.0 / recording.fs, 2.0 / stream.fs, EMG_LIMITS.rate_tolerance * trial)
    if abs(float(stream.time[-1] - recording.time[-1])) <= beside:
        return []
    text = f"{emg:.4g} s of EMG at {_mean_rate(stream):.4g} Hz, until {stream.time[-1]:.4g} s"
    wanted = (
        f"until {recording.time[-1]:.4g} s, as {recording.path.name} lasts; {len(stream)} samples are as long at "
        f"{(len(stream) - 1) / trial:.4g} Hz"
    )
    # An amplifier may run on after the trial, so longer EMG is only noted. Shorter EMG is refused.
    severity = "refuse" if emg < trial else "note"
    return [channel_fault(severity, "rate", stream.path.name, recording.name, "time", text, wanted)]


def _envelope_faults(recording: Recording, stream: Recording, chain: EmgChain) -> list[Fault]:
    """Return faults of the envelopes' contrast in maximal contractions, and of swapped channels in torque steps."""
    if recording.protocol not in (MAXIMAL_PROTOCOL, "torque_steps"):
        return []
    raw = {n.removeprefix("emg."): c for n, c in stream.channels.items() if n.startswith("emg.") and c.unit == "V"}
    try:
        made = {muscle: chain.zero_phase(c.samples, stream.fs) for muscle, c in raw.items()}
    except RecordingError:  # The recording is too short for the chain's filters, which calibration reports itself
        return []
    if recording.protocol == MAXIMAL_PROTOCOL:
        inside = (stream.time >= stream.time[0] + ENVELOPE_SETTLING_S) & (
            stream.time <= stream.time[-1] - ENVELOPE_SETTLING_S
        )
        return contrast_faults(stream, {muscle: e[inside] for muscle, e in made.items()})
    flexor, extensor = _first_muscle_named(raw, FLEXOR_NAME_PARTS), _first_muscle_named(raw, EXTENSOR_NAME_PARTS)
    if flexor is None or extensor is None or "torque" not in recording:
        return []
    # A wearer who holds still counters the orthosis's torque with its opposite.
    answered = -np.interp(stream.time, recording.time, recording["torque"])
    return swapped_faults(stream, flexor, extensor, made, answered)


def _first_muscle_named(muscles: Mapping[str, object], parts: Sequence[str]) -> str | None:
    """Return the first muscle whose name contains one of `parts`; None without one."""
    return next((muscle for muscle in muscles if any(part in muscle for part in parts)), None)


def relative_envelopes(
    study: Study, recording: Recording, top: Mapping[str, float], *, causal: bool, is_scale: bool = False
) -> dict[str, np.ndarray]:
    """Return envelopes by muscle on the recording's clock, shape (n,) each, or refuse EMG that is unfit for use.

    `top` is the envelope of each muscle that counts as 1. For a scale (`is_scale`), short peaks of raw EMG are left
    out. `study` [emg_torque].
    """
    stream, chain = recording.stream_or_self(study.table(EmgTorqueTable).emg), _study_chain(study)
    whole = stream.uncut or stream
    # A stream that ends early is refused below, for each muscle.
    faults = [fault.message for fault in trial_faults(recording, stream, whole=False) if fault.severity == "refuse"]
    if faults:
        raise RecordingError("\n".join(faults))
    made = {}
    for muscle in find_used_muscles(study, stream):
        channel = f"emg.{muscle}"
        inside = find_window(whole, recording, channel)
        x = whole[channel]
        if chain is None:
            x = x[inside]
        else:
            if stream.channels[channel].unit != "V":
                raise RecordingError(
                    f"{stream.path.name} (recording {recording.name}), channel {channel}: found the unit "
                    f'{stream.channels[channel].unit}, expected V for the chain {chain.name}; use chain = "none" '
                    "where envelopes were recorded"
                )
            chain.require_rate(stream.fs, f"{stream.path.name} (recording {recording.name}), channel {channel}")
            run = chain.causal if causal else chain.zero_phase
            x = without_short_peaks(x, stream.fs) if is_scale else x
            x = run(x, stream.fs, maximum=1.0, inside=inside)
        made[muscle] = np.interp(recording.time, whole.time[inside], x / top.get(muscle, 1.0))
    return made


def find_maxima(study: Study, participant: str | None, fitted: Sequence[Recording]) -> dict[str, float]:
    """Return the largest envelope of each muscle of a participant; empty if envelopes are not normalised.

    It is taken from maximal contractions or from the `fitted` recordings, as the study says. `study` [emg_torque].
    """
    source = _scale_recordings(study, participant, fitted)
    top: dict[str, float] = {}
    for recording in source:
        for muscle, envelope in relative_envelopes(study, recording, {}, causal=False, is_scale=True).items():
            top[muscle] = max(top.get(muscle, 0.0), float(envelope.max()))
    lost = [muscle for muscle, most in top.items() if not most > 0.0]
    if lost:
        raise IdentificationError(
            f"recordings {', '.join(r.name for r in source)}: found no activity of {', '.join(lost)}, expected the "
            "largest envelope of each muscle, which others are relative to"
        )
    return top


@dataclass(frozen=True)
class EnvelopeScale:
    """Largest envelope of a participant's muscle, by which envelopes are made relative, with its interval."""

    participant: str | None
    muscle: str
    value: float  # V
    low: float  # Ends of the interval of repetitions of the same effort [V]
    high: float


SCALE_LEVEL = 0.95
"""Probability of the interval of a scale."""


def find_scales(study: Study) -> list[EnvelopeScale]:
    """Return the scale of each muscle of raw EMG with maximal contractions, and its interval. `study` [emg_torque]."""
    chain = _study_chain(study)
    if chain is None or not _has_normalisation(chain) or study.table(EmgTorqueTable).normalise in ("largest", "none"):
        return []
    found = []
    for person in dict.fromkeys(r.participant for r in study.recordings()):
        source = _maximal_recordings(study, person)
        top = find_maxima(study, person, source) if source else {}
        for muscle, value in top.items():
            contractions = []
            for recording in source:
                stream = recording.stream_or_self(study.table(EmgTorqueTable).emg)
                whole, channel = stream.uncut or stream, f"emg.{muscle}"
                inside = find_window(whole, recording, channel)
                contractions.append(without_short_peaks(whole[channel][inside], stream.fs))
            low, high = scale_interval(contractions, stream.fs, chain, SCALE_LEVEL)
            found.append(EnvelopeScale(person, muscle, value, low * value, high * value))
    return found


def scale_verdicts(scales: Sequence[EnvelopeScale]) -> list[Verdict]:
    """Return a note of how certain the scales are."""
    if not scales:
        return []
    widest = max(scales, key=lambda scale: (scale.high - scale.low) / scale.value)
    below, above = (100.0 * abs(end / widest.value - 1.0) for end in (widest.low, widest.high))
    text = (
        f"A repetition of the same maximal contractions changes the largest envelope of {widest.muscle}, the least "
        f"certain one, by -{below:.0f} to +{above:.0f} % ({100.0 * SCALE_LEVEL:g} % interval). All envelopes of the "
        "muscle change with it."
    )
    return [Verdict("note", text)]


def scale_rows(study: str, scales: Sequence[EnvelopeScale]) -> Iterator[ResultRow]:
    """Yield the scale of each muscle and the ends of its interval."""
    for scale in scales:
        base = ".".join(filter(None, (study, "emg_scale", scale.participant, scale.muscle)))
        yield ResultRow(base, scale.value, "V", "calibrate", "fitted", None, "largest envelope of maximal contractions")
        for end in ("low", "high"):
            note = f"{end} end of the {100.0 * SCALE_LEVEL:g} % interval of a repetition of the same effort"
            yield ResultRow(f"{base}.{end}", getattr(scale, end), "V", "calibrate", "fitted", None, note)


def normalisation_words(study: Study) -> str:
    """Return a sentence that says what envelopes are relative to. `study` [emg_torque]."""
    people = dict.fromkeys(r.participant for r in study.recordings())
    mvc = [r.name for person in people for r in _maximal_recordings(study, person)]
    chain, asked = _study_chain(study), study.table(EmgTorqueTable).normalise
    if asked == "largest" or (asked is None and _has_normalisation(chain) and not mvc):
        return "Envelopes are relative to the largest effort in the fitted recordings, not to a maximal contraction."
    if asked == "mvc" or (asked is None and _has_normalisation(chain)):
        return f"Envelopes are relative to each muscle's largest value in maximal contractions: {', '.join(mvc)}."
    if chain is None:
        return "Envelopes are used as recorded; their normalization is unknown."
    return "Envelopes are in V and not normalized, so that they are not comparable between sessions."


def is_relative(study: Study) -> bool:
    """Return whether envelopes are shares of an effort. `study` [emg_torque]."""
    asked, chain = study.table(EmgTorqueTable).normalise, _study_chain(study)
    return asked in ("mvc", "largest") or (asked is None and _has_normalisation(chain)) or chain is None


def is_maximal(study: Study, participant: str | None) -> bool:
    """Return whether envelopes are relative to a maximal effort, as far as the study says. `study` [emg_torque]."""
    asked, chain = study.table(EmgTorqueTable).normalise, _study_chain(study)
    if asked is None and chain is None:
        return True
    return asked != "largest" and bool(_maximal_recordings(study, participant) or chain is None)


def find_window(stream: Recording, recording: Recording, channel: str) -> slice:
    """Return the slice of a stream's samples within the recording's window, which the stream must cover."""
    start, end, step = recording.time[0], recording.time[-1], 1.0 / stream.fs
    if stream.time[0] > start + 1.5 * step or stream.time[-1] < end - 1.5 * step:
        raise RecordingError(
            f"{stream.path.name} (recording {recording.name}), channel {channel}: found samples from "
            f"{stream.time[0]:.4g} s to {stream.time[-1]:.4g} s, expected {start:.4g} s to {end:.4g} s as in "
            f"{recording.path.name}"
        )
    return slice(*map(int, np.searchsorted(stream.time, (start - 0.5 * step, end + 0.5 * step))))


def _maximal_recordings(study: Study, participant: str | None) -> list[Recording]:
    """Return a participant's recordings of maximal contractions."""
    return [r for r in study.recordings("fit") if r.participant == participant and r.protocol == MAXIMAL_PROTOCOL]


def _scale_recordings(study: Study, participant: str | None, fitted: Sequence[Recording]) -> Sequence[Recording]:
    """Return the recordings whose largest envelopes are the scale; empty if envelopes are not normalised."""
    asked, mvc = study.table(EmgTorqueTable).normalise, _maximal_recordings(study, participant)
    if asked == "none" or (asked is None and not _has_normalisation(_study_chain(study))):
        return []
    if asked == "mvc" and not mvc:
        who = f" of {participant}" if participant else ""
        raise IdentificationError(
            f'{study.folder}: found no recording with the protocol "mvc"{who}, expected one, as [emg_torque] normalise '
            '= "mvc" says: a maximal contraction of every muscle'
        )
    return fitted if asked == "largest" else mvc or fitted


def _has_normalisation(chain: EmgChain | None) -> bool:
    """Return whether a chain divides envelopes by a maximum."""
    return chain is not None and any(stage.kind == "normalise" for stage in chain.stages)


def _study_chain(study: Study) -> EmgChain | None:
    """Return the study's filter chain; None for recorded envelopes."""
    return study_chain(study, study.table(EmgTorqueTable))
