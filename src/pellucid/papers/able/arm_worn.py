"""What passes between a person and a virtual arm under the laws of all joints, on arms that none was chosen on.

The laws are the toolkit's own (`control/tree_laws.py`), made from the card that identification gave of that arm. Which
of them is best, and with which constants, is chosen on two arms drawn with another seed, by the interaction torque's
RMS over the wearer's joints on generated reaching; it is then taken as it is to the five arms and to people's motions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import DatasetError
from ..._processes import in_order
from ...control import tree_laws
from ...control.tree_laws import TreeLaw
from ...lab.arm.human_motion import generated_motion, people
from ...lab.arm.rig import ArmRig, drawn_arms
from ...lab.arm.wearer import HANDLE_AT, Person, drawn_people
from ...lab.arm.worn_trial import motion_of, run
from ...models.tree_card import TreeCard
from .arm_card import card_of
from .arm_identification import ArmIdentified, identified_many

CHOSEN_ON, CHOSEN_SEED, PEOPLE_SEED = 2, 4711, 811  # arms, their seed, their wearers'
SECONDS = 12.0  # of each motion
JUDGED_SECONDS = 20.0

Made = Callable[[TreeCard, Person], TreeLaw]


def _sensed(law: TreeLaw, person: Person, proportional: float) -> TreeLaw:
    """By the handle's sensor, which sits where a ruler says."""
    at = (0.0, 0.0, -HANDLE_AT * person.forearm)
    return tree_laws.with_force_sensor(law, body=law.card.bodies[-1], point=at, proportional=proportional)


BEST = "sensor_1"
"""Of these, on the arms that constants were chosen on."""

CANDIDATES: dict[str, Made] = {
    "full": lambda card, person: tree_laws.full_compensation(card),
    "carried": lambda card, person: tree_laws.carried(card),
    "transparent": lambda card, person: tree_laws.transparent(card),
    "transparent_more": lambda card, person: tree_laws.transparent(card, inertia_share=0.6),
    "sensor_0.5": lambda card, person: _sensed(tree_laws.transparent(card), person, 0.5),
    "sensor_1": lambda card, person: _sensed(tree_laws.transparent(card), person, 1.0),
    "sensor_2": lambda card, person: _sensed(tree_laws.transparent(card), person, 2.0),
    "sensor_2_carried": lambda card, person: _sensed(tree_laws.carried(card), person, 2.0),
    "sensor_3_carried": lambda card, person: _sensed(tree_laws.carried(card), person, 3.0),
}
"""What the choice is among; the first is the published one, by which others are judged."""


class Worn:
    """A law as a trial steps it; `gains` (4,) turn its torques into those of the stated gains."""

    def __init__(self, law: TreeLaw, gains: np.ndarray):
        self.law, self.gains, self.sensed = law, gains, law.whole["sensor_link"] > 0.0

    def reset(self) -> None:
        """At rest."""
        self.running = self.law.start()

    def step(self, time: float, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Torque of each joint."""
        handle = wrench[1] if self.sensed else None  # the other sensor is the upper arm's
        asked = self.running.step(time, position, wrench=handle)
        return asked / self.gains


def worn(
    rig: ArmRig, found: ArmIdentified, person: Person, names: Sequence[str], seconds: float
) -> dict[str, tuple[float, str]]:
    """RMS interaction torque by law [N m], and its fault, on one motion of a person."""
    if person.recorded is None:
        motion = generated_motion(3, rig["sampling"]["rate"], seconds)
    else:
        whole = motion_of(person, rig)
        motion = type(whole)(whole.name, whole.source, whole.rate, whole.position[: round(seconds * whole.rate)])
    card = card_of(rig, found.consistent)
    made = {}
    for name in names:
        law = Worn(CANDIDATES[name](card, person), found.gains)
        trial = run(rig, person, law, motion)
        made[name] = (trial.interaction_rms, law.running.fault)
    return made


def chosen(rig: ArmRig) -> tuple[str, dict[str, float]]:
    """The best law over FC on arms of another seed, and what each gave there."""
    arms = drawn_arms(rig, CHOSEN_ON, CHOSEN_SEED)
    people = drawn_people(CHOSEN_ON, PEOPLE_SEED)
    found = identified_many([(arm, 1) for arm in arms])
    jobs = [(worn, arm, f, p, (name,), SECONDS) for arm, f, p in zip(arms, found, people, strict=True)
            for name in CANDIDATES]  # fmt: skip
    each = iter(in_order(jobs))
    ratio: dict[str, list[float]] = {name: [] for name in CANDIDATES}
    for _ in arms:
        of_arm = {name: next(each)[name] for name in CANDIDATES}
        for name, (torque, fault) in of_arm.items():
            ratio[name].append(torque / of_arm["full"][0] if fault == "none" else np.inf)
    worst = {name: float(np.mean(values)) for name, values in ratio.items()}
    return min(worst, key=worst.get), worst


@dataclass(frozen=True)
class ArmsCompared:
    """Laws on arms that took no part in choosing: interaction torque RMS over four joints [N m], by law."""

    best: str  # The law chosen
    tried: dict[str, float]  # Mean torque over FC's where it was chosen, by law
    torque: dict[str, tuple[float, ...]]  # Of each arm
    faults: dict[str, int]  # Arms whose law stopped
    people: bool  # Whether people's motions, else generated reaching

    def over_full(self, law: str) -> np.ndarray:
        """Torque over that of full compensation, of each arm."""
        return np.array(self.torque[law]) / np.array(self.torque["full"])


def compare_arms(rig: ArmRig, arms: Sequence[ArmRig], found: Sequence[ArmIdentified]) -> ArmsCompared:
    """The chosen law beside the published one and two of the toolkit's own."""
    best, tried = chosen(rig)
    try:
        recorded = people()
    except DatasetError:
        recorded = ()
    wearers = drawn_people(len(arms), recorded=recorded)
    names = tuple(dict.fromkeys(("full", "carried", "transparent", best)))
    jobs = [
        (worn, arm, f, p, (name,), JUDGED_SECONDS)
        for arm, f, p in zip(arms, found, wearers, strict=True)
        for name in names
    ]
    each = iter(in_order(jobs))
    of_arms = [{name: next(each)[name] for name in names} for _ in arms]
    return ArmsCompared(
        best,
        tried,
        {name: tuple(one[name][0] for one in of_arms) for name in names},
        {name: sum(one[name][1] != "none" for one in of_arms) for name in names},
        bool(recorded),
    )
