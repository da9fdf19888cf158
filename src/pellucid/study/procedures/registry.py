"""The list of procedures, those that a study asks for, and the model of study.toml with their tables.

`open_study` opens a study with the tables of all procedures.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from dataclasses import replace
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from ..._errors import PellucidError
from ..study import Study
from .procedure import Procedure, ProcedureEntry, described_procedures

if TYPE_CHECKING:
    from ..study_file import StudyFile

def find_procedures() -> tuple[Procedure, ...]:
    """Return every procedure: an entry as it is, and an object of the subclass that a plug-in's package defines."""
    return tuple(
        each if isinstance(each, ProcedureEntry) else _procedure_of_package(each) for each in described_procedures()
    )


def _procedure_of_package(package: ModuleType) -> Procedure:
    """Return an object of the subclass of `Procedure` that the ``procedure.py`` of a package itself defines."""
    module = import_module(f"{package.__name__}.procedure")
    classes = [each for each in vars(module).values() if isinstance(each, type) and issubclass(each, Procedure)]
    (own,) = (each for each in classes if each.__module__ == module.__name__)
    return own()


ALL_PROCEDURES: tuple[Procedure, ...] = find_procedures()
"""Every procedure, in the order in which a study is checked and its report shows them."""


def asked(study: Study, name: str | None = None) -> tuple[Procedure, ...]:
    """Return the procedures that a study asks for: all, or those of one command or of one name."""
    return tuple(p for p in ALL_PROCEDURES if name in (None, p.command, p.name) and p.asked(study))


def study_model(names: Collection[str] | None = None) -> type[StudyFile]:
    """Return the model of study.toml with the tables of all procedures, or only of those among `names`."""
    return _study_model(tuple(p for p in ALL_PROCEDURES if names is None or p.name in names))


@cache
def _study_model(procedures: tuple[Procedure, ...]) -> type[StudyFile]:
    from ..study_file import study_file_model

    return study_file_model({p.name: p.table for p in procedures if p.table is not None})


def open_study(
    folder: str | os.PathLike,
    *,
    out: str | os.PathLike | None = None,
    allow_outside: bool = False,
    accept_stale: bool = False,
) -> Study:
    """Open a study's folder; recordings are read when they are asked for.

    Parameters
    ----------
    folder : path-like
        Folder with a study.toml in it.
    out : path-like, optional
        Folder to write to instead of the study's own, which may be read-only.
    allow_outside : bool
        Whether files outside the study's folder are read where study.toml names them, or a link leads there.
    accept_stale : bool
        Whether model cards are used that were made from something else than the study as it is now.

    Returns
    -------
    Study

    Raises
    ------
    StudyError
        If study.toml is missing or cannot be understood.
    PellucidError
        If it lies outside the folder.

    Examples
    --------
    In a folder with a study ``my-elbow``:

    >>> import pellucid as pl
    >>> study = pl.open("my-elbow")
    >>> [(recording.name, recording.use) for recording in study.recordings()]
    [('slow', 'fit'), ('fast', 'validate')]
    """
    from ..study import open_folder

    study = open_folder(folder, study_model, out=out, allow_outside=allow_outside)
    return replace(study, accept_stale=True) if accept_stale else study


def is_study(subject: object) -> bool:
    """Return whether a subject is a study: an open one, or a path to its folder."""
    return isinstance(subject, (Study, str, os.PathLike))


def as_study(subject: object, caller: str) -> Study:
    """Return the study that a subject names; PellucidError of the function `caller` where it is no study."""
    if isinstance(subject, Study):
        return subject
    if isinstance(subject, (str, os.PathLike)):
        return open_study(subject)
    raise PellucidError(
        f"{caller}: found {type(subject).__name__}, expected a study: the path of its folder, or what pellucid.open "
        "returns"
    )
