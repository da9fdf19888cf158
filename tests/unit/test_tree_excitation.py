"""Motions of several joints: never beyond a limit, at rest at both ends, and better than a random one."""

import numpy as np
import pytest

import pellucid
from pellucid._errors import PellucidError
from pellucid.arm.protocols.tree_fourier import (
    BASE_LINK,
    Capsule,
    Capsules,
    capsules_along_links,
    information_cost,
    optimised_tree_fourier,
    random_tree_fourier,
    segment_distance,
)
from pellucid.arm.study.tree_excitation import tree_protocol
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.numerics.protocols.step_by_step import step_by_step
from pellucid.numerics.protocols.tree_limits import TreeLimits

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}


def arm(axes: str = "yxy") -> Tree:
    """Links of 0.3 m, the first joint's two at one place."""
    joints, links = [], []
    for i, axis in enumerate(axes):
        place = (0.0, 0.0, -0.3 if i > 1 else 0.0)
        joints.append(TreeJoint(f"j{i}", f"link{i - 1}" if i else "base", f"link{i}", axis=AXES[axis], place=place))
        links.append(Link.about_centre(f"link{i}", 1.0, (0.01, 0.02, -0.15), (0.01, 0.0, 0.0, 0.01, 0.0, 0.002)))
    return Tree(joints, links)


@pytest.fixture(scope="module")
def limits():
    """Of three joints beside a post that the last link can reach."""
    tree = arm()
    shape = capsules_along_links(
        [BASE_LINK, 0, 1], np.array([j.place for j in tree.order]), np.array([[0, 0, -0.3]] * 3), 0.04
    )
    post = Capsule(BASE_LINK, (0.35, 0.0, -0.6), (0.35, 0.0, 0.2), 0.05)
    shape = Capsules((*shape.parts, post), (*shape.pairs, (len(shape.parts) - 1, len(shape.parts))))

    def effort(q, v, a):
        return tree.core.inverse_dynamics(q, v, a) + 0.5 * np.tanh(v / 0.02)

    return TreeLimits(
        ("j0", "j1", "j2"), [-1.0, -0.8, -2.0], [1.2, 0.8, 0.2], [2.0] * 3, [8.0] * 3, [6.0, 5.0, 2.0], effort,
        lambda q: shape.distance(tree.core.placements(q)), 0.02,
    )  # fmt: skip


@pytest.fixture(scope="module")
def information():
    """Of columns that no other can stand for, and of dry friction."""
    tree = arm()

    def of(q, v, a):
        y = tree.core.regressor(q, v, a, own=np.stack([v, np.tanh(v / 0.05)], axis=-1)).reshape(-1, 36)
        return y[:, chosen].T @ y[:, chosen]

    rng = np.random.default_rng(0)
    y = tree.core.regressor(*rng.uniform(-2, 2, (3, 500, 3)), own=rng.uniform(-1, 1, (500, 3, 2))).reshape(-1, 36)
    y = y / np.maximum(np.linalg.norm(y, axis=0), 1e-9)
    chosen = []
    for i in range(36):
        if np.linalg.svd(y[:, [*chosen, i]], compute_uv=False)[-1] > 1e-6:
            chosen.append(i)
    return of


@pytest.fixture(scope="module")
def optimised(information, limits):
    rng = np.random.default_rng(1)
    return optimised_tree_fourier(information, limits, rng, fundamental=0.1, harmonics=4, drawn=30)


def test_a_random_motion_keeps_every_limit_and_rests_at_its_ends(limits):
    for seed in range(12):
        series = random_tree_fourier(limits, np.random.default_rng(seed), fundamental=0.1, harmonics=4)
        moved = series.motion(np.array([0.0, series.period, 3.0 * series.period]))
        np.testing.assert_allclose(moved[1:], 0.0, atol=1e-12)
        np.testing.assert_allclose(moved[0], np.tile(moved[0][0], (3, 1)), atol=1e-12)
        time = np.arange(160) / 160 * series.period
        assert (limits.slacks(*series.motion(time)) >= -1e-9).all()


