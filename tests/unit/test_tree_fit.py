"""A virtual robot of several joints, identified: numbers found again, the core's predictions, refusals."""

from types import SimpleNamespace

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import IdentificationError
from pellucid.fit.tree.base_parameters import base_parameters
from pellucid.fit.tree.fit_tree import fit_tree
from pellucid.fit.tree.friction_terms import plain_families
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.models.robot import Robot
from pellucid.signals.tree_motion import TreeMotion

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SHARED = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 1.0, 1.0))


def four_joints(turns=()):
    """An arm whose last motor may turn with two joints."""
    joints = [
        TreeJoint("yaw", "base", "post", axis=Z, rotor_inertia=0.05),
        TreeJoint("shoulder", "post", "upper", axis=Y, place=(0.0, 0.1, 0.3), rotor_inertia=0.05),
        TreeJoint("elbow", "upper", "fore", axis=Y, place=(0.0, 0.0, 0.4), rotor_inertia=0.03),
        TreeJoint("wrist", "fore", "hand", axis=X, place=(0.02, 0.0, 0.3), rotor_inertia=0.01),
    ]
    links = [
        Link.about_centre("post", 3.0, (0.0, 0.02, 0.1), (0.02, 0.0, 0.0, 0.02, 0.0, 0.01)),
        Link.about_centre("upper", 2.5, (0.01, 0.03, 0.2), (0.03, 0.001, 0.0, 0.03, 0.0, 0.004)),
        Link.about_centre("fore", 1.5, (0.02, 0.0, 0.15), (0.01, 0.0, 0.001, 0.01, 0.0, 0.002)),
        Link.about_centre("hand", 0.6, (0.02, 0.03, 0.06), (0.002, 0.0, 0.0, 0.001, 0.0005, 0.001)),
    ]
    return Robot(Tree(joints, links), turns)


def motion_of(robot, numbers, *, seed=0, n=1500, noise=0.0, motors=None, alpha=0.0, parts=10):
    """Sines of all joints at 200 Hz and the effort that the core says they take; noise of `noise` of each joint's RMS,
    a fifth of a second long."""
    rng = np.random.default_rng(seed)
    m, t = len(robot.names), np.arange(n) / 200.0
    w = 2 * np.pi * np.linspace(0.1, 0.7, 6)
    a, b = rng.normal(size=(2, m, 6)) / w
    phase = t[:, None] * w
    q = np.sin(phase) @ a.T + np.cos(phase) @ b.T
    v = (np.cos(phase) * w) @ a.T - (np.sin(phase) * w) @ b.T
    acceleration = -(np.sin(phase) * w**2) @ a.T - (np.cos(phase) * w**2) @ b.T
    rows = np.zeros((m, len(_core.TREE_JOINT_PARAMETER_NAMES)))
    for name, value in numbers.items():
        rows[:, _core.TREE_JOINT_PARAMETER_NAMES.index(name)] = value
    turns = np.asarray(robot.turns)
    plant = _core.DrivenTree(
        robot.tree.links_array, robot.tree.gravity, rows, period=0.005, turns=turns,
        motors=np.zeros((m, len(_core.TREE_MOTOR_PARAMETER_NAMES))) if motors is None else motors,
    )  # fmt: skip
    effort = plant.motor_effort(q, v, acceleration) @ turns
    colour = rng.normal(size=(n + 40, m))
    colour = np.stack([np.convolve(c, np.ones(41) / np.sqrt(41), "valid") for c in colour.T], axis=1)
    effort = effort + noise * np.sqrt(np.mean(effort**2, axis=0)) * colour
    moving = (np.abs(v) > 0.05) & (np.abs(v @ turns.T) > 0.05)
    return TreeMotion(
        recording=f"sines {seed}", use="fit", time=t, position=q, velocity=v, acceleration=acceleration, effort=effort,
        moving=moving, segment=np.arange(n) * parts // n,
    )  # fmt: skip


FRICTION = {"coulomb_positive": 2.0, "coulomb_negative": 2.0, "viscous_positive": 1.5, "viscous_negative": 1.5,
            "offset": 0.3}  # fmt: skip


