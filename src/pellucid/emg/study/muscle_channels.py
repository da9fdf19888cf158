"""EMG of a study by muscle: raw as it was recorded, or envelopes that can be compared with each other.

The filter chain that a study's table asks for, with the mains that its fitted recordings show.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..._errors import IdentificationError, PellucidError, RecordingError, listed_names
from ...files.fault import Fault
from ...files.recording import MAXIMAL_PROTOCOL, Recording
from ...models.estimates import Verdict
from ...study.answer import Step
from ...study.procedures.audit import ENVELOPE_CORRECTION
from ...study.study import Study
from ..signals.emg_chain import EmgChain, emg_chain
from ..signals.emg_findings import (
    envelope_words,
    exchanged_findings,
    own_maximum_channels,
    own_maximum_finding,
    without_short_peaks,
)
from ..signals.emg_quality import ENVELOPE_SCALE_KIND, FINDING_FAULTS, channel_fault, find_hum, inspect_emg
from ..signals.exchanged import exchanged_recordings
from .emg_torque.emg_torque_table import EmgTorqueTable
from .muscle_tables import EnvelopeTable, MuscleTable


def study_chain(study: Study, table: EnvelopeTable | EmgTorqueTable) -> EmgChain | None:
    """Return the chain that a table asks for; None where envelopes were recorded."""
    if table.chain == "none":
        return None
    return emg_chain(
        table.chain, find_notch(study, table), band=table.band, lowpass=table.lowpass, rms_window=table.rms_window
    )


def find_notch(study: Study, table: EnvelopeTable | EmgTorqueTable) -> float | None:
    """Return the frequency of the notch that a table asks for [Hz]; None for that of the published chain.

    Only fitted recordings are searched for hum, so that no other influences an envelope.
    """
    if table.mains != "auto":
        return None if table.mains is None else float(table.mains)
    fitted = [r.stream_or_self(table.emg) for r in study.recordings("fit")]
    key = "mains", table.emg, *(r.name for r in fitted)
    if key not in study.found:
        study.found[key] = find_hum(fitted)
    return study.found[key]


def notch_frequencies(chain: EmgChain | None) -> tuple[float, ...]:
    """Return the frequencies that a chain's notches take out [Hz]."""
    return () if chain is None else tuple(s.cutoff[0] for s in chain.stages if s.kind == "notch")


def mains_verdicts(study: Study, table: EnvelopeTable | EmgTorqueTable) -> list[Verdict]:
    """Return a note of the mains that were found, if a table asks for that."""
    if table.mains != "auto" or table.chain == "none":
        return []
    found = find_notch(study, table)
    if found is None:
        text = f"The fitted recordings have no mains hum; the chain {table.chain} is used as published."
    else:
        text = f"The fitted recordings have mains hum at {found:g} Hz, which a notch filter removes."
    return [Verdict("note", text)]


MIN_ENVELOPE_RATE_HZ = 100.0
"""Smallest rate to which envelopes are decimated [Hz]. Their low-pass removes all higher frequencies."""

FILTER_SETTLING_S = 0.25
"""Duration excluded at the start and end of a file [s], where the filters of a chain have not settled."""


@dataclass(frozen=True, eq=False)
class MuscleEnvelopes:
    """Envelopes of one recording, relative to each muscle's largest of the same participant."""

    name: str  # Name of the recording
    participant: str | None
    condition: str | None
    heldout: bool
    checksum: str
    time: np.ndarray  # Time, shape (n,) [s]
    envelopes: Mapping[str, np.ndarray]  # Envelopes by muscle, shape (n,) each [1]

    @property
    def matrix(self) -> np.ndarray:
        """Envelopes of all muscles, shape (n, m)."""
        return np.column_stack(list(self.envelopes.values()))

    @property
    def group(self) -> str:
        """Participant and condition in words."""
        return ", ".join(part for part in (self.participant, self.condition) if part)


