"""A new study: filled from a public data set, or to be filled by a virtual rig."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from .. import datasets
from .._atomic import write_text_atomically
from .._errors import StudyError
from .elbow.rig import drawn_rigs, parse_elbow_rig
from .rig_file import RIGS, shipped_rig

if TYPE_CHECKING:
    from ..recordings.study import Study

RIG_FILE = "lab/rig.toml"
"""Where a study keeps the description of its virtual rig."""

DRAWN = 5
"""Rigs drawn from the ranges of the one with a carriage."""

DRAWN_FROM = "able-elbow"


def rig_names() -> tuple[str, ...]:
    """Names of the virtual rigs that come with the package."""
    own = sorted(file.name.removesuffix(".toml") for file in RIGS.iterdir())
    return (*own, *(f"{DRAWN_FROM}-drawn-{i + 1}" for i in range(DRAWN)))


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
        Name of the virtual rig that will fill it (see `simulate`).
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
    """Make a folder with a copy of a virtual rig's file, ``lab/rig.toml``, that may be edited.

    Parameters
    ----------
    folder : path-like
        Folder to make; it may exist if it is empty.
    rig : str
        One of `rig_names`.

    Returns
    -------
    Path
        The rig's file.

    Raises
    ------
    StudyError
        If there is no such rig, or the folder is not empty.
    """
    folder = Path(folder)
    if rig not in rig_names():
        raise StudyError(f"unknown rig {rig!r}; known: {', '.join(rig_names())}")
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        found = "a file" if folder.is_file() else f"a folder that holds {', '.join(sorted(os.listdir(folder))[:5])}"
        raise StudyError(f"{folder}: found {found}, expected a new or empty folder")
    text = rig_text(rig)
    (folder / RIG_FILE).parent.mkdir(parents=True)
    return write_text_atomically(folder / RIG_FILE, text)


def rig_text(rig: str) -> str:
    """The text of a rig's file; a drawn rig's is its model's with the drawn values in their places.

    Parameters
    ----------
    rig : str
        One of `rig_names`.

    Returns
    -------
    str
    """
    base, _, drawn = rig.partition("-drawn-")
    text = shipped_rig(base)
    if not drawn:
        return text
    original = parse_elbow_rig(text, base)
    values = drawn_rigs(original, DRAWN)[int(drawn) - 1]
    made, table = [f"# Drawn from the ranges at the end of this file: rig {drawn} of {DRAWN}."], ""
    for line in text.splitlines():
        head = re.match(r"\[([\w.]+)\]", line)
        table = head[1] if head else table
        entry = re.match(r"(\w+) = [^#]*?(?= *(#|$))", line)
        if entry and f"{table}.{entry[1]}" in original["drawn"]:
            line = f"{entry[1]} = {values[table][entry[1]]!r}{line[entry.end() :]}"
        made.append(line)
    return "\n".join(made) + "\n"
