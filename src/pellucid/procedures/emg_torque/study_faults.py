"""What is to be known of a study's EMG before it is calibrated: of each file, and of sessions against each other."""

from __future__ import annotations

from ..._errors import RecordingError
from ...recordings.fault import Fault
from ...recordings.study import Study
from ..loaded_swing.procedure import LoadedSwingTable
from .emg_faults import emg_faults
from .evaluated import Calibrated, estimators_for
from .leg_extension_trials import EXTENSION
from .procedure import EmgTorqueTable
from .relative_envelopes import maxima_of, relative_envelopes
from .seated_swings import SWINGS
from .sessions import session_faults
from .trial_sources import STEPS, moment_trials


def study_faults(study: Study) -> list[Fault]:
    """Return what is wrong with files; where nothing is refused, trials that `calibrate` refuses and channels that are
    not what they were. `study` [emg_torque]."""
    found = emg_faults(study)
    if any(fault.severity == "refuse" for fault in found):
        return found
    return [*found, *trial_refusals(study), *session_faults(study)]


def trial_refusals(study: Study) -> list[Fault]:
    """Return what `calibrate` refuses of the trials that it makes, asked of the functions that make them there.

    `study` [emg_torque].
    """
    protocols = {recording.protocol for recording in study.recordings()}
    if SWINGS in protocols and study.find_table(LoadedSwingTable) is not None:
        return []
    own = next((protocol for protocol in (STEPS, EXTENSION) if protocol in protocols), None)
    asked = study.table(EmgTorqueTable).joints if own is None else [own]
    found = []
    for what in asked:
        try:
            if own is None:
                trials = moment_trials(study, what)
                if trials:
                    estimators_for(trials, what, Calibrated())
            else:
                _make_envelopes(study, own)
        except RecordingError as error:
            text = str(error)
            found.append(Fault("refuse", "envelope", "study.toml", "", text, "trials that can be calibrated", text))
    return list({fault.message: fault for fault in found}.values())


def _make_envelopes(study: Study, protocol: str) -> None:
    """Make every envelope of a protocol's recordings; RecordingError where one cannot be made."""
    recordings = [r for r in study.recordings() if r.protocol == protocol]
    for person in dict.fromkeys(r.participant for r in recordings):
        own = [r for r in recordings if r.participant == person]
        top = maxima_of(study, person, own)
        for recording in own:
            relative_envelopes(study, recording, top, causal=False)
