"""Make a new study from a public data set."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from ..._errors import DatasetError
from ..._given import require_empty_folder
from .registry import fetch, notes, path, template

if TYPE_CHECKING:
    from ..study import Study
    from ..study_file import StudyFile


def init(folder: str | os.PathLike, dataset: str, progress: bool = False) -> Study:
    """Make a study of a public data set: its unchanged files, and a commented study.toml.

    Files are taken from ``PELLUCID_DATA`` or the download folder, and downloaded if they are in neither.
    """
    from ..procedures.registry import open_study
    from ..study import STUDY_FILE

    folder = Path(folder)
    source_file = template(dataset)
    require_empty_folder(folder, DatasetError)
    try:
        source = path(dataset)
    except DatasetError:
        source = fetch(dataset, progress=progress)
    # The study appears completely or not at all.
    building = folder.absolute().parent / f".{folder.absolute().name}.{os.getpid()}"
    try:
        building.mkdir(parents=True)
        text = _with_notes(source_file.read_text(encoding="utf-8"), notes(dataset))
        (building / STUDY_FILE).write_text(text, encoding="utf-8")
        for file in _files(open_study(building).config):
            target = building / file
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / _in_the_data_set(file), target)
        _move(building, folder, last=STUDY_FILE)
    except OSError as error:
        raise DatasetError(f"{folder}: the study could not be made: {error}") from error
    finally:
        shutil.rmtree(building, ignore_errors=True)
    return open_study(folder)


def _files(config: StudyFile) -> list[str]:
    """Return every file that a study.toml names, once."""
    files = [file for entry in config.recordings for file in (entry.file, *entry.streams.values())]
    named = [file for table in config.procedures.values() for file in table.named_files()]
    return list(dict.fromkeys((*files, *named)))


def _in_the_data_set(file: str) -> PurePosixPath:
    # A study keeps a data set's files, subfolders and all, in one folder of its own.
    return PurePosixPath(*PurePosixPath(file).parts[1:])


def _with_notes(text: str, remarks: tuple[str, ...]) -> str:
    if not remarks:
        return text
    remarks_text = ", ".join(json.dumps(remark) for remark in remarks)
    if "\nnotes = [" in text:
        return text.replace("\nnotes = [", f"\nnotes = [{remarks_text}, ", 1)
    line = f"notes = [{remarks_text}]  # repeated in the report\n"
    head, separator, tail = text.partition("\n[rig]")
    return f"{head}{line}{separator}{tail}"


def _move(building: Path, folder: Path, last: str) -> None:
    if not folder.exists():
        building.rename(folder)
        return
    # An empty folder may be a shell's working directory, so it is filled and not replaced.
    for item in sorted(building.iterdir(), key=lambda item: item.name == last):
        item.rename(folder / item.name)
