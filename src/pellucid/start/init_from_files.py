"""Make a study's folder from a lab's own files: copies, study.toml, and the page that shows why.

Where the files lack a part of a study, one sentence says what supplies it; the proposal is also said in lines of text.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._atomic import write_text_atomically
from .._errors import PellucidError, StudyError, UnfitRecordingError, listed_names
from .._given import require_empty_folder
from .._printed_command import printed_command
from ..files.fault import Fault, grouped_messages
from ..files.quantity import is_setting, quantity_of
from ..files.recording import MAXIMAL_PROTOCOL
from ..study.pages.page import Page, write_page
from ..study.procedures.registry import open_study
from ..study.procedures.run import check
from ..study.study import STUDY_FILE
from .given_files import GivenFiles, read_given
from .proposal import Proposal, Question
from .proposal_page import files_page, proposal_page, unmade_page
from .propose_study import (
    accepted_units,
    has_accepted_unit,
    propose_study,
    require_agreeing_units,
    require_delivered_effort,
    require_known_units,
    require_lever_arm,
    require_possible_clock,
    require_rate,
    require_signed_effort,
    require_turns_of_motors,
    shared_folders,
)
from .study_text import MIN_SYNERGY_MUSCLES, channel_mark, channel_name, has_task, study_text

EFFORT_QUANTITIES = ("torque", "force", "moment", "current", "voltage", "duty")
"""Quantities of which a study needs one: each tells the effort of a joint."""


MAX_LISTED_EFFORTS = 3
"""Largest number of columns of constant efforts that a message names."""


def missing_part(proposal: Proposal) -> str | None:
    """Return the first thing that keeps a proposal from being a study; None if the proposal has all its parts."""
    return next(_missing_parts(proposal), None)


def _constant_efforts(proposal: Proposal) -> str:
    """Return that the effort was recorded as one value, with its columns; "" where no column holds such an effort."""
    found: dict[str, str] = {}
    for table in proposal.main.tables:
        for name, x in table.columns.items():
            known = x[np.isfinite(x)]
            kind = quantity_of(name, table.units.get(name, "")).kind
            if kind in EFFORT_QUANTITIES and not is_setting(name) and (not known.size or np.ptp(known) == 0.0):
                found.setdefault(name, f"{known[0]:z.6g}" if known.size else "no number")
    if not found:
        return ""
    listed = listed_names([f'"{name}" ({value} in every row)' for name, value in found.items()], MAX_LISTED_EFFORTS)
    return (
        f"the effort was not measured: {listed} never changes, expected an effort that changes with the motion. "
        "Record again with the sensor or the drive connected"
    )


def _efforts_of_no_joint(proposal: Proposal) -> str:
    """Return that the file holds efforts but none of a joint, with the joints' columns; "" where it holds none."""
    main, joints = proposal.main, proposal.main.roles.joints
    table = main.tables[0]
    efforts = [f'"{r.column}"' for r in main.channels if quantity_of(r.column, r.unit).kind in EFFORT_QUANTITIES]
    motions = [role.column for role in main.channels if role.label in joints]
    if not efforts or not motions:
        return ""
    verb = "belongs" if len(efforts) == 1 else "belong"
    found = f"{table.path.name}: {listed_names(efforts, MAX_LISTED_EFFORTS)} {verb} to none of the {len(joints)} joints"
    # A reader adds its column's index to a name that a header repeats.
    places = [i for i, name in enumerate(table.columns) if name in motions]
    names = {name.removesuffix(f".{i}") for i, name in enumerate(table.columns) if name in motions}
    if len(names) == 1 and len(places) > 1:
        numbers = " and ".join(str(i + 1) for i in places)
        return f'{found}, because columns {numbers} have the same name "{names.pop()}": rename or remove one of them'
    listed = listed_names([f'"{name}"' for name in motions], MAX_LISTED_EFFORTS)
    return f'{found} of {listed}, expected the joint in its name, as in "knee torque [Nm]": rename its column'


