"""A tree under its motors: couplings as a real robot's are published, frictions, stiction, and the free tree."""

import numpy as np
import pytest
from trees import INDEX, PRISMATIC, REVOLUTE, random_tree, tree_of

from pellucid import _core

JOINT = {name: i for i, name in enumerate(_core.TREE_JOINT_PARAMETER_NAMES)}
ELASTIC = {name: i for i, name in enumerate(_core.SERIES_ELASTIC_PARAMETER_NAMES)}
MOTOR = {name: i for i, name in enumerate(_core.TREE_MOTOR_PARAMETER_NAMES)}
GRAVITY = np.array([0.0, 0.0, -9.81])


def joints_of(m, **numbers):
    rows = np.zeros((m, len(JOINT)))
    for name, value in numbers.items():
        rows[:, JOINT[name]] = value
    return rows


def symmetric(coulomb, viscous):
    return {
        "coulomb_positive": coulomb,
        "coulomb_negative": coulomb,
        "viscous_positive": viscous,
        "viscous_negative": viscous,
    }


def test_a_wrist_whose_last_motor_turns_with_two_joints(rng):
    """The published equations of such a robot, term by term: joints 5 and 6 share a motor's inertia and friction."""
    rows = random_tree(rng, 6, kinds=(REVOLUTE,), serial=True)
    rows[:, INDEX["rotor_inertia"]] = 0.0
    ia, fv, fs = rng.uniform(0.1, 0.3, 6), rng.uniform(1, 5, 6), rng.uniform(1, 5, 6)
    offset, iam6, fvm6, fsm6 = rng.normal(size=6), 0.05, 0.6, 2.0
    q, v, a = rng.uniform(-2, 2, (3, 40, 6))
    c = v[:, 4] + v[:, 5]
    wanted = tree_of(rows, GRAVITY).inverse_dynamics(q, v, a) + ia * a + fv * v + fs * np.sign(v) + offset
    for here, other in ((4, 5), (5, 4)):
        wanted[:, here] += iam6 * a[:, other] + fvm6 * v[:, other] + fsm6 * np.sign(c)

    turns = np.eye(6)
    turns[5, 4] = 1.0
    motors = np.zeros((6, len(MOTOR)))
    motors[5, MOTOR["motor_inertia"]] = iam6
    for name, value in symmetric(fsm6, fvm6).items():
        motors[5, MOTOR[name]] = value
    shared = np.array([0, 0, 0, 0, 1, 1])
    rows[:, INDEX["rotor_inertia"]] = ia - iam6 * shared
    joints = joints_of(6, **symmetric(fs, fv - fvm6 * shared), offset=offset)
    driven = _core.DrivenTree(rows, GRAVITY, joints, period=1e-3, turns=turns, motors=motors)
    at_motors = driven.motor_effort(q, v, a)
    np.testing.assert_allclose(at_motors @ turns, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())
    np.testing.assert_array_equal(driven.motor_effort(q[3], v[3], a[3]), at_motors[3])


def test_load_friction_is_of_the_rigid_effort(rng):
    rows = random_tree(rng, 4, kinds=(REVOLUTE, PRISMATIC))
    q, v, a = rng.uniform(-2, 2, (3, 30, 4))
    load = tree_of(rows, GRAVITY).inverse_dynamics(q, v, a)
    driven = _core.DrivenTree(
        rows, GRAVITY, joints_of(4, load_motoring=0.2, load_generating=0.1, coulomb_positive=1.0), period=1e-3
    )
    share = np.where(load * v > 0, 0.2, 0.1)
    wanted = load + share * np.abs(load) * np.sign(v) + (v > 0)
    np.testing.assert_allclose(driven.motor_effort(q, v, a), wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_without_friction_it_is_the_tree(rng):
    rows = random_tree(rng, 3, kinds=(REVOLUTE,))
    tree = tree_of(rows, GRAVITY)
    driven = _core.DrivenTree(rows, GRAVITY, joints_of(3), period=1e-3, substeps=5)
    q, v = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)
    driven.reset(q, v)
    effort, outside = rng.normal(size=(2, 200, 3))
    positions, velocities = driven.run(effort, outside)
    for k in range(200):
        np.testing.assert_allclose(positions[k], q, rtol=0, atol=1e-10)
        np.testing.assert_allclose(velocities[k], v, rtol=0, atol=1e-10)
        for _ in range(5):
            v = v + 2e-4 * tree.forward_dynamics(q, v, effort[k] + outside[k])
            q = q + 2e-4 * v
    np.testing.assert_allclose(driven.position, q, rtol=0, atol=1e-10)


