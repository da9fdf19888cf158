"""Two trees held together by cuffs: energy, action and reaction, balance, muscles, and what is refused."""

import numpy as np
import pytest
from trees import INDEX

from pellucid import _core

GRAVITY = np.array([0.0, 0.0, -9.81])
JOINT = {name: i for i, name in enumerate(_core.TREE_JOINT_PARAMETER_NAMES)}
CUFF = {name: i for i, name in enumerate(_core.CUFF_PARAMETER_NAMES)}
AXES = [(-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)]


def arm(mass=1.0, length=0.3, place=(0.0, 0.0, 0.0)):
    """A shoulder of three axes and an elbow."""
    rows = np.zeros((4, len(INDEX)))
    for i, axis in enumerate(AXES):
        m = mass * (0.3, 0.3, 2.0, 1.2)[i]
        c = np.array([0.01, 0.02, -0.12 if i > 1 else 0.0])
        inertia = np.diag([0.012, 0.011, 0.003]) * mass + m * (c @ c * np.eye(3) - np.outer(c, c))
        at = place if i == 0 else (0.0, 0.0, -length if i == 3 else 0.0)
        rows[i, : INDEX["mass"]] = [i, 1, *at, 0, 0, 0, *axis, 0.0]
        rows[i, INDEX["mass"] :] = [m, *(m * c), *inertia[np.triu_indices(3)]]
    return rows


def cuff(robot_link, limb_link, on_robot, on_limb, **held):
    row = np.zeros(len(CUFF))
    row[: CUFF["stiffness_x"]] = [robot_link, limb_link, *on_robot, *on_limb]
    for name, value in held.items():
        row[CUFF[name]] = value
    return row


def spring(k, kt, d=0.0, dt=0.0):
    # Not the same in all directions: the frame that turns with the robot must not make energy.
    return {
        **{f"stiffness_{a}": share * k for a, share in zip("xyz", (1.0, 1.5, 0.3), strict=True)},
        **{f"damping_{a}": d for a in "xyz"},
        "turning_stiffness": kt,
        "turning_damping": dt,
    }


def worn(*, substeps=4, place=(0.01, -0.02, 0.01), length=0.28, d=0.0, dt=0.0, joints=None, **more):
    cuffs = [
        cuff(3, 3, (0.0, 0.0, -0.15), (0.0, 0.0, -0.14), **spring(800.0, 5.0, d, dt)),
        cuff(4, 4, (0.0, 0.01, -0.2), (0.0, 0.0, -0.2), **spring(1500.0, 8.0, d, dt)),
    ]
    robot = arm()
    joints = np.zeros((4, len(JOINT))) if joints is None else joints
    return _core.WornTree(
        robot, GRAVITY, joints, period=1e-3, substeps=substeps, limb_links=arm(0.9, length, place),
        cuffs=np.array(cuffs), **more,
    )  # fmt: skip


START = np.array([0.3, 0.5, 0.2, 1.0])


def test_energy_is_kept_as_well_as_steps_are_small():
    """Without friction, damping and muscles nothing is lost: what is, vanishes with the step, as Euler's must."""
    spread = []
    for substeps in (4, 16):
        plant = worn(substeps=substeps)
        plant.reset(START, START + 0.03)
        energies = []
        for _ in range(300):
            plant.run(np.zeros(4))
            energies.append(plant.energy)
        spread.append(np.ptp(energies))
    assert spread[0] < 0.05
    assert spread[1] < 0.3 * spread[0]


def test_cuffs_take_energy_and_never_give_it():
    plant = worn(d=20.0, dt=0.1)
    plant.reset(START, START + 0.05)
    energies = [plant.energy]
    for _ in range(40):
        plant.run(np.zeros((10, 4)))
        energies.append(plant.energy)
    assert np.all(np.diff(energies) < 1e-3)
    assert energies[-1] < energies[0] - 0.1


def test_action_is_reaction():
    """Where both first axes are one, turning everything about it stretches no cuff: their moments cancel there."""
    plant = worn(place=(0.0, 0.0, 0.0), d=15.0, dt=0.2)
    rng = np.random.default_rng(2)
    for _ in range(5):
        q = START + 0.2 * rng.standard_normal(4)
        plant.reset(q, q + 0.05 * rng.standard_normal(4))
        *_, on_robot, on_limb, pull = plant.run(rng.standard_normal((20, 4)))
        assert np.abs(on_robot[:, 0]).max() > 0.1
        np.testing.assert_allclose(on_robot[:, 0], -on_limb[:, 0], rtol=0, atol=1e-12 * np.abs(pull).max())


def test_a_robot_alone_is_the_driven_tree_to_the_bit():
    joints = np.zeros((4, len(JOINT)))
    joints[:, [JOINT["coulomb_positive"], JOINT["coulomb_negative"]]] = 0.3
    joints[:, [JOINT["load_motoring"], JOINT["load_generating"]]] = 0.1
    elastic = np.zeros((4, len(_core.SERIES_ELASTIC_PARAMETER_NAMES)))
    for name, value in {"motor_inertia": 0.02, "stiffness": 700.0, "damping": 0.4, "backlash": 0.002}.items():
        elastic[:, _core.SERIES_ELASTIC_PARAMETER_NAMES.index(name)] = value
    effort = np.random.default_rng(3).normal(size=(200, 4))
    alone = _core.WornTree(arm(), GRAVITY, joints, period=1e-3, substeps=4, elastic=elastic)
    driven = _core.DrivenTree(arm(), GRAVITY, joints, period=1e-3, substeps=4, elastic=elastic)
    alone.reset(START)
    driven.reset(START)
    position, velocity, motor, *_ = alone.run(effort)
    wanted = driven.run(effort)
    np.testing.assert_array_equal(position, wanted[0])
    np.testing.assert_array_equal(velocity, wanted[1])
    assert np.abs(motor - position).max() > 1e-3