def _missing_parts(proposal: Proposal) -> Iterator[str]:
    channels = [role for layout in proposal.layouts for role in layout.channels]
    quantities = {role.quantity for role in channels}
    # EMG alone makes a study of muscles.
    if proposal.drive is None and not quantities & {*EFFORT_QUANTITIES, "emg"}:
        yield _efforts_of_no_joint(proposal) or _constant_efforts(proposal) or (
            "no effort was recorded: found no column with a torque, force, current, voltage or duty cycle, "
            'expected one in addition to the motion. Record the effort too, or rename its column, as in "torque [Nm]"'
        )
    elif proposal.drive is None and "emg" not in quantities:
        yield (
            "found joint moments of a person but no EMG, expected EMG, or the effort of a drive (torque, force, "
            "current, voltage or duty cycle)"
        )
    elif not has_task(proposal) and proposal.drive is None and not quantities & {*EFFORT_QUANTITIES}:
        count = sum(role.quantity == "emg" for role in channels)
        if count >= MIN_SYNERGY_MUSCLES and all(r.protocol == MAXIMAL_PROTOCOL for r in proposal.recordings):
            yield (
                f"found {count} muscles in maximal contractions alone, expected a movement. Record one with the same "
                "muscles"
            )
        else:
            others = f"raw EMG, or the envelopes of at least {MIN_SYNERGY_MUSCLES} muscles"
            envelopes = f"the envelope{'s' if count > 1 else ''} of {count} muscle{'s' if count > 1 else ''}"
            if quantities & {"angle", "position"}:
                yield (
                    f"found a joint angle and {envelopes}, but no torque, expected the torque of the joint for torque "
                    f'from EMG, as in "knee_torque [N*m]"; for EMG alone, {others}. Record the torque too, or rename '
                    "its column"
                )
            else:
                yield f"found only {envelopes}, expected {others}"
    elif not has_task(proposal):
        yield (
            "found EMG and an effort but no joint angle, expected the joint angle in degrees. Record the angle too, or "
            "remove the effort to study the EMG alone"
        )
    for role in channels:
        if not has_accepted_unit(role):
            units = " or ".join(accepted_units(role))
            yield (
                f'the column "{role.column}" seems to be the {role.quantity} but has the unit "{role.unit}", expected '
                f"{units} or a multiple. Export the column in one of these units"
            )


RECORDINGS_FOLDER = "recordings"
"""Folder of a study that holds its files."""

AGAIN = "pellucid init DIR --from FILES"
"""Command that is repeated after a refusal, where the files were given as arrays."""

REFUSAL = "no study was made"
"""Words of a refusal that stand before its reason."""

PAGE_FOLDER = "proposal"
"""Folder of a study that holds the page of its proposal."""


@dataclass(frozen=True, eq=False)
class ProposedStudy:
    """A study proposed from a lab's own files.

    Attributes
    ----------
    folder : Path
        Folder of the study.
    study_file : Path
        Its study.toml.
    page : Path or None
        Page that plots every channel with its proposed role; None if it was not drawn.
    proposal : Proposal
        Roles of all columns with their reasons, recordings, questions and answers.
    faults : tuple of Fault
        What `check` finds in the study; it refuses nothing.
    text : str
        Text of its study.toml as it was written.
    """

    folder: Path
    study_file: Path
    page: Path | None
    proposal: Proposal
    faults: tuple[Fault, ...] = ()
    text: str = ""

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
    urdf: str | os.PathLike | None = None,
) -> ProposedStudy:
    """Make a folder with copies of files and a study.toml that is proposed for them, if `check` accepts the study.

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
    urdf : path-like, optional
        Robot's file, which gives the joints.

    Raises
    ------
    StudyError
        If the folder is not empty, no file holds a table of numbers, a stated unit is not known, or an answer cannot
        be.
    UnfitRecordingError
        If `check` refuses the study; the folder is not made.

    An error that comes after the proposal has a note with the path of a page, which shows what was understood.
    """
    folder = Path(folder)
    require_empty_folder(folder)
    paths = [Path(file) for file in files]
    given = read_given(paths)
    if urdf is not None:
        given = given.with_robot(Path(urdf))
    again = file_command(("init", os.fspath(folder), "--from"), paths, answers or {}, urdf)
    return make_study(folder, propose_with_answers(given, study_name(folder), answers, ask, again=again), again=again)


def file_command(
    start: Sequence[str], files: Sequence[Path], answers: Mapping[str, str], urdf: str | os.PathLike | None
) -> str:
    """Return a command on files, as a shell takes it."""
    options = [text for key, value in answers.items() for text in ("--answer", f"{key}={value}")]
    robot = [] if urdf is None else ["--urdf", os.fspath(urdf)]
    name, first, *others = [*start, *map(os.fspath, files)]
    return printed_command(name, first, *others, *robot, *options)


