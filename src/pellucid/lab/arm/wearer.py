"""Who wears the virtual arm: weight and lengths of an arm, its muscles and reflexes, and cuffs that do not quite fit.

A person is a tree of the robot's four joints about another centre, and muscles that follow a motion. The motion and the
torques for it are those of the arm alone, as it was learnt without a robot: so what passes through the cuffs is what
the robot costs.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...models import anthropometry as winter
from ...models.joint import GRAVITY
from ...models.kinematic_tree import Link, Tree, TreeJoint
from .bodies import AXES
from .human_motion import JOINTS, HumanMotion

TRUNK = "trunk"

MUSCLES = {
    # K, D of tense muscles, K_r, D_r of the late reflex, strength: N m/rad, N m s/rad, and N m. The elbow's are those
    # of elbow-participants.toml; the shoulder's are larger by what hands show that are pushed aside while they move: 10
    # to 30 N m/rad at the shoulder where the elbow has 5 to 15 (Gomi and Kawato, Science 272, 1996).
    "abduction": (14.0, 1.4, 5.0, 0.7, 60.0),
    "flexion": (14.0, 1.4, 5.0, 0.7, 60.0),
    "internal_rotation": (6.0, 0.6, 2.0, 0.3, 40.0),
    "elbow_flexion": (5.0, 0.5, 2.0, 0.3, 50.0),
}

REFLEX_DELAY = 0.055  # s: stretch reflex and muscle, as in elbow-participants.toml

UPPER_CUFF, HANDLE = "upper_arm", "handle"
CUFFS = {
    # Stiffness and damping along x, y, z of the robot's link, and against turning: a splint sits on 2 kN/m of padded
    # skin, a cuff round an upper arm on half of it, and both slide along the arm more easily; damping is half of
    # critical for what they hold (elbow-participants.toml).
    UPPER_CUFF: ((1000.0, 1000.0, 300.0), (25.0, 25.0, 10.0), 4.0, 0.10),
    HANDLE: ((2000.0, 2000.0, 1200.0), (25.0, 25.0, 20.0), 6.0, 0.06),
}
UPPER_CUFF_AT = 0.55  # of the upper arm, from the shoulder
HANDLE_AT = 0.90  # of the forearm, from the elbow: the wrist's side of a splint
DONNED = (0.25, 0.35, 0.15, 1.2)  # rad: posture in which the cuffs are closed

OFFSET, FITS = 0.012, (1.58, 1.76)  # m: sd of where the shoulder is found; heights that the robot is made for


@dataclass(frozen=True)
class Person:
    """One wearer."""

    name: str
    height: float = 1.67  # m
    mass: float = 64.0  # kg
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # Of the shoulder from the robot's centre [m]
    stiffness: float = 1.0  # Of muscles, times `MUSCLES`
    padding: float = 1.0  # Stiffness and damping of cuffs, times `CUFFS`
    recorded: str | None = None  # Whose recorded motion this person does
    tree: Tree = field(init=False, repr=False, compare=False)

    def __post_init__(self):
        object.__setattr__(self, "tree", _tree(self))

    @property
    def upper_arm(self) -> float:
        """From shoulder to elbow [m]."""
        return winter.SHOULDER_TO_ELBOW * self.height

    @property
    def forearm(self) -> float:
        """From elbow to wrist [m]."""
        return winter.ELBOW_TO_WRIST * self.height

    def learnt(self, motion: HumanMotion) -> np.ndarray:
        """Torques that move the arm alone so, shape (n, 4) [N m]."""
        of = (motion.position, motion.velocity, motion.acceleration)
        return self.tree.core.inverse_dynamics(*map(np.ascontiguousarray, of))


def _tree(person: Person) -> Tree:
    names = ("upper_arm", "forearm")
    lengths = (person.upper_arm, person.forearm)
    shares = (winter.UPPER_ARM_MASS, winter.FOREARM_MASS)
    centres = (winter.UPPER_ARM_CENTRE, winter.FOREARM_CENTRE)
    gyrations = (winter.UPPER_ARM_GYRATION, winter.FOREARM_GYRATION)
    links = [Link("shoulder_1"), Link("shoulder_2")]
    for name, length, share, centre, gyration, along in zip(
        names, lengths, shares, centres, gyrations, winter.ARM_GYRATION_ALONG, strict=True
    ):
        m = share * person.mass
        across, own = m * (gyration * length) ** 2, m * (along * length) ** 2
        links.append(Link.about_centre(name, m, (0.0, 0.0, -centre * length), (across, 0.0, 0.0, across, 0.0, own)))
    places = (person.offset, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -person.upper_arm))
    joints, parent = [], TRUNK
    for name, link, place in zip(JOINTS, links, places, strict=True):
        joints.append(TreeJoint(name, parent, link.name, "revolute", AXES[name], place))
        parent = link.name
    return Tree(tuple(joints), tuple(links), (0.0, 0.0, -GRAVITY), person.name)


def drawn_people(count: int = 5, seed: int = 20261123, recorded: tuple[str, ...] = ()) -> tuple[Person, ...]:
    """As many people as `count`, drawn with a `seed`; the motions of those who were `recorded` go round among them."""
    rng = np.random.default_rng(seed)
    made = []
    for i in range(count):
        height = float(rng.uniform(*FITS))
        made.append(
            Person(
                f"wearer-{i + 1}",
                height,
                float(height**2 * rng.uniform(19.5, 25.5)),
                tuple(float(x) for x in OFFSET * rng.standard_normal(3)),
                float(rng.uniform(0.7, 1.5)),
                float(rng.uniform(0.6, 1.6)),
                recorded[i % len(recorded)] if recorded else None,
            )
        )
    return tuple(made)


def worn_arguments(person: Person, robot: Tree, period: float) -> dict[str, Any]:
    """What the core's plant takes of a wearer: limb, muscles, and cuffs closed in the posture `DONNED` on a `robot`
    whose carriage is free."""
    numbers = {link: i + 1 for i, link in enumerate(joint.child for joint in robot.order)}
    closed = np.array(DONNED)
    slider = HANDLE_AT * person.forearm
    own = person.tree.core.placements(closed)
    other = robot.core.placements(np.append(closed, slider))
    points = {
        UPPER_CUFF: (3, (0.0, 0.0, -UPPER_CUFF_AT * person.upper_arm), numbers["internal_rotation"]),
        HANDLE: (4, (0.0, 0.0, -slider), numbers["carriage"]),
    }
    rows = []
    for name, (limb_link, point, robot_link) in points.items():
        stiffness, damping, turning, turning_loss = CUFFS[name]
        at = own[limb_link - 1][:, :3] @ point + own[limb_link - 1][:, 3]
        frame = other[robot_link - 1]
        seat = frame[:, :3].T @ (at - frame[:, 3])
        held = np.array([*stiffness, *damping, turning, turning_loss]) * person.padding
        rows.append([robot_link, limb_link, *seat, *point, *held])
    servos = [[*(person.stiffness * np.array(MUSCLES[name][:4])), MUSCLES[name][4]] for name in JOINTS]
    return {
        "limb_links": person.tree.links_array,
        "servos": np.array(servos),
        "reflex_delay": round(REFLEX_DELAY / period),
        "cuffs": np.array(rows),
    }
