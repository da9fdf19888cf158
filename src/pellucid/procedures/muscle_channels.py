"""EMG of a study, muscle by muscle: raw as it was recorded, or envelopes that may be compared with each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._errors import IdentificationError, PellucidError, RecordingError
from ..recordings.fault import Fault
from ..recordings.recording import Recording
from ..recordings.study import Study
from ..signals.emg_chain import EmgChain, emg_chain
from ..signals.emg_quality import inspect_emg
from .muscle_tables import EnvelopeTable, MuscleTable

ENVELOPE_RATE = 100.0
"""At which envelopes are kept, at least [Hz]: nothing in them is faster than their low-pass."""

SETTLING = 0.25
"""Seconds that are left out where a file begins or ends: the filters of a chain know nothing beyond."""


@dataclass(frozen=True, eq=False)
class MuscleEnvelopes:
    """Envelopes of one recording, relative to each muscle's largest of the same participant."""

    name: str  # Of the recording
    participant: str | None
    condition: str | None
    heldout: bool
    checksum: str
    time: np.ndarray  # (n,) [s]
    envelopes: Mapping[str, np.ndarray]  # (n,) By muscle [1]

    @property
    def matrix(self) -> np.ndarray:
        """All muscles, (n, m)."""
        return np.column_stack(list(self.envelopes.values()))

    @property
    def group(self) -> str:
        """Whose it is and under which condition, as words."""
        return ", ".join(part for part in (self.participant, self.condition) if part)


def emg_stream(recording: Recording, table: MuscleTable) -> Recording:
    """The file in which a recording's EMG is, cut to the recording's window."""
    stream = recording.streams.get(table.emg, recording)
    if stream is recording:
        return recording
    inside = _within(stream, recording)
    if inside == slice(0, len(stream)):
        return stream
    channels = {name: replace(c, samples=c.samples[inside]) for name, c in stream.channels.items()}
    return replace(stream, channels=channels, uncut=stream)


def _within(whole: Recording, recording: Recording) -> slice:
    """Samples of a whole file within a recording's time."""
    half = 0.5 / whole.fs
    return slice(*map(int, np.searchsorted(whole.time, (recording.time[0] - half, recording.time[-1] + half))))


def raw_around(stream: Recording, muscle: str) -> tuple[np.ndarray, slice]:
    """Raw EMG of a muscle in the whole file, (n,) [V], and which of it is the stream's own."""
    raw_channel(stream, muscle)
    whole = stream.uncut or stream
    return whole[f"emg.{muscle}"], _within(whole, stream)


def with_emg(study: Study, table: MuscleTable) -> list[Recording]:
    """Recordings that have EMG; RecordingError without any."""
    found = [r for r in study.recordings() if any(n.startswith("emg.") for n in emg_stream(r, table).channels)]
    if not found:
        raise RecordingError(f"{study.folder}: found no recording with EMG, expected channels emg.<muscle>")
    return found


def muscles_of(stream: Recording, table: MuscleTable) -> tuple[str, ...]:
    """Muscles to use of one file; RecordingError where one is not there."""
    present = [name.removeprefix("emg.") for name in stream.channels if name.startswith("emg.")]
    missing = [muscle for muscle in table.muscles if muscle not in present]
    if missing:
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found EMG of {', '.join(present) or 'no muscle'}, expected "
            f"{', '.join(missing)} too"
        )
    return table.muscles or tuple(present)


def emg_faults(study: Study, table: MuscleTable) -> list[Fault]:
    """What is wrong with the EMG of the muscles that a table uses."""
    found = []
    for recording in with_emg(study, table):
        stream = emg_stream(recording, table)
        wanted = {f"emg.{muscle}" for muscle in muscles_of(stream, table)} | {"time"}
        only = replace(stream, channels={n: c for n, c in stream.channels.items() if n in wanted})
        found += inspect_emg(only, has_notch=isinstance(table, EnvelopeTable))
    return found


def envelope_faults(
    study: Study, table: EnvelopeTable, check: Callable[[Study, list[MuscleEnvelopes]], object], expected: str
) -> list[Fault]:
    """EMG that is not fit to be used, and envelopes that `check` refuses, `expected` in a word."""
    found = emg_faults(study, table)
    if any(fault.severity == "refuse" for fault in found):
        return found
    try:
        check(study, relative_envelopes(study, table))
    except (RecordingError, IdentificationError) as error:
        message = str(error)
        found.append(Fault("refuse", "missing_channel", "study.toml", "", message, expected, message))
    return found


def refuse(faults: Sequence[Fault]) -> None:
    """RecordingError with every fault that refuses; none without."""
    told = [fault.message for fault in faults if fault.severity == "refuse"]
    if told:
        raise RecordingError("\n".join(told))


