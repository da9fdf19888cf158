"""Try a log: propose a study for its files, check and identify it in a folder of its own, and write one page."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from .._errors import PellucidError
from .._given import require_empty_folder
from ..models.estimates import Parameter
from ..study.pages.page import write_page
from ..study.procedures.procedure import Progress, quiet
from ..study.procedures.registry import asked, open_study
from ..study.procedures.result import ParameterTable, Result
from ..study.procedures.run import run
from ..study.study import Study
from .assumptions import assumptions_of
from .given_files import GivenFiles, read_given
from .init_from_files import file_command, make_study, note_understood, propose_with_answers, study_name
from .tried_log import TriedJoint, TriedLog
from .try_page import try_page


def try_log(
    files: Iterable[str | os.PathLike],
    *,
    answers: Mapping[str, str] | None = None,
    urdf: str | os.PathLike | None = None,
    out: str | os.PathLike | None = None,
    on_progress: Progress = quiet,
) -> TriedLog:
    """Propose a study for files, with every default, then check it, identify it and write a page.

    Parameters
    ----------
    files : iterable of path-like
        Recordings, and folders of them.
    answers : mapping of str to str, optional
        Answers by the questions' keys; a question without an answer takes its default.
    urdf : path-like, optional
        Robot's file, which gives the joints.
    out : path-like, optional
        Folder to write to, new or empty; without it a new one for temporary files, which stays.
    on_progress : callable
        Called with a text and the share done, 0 to 1.

    Raises
    ------
    PellucidError
        If no study can be made of the files, or nothing can be identified. Its note names a page that shows what was
        understood.
    """
    files = [Path(file) for file in files]
    if out is not None:
        require_empty_folder(Path(out))
    on_progress("reading files", 0.02)
    given = read_given(files)
    if urdf is not None:
        given = given.with_robot(Path(urdf))
    name = _name_of(given)
    on_progress("looking at columns", 0.1)
    folder = Path(tempfile.mkdtemp(prefix="pellucid-try-")) if out is None else Path(out)
    again = file_command(("try",), files, answers or {}, urdf)
    proposal = propose_with_answers(given, name, answers, page_folder=folder, again=again)
    on_progress("checking the recordings", 0.3)
    made = make_study(folder / name, proposal, named=_named(given), page_folder=folder, with_page=False, again=again)
    study = open_study(made.folder)
    try:
        command = next((procedure.command for procedure in asked(study)), "identify")
        result = run(study, command, on_progress=lambda text, share: on_progress(text, 0.4 + 0.5 * share))
    except PellucidError as error:
        note_understood(error, proposal, folder, again)
        raise
    result.save(study)
    on_progress("drawing the page", 0.92)
    tried = TriedLog(
        folder,
        folder,
        proposal,
        study,
        result,
        _joints_of(study, result),
        assumptions_of(proposal, made.text),
        file_command(("init", name, "--from"), files, answers or {}, urdf),
        again,
        file_command(("try",), files, answers or {}, "ROBOT.urdf") if _is_joint_by_joint(study, command) else "",
    )
    return replace(tried, page=write_page(folder, try_page(tried)))


def _name_of(given: GivenFiles) -> str:
    """Return a name for the study of files: that of the only file, or of the folder that all share."""
    paths = list(dict.fromkeys(table.path.absolute() for table in given.tables))
    if len(paths) == 1:
        return study_name(paths[0].with_suffix(""))
    return study_name(Path(os.path.commonpath([path.parent for path in paths])))


def _named(given: GivenFiles) -> str:
    """Return the files in words, for the beginning of a message."""
    names = list(dict.fromkeys(table.path.name for table in given.tables))
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"


def _is_joint_by_joint(study: Study, command: str) -> bool:
    """Return whether several joints were identified without a table of a robot."""
    return len(study.rig.joints) > 1 and all(p.table is None for p in asked(study, command))


def _joints_of(study: Study, result: Result) -> tuple[TriedJoint, ...]:
    """Return what a result says of each joint of a study, in the order of study.toml."""
    names = [each.joint for each in study.rig.joints]
    held = {each.joint or names[0]: each for each in result.held_out}
    joints = [TriedJoint(name, _parameters(study, result, name, len(names) > 1), held.get(name)) for name in names]
    return tuple(joint for joint in joints if joint.parameters or joint.held_out)


def _parameters(study: Study, result: Result, joint: str, is_one_of_several: bool) -> tuple[Parameter, ...]:
    """Return the parameters of a joint that a result shows first."""
    estimates, prefix = result.estimates, f"{joint}." if is_one_of_several else ""
    head = f"{study.name}.{prefix}headline."
    named = [f"{prefix}{row.id.removeprefix(head)}" for row in result.rows if row.id.startswith(head)]
    shown = [estimates[name] for name in named if name in estimates]
    if not shown and is_one_of_several:
        shown = [p for name, p in estimates.items() if name.startswith(prefix) and "." not in name.removeprefix(prefix)]
    if not shown and not is_one_of_several:
        tables = (table for table in result.tables if isinstance(table, ParameterTable))
        shown = list(next(tables, ParameterTable("", ())).parameters)
    return tuple(replace(p, name=p.name.removeprefix(prefix)) for p in shown)
