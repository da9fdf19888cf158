"""New studies: filled from a public data set, to be filled by a virtual rig, or written for a robot's URDF file."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from .. import datasets
from .._atomic import write_text_atomically
from .._errors import StudyError
from .known_rigs import rig_names, rig_text

if TYPE_CHECKING:
    from ..studies.study import Study

RIG_FILE = "lab/rig.toml"
"""Path of the description of a study's virtual rig, relative to the study's folder."""


def init(
    folder: str | os.PathLike,
    dataset: str | None = None,
    rig: str | None = None,
    progress: bool = False,
    urdf: str | os.PathLike | None = None,
) -> Study | Path:
    """Make a study's folder from a public data set, for a virtual rig, or for your own robot.

    Parameters
    ----------
    folder : path-like
        Folder to make; it may exist if it is empty.
    dataset : str, optional
        Name of the data set whose recordings fill it.
    rig : str, optional
        Name of the virtual rig that will fill it (see `simulate`), or a rig's file, which ends in .toml.
    progress : bool
        Show a progress bar while downloading.
    urdf : path-like, optional
        A robot's URDF file. It is copied, and a study.toml is written that lists its joints with their limits and says
        what you have to fill in.

    Returns
    -------
    Study or Path
        The study of a data set, the path of the rig's file, or the path of the robot's study.toml.

    Raises
    ------
    PellucidError
        If not exactly one of `dataset`, `rig` and `urdf` is given, the name is not known, the folder is not empty, a
        file cannot be had, or the URDF file does not describe a robot.

    Examples
    --------
    >>> import pellucid as pl
    >>> pl.init("virtual-joint", rig="bench-joint").name
    'rig.toml'
    """
    if sum(given is not None for given in (dataset, rig, urdf)) != 1:
        raise StudyError(
            "init needs --dataset NAME or --rig NAME or --urdf FILE, one of them; known: "
            f"{', '.join(datasets.names())}; rigs: {', '.join(rig_names())}"
        )
    if rig is not None:
        return init_rig(folder, rig)
    if urdf is not None:
        return init_robot(folder, Path(urdf))
    return datasets.init(folder, dataset=dataset, progress=progress)


def init_rig(folder: str | os.PathLike, rig: str) -> Path:
    """Make a folder with a copy of a virtual rig's file, ``lab/rig.toml``, which you may edit; return its path."""
    folder, text = Path(folder), rig_text(rig)
    _require_empty(folder)
    return write_text_atomically(folder / RIG_FILE, text)


def init_robot(folder: str | os.PathLike, urdf: Path) -> Path:
    """Make a folder with a copy of a robot's URDF file, and a study.toml to be filled in; return the latter's path."""
    from ..procedures.tree.new_study import ROBOT_FILE, new_study
    from ..recordings.readers.urdf import read_urdf
    from ..studies.study import STUDY_FILE

    folder = Path(folder)
    text = new_study(read_urdf(urdf), folder.absolute().name)
    _require_empty(folder)
    try:
        (folder / "recordings").mkdir(parents=True)
        shutil.copyfile(urdf, folder / ROBOT_FILE)
    except OSError as error:
        raise StudyError(f"{folder}: the study could not be made: {error}") from error
    return write_text_atomically(folder / STUDY_FILE, text)


def _require_empty(folder: Path) -> None:
    """Raise a StudyError unless `folder` is new or an empty folder."""
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        found = "a file" if folder.is_file() else f"a folder that holds {', '.join(sorted(os.listdir(folder))[:5])}"
        raise StudyError(f"{folder}: found {found}, expected a new or empty folder")
