"""Recordings of a joint with a carriage, made ready for fits as study.toml says."""

from __future__ import annotations

from collections.abc import Sequence

from ...._errors import RecordingError
from ....files.recording import Recording
from ....study.effort import command_of, drive_model
from ....study.study_file import StudyFile
from ..markers import Geometry
from ..slider_motion import SliderMotion, slider_motion


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