def test_one_after_another_has_the_bits_of_one_run(rng):
    rows = random_tree(rng, 4, kinds=(REVOLUTE,))
    joints = joints_of(4, **symmetric(0.5, 0.1), load_motoring=0.1, presliding_travel=[0.0, 0.01, 0.0, 0.0])
    effort = 5 * np.sin(np.outer(np.arange(400) * 0.02, [1, 2, 3, 4]))
    runs = []
    for pieces in (1, 400):
        driven = _core.DrivenTree(rows, GRAVITY, joints, period=1e-3)
        runs.append(np.concatenate([driven.run(part)[0] for part in np.split(effort, pieces)]))
    np.testing.assert_array_equal(*runs)


def test_joints_that_rest_feel_what_holds_them(rng):
    """While two of four rest, the others move as a tree in which those two are held."""
    rows = random_tree(rng, 4, kinds=(REVOLUTE,), serial=True)
    tree = tree_of(rows, GRAVITY)
    joints = joints_of(4, **symmetric(np.array([1e4, 0.2, 1e4, 0.3]), 0.05))
    driven = _core.DrivenTree(rows, GRAVITY, joints, period=1e-4, substeps=1)
    driven.reset(velocity=[0.0, 1.0, 0.0, -1.0])
    before = driven.velocity
    driven.run(np.zeros(4))
    net = -(np.array([0.0, 0.2, 0.0, -0.3]) + 0.05 * before)
    a = tree.forward_dynamics(np.zeros(4), before, net, held=[True, False, True, False])
    np.testing.assert_allclose(driven.velocity, before + 1e-4 * a, rtol=0, atol=1e-13)
    assert (driven.velocity[[0, 2]] == 0.0).all()


def test_a_motor_behind_a_spring(rng):
    """It starts balanced, its spring carries the weight, and it lags behind what it moves."""
    rows = random_tree(rng, 3, kinds=(REVOLUTE,))
    spring = np.zeros((3, len(ELASTIC)))
    spring[1, ELASTIC["motor_inertia"]], spring[1, ELASTIC["stiffness"]] = 0.1, 300.0
    driven = _core.DrivenTree(rows, GRAVITY, joints_of(3), period=1e-3, substeps=10, elastic=spring)
    q = rng.uniform(-1, 1, 3)
    weight = tree_of(rows, GRAVITY).gravity(q)
    driven.reset(q)
    np.testing.assert_allclose(driven.motor_position - q, [0.0, weight[1] / 300.0, 0.0], atol=1e-14)
    for _ in range(50):
        driven.run(weight)
    np.testing.assert_allclose(driven.position, q, atol=1e-9)
    driven.run(np.tile(weight + np.array([0.0, 5.0, 0.0]), (20, 1)))
    assert driven.motor_position[1] - driven.position[1] > weight[1] / 300.0 + 1e-3


def test_arguments_are_checked(rng):
    rows = random_tree(rng, 3, kinds=(REVOLUTE,))

    def made(joints=joints_of(3), **more):  # noqa: B008
        return _core.DrivenTree(rows, GRAVITY, joints, **({"period": 1e-3} | more))

    with pytest.raises(ValueError, match=r"joints: got shape \(2, 12\), expected \(3, 12\)"):
        made(joints_of(2))
    with pytest.raises(ValueError, match="period: expected a number above 0"):
        made(period=float("nan"))
    with pytest.raises(ValueError, match="substeps: expected a whole number from 1"):
        made(substeps=0)
    with pytest.raises(ValueError, match="turns: found a matrix without an inverse"):
        made(turns=np.ones((3, 3)))
    with pytest.raises(ValueError, match="motors: found motors without turns, expected both"):
        made(motors=np.zeros((3, len(MOTOR))))
    with pytest.raises(ValueError, match=r"elastic: got shape \(3, 2\), expected \(3, 13\)"):
        made(elastic=np.zeros((3, 2)))
    with pytest.raises(ValueError, match=r"effort: got shape \(4,\), expected"):
        made().run(np.zeros(4))
    with pytest.raises(ValueError, match=r"outside: got shape \(3,\), expected \(5, 3\), as effort"):
        made().run(np.zeros((5, 3)), np.zeros(3))
