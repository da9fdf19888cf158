"""A wearer of the virtual orthosis, as described in the rig's file."""

from __future__ import annotations

from dataclasses import dataclass

from pellucid.models.joint import GRAVITY

from .constants import EmgGainTable, LimbTable, StrengthTable, SubjectStrapTable

FLEXOR_MUSCLE = "lateral_hamstring"
"""Name of the muscle that pulls towards positive angles."""

EXTENSOR_MUSCLE = "rectus_femoris"
"""Name of the muscle that pulls towards negative angles."""


@dataclass(frozen=True)
class KneeSubject:
    """A wearer of the orthosis: an entry of ``[subjects]`` in the rig's file, SI."""

    name: str
    sex: str
    age: int  # age [years]
    weight: float  # mass of the body [kg]
    height: float  # height [m]
    shank_length: float  # distance from knee to heel [m]
    limb: LimbTable  # shank and foot
    strap: SubjectStrapTable  # this person's strap; what it leaves out is common to all wearers
    strength: StrengthTable  # largest torque of each muscle group [N*m]
    emg_gain: EmgGainTable  # RMS of each muscle's EMG at full excitation [V]

    @property
    def gravity(self) -> float:
        """Return the gravity torque m g l of shank and foot about the knee [N*m]."""
        return GRAVITY * self.limb.mass * self.limb.centre

    @property
    def inertia(self) -> float:
        """Return the inertia of shank and foot about the knee [kg*m^2]."""
        return self.limb.mass * (self.limb.centre**2 + self.limb.gyration**2)
