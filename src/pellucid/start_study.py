"""A new study: of one's own files, of a public data set, to be filled by a virtual rig, or written for a robot's
file."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ._atomic import write_text_atomically
from ._errors import StudyError, missing_lab
from ._given import require_empty_folder
from ._plugins import Plugin, load_plugins, require_attributes
from .study import datasets

if TYPE_CHECKING:
    from .start.init_from_files import ProposedStudy
    from .start.proposal import Question
    from .study.study import Study


def init(
    folder: str | os.PathLike,
    dataset: str | None = None,
    rig: str | None = None,
    progress: bool = False,
    *,
    urdf: str | os.PathLike | None = None,
    files: Iterable[str | os.PathLike] | None = None,
    answers: Mapping[str, str] | None = None,
    ask: Callable[[Question], str] | None = None,
    session: str | None = None,
) -> Study | Path | ProposedStudy:
    """Make a study's folder from files, a public data set, a simulated rig, a robot's URDF, or a live session.

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
        fill in. With `files` it gives the joints of the recordings.
    files : iterable of path-like, optional
        Recordings of one's own, and folders of them. They are copied; what their columns are is inferred from names,
        units and numbers, and study.toml marks what these do not decide. A robot's file among them gives its joints. A
        study that `check` refuses is not written.
    answers : mapping of str to str, optional
        With `files`: answers to questions that files cannot answer, by the questions' keys; a question without one
        takes
        its default, which study.toml marks.
    ask : callable, optional
        With `files`: called with each question without an answer; it returns the answer.
    session : str, optional
        Name of a live session (``"elbow"``, ``"knee"``, ``"able-elbow"``, ``"knee-orthosis"``) whose study.toml is
        written; `pellucid live` runs it.

    Returns
    -------
    Study, Path or ProposedStudy
        The study of a data set; of a rig, the file that describes it; of a robot or a session, its study.toml; of
        files, their proposal.

    Raises
    ------
    PellucidError
        If not exactly one of them is named (a robot's file may accompany `files`), there is none of that name, the
        folder is not empty, files cannot be had or cannot be a robot's, or `check` refuses the study of `files`. A rig
        needs the distribution `pellucid-lab`.

    Examples
    --------
    >>> import pellucid as pl
    >>> pl.init("virtual-joint", rig="bench-joint").name
    'rig.toml'

    A study of own files: a pendulum of 2 N*m with viscous friction. Questions that nobody answers take their defaults:

    >>> import math
    >>> from pathlib import Path
    >>> angles = [0.5 * math.sin(k / 20) for k in range(400)]  # [rad]
    >>> torques = [2.0 * math.sin(angle) + 0.5 * math.cos(k / 20) for k, angle in enumerate(angles)]
    >>> pairs = zip(angles, torques)
    >>> rows = [f"{0.01 * k:.2f},{math.degrees(q):.3f},{torque:.3f}" for k, (q, torque) in enumerate(pairs)]
    >>> _ = Path("swing.csv").write_text("\\n".join(["t [s],angle [deg],torque [Nm]", *rows]))
    >>> made = pl.init("own-joint", files=["swing.csv"])
    >>> [question.key for question in made.questions]
    ['worn', 'angle_zero']
    """
    robot = None if files is not None else urdf
    if sum(given is not None for given in (dataset, rig, robot, files, session)) != 1:
        from .live.session.run_session import SHIPPED_SESSIONS

        rigs = _rig_source()
        raise StudyError(
            "init needs exactly one of --from FILES, --dataset NAME, --rig NAME, --urdf FILE and --session NAME; "
            f"datasets: {', '.join(datasets.names())}; "
            f"rigs: {', '.join(rigs.value.study_names()) if rigs else 'none installed'}; "
            f"sessions: {', '.join(SHIPPED_SESSIONS)}"
        )
    if files is not None:
        from .start.init_from_files import init_from_files

        return init_from_files(folder, files, answers=answers, ask=ask, urdf=urdf)
    if session is not None:
        from .live.session.run_session import start_session_study

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
    from .arm.study.new_study import ROBOT_FILE, new_study
    from .arm.urdf import read_urdf
    from .study.study import STUDY_FILE

    folder = Path(folder)
    text = new_study(read_urdf(urdf), folder.absolute().name)
    require_empty_folder(folder)
    try:
        (folder / "recordings").mkdir(parents=True)
        shutil.copyfile(urdf, folder / ROBOT_FILE)
    except OSError as error:
        raise StudyError(f"{folder}: the study could not be made: {error}") from error
    return write_text_atomically(folder / STUDY_FILE, text)
