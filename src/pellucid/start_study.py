"""A new study: filled from a public data set, to be filled by a virtual rig, or written for a robot's file."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from . import datasets
from ._atomic import write_text_atomically
from ._errors import StudyError, missing_lab
from ._given import require_empty_folder
from ._plugins import Plugin, load_plugins, require_attributes

if TYPE_CHECKING:
    from .studies.study import Study


def init(
    folder: str | os.PathLike,
    dataset: str | None = None,
    rig: str | None = None,
    progress: bool = False,
    urdf: str | os.PathLike | None = None,
    session: str | None = None,
) -> Study | Path:
    """Make a study's folder: of a public data set, of a virtual rig, for a robot of one's own, or of a live session.

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
    session : str, optional
        Name of a live session (``"elbow"``, ``"knee"``, ``"able-elbow"``, ``"knee-orthosis"``) whose study.toml is
        written; `pellucid live` runs it.

    Returns
    -------
    Study or Path
        The study of a data set; of a rig, the file that describes it; of a robot or a session, its study.toml.

    Raises
    ------
    PellucidError
        If not exactly one of them is named, there is none of that name, the folder is not empty, or files cannot be
        had, or cannot be a robot's. A rig needs the distribution `pellucid-lab`.

    Examples
    --------
    >>> import pellucid as pl
    >>> pl.init("virtual-joint", rig="bench-joint").name
    'rig.toml'
    """
    if sum(given is not None for given in (dataset, rig, urdf, session)) != 1:
        from .session.new_session import SHIPPED_SESSIONS

        rigs = _rig_source()
        raise StudyError(
            "init needs --dataset NAME or --rig NAME or --urdf FILE or --session NAME, one of them; known: "
            f"{', '.join(datasets.names())}; "
            f"rigs: {', '.join(rigs.value.study_names()) if rigs else 'none installed'}; "
            f"sessions: {', '.join(SHIPPED_SESSIONS)}"
        )
    if session is not None:
        from .session.new_session import start_session_study

        return start_session_study(folder, session, Path(folder).absolute().name)
    if rig is not None:
        source = _rig_source()
        if source is None:
            raise missing_lab("init --rig")
        return source.value.start_study(folder, rig)
    if urdf is not None:
        return _start_robot_study(folder, Path(urdf))
    assert dataset is not None  # one of the three is given
    return datasets.init(folder, dataset=dataset, progress=progress)


def _rig_source() -> Plugin | None:
    """Return the plug-in that starts studies of virtual rigs, None if there is none."""
    for plugin in load_plugins("pellucid.study_sources"):
        if plugin.name == "rig":
            require_attributes(plugin, "pellucid.study_sources", "start_study", "study_names")
            return plugin
    return None


def _start_robot_study(folder: str | os.PathLike, urdf: Path) -> Path:
    """Make a folder with a copy of a robot's file, and a study.toml that is to be filled in."""
    from .procedures.tree.new_study import ROBOT_FILE, new_study
    from .recordings.readers.urdf import read_urdf
    from .studies.study import STUDY_FILE

    folder = Path(folder)
    text = new_study(read_urdf(urdf), folder.absolute().name)
    require_empty_folder(folder)
    try:
        (folder / "recordings").mkdir(parents=True)
        shutil.copyfile(urdf, folder / ROBOT_FILE)
    except OSError as error:
        raise StudyError(f"{folder}: the study could not be made: {error}") from error
    return write_text_atomically(folder / STUDY_FILE, text)
