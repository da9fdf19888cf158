"""A virtual rig's recordings, written as the study that a lab would have made of them."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .._errors import PellucidError, StudyError
from .._given import require_folder
from ..studies.study import STUDY_FILE, Study
from .init import RIG_FILE
from .known_rigs import parse_rig, text_of_rig
from .study import TRUTH_FILE, is_changed_by_hand, write_full_study


@dataclass(frozen=True)
class Simulated:
    """Recordings that a virtual rig made.

    Parameters
    ----------
    study : Study
    recordings : int
        How many.
    joint_time : float
        How long the joint moved [s].
    wall_time : float
        How long that took here, files and all [s].
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
    on_progress: Callable[[str, float], None] | None = None,
) -> Simulated:
    """Record the full protocol on the virtual rig of ``lab/rig.toml``, and write the study of it: study.toml,
    recordings, and apart from both the truth in ``lab/truth.json``. The same seed makes the same files.

    Parameters
    ----------
    folder : path-like
        Made by `init` with a rig.
    seed : int
        Of every random draw.
    controllers : sequence of str, optional
        That people wear beside no robot, by their names in `export`; the published three if left out.
    overwrite : bool
        Whether a study.toml that was changed by hand since the last simulation may be replaced.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Simulated

    Raises
    ------
    StudyError
        If there is no rig file, it cannot be understood, the folder holds a study that was not simulated or whose
        study.toml was changed since, or controllers are not known, or named where nobody wears any.

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
        study, joint_time = write_full_study(folder, rig, name=name, seed=seed, on_progress=on_progress)
    except PellucidError:
        raise
    except (ArithmeticError, ValueError, TypeError, LookupError, AttributeError) as error:
        # Constants that are each in range may together be no machine.
        raise StudyError(f"{path}: no machine is like this: {type(error).__name__}: {error}") from error
    return Simulated(study, len(study.config.recordings), joint_time, time.perf_counter() - begun)


def rig_file(folder: Path) -> Path:
    """Where a folder's rig is said; a StudyError if nowhere."""
    require_folder(folder, f"a folder with {RIG_FILE} in it", StudyError)
    path = folder / RIG_FILE
    if not path.is_file():
        raise StudyError(f"{path}: no such file; make one with: pellucid init {folder} --rig NAME")
    return path


def study_name(folder: Path) -> str:
    """A folder's name as a study's, with what such a name may not hold replaced by a hyphen."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", folder.absolute().name).lstrip("_-") or "study"
