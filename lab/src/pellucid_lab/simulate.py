"""The command `simulate`: recordings of a virtual rig, written as the study that a lab would have made of them."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from pellucid._errors import PellucidError, StudyError
from pellucid._given import require_folder
from pellucid.study.study import STUDY_FILE, Study
from pellucid.study.study_place import RIG_FILE

from .known_rigs import parse_rig
from .shipped_rigs import text_of_rig
from .study import TRUTH_FILE, is_changed_by_hand, write_full_study


@dataclass(frozen=True)
class Simulated:
    """The study that `simulate` wrote, and how long its simulation took.

    Parameters
    ----------
    study : Study
    recordings : int
        Number of recordings.
    joint_time : float
        Total duration of the recordings [s].
    wall_time : float
        Time that simulating and writing took [s].
    """

    study: Study
    recordings: int
    joint_time: float
    wall_time: float


def simulate(
    folder: str | os.PathLike,
    seed: int = 1,
    *,
    controllers: Sequence[str] | None = None,
    overwrite: bool = False,
    executor: Executor | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Simulated:
    """Record the full protocol on the virtual rig of ``lab/rig.toml``, and write its study.

    The study has study.toml and its recordings. The true parameters are written to ``lab/truth.json``, which no
    procedure reads. The same seed makes the same files.

    Parameters
    ----------
    folder : path-like
        Folder that `init` made with a rig.
    seed : int
        Seed of every random draw, at least 0.
    controllers : sequence of str, optional
        Controllers that people wear, by their names in `export`, compared with no robot; by default the published
        three.
    overwrite : bool
        Whether a study.toml that was changed by hand since the last simulation may be replaced.
    executor : concurrent.futures.Executor, optional
        Records trials that do not depend on each other, for instance a cluster's whose workers see the folder.
    on_progress : callable, optional
        Function that is called with a text and the share of the work that is done, 0 to 1.

    Returns
    -------
    Simulated

    Raises
    ------
    StudyError
        If the rig's file is missing or not valid; if the folder holds a study that was not simulated, or whose
        study.toml was changed since; if a controller is not known, or controllers are named for a rig that nobody
        wears.

    Examples
    --------
    >>> import pellucid as pl
    >>> _ = pl.init("a-virtual-joint", rig="bench-joint")
    >>> made = pl.simulate("a-virtual-joint", seed=1)
    >>> len(made.study.recordings()) > 1
    True
    """
    folder, tell = Path(folder), on_progress or (lambda text, share: None)
    if seed < 0:
        raise StudyError(f"simulate: found the seed {seed}, expected 0 or more")
    path = rig_file(folder)
    if (folder / STUDY_FILE).exists() and not (folder / TRUTH_FILE).exists():
        raise StudyError(f"{folder}: found a study that was not simulated, which simulate would overwrite")
    if not overwrite and (folder / STUDY_FILE).exists() and is_changed_by_hand(folder):
        raise StudyError(
            f"{folder / STUDY_FILE}: found changes since the last simulation wrote it, which simulate would overwrite; "
            "expected none. Move it away, or let it be replaced: --overwrite (overwrite=True)"
        )
    name, begun = study_name(folder), time.perf_counter()
    rig = parse_rig(text_of_rig(path), name)
    tell("preparing the rig", 0.0)
    try:
        rig = rig.prepared(controllers, seed)
        study, joint_time = write_full_study(
            folder, rig, name=name, seed=seed, executor=executor, on_progress=on_progress
        )
    except PellucidError:
        raise
    except (ArithmeticError, ValueError, TypeError, LookupError, AttributeError) as error:
        # Constants that are in range one by one may be impossible together.
        raise StudyError(f"{path}: no machine is like this: {type(error).__name__}: {error}") from error
    return Simulated(study, len(study.config.recordings), joint_time, time.perf_counter() - begun)


def rig_file(folder: Path) -> Path:
    """Return the path of a folder's rig file; raise a StudyError if there is none."""
    require_folder(folder, f"a folder with {RIG_FILE} in it", StudyError)
    path = folder / RIG_FILE
    if not path.is_file():
        raise StudyError(f"{path}: no such file; make one with: pellucid init my-rig --rig able-elbow")
    return path


def study_name(folder: Path) -> str:
    """Return a study's name made from its folder's, with a hyphen for characters that such a name may not hold."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", folder.absolute().name).lstrip("_-") or "study"