def test_an_optimised_motion_keeps_every_limit_between_the_search_s_samples_too(optimised, limits):
    series = optimised.series
    moved = series.motion(np.linspace(0.0, series.period, 20_011))
    assert limits.passed(*moved) is None
    assert np.abs(np.array(series.motion(np.array([0.0])))[1:]).max() < 1e-12


def test_an_optimised_motion_tells_more_than_the_best_of_those_drawn(optimised, information, limits):
    assert optimised.cost < optimised.drawn[0] < np.median(optimised.drawn)
    time = np.arange(160) / 160 * optimised.series.period
    assert information_cost(information(*optimised.series.motion(time))) == pytest.approx(optimised.cost, abs=1e-6)


def test_equal_seeds_give_equal_motions_and_either_criterion_its_own(information, limits):
    def made(criterion, seed):
        rng = np.random.default_rng(seed)
        return optimised_tree_fourier(
            information, limits, rng, fundamental=0.2, harmonics=2, criterion=criterion, drawn=3
        ).series

    first = made("A", 3)
    np.testing.assert_array_equal(first.a, made("A", 3).a)
    assert np.abs(first.a - made("D", 3).a).max() > 1e-3


def test_what_an_arm_cannot_do_is_said(limits, information):
    held = TreeLimits(limits.names, limits.low, limits.high, limits.velocity, limits.acceleration,
                      np.array([1e-3, 5.0, 2.0]), limits.effort_of)  # fmt: skip
    with pytest.raises(PellucidError, match="joint 'j0': effort"):
        random_tree_fourier(held, np.random.default_rng(0), fundamental=0.1, harmonics=3)
    with pytest.raises(PellucidError, match="expected low < high"):
        TreeLimits(("a",), [1.0], [0.0], [1.0], [1.0])
    with pytest.raises(PellucidError, match="joint 'a': found velocity -1"):
        TreeLimits(("a",), [0.0], [1.0], [-1.0], [1.0])
    with pytest.raises(PellucidError, match="expected at least 2"):
        optimised_tree_fourier(information, limits, np.random.default_rng(0), fundamental=0.1, harmonics=1)


def test_distance_of_segments_is_the_least_of_their_points():
    rng = np.random.default_rng(4)
    p0, p1, q0, q1 = rng.uniform(-1, 1, (4, 300, 3))
    p1[:20] = p0[:20] + 0.5 * (q1[:20] - q0[:20])  # parallel
    q1[20:25] = q0[20:25]  # a point
    share = np.linspace(0.0, 1.0, 201)
    p = p0[:, None] + share[:, None] * (p1 - p0)[:, None]
    q = q0[:, None] + share[:, None] * (q1 - q0)[:, None]
    brute = np.array([np.linalg.norm(a[:, None] - b[None], axis=-1).min() for a, b in zip(p, q, strict=True)])
    found = segment_distance(p0, p1, q0, q1)
    assert (found <= brute + 1e-12).all()
    np.testing.assert_allclose(found, brute, atol=0.01)


def test_neighbours_are_not_compared_and_a_bound_holds_between_samples():
    tree = arm("yyyy")
    places = np.array([j.place for j in tree.order])
    shape = capsules_along_links([BASE_LINK, 0, 1, 2], places, np.array([[0, 0, -0.3]] * 4), 0.05)
    named = {(shape.parts[i].link, shape.parts[j].link) for i, j in shape.pairs}
    assert named == {(0, 2), (0, 3), (1, 3)}  # link 0 is a point, where link 1 begins and the rest can fold back to
    q = np.linspace([0.0, 0.0, 0.2, 0.2], [0.0, 0.0, 2.4, 2.4], 2001)
    exact = shape.distance(tree.core.placements(q))
    for every in (10, 50, 200):
        assert shape.least(tree.core.placements(q[::every])) <= exact.min() + 1e-9
    assert shape.least(tree.core.placements(q[::10])) == pytest.approx(exact.min(), abs=0.01)


