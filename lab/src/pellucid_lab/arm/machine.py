"""The mechanics of a virtual arm exoskeleton: its bodies as drawn and as built, its drives and its plant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pellucid import _core
from pellucid.models.kinematic_tree import Tree
from pellucid.models.robot import Robot

from ..rig import Rig
from .bodies import built_gravity, built_tree, drawing, drive_rows, friction_rows, transmission_rows
from .constants import ArmConstants
from .human_motion import JOINTS


@dataclass(frozen=True)
class ArmMachine(Rig):
    """A virtual arm as a machine; `ArmRig` adds its protocol, its instruments and its study."""

    constants: ArmConstants

    @cached_property
    def drawing(self) -> Tree:
        """Return the bodies and joints as the drawing shows them, which is what an identification is given."""
        return drawing(self.constants)

    @property
    def robot(self) -> Robot:
        """Return the robot according to its drawing, with a motor for each joint."""
        return Robot(self.drawing)

    @cached_property
    def built(self) -> Tree:
        """Return the robot as built, its carriage clamped as for an identification, rotors in their joints."""
        return built_tree(self.constants, slider=self.constants.slider.clamped)

    @property
    def gains(self) -> np.ndarray:
        """Return the torque at each joint per ampere, shape (4,) [N m/A]."""
        return drive_rows(self.constants, free=False)[:, 0]

    @property
    def limits(self) -> np.ndarray:
        """Return the largest torque of each drive at its joint, shape (4,) [N m]."""
        return self.gains * [self.constants.joint[name].current_limit for name in JOINTS]

    @property
    def quanta(self) -> np.ndarray:
        """Return the angle of each joint per count of its encoder, shape (4,) [rad]."""
        turn = 2.0 * np.pi / self.constants.encoder.counts_per_turn
        return turn / np.array([self.constants.joint[name].gear_ratio for name in JOINTS])

    def gravity(self, position: np.ndarray) -> np.ndarray:
        """Return the torque that holds the built robot at each `position` (n, 4) [rad], shape (n, 4) [N m]."""
        return self.built.core.gravity(np.ascontiguousarray(position))

    def plant(self, *, slider: float | None = None, **worn: Any) -> _core.WornTree:
        """Return the core's plant, driven by currents [A].

        The carriage is clamped at `slider` [m], or free; `worn` are the core's parameters of a limb.
        """
        free, period = slider is None, 1.0 / self.constants.sampling.rate
        tree = built_tree(self.constants, slider=slider, rotors=False)
        return _core.WornTree(
            tree.links_array,
            np.array(built_gravity(self.constants)),
            friction_rows(self.constants, free=free),
            period=period,
            substeps=self.constants.sampling.substeps,
            elastic=transmission_rows(self.constants, free=free),
            drives=drive_rows(self.constants, free=free),
            lag=self.constants.drive.lag,
            **worn,
        )
