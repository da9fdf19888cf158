"""Read a study's muscles from the model file that it names: constants, and lengths over its joints.

The EMG channels of a study that are used: those that the study names, or that all fitted recordings have.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from ...._errors import PellucidError, RecordingError, listed_names
from ...._given import read_given
from ....files.recording import Recording
from ....models.estimates import Verdict
from ....study.study import Study
from ...files.muscle_constants import MuscleConstants, read_model, read_subject
from ...files.muscle_polynomials import (
    POLYNOMIAL_FILE,
    ModelMuscles,
    model_muscles,
    read_polynomials,
    write_polynomials,
)
from ...files.osim_paths import read_paths
from .emg_torque_table import EmgTorqueTable

MAX_NAMED_RECORDINGS = 3
"""Largest number of recordings that a sentence names."""

MISSING_CHANNEL_FINDING = "missing_channel"
"""Identifier of the finding that a muscle is not used, since a fitted recording lacks its channel."""


def read_muscle_constants(path: Path) -> dict[str, MuscleConstants]:
    """Return the constants of all muscles in a file, by the file's own names."""
    path = Path(path)
    if path.suffix.lower() == ".osim":
        return read_model(path)
    if path.suffix.lower() == ".xml":
        return dict(read_subject(path).muscles)
    if path.suffix.lower() == ".json":
        return {each.name: each for each in read_polynomials(path).constants.values()}
    raise RecordingError(
        f'{path.name}: found the ending "{path.suffix}", expected .osim (OpenSim), .xml (a CEINMS subject) or '
        ".json (geometry that was kept)"
    )


def study_muscles(study: Study) -> dict[str, MuscleConstants]:
    """Return the constants of a study's muscles, by the study's own names. `study` [emg_torque]."""
    spec = study.find_table(EmgTorqueTable)
    if spec is None or spec.muscle_file is None:
        return {}
    path = study.inside(spec.muscle_file, "[emg_torque] muscle_file")
    if path.suffix.lower() == ".json":
        return dict(read_polynomials(path).constants)
    found = read_muscle_constants(path)
    missing = [name for name in spec.muscle_names.values() if name not in found]
    if missing:
        raise RecordingError(
            f"{spec.muscle_file}: found the muscles {', '.join(list(found)[:20])}, expected {', '.join(missing)} too, "
            "as [emg_torque] muscle_names has them"
        )
    return {ours: found[theirs] for ours, theirs in spec.muscle_names.items()} or found


def study_geometry(study: Study) -> ModelMuscles | None:
    """Return the lengths of a study's muscles over its joints, from an OpenSim model; None without a usable model.

    They are computed once and stored in the study as ``muscle_geometry.json``. `study` [emg_torque].
    """
    spec = study.find_table(EmgTorqueTable)
    if spec is None or spec.muscle_file is None:
        return None
    path = study.inside(spec.muscle_file, "[emg_torque] muscle_file")
    if path.suffix.lower() == ".json":
        return read_polynomials(path)
    if path.suffix.lower() != ".osim":
        return None
    if not path.is_file():
        kept = (
            f'; its polynomials were kept: use muscle_file = "{POLYNOMIAL_FILE}"'
            if (study.folder / POLYNOMIAL_FILE).is_file()
            else ""
        )
        raise RecordingError(f"{path}: not readable: no such file{kept}")
    coordinates = study_coordinates(study)
    if not coordinates:
        return None
    asked = tuple(coordinates.items()), tuple(spec.muscle_names.items())
    return _load_or_make_polynomials(path, study.place(POLYNOMIAL_FILE), path.stat().st_mtime_ns, *asked)


def study_coordinates(study: Study) -> dict[str, str]:
    """Return the OpenSim model's coordinate of each joint, with a minus for an opposite sign. `study` [emg_torque]."""
    spec = study.table(EmgTorqueTable)
    if spec.coordinates or spec.muscle_file is None or not spec.muscle_file.lower().endswith(".osim"):
        return dict(spec.coordinates)
    path = study.inside(spec.muscle_file, "[emg_torque] muscle_file")
    known = set(_known_coordinates(path, path.stat().st_mtime_ns))
    return {
        name.removeprefix("angle."): str(channel.column) if channel.sign > 0 else f"-{channel.column}"
        for name, channel in study.config.channels.items()
        if name.startswith("angle.") and channel.column in known
    }


@lru_cache(maxsize=8)
def _known_coordinates(path: Path, changed: int) -> tuple[str, ...]:
    """Return the names of a model's coordinates. `changed` is the file's time, so that a new file is read again."""
    return tuple(read_paths(path).skeleton.coordinates)


@lru_cache(maxsize=8)
def _load_or_make_polynomials(path: Path, place: Path, changed: int, coordinates: tuple, names: tuple) -> ModelMuscles:
    """Return the muscles' polynomials that are stored at `place`, or compute and store them.

    `changed` is the time of the model's file, so that a changed model is read again.
    """
    checksum = hashlib.sha256(read_given(path)).hexdigest()
    asked = checksum, dict(coordinates), dict(names)
    if place.is_file():
        # A stored file that cannot be read, or belongs to another model, is computed again.
        with suppress(PellucidError):
            kept = read_polynomials(place)
            if (kept.checksum, dict(kept.coordinates), dict(kept.named)) == asked:
                return kept
    made = model_muscles(path, *asked)
    # In a folder without permission to write, nothing is stored.
    with suppress(OSError):
        write_polynomials(place, made)
    return made


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


def unused_channels(study: Study) -> Iterator[tuple[str, list[Recording], list[str]]]:
    """Yield each muscle whose channel is not used, the recordings that have it and the fitted ones that lack it.

    `study` [emg_torque].
    """
    ignored, fitted = ignored_channels(study), [(r, _emg_channels(study, r)) for r in study.recordings("fit")]
    present: dict[tuple[str, str | None], list[Recording]] = {}
    for recording in study.recordings():
        for muscle in ignored.get(recording.name, ()):
            present.setdefault((muscle, recording.participant), []).append(recording)
    for (muscle, participant), recordings in present.items():
        each = [(r, names) for r, names in fitted if names]
        own = [(r, names) for r, names in each if r.participant == participant] or each
        yield muscle, recordings, [r.name for r, names in own if muscle not in names]


def ignored_channel_verdicts(study: Study) -> list[Verdict]:
    """Return a verdict for each muscle whose channel is not used: a warning if a fitted recording has it.

    `study` [emg_torque].
    """
    made = []
    for muscle, recordings, lacking in unused_channels(study):
        loses = any(r.use == "fit" for r in recordings)
        where = listed_names([r.name for r in recordings], MAX_NAMED_RECORDINGS)
        why = listed_names(lacking, MAX_NAMED_RECORDINGS)
        do = f"Add the channel to {why}, or remove {why} from study.toml, and calibrate again." if loses else ""
        made.append(
            Verdict(
                "warning" if loses else "note",
                f"{where}: emg.{muscle} is not used, because {why} {'lacks' if len(lacking) == 1 else 'lack'} it.",
                do,
                finding=MISSING_CHANNEL_FINDING,
            )
        )
    return made
