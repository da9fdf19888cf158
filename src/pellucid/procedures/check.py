"""Are these recordings fit to identify from? Faults of the files, then faults of the motion."""

from __future__ import annotations

from .._errors import PellucidError
from ..fit.joint.regression import solve, stack
from ..models.joint import joint_model
from ..recordings.quality import Fault, drive_channel, inspect
from ..recordings.study import Study
from ..signals.effort import drive_model
from ..signals.motion import motions
from .joint.joint_verdicts import sign_error
from .run import procedure_faults
from .slider.slider_faults import examine


def check(study: Study) -> list[Fault]:
    """Every fault found in a study's recordings; empty where there is none.

    Parameters
    ----------
    study : Study

    Returns
    -------
    list of Fault
        `severity` "refuse" stops `identify`, "note" does not.

    Raises
    ------
    RecordingError
        If a file cannot be read at all.
    """
    faults: list[Fault] = []
    if study.config.emg_torque is not None:
        from .emg_torque.emg_faults import emg_faults

        faults += emg_faults(study)
    if study.config.assessment is not None:
        from .assessment.pointing_faults import assessment_faults

        faults += assessment_faults(study)
    if study.config.procedure is not None:
        faults += procedure_faults(study)
    if study.config.procedure is not None or study.rig.drive is None:
        return sorted(faults, key=lambda fault: fault.severity != "refuse")
    faults += [fault for recording in study.recordings() for fault in inspect(recording, study)]
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    if study.rig.slider is not None:
        more = examine(study.config, study.recordings()).faults
        return sorted(faults + more, key=lambda fault: fault.severity != "refuse")
    try:
        data = stack([m for m in motions(study) if m.split == "fitted"])
        model = joint_model(
            "symmetric",
            motion=study.rig.motion,
            effort_unit=drive_model(study.rig).effort_unit,
            gravity=study.model.gravity,
            known=study.model.known,
        )
        solve(model, data)
        sign_error(model, data, drive_channel(study.recordings("fit")[0], study))
    except PellucidError as error:
        faults.append(
            Fault(
                severity="refuse",
                kind="excitation",
                file="study.toml",
                channel="",
                found=str(error),
                expected="a motion that shows every parameter",
                message=str(error),
            )
        )
    return faults
