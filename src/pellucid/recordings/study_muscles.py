"""Constants of a study's muscles, from the file of the model that it names."""

from __future__ import annotations

from pathlib import Path

from .._errors import RecordingError
from .muscle_constants import MuscleConstants
from .readers.ceinms_xml import read_subject
from .readers.osim import read_model
from .study import Study


def read_muscle_constants(path: Path) -> dict[str, MuscleConstants]:
    """Constants of all muscles of a file, by the names it has for them."""
    path = Path(path)
    if path.suffix.lower() == ".osim":
        return read_model(path)
    if path.suffix.lower() == ".xml":
        return dict(read_subject(path).muscles)
    raise RecordingError(
        f'{path.name}: found the ending "{path.suffix}", expected .osim (OpenSim) or .xml (a CEINMS subject)'
    )


def study_muscles(study: Study) -> dict[str, MuscleConstants]:
    """Constants of a study's muscles, by the study's own names. `study` [emg_torque]."""
    spec = study.config.emg_torque
    if spec is None or spec.muscle_file is None:
        return {}
    found = read_muscle_constants(study.inside(spec.muscle_file, "[emg_torque] muscle_file"))
    missing = [name for name in spec.muscle_names.values() if name not in found]
    if missing:
        raise RecordingError(
            f"{spec.muscle_file}: found the muscles {', '.join(list(found)[:20])}, expected {', '.join(missing)} too, "
            "as [emg_torque] muscle_names has them"
        )
    return {ours: found[theirs] for ours, theirs in spec.muscle_names.items()} or found