def raw_channel(stream: Recording, muscle: str) -> np.ndarray:
    """Raw EMG of a muscle, (n,) [V]; RecordingError where an envelope was recorded."""
    channel = stream.channels[f"emg.{muscle}"]
    if channel.unit != "V":
        raise RecordingError(
            f"{where(stream, muscle)}: found the unit {channel.unit}, expected raw EMG in V: an envelope has lost when "
            "a muscle began"
        )
    return channel.samples


def where(stream: Recording, muscle: str) -> str:
    """A channel, as messages name it."""
    return f"{stream.path.name} (recording {stream.name}), channel emg.{muscle}"


def relative_envelopes(study: Study, table: EnvelopeTable) -> list[MuscleEnvelopes]:
    """Return envelopes of every recording but maximal contractions, relative to the largest of a participant's maximal
    contractions, or without one to the largest of the participant's fitted recordings.
    """
    recordings = with_emg(study, table)
    made = [(recording, *_envelopes(emg_stream(recording, table), table)) for recording in recordings]
    top: dict[tuple[str | None, str], float] = {}
    fitted = [r for r in recordings if r.use == "fit"]
    maximal = {r.participant for r in fitted if r.protocol == "mvc"}
    unscaled = sorted({r.participant or "" for r in recordings} - {r.participant or "" for r in fitted})
    if unscaled:
        who = ", ".join(unscaled).strip()
        raise RecordingError(
            f'{study.folder}: found only recordings with use = "validate"{f" of {who}" if who else ""}, expected one '
            'with use = "fit", a maximal contraction (protocol = "mvc") or another, whose largest envelope is the scale'
        )
    for recording, _, envelopes in made:
        if recording.use != "fit" or (recording.participant in maximal and recording.protocol != "mvc"):
            continue
        for muscle, x in envelopes.items():
            key = recording.participant, muscle
            top[key] = max(top.get(key, 0.0), float(x.max()))
    silent = sorted({muscle for (_, muscle), most in top.items() if not most > 0.0})
    if silent:
        raise RecordingError(f"{study.folder}: found no activity at all of {', '.join(silent)}, expected some")
    return [
        MuscleEnvelopes(
            r.name, r.participant, r.condition, r.use != "fit", r.checksum, time,
            {muscle: np.maximum(x, 0.0) / top[r.participant, muscle] for muscle, x in envelopes.items()},
        )
        for r, time, envelopes in made
        if r.protocol != "mvc"
    ]  # fmt: skip


def _envelopes(stream: Recording, table: EnvelopeTable) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times [s] and envelopes, thinned, of one file."""
    every = slice(None, None, max(1, int(stream.fs / ENVELOPE_RATE)))
    if table.chain == "none":
        return stream.time[every], {m: _recorded(stream, m)[every] for m in muscles_of(stream, table)}
    chain = _unscaled(emg_chain(table.chain, table.mains))
    settling = round(SETTLING * stream.fs)
    kept = slice(None)
    if len(stream) < 4 * settling:
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found {len(stream) / stream.fs:.3g} s of EMG, expected at "
            f"least {4.0 * SETTLING:g} s"
        )
    made = {}
    for muscle in muscles_of(stream, table):
        if stream.channels[f"emg.{muscle}"].unit != "V":
            raise RecordingError(
                f"{where(stream, muscle)}: found the unit {stream.channels[f'emg.{muscle}'].unit}, expected V for the "
                f'chain {chain.name}; use chain = "none" where envelopes were recorded'
            )
        samples, inside = raw_around(stream, muscle)
        # Only where the file itself begins or ends nothing is known beyond.
        first, last = max(settling - inside.start, 0), max(settling - (len(samples) - inside.stop), 0)
        kept = slice(first, inside.stop - inside.start - last)
        try:
            made[muscle] = chain.zero_phase(samples, stream.fs, inside=inside)[kept][every]
        except PellucidError as error:
            raise RecordingError(f"{where(stream, muscle)}: {error}") from None
    return stream.time[kept][every], made


def _recorded(stream: Recording, muscle: str) -> np.ndarray:
    channel = stream.channels[f"emg.{muscle}"]
    if channel.unit == "V":
        raise RecordingError(
            f'{where(stream, muscle)}: found the unit V, expected an envelope for chain = "none"; name the chain that '
            "makes one of raw EMG"
        )
    # A filter run both ways may leave a little below 0 behind a burst.
    if np.min(channel.samples) < -0.2 * np.max(channel.samples):
        raise RecordingError(
            f"{where(stream, muscle)}: found {np.min(channel.samples):.3g}, expected an envelope, none below 0: raw "
            "EMG has a unit of volts and needs a chain"
        )
    return channel.samples


def _unscaled(chain: EmgChain) -> EmgChain:
    """Without what divides by a recording's own maximum: efforts of several are compared."""
    return replace(chain, stages=tuple(s for s in chain.stages if s.kind != "normalise"))