@pytest.fixture(scope="module")
def coupled():
    """A robot with a shared motor, its recording without noise, and the estimate with load friction everywhere."""
    robot = four_joints(SHARED)
    motors = np.zeros((4, len(_core.TREE_MOTOR_PARAMETER_NAMES)))
    for name, value in {"motor_inertia": 0.02, "coulomb_positive": 0.5, "coulomb_negative": 0.5,
                        "viscous_positive": 0.2, "viscous_negative": 0.2}.items():  # fmt: skip
        motors[3, _core.TREE_MOTOR_PARAMETER_NAMES.index(name)] = value
    motion = motion_of(robot, FRICTION | {"load_motoring": 0.1, "load_generating": 0.1}, motors=motors)
    families = [(*family, "load") for family in plain_families(4, robot.shared)]
    return SimpleNamespace(robot=robot, motion=motion, fit=fit_tree(robot, [motion], families))


def test_what_a_base_parameter_stands_for():
    base = base_parameters(four_joints())
    y = four_joints().tree.core
    q, v, a = np.random.default_rng(1).normal(size=(3, 50, 4))
    numbers = four_joints().tree.parameters
    everything = np.concatenate([numbers, [0.05, 0.05, 0.03, 0.01]])
    own = y.regressor(q, v, a, own=a[:, :, None])
    np.testing.assert_allclose(
        own[:, :, base.chosen] @ (base.combination @ everything), own @ everything, rtol=0, atol=1e-10
    )
    assert base.reading("upper.moment_z.regrouped") == "upper.moment_z + 0.4 fore.mass + 0.4 hand.mass"
    assert "yaw.rotor_inertia" not in base.names  # the post's inertia stands for it
    assert base.rotors == sum(name.endswith("rotor_inertia") for name in base.names)


def test_numbers_are_found_again(coupled):
    fit = coupled.fit
    for name in coupled.robot.names:
        assert fit[f"{name}.coulomb"].value == pytest.approx(2.0, rel=1e-4)
        assert fit[f"{name}.viscous"].value == pytest.approx(1.5, rel=1e-4)
        assert fit[f"{name}.load"].value == pytest.approx(0.1, rel=1e-3)
    assert fit["wrist.motor_inertia"].value == pytest.approx(0.02, rel=1e-3)
    assert fit["wrist.motor_coulomb"].value == pytest.approx(0.5, rel=1e-3)
    truth = base_parameters(coupled.robot)
    motors = [0.02]
    everything = np.concatenate([coupled.robot.tree.parameters, [0.05, 0.05, 0.03, 0.01], motors])
    found = [fit[name].value for name in truth.names]
    np.testing.assert_allclose(found, truth.combination @ everything, rtol=1e-3, atol=1e-5)


def test_the_core_predicts_what_the_estimate_predicts(coupled):
    fit, motion = coupled.fit, coupled.motion
    plant = _core.DrivenTree(
        fit.links(), fit.robot.tree.gravity, fit.joints(), period=0.005, turns=np.asarray(fit.robot.turns),
        motors=fit.motors(),
    )  # fmt: skip
    by_core = plant.motor_effort(motion.position, motion.velocity, motion.acceleration) @ np.asarray(fit.robot.turns)
    np.testing.assert_allclose(fit.effort(motion), by_core, rtol=0, atol=1e-9)
    np.testing.assert_allclose(fit.effort(motion), motion.effort, rtol=0, atol=0.02)


def test_a_family_that_does_not_fit_is_refused():
    robot = four_joints()
    motion = motion_of(robot, FRICTION, n=400)
    with pytest.raises(IdentificationError, match="found friction term 'sticky', expected some of viscous"):
        fit_tree(robot, [motion], [("sticky",)] * 4)
    with pytest.raises(IdentificationError, match="its motor turns with it alone"):
        fit_tree(robot, [motion], [("viscous", "motor_coulomb")] * 4)
    with pytest.raises(IdentificationError, match="found 1 friction families, expected one for each of 4 joints"):
        fit_tree(robot, [motion], [("viscous",)])
