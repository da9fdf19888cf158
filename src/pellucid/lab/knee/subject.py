"""Somebody who wears the virtual orthosis, as the rig file says them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ...models.joint import GRAVITY

FLEXOR, EXTENSOR = "lateral_hamstring", "rectus_femoris"
"""The muscle that pulls towards positive angles, and the one that pulls back."""


@dataclass(frozen=True)
class KneeSubject:
    """Somebody who wears the orthosis: an entry of the rig file's ``[subjects]``, SI."""

    name: str
    sex: str
    age: float  # age, weight, height, shank_length: [years], [kg], [m], [m]
    weight: float
    height: float
    shank_length: float
    limb: Mapping[str, float]  # limb, strap: As in the rig file
    strap: Mapping[str, float]
    strength: Mapping[str, float]  # strength, emg_gain: Of each muscle [N*m], [V]
    emg_gain: Mapping[str, float]

    @property
    def gravity(self) -> float:
        """Of shank and foot about the knee, m g l [N*m]."""
        return GRAVITY * self.limb["mass"] * self.limb["centre"]

    @property
    def inertia(self) -> float:
        """Of shank and foot about the knee [kg*m^2]."""
        return self.limb["mass"] * (self.limb["centre"] ** 2 + self.limb["gyration"] ** 2)