def emg_stream(recording: Recording, table: MuscleTable) -> Recording:
    """Return the stream with a recording's EMG, cut to the recording's window."""
    stream = recording.stream_or_self(table.emg)
    if stream is recording:
        return recording
    inside = _find_window(stream, recording)
    if inside == slice(0, len(stream)):
        return stream
    channels = {name: replace(c, samples=c.samples[inside]) for name, c in stream.channels.items()}
    return replace(stream, channels=channels, uncut=stream)


def _find_window(whole: Recording, recording: Recording) -> slice:
    """Return the slice of a whole file's samples within a recording's time."""
    half = 0.5 / whole.fs
    return slice(*map(int, np.searchsorted(whole.time, (recording.time[0] - half, recording.time[-1] + half))))


def raw_whole_file(stream: Recording, muscle: str) -> tuple[np.ndarray, slice]:
    """Return raw EMG of a muscle in the whole file, shape (n,) [V], and the slice of the stream in it."""
    raw_channel(stream, muscle)
    whole = stream.uncut or stream
    return whole[f"emg.{muscle}"], _find_window(whole, stream)


def find_recordings_with_emg(study: Study, table: MuscleTable) -> list[Recording]:
    """Return the recordings with EMG; raise a RecordingError if there are none."""
    found = [r for r in study.recordings() if any(n.startswith("emg.") for n in emg_stream(r, table).channels)]
    if not found:
        raise RecordingError(f"{study.folder}: found no recording with EMG, expected channels emg.<muscle>")
    return found


def find_used_muscles(stream: Recording, table: MuscleTable) -> tuple[str, ...]:
    """Return the muscles of a file that a table uses; raise a RecordingError if one is missing."""
    present = [name.removeprefix("emg.") for name in stream.channels if name.startswith("emg.")]
    missing = [muscle for muscle in table.muscles if muscle not in present]
    if missing:
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found EMG of {', '.join(present) or 'no muscle'}, expected "
            f"{', '.join(missing)} too"
        )
    return table.muscles or tuple(present)


def emg_faults(study: Study, table: MuscleTable) -> list[Fault]:
    """Return the faults of the EMG of the muscles that a table uses."""
    found, streams = [], []
    notches = notch_frequencies(study_chain(study, table)) if isinstance(table, EnvelopeTable) else None
    for recording in find_recordings_with_emg(study, table):
        stream = emg_stream(recording, table)
        wanted = {f"emg.{muscle}" for muscle in find_used_muscles(stream, table)} | {"time"}
        only = replace(stream, channels={n: c for n, c in stream.channels.items() if n in wanted})
        found += inspect_emg(only, notches=notches)
        streams.append(only)
    if isinstance(table, EnvelopeTable):  # The analysis scales envelopes itself, so that any scale will do
        found = [fault for fault in found if fault.kind != ENVELOPE_SCALE_KIND]
    return found + session_faults(study, streams)


def envelope_faults(
    study: Study, table: EnvelopeTable, check: Callable[[list[MuscleEnvelopes]], object], expected: str
) -> list[Fault]:
    """Return faults of EMG, and of envelopes that `check` refuses. `expected` names what was missing."""
    found = emg_faults(study, table)
    if any(fault.severity == "refuse" for fault in found):
        return found
    try:
        check(relative_envelopes(study, table))
    except (RecordingError, IdentificationError) as error:
        message = str(error)
        found.append(Fault("refuse", "missing_channel", "study.toml", "", message, expected, message))
    return found


def raise_refusals(faults: Sequence[Fault]) -> None:
    """Raise a RecordingError with the messages of all refusing faults, if there are any."""
    refusals = [fault.message for fault in faults if fault.severity == "refuse"]
    if refusals:
        raise RecordingError("\n".join(refusals))


def raw_channel(stream: Recording, muscle: str) -> np.ndarray:
    """Return raw EMG of a muscle, shape (n,) [V]; raise a RecordingError if an envelope was recorded."""
    channel = stream.channels[f"emg.{muscle}"]
    if channel.unit != "V":
        raise RecordingError(
            f"{name_channel(stream, muscle)}: found the unit {channel.unit}, expected raw EMG in V: an envelope has "
            "lost when a muscle began"
        )
    return channel.samples


