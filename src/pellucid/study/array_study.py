"""Study whose recordings are arrays in memory, with the same decisions as for files."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from .._errors import ArgumentError, RecordingError
from ..files.readers import Columns
from ..files.recording import Recording
from .recording_steps import OWN_FILE_STEPS, RecordedFile, mark_lost_end, read_recording
from .study import Study
from .study_file import StudyFile, rig_units

ARRAY_STEPS = tuple(step for step in OWN_FILE_STEPS if step is not mark_lost_end)
"""Steps from arrays to a recording: those of files, without the one that looks at a truncated file."""


class ArrayStudy(Study):
    """A study without a folder. Its recordings are made once, when it is opened."""

    def files(self) -> tuple[Path, ...]:
        """Return no files."""
        return ()

    def recordings(
        self, use: str | None = None, *, on_progress: Callable[[str, float], None] = lambda text, share: None
    ) -> tuple[Recording, ...]:
        """Return the recordings in the order in which they were given; `use` is as in `Study.recordings`."""
        kept = self.kept.recordings
        return tuple(r for name, r in kept.items() if use in (None, r.use) and name not in self.left_out)

    def recording(self, name: str) -> Recording:
        """Return one recording by its name; raise a RecordingError if there is none."""
        if name not in self.kept.recordings:
            raise RecordingError(f"found no recording {name!r}, expected one of {', '.join(self.kept.recordings)}")
        return self.kept.recordings[name]


def parse_tables(raw: Mapping[str, Any], caller: str) -> StudyFile:
    """Return the contents of a study.toml from its tables; raise an ArgumentError of the function `caller`."""
    try:
        return StudyFile.model_validate(dict(raw), context=rig_units(raw))
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        place = next((str(each) for each in reversed(first["loc"]) if isinstance(each, str)), "argument")
        raise ArgumentError(f"{caller}: {place}: {first['msg'].removeprefix('Value error, ')}") from None


def array_study(config: StudyFile, recordings: Mapping[str, Mapping[str, np.ndarray]], caller: str) -> ArrayStudy:
    """Return a study of arrays: the columns, (n,), of each recording by its name, which is its `file` in `config`.

    `caller` is the function that was called; it stands for the study's folder.
    """
    study = ArrayStudy(Path(caller), config)
    study.kept.digests[study.path] = hashlib.sha256(config.model_dump_json(warnings=False).encode()).hexdigest()
    for entry in config.recordings:
        path = study.folder / entry.name / "arrays"  # messages show the last part beside the recording's name
        columns = {name: np.ascontiguousarray(x, float) for name, x in recordings[entry.name].items()}
        content = hashlib.sha256()
        for name, samples in columns.items():
            content.update(name.encode() + samples.tobytes())
        study.kept.digests[path] = content.hexdigest()
        file = RecordedFile(study, entry, entry.name, path, {path: Columns(path, columns)})
        recording = read_recording(file, entry.window)
        for step in ARRAY_STEPS:
            recording = step(recording, file)
        study.kept.apart[entry.name] = study.kept.recordings[entry.name] = recording
    return study
