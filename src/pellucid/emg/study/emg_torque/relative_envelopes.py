"""Envelopes on a recording's clock, relative to maximal contractions or to the largest effort seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...._errors import IdentificationError, RecordingError
from ....files.recording import MAXIMAL_PROTOCOL, Recording
from ....study.study import Study
from ...signals.emg_chain import EmgChain
from ..muscle_channels import study_chain
from .emg_faults import trial_faults
from .emg_torque_table import EmgTorqueTable
from .study_muscles import find_used_muscles


def relative_envelopes(
    study: Study, recording: Recording, top: Mapping[str, float], *, causal: bool
) -> dict[str, np.ndarray]:
    """Return envelopes by muscle on the recording's clock, shape (n,) each, or refuse EMG that is unfit for use.

    `top` is the envelope of each muscle that counts as 1. `study` [emg_torque].
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
        for muscle, envelope in relative_envelopes(study, recording, {}, causal=False).items():
            top[muscle] = max(top.get(muscle, 0.0), float(envelope.max()))
    lost = [muscle for muscle, most in top.items() if not most > 0.0]
    if lost:
        raise IdentificationError(
            f"recordings {', '.join(r.name for r in source)}: found no activity of {', '.join(lost)}, expected the "
            "largest envelope of each muscle, which others are relative to"
        )
    return top


def normalisation_words(study: Study) -> str:
    """Return a sentence that says what envelopes are relative to. `study` [emg_torque]."""
    people = dict.fromkeys(r.participant for r in study.recordings())
    mvc = [r.name for person in people for r in _maximal_recordings(study, person)]
    chain, asked = _study_chain(study), study.table(EmgTorqueTable).normalise
    if asked == "largest" or (asked is None and _has_normalisation(chain) and not mvc):
        return "Envelopes are relative to the largest of what is fitted: a share of that effort, not of a maximal one."
    if asked == "mvc" or (asked is None and _has_normalisation(chain)):
        return f"Envelopes are relative to the largest of each muscle in maximal contractions: {', '.join(mvc)}."
    if chain is None:
        return "Envelopes are taken as they were recorded: what they are relative to is not known here."
    return "Envelopes are in V, relative to nothing: another session's electrodes give others."


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
