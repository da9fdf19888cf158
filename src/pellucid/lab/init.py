"""A new study: filled from a public data set, to be filled by a virtual rig, or written for a robot's file."""

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
"""Where a study keeps the description of its virtual rig."""


def init(
    folder: str | os.PathLike,
    dataset: str | None = None,
    rig: str | None = None,
    progress: bool = False,
    urdf: str | os.PathLike | None = None,
) -> Study | Path:
    """Make a study's folder: of a public data set, of a virtual rig, or for a robot of one's own.

    Parameters
    ----------
    folder : path-like
        Folder to make; it may exist if it is empty.
    dataset : str, optional
        Name of the data set whose recordings fill it.
    rig : str, optional
        Name of the virtual rig that will fill it (see `simulate`), or a file that describes one and ends in .toml.
    progress : bool
        Show a progress bar while downloading.
    urdf : path-like, optional
        File of a robot; it is copied, and a study.toml written that has its joints and their limits, and says what to
        fill in.

    Returns
    -------
    Study or Path
        The study of a data set; of a rig, the file that describes it; of a robot, its study.toml.

    Raises
    ------
    PellucidError
        If not exactly one of them is named, there is none of that name, the folder is not empty, or files cannot be
        had, or cannot be a robot's.

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
    """Make a folder with a copy of a virtual rig's file, ``lab/rig.toml``, that may be edited."""
    folder, text = Path(folder), rig_text(rig)
    _require_empty(folder)
    return write_text_atomically(folder / RIG_FILE, text)


def init_robot(folder: str | os.PathLike, urdf: Path) -> Path:
    """Make a folder with a copy of a robot's file, and a study.toml that is to be filled in."""
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
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        found = "a file" if folder.is_file() else f"a folder that holds {', '.join(sorted(os.listdir(folder))[:5])}"
        raise StudyError(f"{folder}: found {found}, expected a new or empty folder")
