"""A robot some of whose joints are held at angles, as one with fewer joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pellucid._errors import IdentificationError
from pellucid.models.kinematic_tree import Tree, TreeJoint
from pellucid.models.robot import Robot


def hold_joints(robot: Robot, posture: Mapping[str, float]) -> Robot:
    """The robot with the joints of `posture` welded there [rad; m]; motors that turned with them turn with the rest."""
    unknown = sorted(set(posture) - set(robot.names))
    if unknown:
        raise IdentificationError(
            f"{robot.tree.source}: found no joint {unknown[0]!r} that moves, expected some of {', '.join(robot.names)}"
        )
    kept = [i for i, name in enumerate(robot.names) if name not in posture]
    if not kept:
        raise IdentificationError(f"{robot.tree.source}: found every joint held, expected one that moves")
    at = np.array([posture.get(name, 0.0) for name in robot.names])
    places = robot.tree.core.placements(at)
    number = {joint.child: i for i, joint in enumerate(robot.tree.order)}
    base = np.hstack([np.eye(3), np.zeros((3, 1))])

    def welded(joint: TreeJoint) -> TreeJoint:
        if joint.name not in posture:
            return joint
        parent = places[number[joint.parent]] if joint.parent in number else base
        child = places[number[joint.child]]
        turn = parent[:, :3].T @ child[:, :3]
        place = parent[:, :3].T @ (child[:, 3] - parent[:, 3])
        x, y, z = map(float, place)
        return replace(joint, kind="fixed", axis=None, place=(x, y, z), turned=_angles(turn), rotor_inertia=0.0)

    tree = Tree(tuple(map(welded, robot.tree.joints)), robot.tree.links, robot.tree.gravity, robot.tree.source)
    turns = robot.turns_array[np.ix_(kept, kept)]
    return Robot(tree, tuple(map(tuple, turns)))


def _angles(turn: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation, (3, 3)."""
    pitch = float(np.arctan2(-turn[2, 0], np.hypot(turn[0, 0], turn[1, 0])))
    if np.hypot(turn[0, 0], turn[1, 0]) < 1e-9:  # Roll and yaw are one
        return float(np.arctan2(-turn[1, 2], turn[1, 1])), pitch, 0.0
    return float(np.arctan2(turn[2, 1], turn[2, 2])), pitch, float(np.arctan2(turn[1, 0], turn[0, 0]))
