"""Make a study's folder from a lab's own files: copies, study.toml, and the page that shows why."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from .._atomic import write_text_atomically
from .._errors import StudyError
from .._given import require_empty_folder
from ..pages.page import write_page
from ..studies.study import STUDY_FILE
from .given_files import GivenFiles, read_given
from .proposal_page import proposal_page
from .propose_study import Proposal, propose_study
from .questions import Question
from .study_text import study_text

RECORDINGS_FOLDER = "recordings"
"""Folder of a study that holds its files."""

PAGE_FOLDER = "proposal"
"""Folder of a study that holds the page of its proposal."""


@dataclass(frozen=True, eq=False)
class ProposedStudy:
    """A study that was made of a lab's own files.

    Attributes
    ----------
    folder : Path
        Folder of the study.
    study_file : Path
        Its study.toml.
    page : Path
        Page with every channel drawn beside its proposed role.
    proposal : Proposal
        Roles of all columns with their reasons, recordings, questions and answers.
    """

    folder: Path
    study_file: Path
    page: Path
    proposal: Proposal

    @property
    def questions(self) -> tuple[Question, ...]:
        """Questions that only the lab can answer, at most five."""
        return self.proposal.asked


def init_from_files(
    folder: str | os.PathLike,
    files: Iterable[str | os.PathLike],
    *,
    answers: Mapping[str, str] | None = None,
    ask: Callable[[Question], str] | None = None,
) -> ProposedStudy:
    """Make a folder with copies of files and a study.toml that is proposed for them.

    Parameters
    ----------
    folder : path-like
        Folder to make; it may exist if it is empty.
    files : iterable of path-like
        Recordings, and folders of them.
    answers : mapping of str to str, optional
        Answers by the questions' keys; a question without an answer takes its default.
    ask : callable, optional
        Called with each question that has no answer; it returns one.

    Raises
    ------
    StudyError
        If the folder is not empty, no file holds a table of numbers, or an answer cannot be.
    """
    folder = Path(folder)
    require_empty_folder(folder)
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", folder.absolute().name).strip("_-") or "study"
    given = read_given(files)
    proposal = propose_study(given, name, answers)
    if ask is not None:
        said = dict(answers or {})
        for question in proposal.asked:
            if question.key not in said:
                answer = ask(question).strip()
                if answer and answer != question.default:
                    said[question.key] = answer
        proposal = propose_study(given, name, said) if said != dict(answers or {}) else proposal
    return _write(folder, proposal, given)


def _write(folder: Path, proposal: Proposal, given: GivenFiles) -> ProposedStudy:
    used = {recording.table.path for recording in proposal.recordings}
    used |= {table.path for recording in proposal.recordings for table in recording.streams.values()}
    places = _places(sorted(used))
    try:
        for path, place in {**places, **{robot: robot.name for robot in given.robots}}.items():
            target = folder / RECORDINGS_FOLDER / place
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    except OSError as error:
        raise StudyError(f"{folder}: the study could not be made: {error}") from error
    files = {
        id(table): f"{RECORDINGS_FOLDER}/{places[table.path]}"
        for recording in proposal.recordings
        for table in (recording.table, *recording.streams.values())
    }
    page = write_page(folder / PAGE_FOLDER, proposal_page(proposal))
    study_file = write_text_atomically(folder / STUDY_FILE, study_text(proposal, files))
    return ProposedStudy(folder, study_file, page, proposal)


def _places(paths: Iterable[Path]) -> dict[Path, str]:
    """Return where each file stands in the folder of recordings: below the folders that not all files share."""
    paths = list(paths)
    parts = [path.absolute().parent.parts for path in paths]
    shared = 0
    while parts and all(len(p) > shared for p in parts) and len({p[shared] for p in parts}) == 1:
        shared += 1
    places = {path: "/".join((*own[shared:], path.name)) for path, own in zip(paths, parts, strict=True)}
    return places