def enveloped_channels(study: Study, table: MuscleTable) -> list[tuple[str, str]]:
    """Return recording and muscle of every channel that is stated as raw EMG and holds an envelope."""
    found = []
    for recording in find_recordings_with_emg(study, table):
        stream = emg_stream(recording, table)
        found.extend(
            (recording.name, muscle)
            for muscle in find_used_muscles(stream, table)
            if stream.channels[name := f"emg.{muscle}"].unit == "V" and envelope_words(stream[name], stream.fs)
        )
    return found


def raw_emg_steps(enveloped: Mapping[str, int]) -> tuple[Step, ...]:
    """Return the step that muscles need whose channels hold envelopes where raw EMG was expected; none without any."""
    if not enveloped:
        return ()
    return (Step(ENVELOPE_CORRECTION.format(channels=counted_muscles(enveloped))),)


def counted_muscles(counts: Mapping[str, int]) -> str:
    """Return muscles in words, each with its number of recordings."""
    return ", ".join(
        f"{muscle.replace('_', ' ')} ({count} recording{'s' * (count > 1)})" for muscle, count in counts.items()
    )


def name_channel(stream: Recording, muscle: str) -> str:
    """Return the words with which messages name a channel."""
    return f"{stream.path.name} (recording {stream.name}), channel emg.{muscle}"


def relative_envelopes(study: Study, table: EnvelopeTable) -> list[MuscleEnvelopes]:
    """Return relative envelopes of every recording except maximal contractions.

    The scale is the largest envelope in a participant's maximal contractions, or without any, in the participant's
    fitted recordings.
    """
    recordings = find_recordings_with_emg(study, table)
    tables = {who: _table_of_participant(recordings, table, who) for who in {r.participant for r in recordings}}
    chain = study_chain(study, table)
    made = [(r, *_stream_envelopes(emg_stream(r, table), tables[r.participant], chain)) for r in recordings]
    top: dict[tuple[str | None, str], float] = {}
    fitted = [r for r in recordings if r.use == "fit"]
    maximal = {r.participant for r in fitted if r.protocol == MAXIMAL_PROTOCOL}
    unscaled = sorted({r.participant or "" for r in recordings} - {r.participant or "" for r in fitted})
    if unscaled:
        who = ", ".join(unscaled).strip()
        raise RecordingError(
            f'{study.folder}: found only recordings with use = "validate"{f" of {who}" if who else ""}, expected one '
            'with use = "fit", a maximal contraction (protocol = "mvc") or another, whose largest envelope is the scale'
        )
    for recording, _, plain in made:
        if recording.use != "fit" or (recording.participant in maximal and recording.protocol != MAXIMAL_PROTOCOL):
            continue
        stream = sound_stream(emg_stream(recording, table))
        envelopes = plain
        if stream is not None:
            envelopes = _stream_envelopes(stream, tables[recording.participant], chain)[1]
        for muscle, x in envelopes.items():
            key = recording.participant, muscle
            top[key] = max(top.get(key, 0.0), float(x.max()))
    silent = sorted({muscle for (_, muscle), most in top.items() if not most > 0.0})
    if silent:
        raise RecordingError(f"{study.folder}: found no activity at all of {', '.join(silent)}, expected some")
    if all(recording.protocol == MAXIMAL_PROTOCOL for recording in recordings):
        raise RecordingError(f"{study.folder}: found maximal contractions alone, expected a recording of movement too")
    return [
        MuscleEnvelopes(
            r.name, r.participant, r.condition, r.use != "fit", r.checksum, time,
            {muscle: np.maximum(x, 0.0) / top[r.participant, muscle] for muscle, x in envelopes.items()},
        )
        for r, time, envelopes in made
        if r.protocol != MAXIMAL_PROTOCOL
    ]  # fmt: skip


def sound_stream(stream: Recording) -> Recording | None:
    """Return a stream whose raw EMG has no short peaks, from which its maxima are taken; None if it has none anyway."""

    def sound(each: Recording) -> Recording:
        channels = {
            name: replace(c, samples=without_short_peaks(c.samples, each.fs))
            if name.startswith("emg.") and c.unit == "V"
            else c
            for name, c in each.channels.items()
        }
        return replace(each, channels=channels)

    made = sound(stream)
    if all(made.channels[name].samples is c.samples for name, c in stream.channels.items()):
        return None
    return replace(made, uncut=sound(stream.uncut)) if stream.uncut is not None else made


