"""A new study: filled from a public data set, or to be filled by a virtual rig."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from .. import datasets
from .._atomic import write_text_atomically
from .._errors import StudyError
from .known_rigs import rig_names, rig_text

if TYPE_CHECKING:
    from ..recordings.study import Study

RIG_FILE = "lab/rig.toml"
"""Where a study keeps the description of its virtual rig."""


def init(
    folder: str | os.PathLike, dataset: str | None = None, rig: str | None = None, progress: bool = False
) -> Study | Path:
    """Make a study's folder, either of a public data set or of a virtual rig.

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

    Returns
    -------
    Study or Path
        The study of a data set; of a rig, the file that describes it.

    Raises
    ------
    PellucidError
        If not exactly one of both is named, there is none of that name, the folder is not empty, or files cannot be
        had.

    Examples
    --------
    >>> import pellucid as pl
    >>> pl.init("virtual-joint", rig="bench-joint").name
    'rig.toml'
    """
    if (dataset is None) == (rig is None):
        raise StudyError(
            f"init needs --dataset NAME or --rig NAME, one of them; known: {', '.join(datasets.names())}; "
            f"rigs: {', '.join(rig_names())}"
        )
    if rig is not None:
        return init_rig(folder, rig)
    return datasets.init(folder, dataset=dataset, progress=progress)


def init_rig(folder: str | os.PathLike, rig: str) -> Path:
    """Make a folder with a copy of a virtual rig's file, ``lab/rig.toml``, that may be edited."""
    folder, text = Path(folder), rig_text(rig)
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        found = "a file" if folder.is_file() else f"a folder that holds {', '.join(sorted(os.listdir(folder))[:5])}"
        raise StudyError(f"{folder}: found {found}, expected a new or empty folder")
    return write_text_atomically(folder / RIG_FILE, text)
