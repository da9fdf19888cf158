"""Bodies and joints of the virtual arm: as it was built, and as its drawing has them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pellucid import _core
from pellucid.models.joint import GRAVITY
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint

from .constants import ArmConstants, LinkTable, MakerTable
from .human_motion import JOINTS

AXES: Mapping[str, tuple[float, float, float]] = {
    "abduction": (-1.0, 0.0, 0.0),
    "flexion": (0.0, -1.0, 0.0),
    "internal_rotation": (0.0, 0.0, 1.0),
    "elbow_flexion": (0.0, -1.0, 0.0),
}
"""Axes of a right arm's joints in their own frames: x forwards, y to the left, z up while the arm hangs."""

CARRIAGE_BODY = "carriage"
"""Name of the body that slides along the forearm."""

SLIDER_JOINT = "slider"
"""Name of the joint between forearm and carriage."""

BASE_BODY = "trunk"
"""Name of the body that does not move."""

DOWN_THE_ARM = (0.0, 0.0, -1.0)
"""Direction along the hanging arm, away from the shoulder [1]."""

JOINT_NUMBERS: tuple[str, ...] = tuple(_core.TREE_JOINT_PARAMETER_NAMES)
ELASTIC_NUMBERS: tuple[str, ...] = tuple(_core.SERIES_ELASTIC_PARAMETER_NAMES)


def _link(said: LinkTable, name: str) -> Link:
    (xx, yy, zz), (xy, xz, yz) = said.inertia, said.product
    return Link.about_centre(name, said.mass, tuple(said.centre), (xx, xy, xz, yy, yz, zz))


def _drawn_link(said: LinkTable, name: str, maker: MakerTable) -> Link:
    """What the maker states of a body; its centre is off by the same in each direction."""
    mass, inertia = maker.mass * said.mass, [maker.inertia * x for x in said.inertia]
    centre = tuple(x + maker.centre for x in said.centre)
    return Link.about_centre(name, mass, centre, (inertia[0], 0.0, 0.0, inertia[1], 0.0, inertia[2]))


def built_tree(constants: ArmConstants, *, slider: float | None = None, rotors: bool = True) -> Tree:
    """The robot as it stands there: axes off, base not level. The carriage clamped at `slider` [m], or None: free, a
    fifth coordinate. Without `rotors` they are behind springs, and no part of the bodies."""
    assembly, names = constants.assembly, list(JOINTS)
    joints, parent = [], BASE_BODY
    for name in names:
        off = np.array(assembly.get(f"place_{name}", (0.0, 0.0, 0.0)), float)
        if name == "elbow_flexion":
            off = off + constants.body.upper_arm * np.array(DOWN_THE_ARM)
        axis = np.array(AXES[name]) + np.cross(assembly[f"axis_{name}"], AXES[name])
        said = constants.joint[name]
        rotor = said.motor_inertia if rotors else 0.0
        axis /= np.linalg.norm(axis)
        joints.append(
            TreeJoint(name, parent, name, "revolute", tuple(axis.tolist()), tuple(off.tolist()), rotor_inertia=rotor)
        )
        parent = name
    if slider is None:
        joints.append(TreeJoint(SLIDER_JOINT, parent, CARRIAGE_BODY, "prismatic", DOWN_THE_ARM))
    else:
        joints.append(TreeJoint(SLIDER_JOINT, parent, CARRIAGE_BODY, "fixed", None, (0.0, 0.0, -float(slider))))
    links = tuple(_link(constants.link[name], name) for name in (*names, CARRIAGE_BODY))
    return Tree(tuple(joints), links, built_gravity(constants), "virtual arm")


def built_gravity(constants: ArmConstants) -> tuple[float, float, float]:
    """In the base's frame, which is not quite level [m/s^2]."""
    roll, pitch = constants.assembly.tilt
    down = np.array([np.sin(pitch), -np.sin(roll) * np.cos(pitch), -np.cos(roll) * np.cos(pitch)])
    return tuple((GRAVITY * down).tolist())