def test_a_limb_that_learnt_its_motion_does_it_alone():
    """Feed-forward of the arm's own dynamics; muscles correct what steps leave; no cuff, no pull."""
    n = 800
    time = 1e-3 * np.arange(n)
    wanted = START + 0.3 * np.sin(2.0 * np.pi * time)[:, None] ** 2
    speed = np.gradient(wanted, 1e-3, axis=0)
    limb = _core.KinematicTree(arm(0.9, 0.28), GRAVITY)
    learnt = limb.inverse_dynamics(wanted, speed, np.gradient(speed, 1e-3, axis=0))
    servos = np.tile([10.0, 1.0, 4.0, 0.5, 60.0], (4, 1))
    plant = _core.WornTree(
        arm(), GRAVITY, np.zeros((4, len(JOINT))), period=1e-3, limb_links=arm(0.9, 0.28), servos=servos,
        reflex_delay=50,
    )  # fmt: skip
    plant.reset(START, wanted[0])
    _, _, _, position, _, _, on_limb, pull = plant.run(np.zeros((n, 4)), wanted, speed, learnt)
    assert pull.shape == (n, 0, 6)
    assert np.abs(on_limb).max() == 0.0
    assert np.abs(position - wanted).max() < 2e-3
    plant.reset(START, wanted[0] + 0.1)
    _, _, _, position, *_ = plant.run(np.zeros((n, 4)), wanted, speed, learnt)
    assert np.abs(position[-1] - wanted[-1]).max() < 0.03


def test_drives_lag_behind_their_commands():
    plant = _core.WornTree(arm(), np.zeros(3), np.zeros((4, len(JOINT))), period=1e-3, lag=0.02,
                           drives=np.tile([2.0, 0.0, 0.0, 0.0], (4, 1)))  # fmt: skip
    command = np.zeros((100, 4))
    command[:, 3] = 0.01
    _, velocity, *_ = plant.run(command)
    gained = np.diff(velocity[:, 3])
    assert gained[2] == pytest.approx(gained[-1] * (1.0 - np.exp(-2.5e-3 / 0.02)), rel=0.2)


def test_whatever_comes_in_it_ends_and_periods_do_not_hang_on_how_they_are_asked():
    plant = worn(d=10.0)
    plant.reset(START, START)
    whole = plant.run(np.full((50, 4), 0.5), np.tile(START, (50, 1)))
    plant.reset(START, START)
    single = [plant.run(np.full(4, 0.5), START) for _ in range(50)]
    for together, apart in zip(whole, zip(*single, strict=True), strict=True):
        np.testing.assert_array_equal(together, np.array(apart))
    *_, pull = plant.run(np.full((3, 4), np.nan))
    assert pull.shape == (3, 2, 6)
    plant.reset(START, START)
    np.testing.assert_array_equal(plant.run(np.full((50, 4), 0.5), np.tile(START, (50, 1)))[0], whole[0])


def test_follow_is_a_loop_at_each_motor():
    gains = np.tile([6.0, 4.0, 0.0, 3.0, 30.0], (4, 1))
    quantum, reference = np.full(4, 1e-4), np.tile(START, (4000, 1))
    plant = _core.WornTree(arm(), GRAVITY, np.zeros((4, len(JOINT))), period=1e-3)
    plant.reset(START)
    command, measured, position, _ = plant.follow(
        reference, gains, loop="cascade", velocity_span=4, quantum=quantum, noise=np.zeros((4000, 4))
    )
    np.testing.assert_allclose(measured / quantum, np.round(measured / quantum), atol=1e-6)
    weight = _core.KinematicTree(arm(), GRAVITY).gravity(position[-1])
    assert np.abs(position[-1] - START).max() < 0.03
    np.testing.assert_allclose(command[-1], weight, atol=0.1 * np.abs(weight).max())


def test_what_is_refused():
    joints = np.zeros((4, len(JOINT)))
    with pytest.raises(ValueError, match="cuffs: found a link that robot or limb lacks"):
        _core.WornTree(arm(), GRAVITY, joints, period=1e-3, limb_links=arm(),
                       cuffs=cuff(5, 3, (0, 0, 0), (0, 0, 0))[None])  # fmt: skip
    with pytest.raises(ValueError, match="limb_links: found limb_joints"):
        _core.WornTree(arm(), GRAVITY, joints, period=1e-3, servos=np.zeros((4, 5)))
    with pytest.raises(ValueError, match="lag: expected a number of at least 0"):
        _core.WornTree(arm(), GRAVITY, joints, period=1e-3, lag=-1.0)
    plant = _core.WornTree(arm(), GRAVITY, joints, period=1e-3)
    with pytest.raises(ValueError, match=r"command: got shape \(3,\), expected \(n, 4\) or \(4,\)"):
        plant.run(np.zeros(3))
    with pytest.raises(ValueError, match="loop: got 'fuzzy'"):
        plant.follow(np.zeros((2, 4)), np.zeros((4, 5)), loop="fuzzy", velocity_span=0, quantum=np.zeros(4),
                     noise=np.zeros((2, 4)))  # fmt: skip