def study_name(folder: Path) -> str:
    """Return the name of a study in a folder: the folder's, in characters that a figure's id may have."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", folder.absolute().name).strip("_-") or "study"


def propose_with_answers(
    given: GivenFiles,
    name: str,
    answers: Mapping[str, str] | None = None,
    ask: Callable[[Question], str] | None = None,
    page_folder: Path | None = None,
    again: str = AGAIN,
) -> Proposal:
    """Return the proposal for files; `ask` is called with each question that `answers` do not have.

    `again` is the command that is repeated after an error. The error has a note with the path of a page of the columns,
    in `page_folder` or a new one for temporary files.
    """
    try:
        proposal = propose_study(given, name, answers)
        if ask is None:
            return proposal
        said = dict(answers or {})
        for question in proposal.asked:
            if question.key not in said:
                answer = ask(question).strip()
                if answer and answer != question.default:
                    said[question.key] = answer
        return propose_study(given, name, said) if said != dict(answers or {}) else proposal
    except PellucidError as error:
        _note_page(error, name, files_page(given, name, str(error), again), page_folder)
        raise


def check_folder(folder: Path) -> list[Fault]:
    """Return the faults of the study in a folder, as the command `check` does."""
    return check(open_study(folder))


def copy_file(source: Path, target: Path) -> None:
    """Copy a recording into a study."""
    shutil.copyfile(source, target)


def make_study(
    folder: Path,
    proposal: Proposal,
    *,
    named: str = "",
    put: Callable[[Path, Path], None] = copy_file,
    page_folder: Path | None = None,
    with_page: bool = True,
    again: str = AGAIN,
) -> ProposedStudy:
    """Write a proposal's study into a folder that is new or empty, if `check` accepts it.

    Parameters
    ----------
    folder : Path
        Folder to make.
    proposal : Proposal
        Study to write.
    named : str
        What a refusal names at its beginning; the folder without it.
    put : callable
        Called with the path of each recording and the path that it gets in the study; it writes the recording there.
    page_folder : Path, optional
        Folder for the page of a study that cannot be made; without it a new one for temporary files.
    with_page : bool
        Whether the page of the proposal is drawn into the study.
    again : str
        Command that is repeated after a refusal.

    Raises
    ------
    StudyError
        If a stated unit is not known, or stated units contradict each other.
    UnfitRecordingError
        If `check` refuses the study. Nothing is written then but a page, which the error's note names.
    """
    page = None
    try:
        require_known_units(proposal)
        require_possible_clock(proposal)
        require_agreeing_units(proposal)
        require_turns_of_motors(proposal)
        require_lever_arm(proposal)
        require_rate(proposal)
        require_delivered_effort(proposal)
        require_signed_effort(proposal)
        with _draft_of(folder) as draft:
            text = _write(draft, proposal, put)
            faults = _require_accepted(draft, named or folder, proposal, check_folder)
            if with_page:
                page = write_page(draft / PAGE_FOLDER, proposal_page(proposal, folder)).relative_to(draft)
            _move_content(draft, folder)
    except PellucidError as error:
        note_understood(error, proposal, page_folder, again)
        raise
    return ProposedStudy(folder, folder / STUDY_FILE, None if page is None else folder / page, proposal, faults, text)


def note_understood(
    error: PellucidError, proposal: Proposal, page_folder: Path | None = None, again: str = AGAIN
) -> None:
    """Draw what was understood of files of which no study can be made, and add the page's path to the error's notes."""
    reason = str(error).rpartition(f"{REFUSAL}: ")[2]
    # An answer may be what the study lacks.
    for question in proposal.asked:
        error.add_note(question_line(question, proposal.answers.get(question.key)))
    _note_page(error, proposal.name, unmade_page(proposal, reason, again), page_folder)


def question_line(question: Question, answer: str | None) -> str:
    """Return a question with its answer, or with the default that was taken in its place."""
    if answer:
        return f"question {question.key}: {question.text} Answer: {answer}."
    default = f'Default taken: {question.default}. --answer "{question.key}=..." changes it.'
    return f"question {question.key}: {question.text} {default}"


def _note_page(error: PellucidError, name: str, page: Page, page_folder: Path | None) -> None:
    """Write a page, and add its path to an error's notes; nothing where no folder for it can be written."""
    with suppress(OSError):
        target = page_folder or Path(tempfile.mkdtemp(prefix=f"pellucid-{name}-proposal-"))
        error.add_note(f"What was understood: {write_page(target, page)}")