def drawing(constants: ArmConstants) -> Tree:
    """What identification is given: axes as they were meant, the forearm and its clamped carriage one body."""
    joints, links, parent = [], [], BASE_BODY
    for name in JOINTS:
        place = (0.0, 0.0, -constants.body.upper_arm) if name == "elbow_flexion" else (0.0, 0.0, 0.0)
        said = constants.joint[name]
        rotor = said.motor_inertia
        joints.append(TreeJoint(name, parent, name, "revolute", AXES[name], place, rotor_inertia=rotor))
        links.append(_drawn_link(constants.link[name], name, constants.maker))
        parent = name
    carriage = _drawn_link(constants.link[CARRIAGE_BODY], CARRIAGE_BODY, constants.maker)
    links[-1] = joined(links[-1], carriage, (0.0, 0.0, -constants.slider.clamped))
    return Tree(tuple(joints), tuple(links), (0.0, 0.0, -GRAVITY), "drawing of the virtual arm")


def joined(link: Link, other: Link, place: tuple[float, float, float]) -> Link:
    """A link with another welded on at a `place` [m], axes alike: one body."""
    p, h = np.array(place), np.array(other.moment)
    xx, xy, xz, yy, yz, zz = other.inertia
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moved = own + (2.0 * p @ h + other.mass * p @ p) * np.eye(3)
    moved -= np.outer(h, p) + np.outer(p, h) + other.mass * np.outer(p, p)
    inertia = tuple((np.array(link.inertia) + moved[np.triu_indices(3)]).tolist())
    moment = tuple((np.array(link.moment) + h + other.mass * p).tolist())
    return Link(link.name, link.mass + other.mass, moment, inertia)


def friction_rows(constants: ArmConstants, *, free: bool) -> np.ndarray:
    """Return the friction of the joints behind their transmissions, in the order of `JOINT_NUMBERS`.

    A free slider's row is last.
    """
    rows = np.zeros((len(JOINTS) + free, len(JOINT_NUMBERS)))

    def put(row: int, **numbers: float) -> None:
        for key, value in numbers.items():
            rows[row, JOINT_NUMBERS.index(key)] = value

    for i, name in enumerate(JOINTS):
        said = constants.joint[name]
        coulomb, viscous = said.bearing_coulomb, said.bearing_viscous
        put(i, coulomb_positive=coulomb, coulomb_negative=coulomb, viscous_positive=viscous, viscous_negative=viscous)
        put(i, presliding_travel=said.presliding_travel)
    if free:
        rail = constants.slider
        put(-1, coulomb_positive=rail.coulomb, coulomb_negative=rail.coulomb)
        put(-1, viscous_positive=rail.viscous, viscous_negative=rail.viscous)
    return rows


def transmission_rows(constants: ArmConstants, *, free: bool) -> np.ndarray:
    """Return the parameters of each motor behind its cable, in the order of `ELASTIC_NUMBERS`.

    The row of a free slider is 0.
    """
    rows = np.zeros((len(JOINTS) + free, len(ELASTIC_NUMBERS)))
    for i, name in enumerate(JOINTS):
        said = constants.joint[name]
        values = {**said.model_dump(), "motor_inertia": said.motor_inertia}
        rows[i] = [values[key] for key in ELASTIC_NUMBERS]
    return rows


def drive_rows(constants: ArmConstants, *, free: bool) -> np.ndarray:
    """Effort at the joint per ampere, then amplitude, wave number and phase of its ripple, of each motor."""
    rows = np.zeros((len(JOINTS) + free, 4))
    rows[:, 0] = 1.0
    for i, name in enumerate(JOINTS):
        said = constants.joint[name]
        rows[i] = said.gain, said.ripple_amplitude, said.ripple_wave_number, float(i)
    return rows
