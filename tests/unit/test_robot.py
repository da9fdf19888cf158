"""Robots: trees, and motors that turn with their joints."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.models.robot import Robot

X = (1.0, 0.0, 0.0)
TREE = Tree(
    [TreeJoint("shoulder", "base", "upper", axis=X), TreeJoint("slide", "upper", "lower", "prismatic", axis=X)],
    [Link("upper", 2.0, (0.0, 0.0, -0.3)), Link("lower", 1.0, (0.0, 0.0, -0.1))],
)


def test_motors_turn_with_their_own_joint_unless_said_otherwise():
    robot = Robot(TREE)
    assert robot.names == ("shoulder", "slide")
    assert robot.units == (("rad", "N*m"), ("m", "N"))
    assert robot.shared == ()
    np.testing.assert_array_equal(robot.turns_array, np.eye(2))
    assert Robot(TREE, ((1.0, 0.0), (0.5, 1.0))).shared == (1,)


def test_turns_that_cannot_be_are_named():
    def refused(message, turns):
        with pytest.raises(IdentificationError, match=message):
            Robot(TREE, turns)

    refused(r"found shape \(1, 2\), expected 2 rows", ((1.0, 0.0),))
    refused("found 32 of the motor of shoulder by its own joint, expected 1: gears", ((32.0, 0.0), (0.0, 1.0)))
    refused("linearly dependent rows", ((1.0, 1.0), (1.0, 1.0)))
    refused("expected 2 rows of 2 finite", ((1.0, float("nan")), (0.0, 1.0)))
