"""A virtual rig's recordings, written as the study that a lab would have made of them."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .._errors import StudyError
from ..recordings.study import STUDY_FILE, Study
from .elbow.protocol import trials
from .elbow.rig import KIND, parse_elbow_rig
from .elbow.study import excitation, write_elbow_study
from .init import RIG_FILE
from .knee.protocol import tasks
from .knee.rig import KIND as KNEE
from .knee.rig import parse_knee_rig
from .knee.study import write_knee_study
from .pointing.people import KIND as PEOPLE
from .pointing.people import parse_pointing_rig
from .pointing.study import write_pointing_study
from .rig_file import parse_tables
from .seated.protocol import seated_trials
from .seated.rig import KIND as SEATED
from .seated.rig import parse_seated_rig
from .seated.study import write_seated_study
from .study_folder import TRUTH_FILE
from .virtual_joint import parse_rig, write_study


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
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Simulated

    Raises
    ------
    StudyError
        If there is no rig file, it cannot be understood, the folder holds a study that was not simulated, or
        controllers are not known, or named where nobody wears any.

    Examples
    --------
    >>> import pellucid as pl
    >>> _ = pl.init("a-virtual-joint", rig="bench-joint")
    >>> made = pl.simulate("a-virtual-joint", seed=1)
    >>> len(made.study.recordings()) > 1
    True
    """
    folder, tell = Path(folder), on_progress or (lambda text, share: None)
    path = folder / RIG_FILE
    if not path.is_file():
        raise StudyError(f"{path}: no such file; make one with: pellucid init {folder} --rig NAME")
    if (folder / STUDY_FILE).exists() and not (folder / TRUTH_FILE).exists():
        raise StudyError(f"{folder}: found a study that was not simulated, which simulate would overwrite")
    text = path.read_text(encoding="utf-8")
    kind = parse_tables(text, str(path)).get("kind")
    name = study_name(folder)
    if controllers and kind != PEOPLE:
        raise StudyError(f"{path}: found controllers {', '.join(controllers)}, expected them with people who wear them")
    begun = time.perf_counter()
    if kind == KIND:
        rig = parse_elbow_rig(text, name)
        tell("optimising the excitation", 0.0)
        made = trials(rig, excitation)
        study = write_elbow_study(folder, rig, name=name, seed=seed, made=made, on_progress=on_progress)
        joint_time = sum(len(trial.reference) for trial in made) / rig["sampling"]["rate"]
    elif kind == KNEE:
        knee = parse_knee_rig(text, name)
        made = tasks(knee)
        study = write_knee_study(folder, knee, name=name, seed=seed, made=made, on_progress=on_progress)
        joint_time = knee.period * sum(len(trial.reference) for trial, _ in made)
    elif kind == SEATED:
        seated = parse_seated_rig(text, name)
        tell("optimising the excitation", 0.0)
        made = seated_trials(seated)
        study = write_seated_study(folder, seated, name=name, seed=seed, made=made, on_progress=on_progress)
        joint_time = seated.period * sum(len(trial.reference) for trial in made)
    elif kind == PEOPLE:
        from .pointing.conditions import study_conditions

        people = parse_pointing_rig(text, name)
        tell("identifying the robot that is worn", 0.0)
        conditions = study_conditions(people, controllers, seed=seed)
        study = write_pointing_study(
            folder, people, conditions, name=name, seed=seed, threads=2, on_progress=on_progress
        )
        joint_time = sum(float(recording.time[-1]) for recording in study.recordings())
    elif kind is None:
        joint = parse_rig(text, name)
        tell("moving the virtual joint", 0.1)
        study = write_study(folder, joint, name=name, seed=seed)
        joint_time = joint.duration * len(study.config.recordings)
    else:
        raise StudyError(
            f'{path}: found kind = {kind!r}, expected "{KIND}", "{KNEE}", "{SEATED}", "{PEOPLE}", or no kind for a '
            "joint on a bench"
        )
    return Simulated(study, len(study.config.recordings), joint_time, time.perf_counter() - begun)


def study_name(folder: Path) -> str:
    """A folder's name as a study's, with what such a name may not hold replaced by a hyphen."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", folder.absolute().name).lstrip("_-") or "study"
