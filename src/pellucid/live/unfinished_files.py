"""Seal the files that a session left unfinished when its computer lost power or its recorder was killed."""

from __future__ import annotations

import time
from pathlib import Path

from .._errors import PellucidError
from ..files.readers.read import find_lost_end
from ..files.xdf_writer import seal_xdf

MIN_UNFINISHED_AGE_S = 2.0
"""A file that grew within this time may still have a recorder, which appends 50 times a second."""

NOTE_ENDING = ".about.json"
"""Ending of the note that stands beside a trial's file until it is sealed."""


def seal_unfinished(recordings: Path, run_folder: Path) -> list[str]:
    """Seal the unfinished files of earlier sessions; return a sentence for each.

    Parameters
    ----------
    recordings : Path
        Folder of the trials. A trial's file is unfinished if its note is there.
    run_folder : Path
        Folder of the files of whole sessions.
    """
    trials = {note.with_name(f"{note.name.removesuffix(NOTE_ENDING)}.xdf"): note for note in _notes(recordings)}
    sessions = (path for path in sorted(run_folder.glob("session*.xdf")) if _is_unfinished(path))
    paths = [*(path for path in trials if path.is_file()), *sessions]
    _wait_for_recorders(paths)
    said = []
    for path in paths:
        if _age(path) < MIN_UNFINISHED_AGE_S:
            continue  # another session writes it
        try:
            before = path.stat().st_size
            removed = seal_xdf(path)
        except (PellucidError, OSError) as error:
            said.append(f"{path}: not sealed: {error}")
            continue
        if path.stat().st_size != before:
            said.append(f"{path}: its recorder was stopped; sealed, {removed} bytes of an incomplete chunk left out")
        if path in trials:
            trials[path].unlink(missing_ok=True)
    return said


def _notes(folder: Path) -> list[Path]:
    return sorted(folder.glob(f"*{NOTE_ENDING}")) if folder.is_dir() else []


def _is_unfinished(path: Path) -> bool:
    try:
        return bool(find_lost_end(path))
    except (PellucidError, OSError):
        return False  # no file of streams


def _wait_for_recorders(paths: list[Path]) -> None:
    """Wait until the recorder of a session that has just died has ended; it ends by itself."""
    until = time.monotonic() + 2.0 * MIN_UNFINISHED_AGE_S
    while time.monotonic() < until and any(_age(path) < MIN_UNFINISHED_AGE_S for path in paths):
        time.sleep(0.1)


def _age(path: Path) -> float:
    """Return the time since a file was written [s]; a computer that lost power may have another date than before."""
    return abs(time.time() - path.stat().st_mtime)
