"""A virtual robot of several joints, identified: numbers found again, the core's predictions, refusals."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import IdentificationError
from pellucid.arm.fit.fit_tree import fit_tree, heldout_errors, identify_tree, make_tree_estimate
from pellucid.arm.fit.friction_terms import plain_families
from pellucid.arm.fit.tree_estimate import find_base_parameters, parameter_verdict
from pellucid.arm.fit.tree_families import choose_families
from pellucid.arm.fit.tree_regression import TreeModel, collect_rows, fit_rows
from pellucid.arm.tree_motion import TreeMotion
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.models.robot import Robot

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
    base = find_base_parameters(four_joints())
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


def test_numbers_are_found_again(coupled):
    fit = coupled.fit
    for name in coupled.robot.names:
        assert fit[f"{name}.coulomb"].value == pytest.approx(2.0, rel=1e-4)
        assert fit[f"{name}.viscous"].value == pytest.approx(1.5, rel=1e-4)
        assert fit[f"{name}.load"].value == pytest.approx(0.1, rel=1e-3)
    assert fit["wrist.motor_inertia"].value == pytest.approx(0.02, rel=1e-3)
    assert fit["wrist.motor_coulomb"].value == pytest.approx(0.5, rel=1e-3)
    truth = find_base_parameters(coupled.robot)
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
    with pytest.raises(IdentificationError, match="its motor drives only this joint"):
        fit_tree(robot, [motion], [("viscous", "motor_coulomb")] * 4)
    with pytest.raises(IdentificationError, match="found 1 friction families, expected one for each of 4 joints"):
        fit_tree(robot, [motion], [("viscous",)])


@pytest.fixture(scope="module")
def rubbing():
    """A robot whose third joint rubs with its load and whose last has a ripple of an order that is not whole, in noise
    that remembers; and what is identified."""
    robot = four_joints()
    motion = motion_of(robot, FRICTION, n=2600, noise=0.03, parts=13)
    clean = motion_of(robot, {}, n=2600)
    load = 0.15 * np.abs(clean.effort[:, 2]) * np.sign(motion.velocity[:, 2])
    effort = motion.effort.copy()
    effort[:, 2] += load
    effort[:, 3] += 0.5 * np.sin(23.4 * motion.position[:, 3] + 0.7)
    motion = replace(motion, effort=effort, rate=200.0)
    return SimpleNamespace(robot=robot, motion=motion, found=identify_tree(robot, [motion]))


def test_terms_and_ripple_are_chosen_where_they_are(rubbing):
    best = rubbing.found.best
    assert best.families[2] == ("viscous", "coulomb", "offset", "load")
    (ripple,) = best.ripples
    assert ripple.motor == 3
    assert ripple.order == pytest.approx(23.4, abs=0.1)
    assert ripple.amplitude == pytest.approx(0.5, abs=3 * best["wrist.ripple_sine"].standard_error)
    assert best["elbow.load"].value == pytest.approx(0.15, abs=3 * best["elbow.load"].standard_error)
    assert any("wrist has a ripple of 23.4 periods" in note for note in best.notes)


def test_a_term_that_saves_little_of_its_joints_error_is_not_added():
    robot = four_joints()
    rows = collect_rows(robot, [motion_of(robot, FRICTION, n=2600, noise=0.03, parts=13)])
    assert [(x.joint, x.term) for x in choose_families(rows, min_improvement=0.0).taken] == [(3, "load")]
    assert choose_families(rows).taken == ()


def test_segments_left_out_tell_the_better_model(rubbing):
    found = rubbing.found
    assert found.best_out.mean < found.base_out.mean
    # The maker's links are the truth here, and their friction lacks what the base has.
    assert found.best_out.errors[3] < 0.5 * found.maker_out.errors[3]
    off = rubbing.motion.effort - found.best.effort(rubbing.motion)
    shown = rubbing.motion.moving
    size = np.sqrt(np.sum(shown * off**2, axis=0) / np.sum(shown * rubbing.motion.effort**2, axis=0))
    np.testing.assert_allclose(heldout_errors(found.best, [rubbing.motion]), 100 * size)
    assert np.all(found.best_out.errors > 100 * size)


def test_intervals_agree_with_the_jackknife_and_textbooks_do_not(rubbing):
    jackknife = rubbing.found.jackknife
    assert jackknife.share_within >= 80.0
    assert jackknife.textbook_ratio > 2.0


def test_each_number_is_told_from_0_or_not(rubbing):
    best = rubbing.found.best
    kinds = {name: parameter_verdict(p) for name, p in best.parameters.items()}
    assert kinds["elbow.load"] == "identified"
    assert set(kinds.values()) == {"identified", "weak"}


def test_intervals_hold_the_truth():
    """On virtual robots in coloured noise, 95 % intervals hold the truth about as often as they say."""
    robot = four_joints()
    base = find_base_parameters(robot)
    truth = base.combination @ np.concatenate([robot.tree.parameters, [0.05, 0.05, 0.03, 0.01]])
    hits = []
    for seed in range(12):
        fit = fit_tree(robot, [motion_of(robot, FRICTION, seed=seed, noise=0.03)])
        for name, value in zip(base.names, truth, strict=True):
            low, high = fit[name].interval()
            hits.append(low <= value <= high)
        for name in robot.names:
            low, high = fit[f"{name}.coulomb"].interval()
            hits.append(low <= 2.0 <= high)
    assert 0.90 <= np.mean(hits) <= 0.99


def test_a_joint_that_rests_is_named():
    robot = four_joints()
    motion = motion_of(robot, FRICTION, n=400)
    moving = motion.moving.copy()
    moving[:, 1] = False
    with pytest.raises(IdentificationError, match="joint 'shoulder' never moves in sines 0"):
        fit_tree(robot, [replace(motion, moving=moving)])


@pytest.mark.parametrize("width", [0.0, 0.02])
def test_the_core_knows_every_term(coupled, width):
    """Whatever terms a joint is given, its numbers for the core predict what the estimate predicts."""
    robot, motion = coupled.robot, coupled.motion
    rows = collect_rows(robot, [motion], width=width)
    families = (
        ("viscous", "coulomb", "offset", "square_root", "load"),
        ("viscous", "coulomb", "offset", "directional"),
        ("viscous", "coulomb", "offset", "stribeck"),
        ("viscous", "coulomb", "offset", "motor_viscous", "motor_coulomb", "motor_square_root"),
    )
    model = TreeModel(robot, rows.base, families, speeds={2: 0.2})
    fit = make_tree_estimate("all", rows, *fit_rows(model, rows))
    assert fit["elbow.stribeck_velocity"].value == 0.2
    turns = np.asarray(robot.turns)
    plant = _core.DrivenTree(
        fit.links(), robot.tree.gravity, fit.joints(), period=0.005, turns=turns, motors=fit.motors()
    )
    by_core = plant.motor_effort(motion.position, motion.velocity, motion.acceleration) @ turns
    np.testing.assert_allclose(fit.effort(motion), by_core, rtol=0, atol=1e-9)
