"""The robot that people wear while they point, and the strap that couples it to the forearm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from pellucid import _core

from ..elbow.rig import ElbowRig
from ..rig import Rig
from .constants import PointingConstants, RobotTable


@dataclass(frozen=True)
class PointingPlant(Rig):
    """People who point, with their robot and its strap; `PointingRig` adds the experiment, recordings and study."""

    constants: PointingConstants
    robot: ElbowRig

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        return 1.0 / self.robot.constants.sampling.rate

    @property
    def strap(self) -> np.ndarray:
        """Return the core's parameters of the strap, shape (11,), SI; effects that the file leaves out are 0."""
        values = self.constants.robot.model_dump()
        return np.array([values[name] for name in _core.STRAP_PARAMETER_NAMES], float)

    def strapped(self, values: Mapping[str, float]) -> Self:
        """Return the same people with some constants of the strap changed, as `without_strap_options` gives them."""
        # Only people differ in the offset of their axis; the strap itself has none.
        strap = {f"robot.strap_{name}": value for name, value in values.items()}
        known = {path: value for path, value in strap.items() if path.partition(".")[2] in RobotTable.key_names()}
        return self.changed(known)
