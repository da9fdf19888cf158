"""Whole arms worn: what passes through cuffs under laws built from cards, on robots and people nothing was chosen on.

Each robot is identified from its own recordings. Full compensation of weight and friction, as identified, is what
published laws of the elbow do, with every joint's best friction; the others are the toolkit's. Inertia's share and
bandwidth of the law with encoders alone, gain and low-pass of the one with force sensors in both cuffs, were chosen on
four other robots and people (seeds 777 and 778), by interaction torque among gains that may be doubled without ringing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import PellucidError
from ..._processes import ordered_results
from ...control.tree_laws import TreeLaw, carried, full_compensation, transparent, with_force_sensor
from ...lab.arm.card_law import CardLaw, card_of, identified, sensor_points
from ...lab.arm.human_motion import people
from ...lab.arm.rig import ArmRig
from ...lab.arm.wearer import Person, drawn_people
from ...lab.arm.worn_trial import motion_of, run
from ...models.tree_card import TreeCard

LAWS: Mapping[str, Callable[[TreeCard], TreeLaw]] = {
    "fc": full_compensation,
    "carried": carried,
    "transparent": lambda card: transparent(card, inertia_share=0.4).changed(bandwidth=50.0),
    "force_sensors": lambda card: with_force_sensor(carried(card)),
}
PUBLISHED, BEST, SENSED = "fc", "force_sensors", ("force_sensors",)


@dataclass(frozen=True)
class ArmWorn:
    """One robot on one person under one law."""

    interaction: float  # RMS of the cuffs' torque at the wearer's joints [N m]; infinite where the trial was stopped
    error: float  # RMS of how far the arm is off [rad]
    work: float  # what the wearer does against the robot and is not given back [J]
    exchanged: float  # work to and fro [J]
    faulted: bool  # whether the law's gate or the trial was stopped


def worn(
    rig: ArmRig, person: Person, laws: Sequence[str] = tuple(LAWS), seconds: float | None = None
) -> dict[str, ArmWorn]:
    """Figures of laws on one robot and one person, of the first `seconds` [s] of a motion where they are given."""
    card, motion, made = card_of(rig, identified(rig)), motion_of(person, rig, repetition=3), {}
    if seconds is not None:
        motion = replace(motion, position=motion.position[: round(seconds * motion.rate)])
    for name in laws:
        law = CardLaw(LAWS[name](card), sensor_points(person) if name in SENSED else None)
        trial = run(rig, person, law, motion)
        off = float(np.sqrt(np.mean(trial.error**2)))
        stopped = trial.stopped or law.running.fault != "none"
        made[name] = ArmWorn(trial.interaction_rms, off, trial.work, trial.exchanged, stopped)
    return made


def wearers_of(arms: Sequence[ArmRig]) -> tuple[Sequence[Person], str]:
    """Whom each of some robots is worn by, and how they move, in words."""
    try:
        recorded, said = people(), "recorded reaching"
    except PellucidError:
        recorded, said = (), "generated reaching"
    return drawn_people(len(arms), recorded=recorded), said


def arms_worn(arms: Sequence[ArmRig]) -> tuple[list[dict[str, ArmWorn]], str]:
    """Every law on each of some robots, and how their wearers moved, in words."""
    wearers, said = wearers_of(arms)
    return ordered_results([(worn, rig, person) for rig, person in zip(arms, wearers, strict=True)]), said
