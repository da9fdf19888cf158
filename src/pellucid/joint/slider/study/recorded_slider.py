"""Recordings of a joint with a carriage, made ready for fits as study.toml says.

Are recordings of a joint with a carriage fit to identify from? What the markers show, then what the motion lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...._errors import IdentificationError, PellucidError, RecordingError
from ....files.fault import Fault, warn_if_held_out
from ....files.recording import Recording
from ....numerics.protocols.excitation import REVERSALS_NAME
from ....study.procedures.dead_effort import dead_effort_faults
from ....study.quality import inspect
from ....study.recorded_motions import command_of, drive_model
from ....study.study import Study
from ....study.study_file import StudyFile
from ..axis_offset import FREE_CARRIAGE_NAME
from ..markers import Geometry, geometry_faults, slider_geometry
from ..slider_fit import STEP_PROTOCOLS, SliderMotion, require_both_directions, require_places, slider_motion


def slider_motions(recordings: Sequence[Recording], config: StudyFile, geometry: Geometry) -> tuple[SliderMotion, ...]:
    """Return the motion of every recording, with the processing that study.toml states for it."""
    gain = drive_model(config.rig).gain
    places = {placement.recording: placement.slider for placement in geometry.placements}
    made = []
    for recording in recordings:
        processing = config.processing_of(recording.name)
        if processing.lowpass is None and processing.sliding_means is None:
            raise RecordingError('study.toml: [processing] states no lowpass; expected one such as "5 Hz"')
        made.append(
            slider_motion(
                recording,
                gain * command_of(recording, config.rig),
                places[recording.name],
                lowpass=processing.lowpass or 0.0,
                order=processing.order,
                dead_band=processing.dead_band,
                trim=processing.trim,
                recorded_velocity=processing.velocity == "recorded",
                sliding_means=processing.sliding_means,
            )
        )
    return tuple(made)


@dataclass(frozen=True)
class SliderExamination:
    """Examined recordings of a joint with a carriage."""

    faults: list[Fault]  # Faults, those that refuse first
    geometry: Geometry | None = None
    motions: tuple[SliderMotion, ...] = ()  # Motions that could be computed; complete if no fault refuses


def slider_faults(study: Study) -> list[Fault]:
    """Return the faults of every file and, if none refuses, of the carriage's places and the motions."""
    faults = [fault for recording in study.recordings() for fault in inspect(recording, study)]
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    faults += dead_effort_faults(study)
    if any(fault.severity == "refuse" for fault in faults):
        return faults
    return faults + examine(study.config, study.recordings()).faults


def of_body(recordings: Sequence[Recording]) -> list[Recording]:
    """Those that show the body alone: reversals show how its friction builds up, a free carriage where a wearer is."""
    others = (REVERSALS_NAME, FREE_CARRIAGE_NAME)
    return [recording for recording in recordings if recording.protocol not in others]


def examine(config: StudyFile, recordings: Sequence[Recording]) -> SliderExamination:
    """Faults of the carriage's places, of the clocks and of the motion, of recordings that are sound as files."""
    recordings = of_body(recordings)
    try:
        geometry = slider_geometry(recordings)
    except PellucidError as error:
        return SliderExamination([_fault("geometry", "markers that show the axis and the carriage", error)])
    uses = {r.path.name if r.optical is None else r.optical.path.name: r.use for r in recordings}
    rail = None if config.rig.slider is None else (config.rig.slider.low, config.rig.slider.high)
    faults = [warn_if_held_out(f, uses.get(f.file, "fit")) for f in geometry_faults(geometry, rail)]
    faults.sort(key=lambda fault: fault.severity != "refuse")
    if any(fault.severity == "refuse" for fault in faults):
        return SliderExamination(faults, geometry)
    try:
        require_torques(config)
    except IdentificationError as error:
        return SliderExamination([_fault("drive", "torques in N*m", error), *faults], geometry)
    motions: tuple[SliderMotion, ...] = ()
    try:
        motions = slider_motions(recordings, config, geometry)
        steps = [m for m in motions if m.split == "fitted" and m.protocol in STEP_PROTOCOLS]
        require_both_directions(steps)
        require_places(steps)
        require_dissipation(steps)
    except PellucidError as error:
        faults.insert(0, _fault("excitation", "motion both ways, at several places of the carriage", error))
    return SliderExamination(faults, geometry, motions)


def require_torques(config: StudyFile) -> None:
    """Do nothing where the drive's constant makes torques of its currents."""
    if drive_model(config.rig).effort_unit != "N*m":
        raise IdentificationError("study.toml: found no [rig.drive] torque_constant, expected one in N*m/A")


def require_dissipation(motions: Sequence[SliderMotion]) -> None:
    """Raise an error unless the drive does positive work on a joint that moves back and forth."""
    work = sum(float((m.effort * m.velocity).sum()) / m.fs for m in motions)
    if motions and work < 0.0:
        names = ", ".join(m.recording for m in motions[:3]) + (", ..." if len(motions) > 3 else "")
        raise IdentificationError(
            f"{names}: found {-work:.3g} J that the joint gives to its drive, expected that friction takes some; the "
            "sign of channel position or of channel current is reversed"
        )


def _fault(kind: str, expected: str, error: PellucidError) -> Fault:
    return Fault("refuse", kind, "study.toml", "", str(error), expected, str(error))