def test_step_by_step_isolates_joints_then_couples_pairs_within_all_limits(limits):
    rate = 100.0
    made = step_by_step(limits, rate, angles=5, hold=1.0, velocities=3, slow=1, sweep=8.0)
    assert made.left_out == ()
    assert [s.kind for s in made.steps].count("coupling") == 3
    velocity = np.gradient(made.position, 1.0 / rate, axis=0)
    acceleration = np.gradient(velocity, 1.0 / rate, axis=0)
    assert limits.passed(made.position, velocity, acceleration) is None
    for step in made.steps:
        moves = np.ptp(made.position[step.first : step.last], axis=0) > 0.0
        np.testing.assert_array_equal(np.flatnonzero(moves), step.joints)
        if step.kind == "coupling":
            signs = np.sign(velocity[step.first : step.last, list(step.joints)])
            assert {tuple(s) for s in signs.astype(int)} >= {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    np.testing.assert_array_equal(made.position[0], made.position[-1])


def test_step_by_step_refuses_a_posture_beyond_a_limit_by_name(limits):
    with pytest.raises(PellucidError, match=r"joint 'j1': place 0\.9"):
        step_by_step(limits, 100.0, posture=[0.0, 0.9, 0.0])


STUDY = """
name = "pair"
[tree]
[processing]
lowpass = "10 Hz"
[channels]
time = { column = "t", unit = "s" }
"""
JOINT = """
position.{name} = {{ column = "{name}", unit = "rad" }}
torque.{name} = {{ column = "{name}_torque", unit = "N*m" }}
"""
RIG = """
[[rig.joints]]
name = "{name}"
motion = "rotary"
place = ["0 m", "0 m", "{down} m"]
axis = [{axis}]
[rig.joints.body]
mass = "1 kg"
centre = ["0.01 m", "0.02 m", "-0.15 m"]
inertia = ["0.01 kg*m^2", "0 kg*m^2", "0 kg*m^2", "0.01 kg*m^2", "0 kg*m^2", "0.002 kg*m^2"]
[rig.joints.drive]
kind = "torque"
[rig.joints.limits]
position_min = "-1 rad"
position_max = "1 rad"
velocity = "2 rad/s"
{more}
"""


@pytest.fixture
def pair(tmp_path):
    """A study of two joints, nothing recorded yet."""
    channels = JOINT.format(name="shoulder") + JOINT.format(name="elbow")
    joints = RIG.format(name="shoulder", down=0, axis="0, 1, 0", more='effort = "20 N*m"')
    joints += RIG.format(name="elbow", down=-0.3, axis="1, 0, 0", more='effort = "10 N*m"')
    entry = '[[recordings]]\nname = "first"\nfile = "first.csv"\nuse = "fit"\n'
    (tmp_path / "study.toml").write_text(STUDY + channels + joints + entry, encoding="utf-8")
    return tmp_path


def test_a_study_s_robot_is_asked_for_a_motion_of_all_its_joints(pair, tmp_path):
    study = pellucid.open(pair)
    made = tree_protocol("optimised_fourier", study, tmp_path / "out", rate=50.0, harmonics=2, periods=2, seed=4)
    assert made.files[0].read_text(encoding="utf-8").splitlines()[1] == "time,shoulder,elbow"
    table = np.loadtxt(made.files[0], delimiter=",", skiprows=2)
    assert table.shape == (1001, 3)
    assert (np.abs(table[:, 1:]) < 1.0).all()
    np.testing.assert_allclose(table[0, 1:], table[-1, 1:], atol=1e-7)
    assert made.gain > 1.0
    steps = tree_protocol("step_by_step", study, tmp_path / "out", rate=50.0)
    assert np.loadtxt(steps.files[0], delimiter=",", skiprows=2).shape[1] == 3


def test_a_joint_without_limits_is_named(pair):
    file = pair / "study.toml"
    file.write_text(file.read_text(encoding="utf-8").replace('velocity = "2 rad/s"\n', "", 1), encoding="utf-8")
    with pytest.raises(PellucidError, match="shoulder: limits: found no velocity"):
        tree_protocol("step_by_step", pellucid.open(pair), pair / "out", rate=50.0)
