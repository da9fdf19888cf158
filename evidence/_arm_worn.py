"""Whole arms worn: what passes through cuffs under laws built from cards, on robots and people nothing was chosen on.

Five drawn robots, each identified from its own recordings and worn by one of five drawn people, who reach as recorded
people did where their recordings are here. Full compensation of weight and friction, as identified, is what published
laws of the elbow do, with every joint's best friction; the others are the toolkit's.

Inertia's share and bandwidth of the law with encoders alone, gain and low-pass of the one with force sensors in both
cuffs, were chosen on four other robots and people (seeds 777 and 778), by interaction torque among gains that may be
doubled without ringing; then these five were drawn.
"""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from pellucid._errors import PellucidError
from pellucid._processes import in_order
from pellucid.control.tree_laws import TreeLaw, carried, full_compensation, transparent, with_force_sensor
from pellucid.lab.arm.card_law import CardLaw, card_of, identified, sensor_points
from pellucid.lab.arm.human_motion import people
from pellucid.lab.arm.rig import ArmRig, able_arm, drawn_arms
from pellucid.lab.arm.wearer import Person, drawn_people
from pellucid.lab.arm.worn_trial import motion_of, run
from pellucid.models.tree_card import TreeCard
from pellucid.recordings.results import ResultRow

ARMS = 5

LAWS: Mapping[str, Callable[[TreeCard], TreeLaw]] = {
    "fc": full_compensation,
    "carried": carried,
    "transparent": lambda card: transparent(card, inertia_share=0.4).changed(bandwidth=50.0),
    "force_sensors": lambda card: with_force_sensor(carried(card), proportional=2.0, lowpass=15.0),
}
SENSED, BEST = ("force_sensors",), "force_sensors"

FIGURES = {
    "interaction": ("N*m", "RMS of the cuffs' torque at the wearer's joints"),
    "error": ("rad", "RMS of how far the arm is off"),
    "work": ("J", "what the wearer does against the robot and is not given back"),
    "exchanged": ("J", "work to and fro"),
    "faults": ("1", "trials that a gate stopped"),
}


def worn(rig: ArmRig, person: Person) -> dict[str, dict[str, float]]:
    """Figures of every law on one robot and one person."""
    card, motion, made = card_of(rig, identified(rig)), motion_of(person, rig, repetition=3), {}
    for name, build in LAWS.items():
        law = CardLaw(build(card), sensor_points(person) if name in SENSED else None)
        trial = run(rig, person, law, motion)
        made[name] = {
            "interaction": trial.interaction_rms,
            "error": float(np.sqrt(np.mean(trial.error**2))),
            "work": trial.work,
            "exchanged": trial.exchanged,
            "faults": float(trial.stopped or law.running.fault != "none"),
        }
    return made


def rows(arms: int = ARMS) -> Iterator[ResultRow]:
    """Every figure; ratios are of pairs, on one robot and person."""
    try:
        recorded, motion = people(), "recorded reaching"
    except PellucidError:
        recorded, motion = (), "generated reaching"
    pairs = zip(drawn_arms(able_arm(), arms), drawn_people(arms, recorded=recorded), strict=True)
    found = in_order([(worn, rig, person) for rig, person in pairs])
    said = f"{arms} robots and people that no law was chosen on, {motion}"
    for law in LAWS:
        for figure, (unit, what) in FIGURES.items():
            yield _row(f"worn.{law}.{figure}", [one[law][figure] for one in found], unit, f"{what}; {said}")
        ratios = [one[law]["interaction"] / one["fc"]["interaction"] for one in found]
        yield _row(f"worn.{law}.over_fc", ratios, "1", f"interaction over that under full compensation; {said}")
        if law == BEST:
            yield _row("torque.best_over_fc", ratios, "1", f"force sensors in both cuffs; {said}")


def _row(name: str, values: list[float], unit: str, note: str) -> ResultRow:
    """The median; of a trial that was stopped interaction is infinite."""
    note = f"median; {note}; {min(values):.3g} to {max(values):.3g}"
    middle = float(np.median(values))
    return ResultRow(f"arm.{name}", middle if np.isfinite(middle) else None, unit, "evidence", "simulated", None, note)
