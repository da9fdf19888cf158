"""Read ``[rig.instruments]`` of study.toml as the instruments that the supervisor's thresholds follow from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..._errors import StudyError
from ...study.instruments_table import DriveSensor
from ...study.recorded_motions import drive_model
from ...study.study_fields import StudyTable
from ...study.study_file import JointTable, SeveralJoints
from ..instruments import Instruments

INSTRUMENT_KEYS: Mapping[str, str] = {
    "encoder_resolution": "encoder_resolution",
    "second_encoder": "joint_encoder",
    "second_encoder_tolerance": "joint_tolerance",
    "spring_stiffness": "spring_stiffness",
    "emg_range": "emg_range",
    "drive_answer": "drive_answer",
    "start_up_answer": "start_up_answer",
    "start_up_wave": "start_up_wave",
    "probe": "probe",
    "probe_answer": "probe_answer",
    "probe_window": "probe_window",
    "shaking": "shaking",
}
"""Field of `Instruments` for each key of ``[rig.instruments]``."""

DRIVE_SENSOR_KEYS: Mapping[str, str] = {
    "present": "drive",
    "gain_error": "drive_gain_error",
    "offset": "drive_offset",
    "noise": "drive_noise",
    "lag": "drive_lag",
    "largest_effort": "drive_limit",
}
"""Field of `Instruments` for each key of ``[rig.instruments.drive_sensor]``."""

FORCE_SENSOR_KEYS: Mapping[str, str] = {
    "range": "force_range",
    "gain_error": "force_gain_error",
    "offset": "force_offset",
}
"""Field of `Instruments` for each key of ``[rig.instruments.force_sensor]``."""


def rig_instruments(joint: JointTable | SeveralJoints) -> Instruments:
    """Return the instruments of a joint of ``[rig]``, SI; what its table does not say has the default.

    A spring of known stiffness measures the drive. Without ``largest_effort`` the drive's largest effort follows from
    ``limit`` in ``[rig.drive]``, if that is stated.
    """
    if isinstance(joint, SeveralJoints):
        raise StudyError(joint.refusal)
    table, drive = joint.instruments, joint.drive
    given: dict[str, Any] = {}
    stated: set[str] = set()

    def take(keys: Mapping[str, str], of: StudyTable) -> None:
        given.update({name: getattr(of, key) for key, name in keys.items()})
        stated.update(name for key, name in keys.items() if key in of.model_fields_set)

    take(INSTRUMENT_KEYS, table)
    sensor = table.drive_sensor
    if sensor is None and table.spring_stiffness is not None:
        sensor = DriveSensor()
    if sensor is not None:
        stated.add(DRIVE_SENSOR_KEYS["present"])
        if sensor.present:
            take(DRIVE_SENSOR_KEYS, sensor)
    # A voltage limits the effort only together with the speed.
    limit = None if drive is None or drive.kind == "voltage" else drive.limit
    if limit is not None and given.get("drive_limit") is None:
        given["drive_limit"] = drive_model(joint).gain * limit
        stated.add("drive_limit")
    if table.force_sensor is not None:
        take(FORCE_SENSOR_KEYS, table.force_sensor)
    return Instruments(**{name: value for name, value in given.items() if value is not None}, stated=frozenset(stated))