def session_faults(study: Study, streams: Sequence[Recording]) -> list[Fault]:
    """Return what recordings of a study show only together: trials with own maxima, and exchanged channels.

    Several procedures look at the same channels; the study keeps what was found.
    """
    named = ((s.name, s.path, *(name for name in s.channels if name.startswith("emg."))) for s in streams)
    key = "session_faults", *named
    if key not in study.found:
        study.found[key] = per_trial_faults(streams) + exchanged_faults(streams)
    return list(study.found[key])


def excluded_faults(study: Study, names: Collection[str]) -> list[Fault]:
    """Return what is wrong with the EMG of the excluded recordings of these names: none of it stops the study."""
    streams, found, files = [], [], set()
    for recording in study.recordings():
        for part in (recording, *recording.streams.values()):
            if not any(name.startswith("emg.") for name in part.channels):
                continue
            streams.append(part)
            if recording.name in names:
                found += inspect_emg(part)
                files.add(part.path.name)
    found += [fault for fault in session_faults(study, streams) if fault.file in files]
    return [replace(fault, severity="warn") if fault.severity == "refuse" else fault for fault in found]


def exchanged_faults(streams: Sequence[Recording]) -> list[Fault]:
    """Return faults of channels that are exchanged against another recording of the same participant."""
    groups: dict[tuple[object, ...], dict[Path, tuple[Recording, tuple[str, ...], np.ndarray]]] = {}
    for stream in streams:
        whole = stream.uncut or stream
        names = tuple(n for n, c in whole.channels.items() if n.startswith("emg.") and c.unit == "V")
        if len(names) > 1 and stream.path not in groups.get(key := (stream.participant, names, round(stream.fs)), {}):
            samples = np.column_stack([whole[n] for n in names])
            groups.setdefault(key, {})[stream.path] = (stream, names, samples)
    found = []
    for group in groups.values():
        own = list(group.values())
        for each in exchanged_recordings([samples for _, _, samples in own], own[0][0].fs):
            (stream, names, samples), (other, _, _) = own[each.place], own[each.reference]
            by_channel = exchanged_findings(each.pairs, names, len(samples) / stream.fs, other.path.name)
            severity, kind, expected = FINDING_FAULTS["exchanged"]
            for name, one in by_channel.items():
                where = stream.path.name, stream.name, str(name)
                found.append(channel_fault(severity, kind, *where, one.found, expected))
    return found


def per_trial_faults(streams: Sequence[Recording]) -> list[Fault]:
    """Return faults of relative envelopes that reach exactly 1 in a recording: its own maximum.

    Several recordings of a participant cannot be compared then. Of a single one it is a note.
    """
    files: dict[object, dict[Path, tuple[Recording, tuple[str, ...], set[str]]]] = {}
    for stream in streams:
        own = files.setdefault(stream.participant, {})
        if stream.path not in own:
            whole = stream.uncut or stream
            relative = {n: c.samples for n, c in whole.channels.items() if n.startswith("emg.") and c.unit != "V"}
            reached = {n for n, x in relative.items() if own_maximum_finding(n, x, whole.fs, "1") is not None}
            own[stream.path] = (stream, tuple(relative), reached)
    faults = []
    for own in files.values():
        members = [*own.values()]
        kept = own_maximum_channels([(names, reached) for _, names, reached in members])
        for name in dict.fromkeys(n for _, names, _ in members for n in names):
            trials = [stream for (stream, _, _), channels in zip(members, kept, strict=True) if name in channels]
            if not trials:
                continue
            if len(trials) == 1:
                severity, said = "note", "a largest value of exactly 1, its own maximum"
            else:
                listed = listed_names([each.name for each in trials], 5)
                severity, each = "warn", f"a largest value of exactly 1 in each of {len(trials)} recordings ({listed})"
                said = f"{each}: each is its own maximum"
            expected = "one maximum for all recordings of a participant"
            where = trials[0].path.name, trials[0].name, name
            faults.append(channel_fault(severity, "normalised_per_trial", *where, said, expected))
    return faults


