"""Wearers of the virtual arm: masses and lengths of their arms, muscles and reflexes, and cuffs that fit imperfectly.

A person is a tree with the robot's four joints about another centre, and muscles that follow a motion. The feedforward
torques are those of the arm alone, as it was learnt without a robot. What passes through the cuffs is therefore due to
the robot.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pellucid.models import anthropometry as winter
from pellucid.models.joint import GRAVITY
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint

from .bodies import AXES
from .human_motion import JOINTS, HumanMotion

TRUNK_LINK = "trunk"
"""Name of the link that does not move."""


@dataclass(frozen=True)
class MuscleConstants:
    """The muscles of one joint, as a servo about the intended motion."""

    stiffness: float  # stiffness of tense muscles [N m/rad]
    damping: float  # damping of tense muscles [N m s/rad]
    reflex_stiffness: float  # stiffness of the late stretch reflex [N m/rad]
    reflex_damping: float  # damping of the late stretch reflex [N m s/rad]
    max_torque: float  # strength [N m]


MUSCLES = {
    "abduction": MuscleConstants(14.0, 1.4, 5.0, 0.7, 60.0),
    "flexion": MuscleConstants(14.0, 1.4, 5.0, 0.7, 60.0),
    "internal_rotation": MuscleConstants(6.0, 0.6, 2.0, 0.3, 40.0),
    "elbow_flexion": MuscleConstants(5.0, 0.5, 2.0, 0.3, 50.0),
}
"""Muscles by joint.

The elbow's are those of elbow-participants.toml. The shoulder's are stiffer, as hands show that are pushed aside while
they move: 10 to 30 N m/rad at the shoulder where the elbow has 5 to 15 [1]_.

.. [1] H. Gomi, M. Kawato, "Equilibrium-point control hypothesis examined by measured arm stiffness during multijoint
   movement", Science 272, 1996."""

REFLEX_DELAY_S = 0.055
"""Delay of stretch reflex and muscle together, as in elbow-participants.toml [s]."""


@dataclass(frozen=True)
class CuffConstants:
    """The coupling of limb and robot by one cuff."""

    stiffness: tuple[float, float, float]  # along x, y and z of the robot's link [N/m]
    damping: tuple[float, float, float]  # along x, y and z of the robot's link [N s/m]
    turning_stiffness: float  # [N m/rad]
    turning_damping: float  # [N m s/rad]


UPPER_CUFF = "upper_arm"
"""Name of the cuff round the upper arm."""

HANDLE_CUFF = "handle"
"""Name of the splint on the forearm."""

CUFF_CONSTANTS = {
    UPPER_CUFF: CuffConstants((1000.0, 1000.0, 300.0), (25.0, 25.0, 10.0), 4.0, 0.10),
    HANDLE_CUFF: CuffConstants((2000.0, 2000.0, 1200.0), (25.0, 25.0, 20.0), 6.0, 0.06),
}
"""Cuffs by name.

A splint rests on 2 kN/m of padded skin, a cuff round an upper arm on half of it; both slide along the arm more easily.
The damping is half of critical for the mass that the cuff holds, as in elbow-participants.toml."""

UPPER_CUFF_AT = 0.55
"""Place of the cuff on the upper arm, as a share of its length from the shoulder."""

HANDLE_AT = 0.90
"""Place of the splint's handle on the forearm, as a share of its length from the elbow: near the wrist."""

DONNING_POSTURE_RAD = (0.25, 0.35, 0.15, 1.2)
"""Posture in which the cuffs are closed [rad]. Chosen by judgement; no measurement is recorded."""

SHOULDER_OFFSET_SD_M = 0.012
"""Standard deviation of the shoulder's place from the robot's centre, in each direction [m]."""

HEIGHT_RANGE_M = (1.58, 1.76)
"""Smallest and largest height of people who fit the robot [m]."""

BODY_MASS_INDEX_RANGE = (19.5, 25.5)
"""Smallest and largest body mass index of simulated people [kg/m^2].

Chosen by judgement; no measurement is recorded."""

STIFFNESS_FACTOR_RANGE = (0.7, 1.5)
"""Smallest and largest factor of simulated people on `MUSCLES` [1]. Chosen by judgement; no measurement is recorded."""

PADDING_FACTOR_RANGE = (0.6, 1.6)
"""Smallest and largest factor of simulated people on `CUFF_CONSTANTS` [1].

Chosen by judgement; no measurement is recorded."""


