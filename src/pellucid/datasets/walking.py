"""Read the motion of a knee in walking from a public recording on a treadmill, which virtual wearers follow."""

from __future__ import annotations

import numpy as np

from .._errors import DatasetError
from ..recordings.readers.read import read_columns
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
