"""Trees without welds: what a fixed joint carries is one body with what it hangs on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .kinematic_tree import Link, TreeJoint, Vector, order_outwards, rotation

Pose = tuple[np.ndarray, np.ndarray]
"""Rotation (3, 3) and place (3,) [m] of a frame in another."""

IDENTITY_POSE: Pose = (np.eye(3), np.zeros(3))


def weld_fixed_joints(
    joints: Sequence[TreeJoint], links: Sequence[Link], where: str
) -> tuple[tuple[TreeJoint, ...], tuple[Link, ...], Mapping[str, tuple[str, Pose]]]:
    """Joints that move and the links behind them, each with what is welded to it; and of every link by its name the one
    that carries it, and where on that it is."""
    on: dict[str, tuple[str, Pose]] = {}
    kept, bodies = [], {link.name: link for link in links}
    for joint in order_outwards(joints, links, where):
        carrier, pose = on.setdefault(joint.parent, (joint.parent, IDENTITY_POSE))
        if joint.kind == "fixed":
            on[joint.child] = carrier, compose_poses(pose, joint_pose(joint))
            if carrier in bodies and joint.child in bodies:
                bodies[carrier] = join_links(bodies[carrier], bodies.pop(joint.child), on[joint.child][1])
            continue
        on[joint.child] = joint.child, IDENTITY_POSE
        if carrier != joint.parent:
            turn, place = compose_poses(pose, joint_pose(joint))
            joint = replace(joint, parent=carrier, place=_vector(place), turned=roll_pitch_yaw(turn))
        kept.append(joint)
    moving = [joint.child for joint in kept]
    return tuple(kept), tuple(bodies[name] for name in moving), on


def hold_joint(joint: TreeJoint, coordinate: float) -> TreeJoint:
    """A joint that moves, fixed at its coordinate [rad; m]."""
    turn, place = joint_pose(joint)
    axis = np.asarray(joint.axis, float)
    if joint.kind == "prismatic":
        place = place + turn @ axis * coordinate
    else:
        turn = turn @ _rotation_about(axis, coordinate)
    return replace(joint, kind="fixed", axis=None, place=_vector(place), turned=roll_pitch_yaw(turn), rotor_inertia=0.0)


def joint_pose(joint: TreeJoint) -> Pose:
    """Return the pose of a joint's frame in its parent's."""
    return rotation(joint.turned), np.asarray(joint.place, float)


def compose_poses(outer: Pose, inner: Pose) -> Pose:
    """A pose in a frame that has one itself."""
    return outer[0] @ inner[0], outer[1] + outer[0] @ inner[1]


def join_links(body: Link, other: Link, pose: Pose) -> Link:
    """A link with another welded to it at a pose."""
    turn, place = pose
    moment = turn @ np.asarray(other.moment)
    xx, xy, xz, yy, yz, zz = other.inertia
    about = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    about += (other.mass * place @ place + 2.0 * place @ moment) * np.eye(3)
    about -= other.mass * np.outer(place, place) + np.outer(place, moment) + np.outer(moment, place)
    return Link(
        body.name,
        body.mass + other.mass,
        _vector(np.asarray(body.moment) + moment + other.mass * place),
        tuple((np.asarray(body.inertia) + about[np.triu_indices(3)]).tolist()),
    )


def roll_pitch_yaw(turn: np.ndarray) -> Vector:
    """Roll, pitch and yaw [rad] of a rotation (3, 3); exact where pitch is a right angle too."""
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    s, c = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-turn[2, 0], c * turn[0, 0] + s * turn[1, 0])
    roll = np.arctan2(s * turn[0, 2] - c * turn[1, 2], c * turn[1, 1] - s * turn[0, 1])
    return float(roll), float(pitch), float(yaw)


def _rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def _vector(values: np.ndarray) -> Vector:
    x, y, z = values
    return float(x), float(y), float(z)