def _table_of_participant(
    recordings: Sequence[Recording], table: EnvelopeTable, participant: str | None
) -> EnvelopeTable:
    """Return the table with the muscles that all fitted recordings of a participant have, if it names none."""
    if table.muscles:
        return table
    fitted = [r for r in recordings if r.participant == participant and r.use == "fit"]
    own = [find_used_muscles(emg_stream(r, table), table) for r in fitted]
    common = [muscle for muscle in own[0] if all(muscle in names for names in own)] if own else []
    return table.model_copy(update={"muscles": tuple(common)})


def _stream_envelopes(
    stream: Recording, table: EnvelopeTable, asked: EmgChain | None
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the times [s] and the envelopes of one file by the chain `asked`, thinned."""
    every = slice(None, None, max(1, int(stream.fs / MIN_ENVELOPE_RATE_HZ)))
    if asked is None:
        return stream.time[every], {m: _recorded_envelope(stream, m)[every] for m in find_used_muscles(stream, table)}
    chain = _without_normalisation(asked)
    settling = round(FILTER_SETTLING_S * stream.fs)
    if len(stream) < 4 * settling:
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found {len(stream) / stream.fs:.3g} s of EMG, expected at "
            f"least {4.0 * FILTER_SETTLING_S:g} s"
        )
    made, muscles = {}, find_used_muscles(stream, table)
    has_raw = any(stream.channels[f"emg.{muscle}"].unit == "V" for muscle in muscles)
    whole = stream.uncut or stream
    inside = _find_window(whole, stream)
    # Settling time is left out only where the file itself begins or ends, not at the window's ends.
    first, last = max(settling - inside.start, 0), max(settling - (len(whole) - inside.stop), 0)
    kept = slice(first, inside.stop - inside.start - last)
    for muscle in muscles:
        is_raw = stream.channels[f"emg.{muscle}"].unit == "V"
        if not is_raw and not has_raw:
            raise RecordingError(
                f"{name_channel(stream, muscle)}: found the unit {stream.channels[f'emg.{muscle}'].unit}, expected V "
                f'for the chain {chain.name}; use chain = "none" where envelopes were recorded'
            )
        if not is_raw:
            _recorded_envelope(stream, muscle)
        own = chain if is_raw else _smoothing_part(chain)
        try:
            made[muscle] = own.zero_phase(whole[f"emg.{muscle}"], stream.fs, inside=inside)[kept][every]
        except PellucidError as error:
            raise RecordingError(f"{name_channel(stream, muscle)}: {error}") from None
    return stream.time[kept][every], made


def _smoothing_part(chain: EmgChain) -> EmgChain:
    """Return the stages that smooth rectified EMG: recorded envelopes become as smooth as those of raw EMG."""
    kinds = [stage.kind for stage in chain.stages]
    return replace(chain, stages=chain.stages[kinds.index("rectify") :])


def _recorded_envelope(stream: Recording, muscle: str) -> np.ndarray:
    """Return a recorded envelope, shape (n,); refuse raw EMG."""
    channel = stream.channels[f"emg.{muscle}"]
    if channel.unit == "V":
        raise RecordingError(
            f'{name_channel(stream, muscle)}: found the unit V, expected an envelope for chain = "none"; name the '
            "chain that makes one of raw EMG"
        )
    # A zero-phase filter may undershoot slightly below 0 beside a burst.
    if np.min(channel.samples) < -0.2 * np.max(channel.samples):
        raise RecordingError(
            f"{name_channel(stream, muscle)}: found {np.min(channel.samples):.3g}, expected an envelope, none below 0: "
            "raw EMG has a unit of volts and needs a chain"
        )
    return channel.samples


def _without_normalisation(chain: EmgChain) -> EmgChain:
    """Return a chain without normalisation by a recording's own maximum, so that recordings can be compared."""
    return replace(chain, stages=tuple(s for s in chain.stages if s.kind != "normalise"))
