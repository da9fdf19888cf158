"""People who point with four joints: they arrive, they learn a load, and their index is 0 against themselves."""

import numpy as np
import pytest

from pellucid_lab.arm.pointing import (
    LOAD_TRUST,
    LoadMemory,
    PointingTarget,
    draw_targets,
    expected_torque,
    load_features,
    point,
)
from pellucid_lab.arm.rig import able_arm
from pellucid_lab.arm.wearer import Person


class Powerless:
    """A law that asks for nothing: the robot hangs on the wearer."""

    def reset(self):
        pass

    def step(self, time, position, wrench):
        return np.zeros(4)


@pytest.fixture(scope="module")
def blocks():
    rig, person = able_arm(), Person("somebody")
    targets = draw_targets(16, np.random.default_rng(3))
    return point(rig, person, None, targets), point(rig, person, Powerless(), targets)


def test_everybody_arrives_without_a_robot_and_fast_movements_are_faster(blocks):
    control, _ = blocks
    assert not control.stopped
    assert all(m.arrived for m in control.movements)
    assert control.mean("peak_acceleration", fast=True) > 1.5 * control.mean("peak_acceleration", fast=False)
    assert [m.upward for m in control.movements] == [True, False] * 8
    assert control.mean("interaction") == 0.0


def test_a_robot_that_hangs_costs_effort_and_the_index_of_control_is_zero(blocks):
    control, worn = blocks
    assert worn.mean("interaction") > 1.0
    for upward in (True, False):
        assert control.emg_per_acceleration(control, upward=upward, fast=False) == pytest.approx(0.0)
    # Before people expect the robot, their corrections accelerate the arm, and the index falls.
    assert worn.emg_per_acceleration(control, upward=True, fast=False, skip=8) > 0.5


def test_people_keep_to_the_speed_that_they_were_asked_for(blocks):
    rig, person, targets = able_arm(), Person("somebody"), draw_targets(4, np.random.default_rng(3))
    free, asked = (point(rig, person, None, targets, asked_speed=most) for most in (None, np.full(4, 0.6)))
    assert asked.mean("duration") > 1.5 * free.mean("duration")
    assert asked.mean("peak_velocity") < free.mean("peak_velocity")


def test_people_need_fewer_corrections_once_they_have_learnt_a_robot_that_hangs(blocks):
    corrections = [m.corrections for m in blocks[1].movements]
    assert sum(corrections[8:]) < 0.6 * sum(corrections[:8])


def test_a_load_is_learnt_from_movements(rng):
    true = LOAD_TRUST * rng.standard_normal((4, 8))
    memory = LoadMemory()
    t = np.linspace(0.0, 1.0, 200)[:, None]
    for _ in range(8):
        size, phase = rng.uniform(0.3, 0.9, 4), rng.uniform(0.0, 6.0, 4)
        motion = [size * np.sin(6.0 * t + phase), 6.0 * size * np.cos(6.0 * t + phase), -36.0 * size * np.sin(6.0 * t)]
        felt = expected_torque(true, *motion)
        before = np.std(felt - expected_torque(memory.coefficients, *motion))
        memory.learn(*motion, felt)
    assert load_features(*motion).shape == (4, 200, 8)
    assert before < 0.2 * np.std(felt)


def test_what_was_learnt_of_small_movements_expects_no_wild_torques_elsewhere(rng):
    """A load of 2 N*m with oscillations that no feature explains, felt on short ways from posture to posture."""
    memory, worst = LoadMemory(), 0.0
    t = np.linspace(0.0, 1.0, 200)[:, None]
    ease = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    low, high = np.array([0.0, 0.1, -0.3, 0.5]), np.array([1.2, 1.3, 0.9, 2.0])
    at = low
    for _ in range(30):
        to = rng.uniform(low, high)
        position, velocity = at + ease * (to - at), np.gradient(ease[:, 0], 1.0 / 200.0)[:, None] * (to - at)
        shaken = 1.5 * np.sin(25.0 * t + rng.uniform(0.0, 6.0, 4))
        memory.learn(position, velocity, np.gradient(velocity, 1.0 / 200.0, axis=0), 2.0 * np.sin(position) + shaken)
        corners = rng.uniform(low, high, (50, 4))
        expected = expected_torque(memory.coefficients, corners, np.zeros((50, 4)), np.zeros((50, 4)))
        worst, at = np.abs(expected - 2.0 * np.sin(corners)).max(), to
    assert worst < 1.5


def test_a_law_that_stops_ends_the_block_before_its_movement():
    class Stopping(Powerless):
        stopped_by = "none"

        def step(self, time, position, wrench):
            self.stopped_by = "velocity" if time > 3.0 else "none"
            return np.zeros(4)

    rig, targets = able_arm(), draw_targets(6, np.random.default_rng(3))
    block = point(rig, Person("somebody"), Stopping(), targets)
    assert block.stopped
    assert len(block.movements) < 4


def test_targets_go_up_and_down_and_every_second_pair_is_fast():
    targets = draw_targets(8, np.random.default_rng(1))
    assert [t.fast for t in targets] == [False, False, True, True] * 2
    assert isinstance(targets[0], PointingTarget)