@dataclass(frozen=True)
class Person:
    """One wearer."""

    name: str
    height: float = 1.67  # [m]
    mass: float = 64.0  # [kg]
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # place of the shoulder from the robot's centre [m]
    stiffness: float = 1.0  # factor on stiffness and damping of `MUSCLES` [1]
    padding: float = 1.0  # factor on stiffness and damping of `CUFF_CONSTANTS` [1]
    recorded: str | None = None  # name of the recorded person whose motions this one makes
    tree: Tree = field(init=False, repr=False, compare=False)

    def __post_init__(self):
        object.__setattr__(self, "tree", _tree(self))

    @property
    def upper_arm(self) -> float:
        """Return the distance from shoulder to elbow [m]."""
        return winter.BODY_SHARES.shoulder_to_elbow * self.height

    @property
    def forearm(self) -> float:
        """Return the distance from elbow to wrist [m]."""
        return winter.BODY_SHARES.elbow_to_wrist * self.height

    def learnt(self, motion: HumanMotion) -> np.ndarray:
        """Return the torques that make a motion with the arm alone, shape (n, 4) [N m]."""
        states = (motion.position, motion.velocity, motion.acceleration)
        return self.tree.core.inverse_dynamics(*map(np.ascontiguousarray, states))


def _tree(person: Person) -> Tree:
    """Return the rigid bodies of a person's arm, with the robot's four joints."""
    names = ("upper_arm", "forearm")
    lengths = (person.upper_arm, person.forearm)
    shares = (winter.BODY_SHARES.upper_arm_mass, winter.BODY_SHARES.forearm_mass)
    centres = (winter.BODY_SHARES.upper_arm_centre, winter.BODY_SHARES.forearm_centre)
    gyrations = (winter.BODY_SHARES.upper_arm_gyration, winter.BODY_SHARES.forearm_gyration)
    links = [Link("shoulder_1"), Link("shoulder_2")]
    for name, length, share, centre, gyration, along in zip(
        names, lengths, shares, centres, gyrations, winter.BODY_SHARES.arm_gyration_along, strict=True
    ):
        m = share * person.mass
        across, axial = m * (gyration * length) ** 2, m * (along * length) ** 2
        links.append(Link.about_centre(name, m, (0.0, 0.0, -centre * length), (across, 0.0, 0.0, across, 0.0, axial)))
    places = (person.offset, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -person.upper_arm))
    joints, parent = [], TRUNK_LINK
    for name, link, place in zip(JOINTS, links, places, strict=True):
        joints.append(TreeJoint(name, parent, link.name, "revolute", AXES[name], place))
        parent = link.name
    return Tree(tuple(joints), tuple(links), (0.0, 0.0, -GRAVITY), person.name)


def drawn_people(count: int = 5, seed: int = 20261123, recorded: tuple[str, ...] = ()) -> tuple[Person, ...]:
    """Draw `count` people; the motions of the `recorded` people are assigned to them in turn."""
    rng = np.random.default_rng(seed)
    people = []
    for i in range(count):
        height = float(rng.uniform(*HEIGHT_RANGE_M))
        people.append(
            Person(
                f"wearer-{i + 1}",
                height,
                float(height**2 * rng.uniform(*BODY_MASS_INDEX_RANGE)),
                tuple(float(x) for x in SHOULDER_OFFSET_SD_M * rng.standard_normal(3)),
                float(rng.uniform(*STIFFNESS_FACTOR_RANGE)),
                float(rng.uniform(*PADDING_FACTOR_RANGE)),
                recorded[i % len(recorded)] if recorded else None,
            )
        )
    return tuple(people)


def worn_arguments(person: Person, robot: Tree, period: float) -> dict[str, Any]:
    """Return the arguments of the core's plant that describe a wearer: limb, muscles, and cuffs.

    The cuffs are closed in the posture `DONNING_POSTURE_RAD` on a `robot` whose carriage moves freely.
    """
    numbers = {link: i + 1 for i, link in enumerate(joint.child for joint in robot.order)}
    closed = np.array(DONNING_POSTURE_RAD)
    slider = HANDLE_AT * person.forearm
    limb_frames = person.tree.core.placements(closed)
    robot_frames = robot.core.placements(np.append(closed, slider))
    points = {
        UPPER_CUFF: (3, (0.0, 0.0, -UPPER_CUFF_AT * person.upper_arm), numbers["internal_rotation"]),
        HANDLE_CUFF: (4, (0.0, 0.0, -slider), numbers["carriage"]),
    }
    rows = []
    for name, (limb_link, point, robot_link) in points.items():
        cuff, limb_frame, frame = CUFF_CONSTANTS[name], limb_frames[limb_link - 1], robot_frames[robot_link - 1]
        place = limb_frame[:, :3] @ point + limb_frame[:, 3]
        place_on_robot = frame[:, :3].T @ (place - frame[:, 3])
        constants = [*cuff.stiffness, *cuff.damping, cuff.turning_stiffness, cuff.turning_damping]
        rows.append([robot_link, limb_link, *place_on_robot, *point, *(np.array(constants) * person.padding)])
    servos = []
    for name in JOINTS:
        muscle = MUSCLES[name]
        impedance = [muscle.stiffness, muscle.damping, muscle.reflex_stiffness, muscle.reflex_damping]
        servos.append([*(person.stiffness * np.array(impedance)), muscle.max_torque])
    return {
        "limb_links": person.tree.links_array,
        "servos": np.array(servos),
        "reflex_delay": round(REFLEX_DELAY_S / period),
        "cuffs": np.array(rows),
    }
