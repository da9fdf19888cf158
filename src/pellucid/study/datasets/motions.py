"""Read public recordings of people's movements: joint angles without torques, which simulated rigs follow.

Read the motion of a knee in walking from a public recording on a treadmill, which simulated wearers follow.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import DatasetError
from ...files.readers.read import read_columns
from .registry import gait_names, info, motion_names, path


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """One recorded movement of one person."""

    person: str
    task: int  # number of the task, from 1
    repetition: int  # number of the repetition, from 1
    number: int  # number of the movement in the repetition, from 1
    rate: float  # sampling rate [Hz]
    joints: tuple[str, ...]
    angles: np.ndarray = field(repr=False)  # joint angles, shape (n, joints) [rad]

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return (len(self.angles) - 1) / self.rate


def recorded_motions(joints: Sequence[str]) -> tuple[RecordedMotion, ...]:
    """Return all motions of the data set with the `joints`, in the order of the joints.

    A DatasetError says how to get the data set if it is not on this machine.
    """
    for name in motion_names():
        if set(joints) <= set(_motion_format(name)["joints"]):
            return _of(name, tuple(joints), path(name))
    known = "; ".join(", ".join(_motion_format(name)["joints"]) for name in motion_names())
    raise DatasetError(f"motions of {', '.join(joints)}: found no data set, expected joints among {known}")


@lru_cache(maxsize=4)
def _of(name: str, joints: tuple[str, ...], folder: Path) -> tuple[RecordedMotion, ...]:
    return tuple(motion for file in info(name).files for motion in motions_of(name, folder / file, joints))


def _motion_format(name: str) -> Mapping[str, Any]:
    """Return the format of the files with people's motions of the data set `name`."""
    found = info(name).motion
    if found is None:
        raise DatasetError(f"{name}: found no motions of people, expected one of {', '.join(motion_names())}")
    return found


def motions_of(name: str, file: Path, joints: Sequence[str]) -> list[RecordedMotion]:
    """Return the motions in one person's `file`, which has the format of the data set `name`."""
    motion_info, made = _motion_format(name), []
    scale = np.array(motion_info["signs"], float) * (np.pi / 180.0 if motion_info["unit"] == "deg" else 1.0)
    order = [motion_info["joints"].index(joint) for joint in joints]
    cells: dict[tuple[int, ...], dict[int, np.ndarray]] = defaultdict(dict)
    for column, values in read_columns(file).values.items():
        variable, *places = column.split(".")
        if variable == motion_info["variable"] and len(places) == 4 and not isinstance(values, str):
            *cell, row = map(int, places)
            cells[tuple(cell)][row] = values
    if not cells:
        raise DatasetError(f"{file}: found no motions, expected cells {motion_info['variable']}")
    for (repetition, task, number), rows in sorted(cells.items(), key=lambda item: (item[0][1], item[0])):
        angles = np.column_stack([scale[k] * rows[k] for k in order])
        angles.flags.writeable = False
        person = file.name.partition("_")[0]
        made.append(
            RecordedMotion(person, task + 1, repetition + 1, number + 1, motion_info["rate"], tuple(joints), angles)
        )
    return made


def recorded_walking() -> tuple[float, np.ndarray]:
    """Return the rate [Hz] and the flexion of a walking knee, shape (n,) [rad]; raise a DatasetError without a file."""
    for name in gait_names():
        gait_info = info(name).gait
        assert gait_info is not None, "gait_names gives only data sets with a walking knee"
        scale = gait_info["sign"] * (np.pi / 180.0 if gait_info["unit"] == "deg" else 1.0)
        return gait_info["rate"], scale * read_columns(path(name) / gait_info["file"])[gait_info["knee"]]
    raise DatasetError("walking: found no data set that shows a knee, expected one with a table gait")


@dataclass(frozen=True, eq=False)
class RecordedGait:
    """The right leg of somebody who walks on a treadmill; arrays have shape (n,)."""

    name: str
    rate: float  # [Hz]
    flexion: np.ndarray = field(repr=False)  # flexion of the knee [rad]
    tilt: np.ndarray = field(repr=False)  # backward tilt of the pelvis [rad]
    hip: np.ndarray = field(repr=False)  # flexion of the hip [rad]
    forward: np.ndarray = field(repr=False)  # place of the pelvis forward [m]
    upward: np.ndarray = field(repr=False)  # place of the pelvis upward [m]
    knee_moment: np.ndarray = field(repr=False)  # moment at the knee, in flexion [N*m]
    ankle_moment: np.ndarray = field(repr=False)  # moment at the ankle, in dorsiflexion [N*m]

    @property
    def rows(self) -> tuple[np.ndarray, ...]:
        """The arrays, in the order of the fields."""
        return tuple(getattr(self, each.name) for each in fields(self)[2:])


def recorded_gait(speed: str) -> RecordedGait:
    """Return what is recorded of a leg and its pelvis at a `speed`, "slow" or "fast".

    Raises
    ------
    DatasetError
        If no recording at that speed is on this machine.
    """
    for name in gait_names():
        gait = info(name).gait
        if gait is None or speed not in gait.get("speeds", {}):
            continue
        files = gait["speeds"][speed]
        if not all((path(name) / files[kind]).is_file() for kind in ("angles", "moments")):
            continue
        angles, moments = (read_columns(path(name) / files[kind]) for kind in ("angles", "moments"))
        radian = np.pi / 180.0 if gait["unit"] == "deg" else 1.0
        knee, tilt, hip, forward, upward = (
            np.asarray(angles[gait[key]]) for key in ("knee", "tilt", "hip", "forward", "upward")
        )
        knee_moment, ankle_moment = (
            np.interp(angles["time"], moments["time"], moments[gait[key]]) for key in ("knee_moment", "ankle_moment")
        )
        return RecordedGait(
            f"{name}, {files['words']}", gait["rate"], gait["sign"] * radian * knee, radian * tilt, radian * hip,
            forward, upward, gait["sign"] * knee_moment, ankle_moment,
        )  # fmt: skip
    raise DatasetError(f"walking: found no data set with a gait at the speed {speed!r}, expected one")
