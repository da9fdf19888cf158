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

from pellucid._errors import PellucidError
from pellucid.controllers.tree_laws import TreeLaw, carried, full_compensation, transparent, with_force_sensor

from ...arm.card_law import CardLaw, card_of, identified, sensor_points
from ...arm.human_motion import people
from ...arm.rig import ArmRig
from ...arm.wearer import Person, drawn_people
from ...arm.worn_trial import motion_of, run
from ...processes import ordered_results

LAWS: Mapping[str, Callable[..., TreeLaw]] = {
    "fc": full_compensation,
    "carried": carried,
    "transparent": lambda card, **settings: transparent(
        card, inertia_share=0.4, check_margin=False, **settings
    ).changed(bandwidth=50.0),
    "force_sensors": lambda card, **settings: with_force_sensor(carried(card, **settings)),
}
"""Laws of four joints by name: each makes its law from the robot's identified card, and settings of `carried`."""

PUBLISHED_LAW = "fc"
"""Name of the paper's full compensation, extended to four joints."""

BEST_LAW = "force_sensors"
"""Name of the toolkit's own law that the chapter compares with it."""

LAWS_WITH_FORCE_SENSOR = ("force_sensors",)
"""Names of laws that read force sensors at the cuffs."""


@dataclass(frozen=True)
class WornArmOutcome:
    """Outcome of one robot on one person under one law."""

    interaction: float  # RMS of the cuffs' torque at the wearer's joints [N m]; infinite where the trial was stopped
    error: float  # RMS of the arm's deviation from the intended motion [rad]
    work: float  # Net work that the wearer does on the robot [J]
    exchanged: float  # Sum of the absolute work between wearer and robot [J]
    faulted: bool  # whether the law's gate or the trial was stopped


def worn(
    rig: ArmRig, person: Person, laws: Sequence[str] = tuple(LAWS), seconds: float | None = None
) -> dict[str, WornArmOutcome]:
    """Return the outcome of each law on one robot and one person, over the first `seconds` [s] of a motion, or all."""
    card, motion, made = card_of(rig, identified(rig)), motion_of(person, rig, repetition=3), {}
    if seconds is not None:
        motion = replace(motion, position=motion.position[: round(seconds * motion.rate)])
    for name in laws:
        law = CardLaw(LAWS[name](card), sensor_points(person) if name in LAWS_WITH_FORCE_SENSOR else None)
        trial = run(rig, person, law, motion)
        off = float(np.sqrt(np.mean(trial.error**2)))
        stopped = trial.stopped or law.running.fault != "none"
        made[name] = WornArmOutcome(trial.interaction_rms, off, trial.work, trial.exchanged, stopped)
    return made


def wearers_of(arms: Sequence[ArmRig]) -> tuple[Sequence[Person], str]:
    """Return a person for each of some robots, and the source of their motions in words."""
    try:
        recorded, source = people(), "recorded reaching"
    except PellucidError:
        recorded, source = (), "generated reaching"
    return drawn_people(len(arms), recorded=recorded), source


def arms_worn(arms: Sequence[ArmRig]) -> tuple[list[dict[str, WornArmOutcome]], str]:
    """Return the outcome of every law on each of some robots, and the source of the wearers' motions in words."""
    wearers, source = wearers_of(arms)
    return ordered_results([(worn, rig, person) for rig, person in zip(arms, wearers, strict=True)]), source
