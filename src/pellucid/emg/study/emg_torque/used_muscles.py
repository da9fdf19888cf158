"""The EMG channels of a study that are used: those that the study names, or that all fitted recordings have."""

from __future__ import annotations

from ...._errors import RecordingError
from ....files.recording import Recording
from ....models.parameter import Verdict
from ....study.study import Study
from .emg_torque_table import EmgTorqueTable


def find_used_muscles(study: Study, stream: Recording) -> list[str]:
    """Return the muscles of a stream that the study uses; raise a RecordingError if it lacks one.

    They are those that the study names, or all that every fitted recording of the same participant has. A channel that
    some of these lack is not used. `study` [emg_torque].
    """
    wanted = study.table(EmgTorqueTable).muscles or _common_muscles(study, stream.participant)
    present = [name.removeprefix("emg.") for name in stream.channels if name.startswith("emg.")]
    missing = [m for m in wanted if m not in present]
    if missing or not present:
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found EMG of {', '.join(present) or 'no muscle'}, expected "
            f"{', '.join(missing) or 'channels emg.<muscle>'}"
        )
    return list(wanted) or present


def _common_muscles(study: Study, participant: str | None) -> tuple[str, ...]:
    """Return the muscles that all fitted recordings with EMG have: a participant's, or without any, everybody's."""
    each = [(r.participant, _emg_channels(study, r)) for r in study.recordings("fit")]
    each = [(who, names) for who, names in each if names]
    own = [names for who, names in each if who == participant] or [names for _, names in each]
    return tuple(m for m in own[0] if all(m in names for names in own)) if own else ()


def _emg_channels(study: Study, recording: Recording) -> list[str]:
    """Return the muscles with a channel in a recording. `study` [emg_torque]."""
    stream = recording.stream_or_self(study.table(EmgTorqueTable).emg)
    return [name.removeprefix("emg.") for name in stream.channels if name.startswith("emg.")]


def ignored_channels(study: Study) -> dict[str, list[str]]:
    """Return the muscles of each recording whose channels are not used, because other recordings lack them.

    Channels that the study leaves out by naming `muscles` are not among them. `study` [emg_torque].
    """
    if study.table(EmgTorqueTable).muscles:
        return {}
    recordings = study.recordings()
    used = {who: _common_muscles(study, who) for who in {r.participant for r in recordings}}
    extra = {r.name: [m for m in _emg_channels(study, r) if m not in used[r.participant]] for r in recordings}
    return {name: muscles for name, muscles in extra.items() if muscles}


def ignored_channel_verdicts(study: Study) -> list[Verdict]:
    """Return a note for each recording with channels that are not used. `study` [emg_torque]."""
    return [
        Verdict(
            "note",
            f"{name}: {', '.join(f'emg.{m}' for m in muscles)} not used, since not every fitted recording has it.",
        )
        for name, muscles in ignored_channels(study).items()
    ]
