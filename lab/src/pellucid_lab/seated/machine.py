"""The mechanics of a virtual shank exoskeleton on a frame."""

from __future__ import annotations

from dataclasses import dataclass

from pellucid.models.joint import GRAVITY

from ..rig import Rig
from .constants import SeatedConstants


@dataclass(frozen=True)
class SeatedMachine(Rig):
    """A virtual exoskeleton as a machine; `SeatedRig` adds its subjects' trials, instruments and study."""

    constants: SeatedConstants

    @property
    def period(self) -> float:
        """Return the period of controller and recording [s]."""
        return 1.0 / self.constants.instruments.rate

    @property
    def exoskeleton_gravity(self) -> tuple[float, float]:
        """Return the gravity torque per sine and per cosine of the position [N m]."""
        part = self.constants.exoskeleton
        return GRAVITY * part.mass * part.centre[0], GRAVITY * part.mass * part.centre[1]

    @property
    def exoskeleton_inertia(self) -> float:
        """Return the inertia of shank part and rotor about the joint [kg m^2]."""
        return self.constants.exoskeleton.inertia + self.constants.actuator.inertia
