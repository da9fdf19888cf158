"""Read the motion of a knee in walking from a public recording on a treadmill, which virtual wearers follow."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._errors import DatasetError
from ...files.readers.read import read_columns
from .fetch import path
from .registry import gait_names, info


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
        own = (self.flexion, self.tilt, self.hip, self.forward, self.upward)
        return (*own, self.knee_moment, self.ankle_moment)


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
        turned, moment = gait["sign"] * (np.pi / 180.0 if gait["unit"] == "deg" else 1.0), gait["sign"]
        other = np.pi / 180.0 if gait["unit"] == "deg" else 1.0
        at = np.interp
        time = angles["time"]
        own = {key: np.asarray(angles[gait[key]]) for key in ("knee", "tilt", "hip", "forward", "upward")}
        known = {key: at(time, moments["time"], moments[gait[key]]) for key in ("knee_moment", "ankle_moment")}
        return RecordedGait(
            f"{name}, {files['words']}", gait["rate"], turned * own["knee"], other * own["tilt"], other * own["hip"],
            own["forward"], own["upward"], moment * known["knee_moment"], known["ankle_moment"],
        )  # fmt: skip
    raise DatasetError(f"walking: found no data set with a gait at the speed {speed!r}, expected one")
