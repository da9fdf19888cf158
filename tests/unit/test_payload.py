"""A load on a robot: its ten numbers, what of them the motion tells, and the gains of drives that a known one gives."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.arm.fit.consistent_inertias import least_eigenvalue
from pellucid.arm.fit.fit_tree import UNDETERMINED_REASON
from pellucid.arm.fit.friction_terms import PLAIN_TERMS
from pellucid.arm.fit.payload import gains_from_desired, gains_from_payload, identify_payload, with_drive_gains
from pellucid.arm.tree_motion import TreeMotion
from pellucid.models.estimates import Parameter
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.models.robot import Robot

GAINS = np.array([6.0, 9.0, 4.0])
LOAD = Link.about_centre("lower", 1.5, (0.25, 0.03, 0.05), (0.004, 0.0, 0.0, 0.006, 0.0, 0.005)).numbers
FRICTION = np.array([[0.8, 0.5], [0.9, 0.4], [0.3, 0.2]])  # Dry and viscous [N m, N m s]
SHARE = 0.08  # of the load, lost as friction


def arm(lower=None, turns=(), joints=3):
    """An arm of a vertical axis and two level ones; `joints` 2: of the level ones alone."""
    level = (0.0, 1.0, 0.0)
    chain = [
        TreeJoint("turn", "base", "column", axis=(0.0, 0.0, 1.0)),
        TreeJoint("lift", "column", "upper", axis=level),
        TreeJoint("elbow", "upper", "lower", axis=(0.0, 0.8, 0.6) if joints == 3 else level, place=(0.3, 0.0, 0.0)),
    ][3 - joints :]
    chain[0] = replace(chain[0], parent="base")
    links = [
        Link.about_centre("column", 4.0, (0.0, 0.0, -0.1), (0.03, 0.0, 0.0, 0.03, 0.0, 0.02)),
        Link.about_centre("upper", 2.0, (0.15, 0.0, 0.01), (0.003, 0.0, 0.0, 0.02, 0.0, 0.02)),
        Link.about_centre("lower", 1.0, (0.12, 0.01, 0.0), (0.001, 0.0, 0.0, 0.008, 0.0, 0.008)),
    ][3 - joints :]
    if lower is not None:
        n = links[-1].numbers + lower
        links[-1] = Link("lower", n[0], tuple(n[1:4]), tuple(n[4:]))
    return Robot(Tree(chain, links), turns)


def played(robot, loaded, rng, *, noise=0.03, n=600, load_friction=0.0, segments=6):
    """A recording in ampere of a robot with the load or without, white noise in the current; gains said to be 1."""
    m = len(robot.names)
    carrying = arm(LOAD, robot.turns, m) if loaded else robot
    t = np.arange(n) * 0.04
    # Both recordings move alike, as a payload pair does.
    draw = np.random.default_rng(3)
    ways = 2 * np.pi * draw.uniform(0.08, 0.6, (m, 4))
    phase, size = draw.uniform(0, 2 * np.pi, (m, 4)), np.array([0.7, 0.4, 0.3, 0.2])
    q, v, a = (
        np.sum(size * ways**k * np.sin(ways * t[:, None, None] + phase + k * np.pi / 2), axis=-1) for k in range(3)
    )
    y = carrying.tree.core.inverse_dynamics(q, v, a)
    dry, viscous = FRICTION[-m:].T
    effort = y + (dry + load_friction * np.abs(y)) * np.sign(v) + viscous * v
    turns = np.asarray(robot.turns)
    exact = effort @ np.linalg.inv(turns) / GAINS[-m:]
    drive = exact + noise * rng.normal(size=exact.shape)
    return TreeMotion(
        "loaded" if loaded else "empty", "fit", t, q, v, a, drive @ turns, np.abs(v) > 0.02,
        np.arange(n) * segments // n, drive=drive, gain=np.ones(m), drive_units=("A",) * m,
        desired=y, desired_drive=drive,
    )  # fmt: skip


def pair(robot, rng, **more):
    return [played(robot, False, rng, **more)], [played(robot, True, rng, **more)]


def test_the_load_is_within_its_intervals_and_a_body(rng):
    robot = arm()
    empty, loaded = (
        [with_drive_gains(x, robot, GAINS) for x in each] for each in pair(robot, rng, load_friction=SHARE)
    )
    families = ((*PLAIN_TERMS, "load"),) * 3
    found = identify_payload(robot, empty, loaded, families)
    assert found.link == "lower"
    assert least_eigenvalue(found.body) > 0.0
    assert not any(p.refused for p in found.parameters)
    apart = np.abs(found.array - LOAD)
    assert np.all(apart < 3.5 * np.array([p.standard_error for p in found.parameters]) + 1e-6)
    assert found.mass.value == pytest.approx(1.5, rel=0.02)
    np.testing.assert_allclose(found.centre, [0.25, 0.03, 0.05], atol=0.01)


def test_gains_that_were_found_widen_the_load(rng):
    robot = arm()
    empty, loaded = pair(robot, rng, noise=0.001, n=300)

    def found(gains, error=0.0):
        known = [Parameter("gain", "N*m/A", float(g), error * g) for g in gains]
        return identify_payload(robot, empty, loaded, gains=known)

    sure, unsure = found(GAINS), found(GAINS, 0.02)
    np.testing.assert_allclose(sure.array, unsure.array)
    moved = [found(GAINS * (1.0 + 0.02 * (np.arange(3) == i))).mass.value - sure.mass.value for i in range(3)]
    assert unsure.mass.standard_error == pytest.approx(np.linalg.norm(moved), rel=0.2)
    assert sure.mass.standard_error < 0.1 * unsure.mass.standard_error


def test_what_a_plane_does_not_tell_is_refused(rng):
    robot = arm(joints=2)
    empty, loaded = ([with_drive_gains(x, robot, GAINS[1:]) for x in each] for each in pair(robot, rng))
    found = identify_payload(robot, empty, loaded)
    told = [name for name in found if not found[name].refused]
    assert told == ["mass", "moment_x", "moment_z", "inertia_yy"]
    assert found["inertia_zz"].refused == UNDETERMINED_REASON
    assert np.isnan(found.centre).all()  # moment_y is not told


def test_gains_by_a_known_load_are_right_in_the_mean_and_within_their_intervals():
    robot, ratios, inside = arm(joints=2), [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        empty, loaded = pair(robot, rng, noise=0.1, n=240, segments=3)
        found = gains_from_payload(robot, empty, [loaded], [1.5])
        ratios.append([g.value / k for g, k in zip(found, GAINS[1:], strict=True)])
        inside.append([g.interval()[0] < k < g.interval()[1] for g, k in zip(found, GAINS[1:], strict=True)])
    ratios = np.array(ratios)
    error = ratios.std(axis=0) / np.sqrt(len(ratios))
    assert np.all(np.abs(ratios.mean(axis=0) - 1.0) < 3.5 * error)
    assert np.all(error < 0.015)
    assert np.mean(inside) > 0.85


def test_gains_hold_where_a_motor_turns_with_two_joints_and_load_is_lost(rng):
    turns = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0))
    robot = arm(turns=turns)
    empty, loaded = pair(robot, rng, load_friction=SHARE, noise=0.01)
    family = (*PLAIN_TERMS, "load")
    found = gains_from_payload(robot, empty, [loaded], [1.5], (family,) * 3)
    np.testing.assert_allclose([g.value for g in found], GAINS, rtol=0.03)
    assert {g.unit for g in found} == {"N*m/A"}


def test_gains_from_the_controllers_own_torque(rng):
    robot = arm()
    found = gains_from_desired(robot, [played(robot, False, rng)])
    for gain, true in zip(found, GAINS, strict=True):
        low, high = gain.interval(0.999)
        assert low < true < high
        assert gain.standard_error < 0.05 * true


def test_misuse_is_refused(rng):
    robot = arm(joints=2)
    (empty,), (loaded,) = pair(robot, rng, n=100)
    with pytest.raises(IdentificationError, match="found 1 without and 0 with"):
        identify_payload(robot, [empty], [])
    with pytest.raises(IdentificationError, match="found no link 'hand' for the payload, expected one of upper, lower"):
        identify_payload(robot, [empty], [loaded], link="hand")
    with pytest.raises(IdentificationError, match="found masses"):
        gains_from_payload(robot, [empty], [[loaded]], [0.0])
    with pytest.raises(IdentificationError, match="expected both; name their channels"):
        gains_from_desired(robot, [replace(empty, desired=None)])
    with pytest.raises(IdentificationError, match="does not rise with its desired torque"):
        gains_from_desired(robot, [replace(empty, desired_drive=-empty.desired_drive)])
