"""Sets of parameters by directions beside one body: how many there are, which motion visits, what they predict."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.arm.fit.tree_regression import collect_rows
from pellucid.arm.tree_motion import TreeMotion
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.models.robot import Robot
from pellucid_lab.papers.able.directional_sets import compare_directional, draw_closed_paths, fit_directional
from pellucid_lab.papers.able.held_joints import hold_joints

NAMES = ("abduction", "flexion", "elbow")
SHARE = 0.12  # of the load, lost as friction


@pytest.fixture(scope="module")
def arm():
    joints = [
        TreeJoint("abduction", "trunk", "yoke", axis=(-1.0, 0.0, 0.0), rotor_inertia=0.05),
        TreeJoint("flexion", "yoke", "upper", axis=(0.0, -1.0, 0.0), rotor_inertia=0.05),
        TreeJoint("elbow", "upper", "lower", axis=(0.0, -0.8, 0.6), place=(0.0, 0.0, -0.3), turned=(0.1, 0.2, 0.3)),
    ]
    links = [
        Link.about_centre("yoke", 1.5, (-0.08, 0.0, 0.0), (0.01, 0.0, 0.0, 0.008, 0.0, 0.009)),
        Link.about_centre("upper", 2.0, (-0.01, -0.03, -0.15), (0.03, 0.0, 0.0, 0.03, 0.0, 0.004)),
        Link.about_centre("lower", 1.2, (0.01, -0.02, -0.14), (0.012, 0.0, 0.0, 0.012, 0.0, 0.002)),
    ]
    return Robot(Tree(joints, links))


def reaching(robot, seed, n=3000, noise=0.02):
    """Reaching of all joints, with friction that the load shares."""
    rng, m = np.random.default_rng(seed), len(robot.names)
    t = np.arange(n) * 0.02
    ways = 2 * np.pi * rng.uniform(0.05, 0.5, (m, 3))
    phase, size = rng.uniform(0, 2 * np.pi, (m, 3)), np.array([0.4, 0.3, 0.2])
    q, v, a = (
        np.sum(size * ways**k * np.sin(ways * t[:, None, None] + phase + k * np.pi / 2), axis=-1) for k in range(3)
    )
    y = robot.tree.core.inverse_dynamics(q, v, a)
    effort = y + (0.5 + SHARE * np.abs(y)) * np.sign(v) + 0.3 * v + noise * rng.normal(size=v.shape)
    return TreeMotion("reaching", "fit", t, q, v, a, effort, np.abs(v) > 0.05, np.arange(n) * 6 // n)


def test_held_joints_leave_the_others_as_they_were(arm):
    posture = {"flexion": 0.7}
    held = hold_joints(arm, posture)
    assert held.names == ("abduction", "elbow")
    rng = np.random.default_rng(2)
    q, v, a = rng.normal(size=(3, 20, 3))
    q[:, 1], v[:, 1], a[:, 1] = 0.7, 0.0, 0.0
    whole = arm.tree.core.inverse_dynamics(q, v, a)[:, [0, 2]]
    np.testing.assert_allclose(held.tree.core.inverse_dynamics(*(x[:, [0, 2]] for x in (q, v, a))), whole, atol=1e-12)
    with pytest.raises(IdentificationError, match="found no joint 'wrist' that moves, expected some of abduction"):
        hold_joints(arm, {"wrist": 0.0})
    with pytest.raises(IdentificationError, match="found every joint held"):
        hold_joints(arm, dict.fromkeys(NAMES, 0.0))


@pytest.mark.parametrize(("coupling", "others"), [("own", (0, 0, 0)), ("one side", (2, 1, 0)), ("all", (2, 2, 2))])
def test_sets_are_as_many_as_the_formulas_say(arm, coupling, others):
    sets = fit_directional(collect_rows(arm, [reaching(arm, 1)]), coupling)
    # Each joint's own two directions, times those of the joints that it is coupled to.
    assert [len(joints) - 1 for joints in sets.seen] == list(others)
    assert sets.possible == sum(2 * 2**k for k in others)
    assert sets.parameters == sum(2 * p * 2**k for p, k in zip(sets.per_direction, others, strict=True))
    if coupling == "one side":
        assert sets.possible == 2 * (2**3 - 1)


def test_sets_that_no_motion_visits_are_named(arm):
    motion = reaching(arm, 1)
    # Abduction moves back only while the elbow moves forwards.
    apart = (motion.velocity[:, 0] < 0.0) & (motion.velocity[:, 2] < 0.0)
    motion.moving[apart, 0] = False
    sets = fit_directional(collect_rows(arm, [motion]), "one side")
    assert sets.visited == sets.possible - 2
    assert sets.missing == (
        "abduction: abduction -, flexion -, elbow -",
        "abduction: abduction -, flexion +, elbow -",
    )


def test_one_body_with_load_friction_predicts_what_sets_do_not(arm):
    fitted, judged = [reaching(arm, 1)], [reaching(arm, 5)]
    load, plain, own, printed, every = compare_directional(arm, fitted, judged)
    assert load.parameters < own.parameters < printed.parameters < every.parameters
    assert load.mean < plain.mean
    assert load.mean < own.mean < every.mean
    assert load.creates == 0.0
    assert load.least == pytest.approx(1.0)
    assert plain.condition < every.condition <= every.worst_condition


def test_a_single_joint_is_the_case_where_both_agree(arm):
    elbow = hold_joints(arm, {"abduction": 0.2, "flexion": 0.4})
    load, plain, own = compare_directional(elbow, [reaching(elbow, 1)], [reaching(elbow, 5)])
    assert own.sets == 2
    assert own.mean == pytest.approx(load.mean, rel=0.2)
    assert plain.mean > 1.3 * load.mean


def test_closed_paths_close_and_stay_where_the_rows_are(arm):
    rows = collect_rows(arm, [reaching(arm, 1)])
    for path in draw_closed_paths(rows, 5):
        np.testing.assert_allclose(path.velocity.sum(axis=0), 0.0, atol=1e-9)
        assert np.all(path.position >= rows.position.min(axis=0))
        assert np.all(path.position <= rows.position.max(axis=0))