@contextmanager
def _draft_of(folder: Path) -> Iterator[Path]:
    """Make a folder in which a study is drafted; at the end nothing is left of it, nor of an empty new `folder`."""
    existed = folder.is_dir()
    draft = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(dir=folder, prefix=".draft-"))
        yield draft
    except OSError as error:
        raise StudyError(f"{folder}: the study could not be made: {error}") from error
    finally:
        if draft is not None:
            shutil.rmtree(draft, ignore_errors=True)
        if not existed and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def _move_content(source: Path, target: Path) -> None:
    """Move what is in a folder into another one of the same file system, study.toml last."""
    for path in sorted(source.iterdir(), key=lambda path: path.name == STUDY_FILE):
        os.replace(path, target / path.name)


def _require_accepted(
    draft: Path, named: str | Path, proposal: Proposal, check: Callable[[Path], Sequence[Fault]]
) -> tuple[Fault, ...]:
    """Return what `check` finds in a draft; raise an UnfitRecordingError of one sentence if it refuses the draft."""
    faults: tuple[Fault, ...] = ()
    try:
        faults = tuple(check(draft))
    except PellucidError as error:
        reasons = str(error).splitlines()
    else:
        reasons = grouped_messages([fault for fault in faults if fault.severity == "refuse"])
    for place in (draft, draft.absolute(), draft.resolve()):
        reasons = [reason.replace(f"{place}{os.sep}", "") for reason in reasons]
    if reasons:
        said = missing_part(proposal)
        more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 and not said else ""
        raise UnfitRecordingError(f"{named}: {REFUSAL}: {said or reasons[0]}{more}", faults)
    return faults


def _write(folder: Path, proposal: Proposal, put: Callable[[Path, Path], None]) -> str:
    """Write a proposal's recordings and study.toml into a folder; `put` writes each recording.

    Returns the text of study.toml.
    """
    used = {recording.table.path for recording in proposal.recordings}
    used |= {table.path for recording in proposal.recordings for table in recording.streams.values()}
    places = _places(sorted(used))
    for path, place in places.items():
        target = folder / RECORDINGS_FOLDER / place
        target.parent.mkdir(parents=True, exist_ok=True)
        put(path, target)
    for robot in proposal.given.robots:
        copy_file(robot, folder / RECORDINGS_FOLDER / robot.name)
    files = {
        id(table): f"{RECORDINGS_FOLDER}/{places[table.path]}"
        for recording in proposal.recordings
        for table in (recording.table, *recording.streams.values())
    }
    text = study_text(proposal, files)
    write_text_atomically(folder / STUDY_FILE, text)
    return text


def _places(paths: Iterable[Path]) -> dict[Path, str]:
    """Return where each file stands in the folder of recordings: below the folders that not all files share."""
    whole = {path: path.absolute() for path in paths}
    shared = shared_folders(list(whole.values()))
    return {path: "/".join(place.parts[shared:]) for path, place in whole.items()}


MAX_LISTED_CHANNELS = 40
"""At most so many channels are listed in the terminal; the page has all."""


def proposal_lines(made: ProposedStudy) -> list[str]:
    """Return the lines that the command prints."""
    proposal = made.proposal
    lines = [f"{made.folder}: {proposal.summary}."]
    for layout in proposal.layouts:
        for role in layout.channels[:MAX_LISTED_CHANNELS]:
            mark = channel_mark(role, proposal)
            lines.append(
                f"  {role.column} -> {channel_name(role)} [{role.unit}]{f'  {mark}' if mark else ''}: {role.why}"
            )
        if len(layout.channels) > MAX_LISTED_CHANNELS:
            lines.append(f"  and {len(layout.channels) - MAX_LISTED_CHANNELS} more channels")
    for question in proposal.asked:
        lines.append(question_line(question, proposal.answers.get(question.key)))
    lines += [f"note: {text}" for text in proposal.remarks]
    lines.append(f"{made.page} plots every channel with its role. {made.study_file} marks each guess.")
    return lines
