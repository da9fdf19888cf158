"""Faults of a study's EMG before calibration: in each file, and between sessions."""

from __future__ import annotations

from ...._domains import offered
from ...._errors import RecordingError
from ....files.fault import Fault
from ....study.study import Study
from .emg_torque_table import EmgTorqueTable
from .relative_envelopes import emg_faults, find_maxima, relative_envelopes
from .sessions import session_faults
from .torque_findings import CalibrationFindings, find_applicable_estimators
from .trial_sources import EXTENSION_PROTOCOL, STEP_PROTOCOL, moment_trials


def study_faults(study: Study) -> list[Fault]:
    """Return faults of files, and if none is refused, trials that `calibrate` refuses and channels that changed.

    `study` [emg_torque].
    """
    found = emg_faults(study)
    if any(fault.severity == "refuse" for fault in found):
        return found
    return [*found, *trial_refusals(study), *session_faults(study)]


def trial_refusals(study: Study) -> list[Fault]:
    """Return faults of trials that `calibrate` refuses, found by the same functions that make the trials there.

    `study` [emg_torque].
    """
    protocols = {recording.protocol for recording in study.recordings()}
    if any(evaluation.suits(study) for evaluation in offered("TORQUE_EVALUATIONS")):
        return []
    own = next((protocol for protocol in (STEP_PROTOCOL, EXTENSION_PROTOCOL) if protocol in protocols), None)
    asked = study.table(EmgTorqueTable).joints if own is None else [own]
    found = []
    for what in asked:
        try:
            if own is None:
                trials = moment_trials(study, what)
                if trials:
                    find_applicable_estimators(trials, what, CalibrationFindings())
            else:
                _make_envelopes(study, own)
        except RecordingError as error:
            text = str(error)
            found.append(Fault("refuse", "envelope", "study.toml", "", text, "trials that can be calibrated", text))
    return list({fault.message: fault for fault in found}.values())


def _make_envelopes(study: Study, protocol: str) -> None:
    """Make every envelope of a protocol's recordings; raise a RecordingError if one cannot be made."""
    recordings = [r for r in study.recordings() if r.protocol == protocol]
    for person in dict.fromkeys(r.participant for r in recordings):
        own = [r for r in recordings if r.participant == person]
        top = find_maxima(study, person, own)
        for recording in own:
            relative_envelopes(study, recording, top, causal=False)
