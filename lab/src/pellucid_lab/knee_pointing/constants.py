"""The constants of people who point with the shank, as their rig's file states them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ..constants import (
    CamerasTable,
    Coordinate,
    Motion,
    RigConstants,
    RigTable,
    Share,
    Stiffness,
    Text,
    Viscosity,
)
from ..pointing.constants import (
    ChoiceTable,
    ForceSensorTable,
    LearningTable,
    PlanningTable,
    PointingTable,
    ReachingVisionTable,
)


class OrthosisNameTable(RigTable):
    """``[robot]``: the orthosis that is worn."""

    rig: Text  # name of the shipped rig with the orthosis


class PeopleCountTable(RigTable):
    """``[people]``: who takes part; bodies, straps and habits are drawn as `knee.drawn` says."""

    count: Annotated[int, Field(ge=1, le=1000)]  # number of people


class LegImpedanceTable(RigTable):
    """``[impedance]``: impedance about the planned movement."""

    stiffness: Stiffness  # stiffness of the muscles themselves [N*m/rad]
    damping: Viscosity  # damping of the muscles themselves [N*m*s/rad]
    reflex_share: Share  # reflexes over those of somebody who swings the shank [1]
    noise_share: Share  # signal-dependent noise over that of somebody who swings the shank [1]


class LegCamerasTable(CamerasTable):
    """``[cameras]``: motion capture of a marker at the knee and one at the ankle."""

    knee: tuple[Coordinate, Coordinate, Coordinate]  # position of the knee in the laboratory's frame, z up [m]


class KneePointingConstants(RigConstants):
    """A file like ``rigs/knee-participants.toml``."""

    motion: Motion = "rotary"  # way in which the joint moves
    lifts: Text = "flexion"  # name of the positive direction
    robot: OrthosisNameTable
    people: PeopleCountTable
    impedance: LegImpedanceTable
    planning: PlanningTable
    vision: ReachingVisionTable
    choice: ChoiceTable
    learning: LearningTable
    force_sensor: ForceSensorTable
    pointing: PointingTable
    cameras: LegCamerasTable
    margins: dict[Text, Text]  # as ``[assessment.margins]`` of study.toml, stated before anybody is recorded
    justification: dict[Text, Text]  # as ``[assessment.justification]`` of study.toml
