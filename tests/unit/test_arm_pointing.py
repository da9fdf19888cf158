"""People who point with four joints: they arrive, they learn a load, and their index is 0 against themselves."""

import numpy as np
import pytest

from pellucid.lab.arm.pointing import (
    LOAD_TRUST,
    PointingTarget,
    draw_targets,
    expected_torque,
    learn_load,
    load_features,
    point,
)
from pellucid.lab.arm.rig import able_arm
from pellucid.lab.arm.wearer import Person


class Powerless:
    """A law that asks for nothing: the robot hangs on the wearer."""

    def reset(self):
        pass

    def step(self, time, position, wrench):
        return np.zeros(4)


@pytest.fixture(scope="module")
def blocks():
    rig, person = able_arm(), Person("somebody")
    targets = draw_targets(8, np.random.default_rng(3))
    return point(rig, person, None, targets), point(rig, person, Powerless(), targets)


def test_everybody_arrives_without_a_robot_and_fast_movements_are_faster(blocks):
    control, _ = blocks
    assert not control.stopped
    assert all(m.arrived for m in control.movements)
    assert control.mean("peak_acceleration", fast=True) > 1.5 * control.mean("peak_acceleration", fast=False)
    assert [m.upward for m in control.movements] == [True, False] * 4
    assert control.mean("interaction") == 0.0


def test_a_robot_that_hangs_costs_effort_and_the_index_of_control_is_zero(blocks):
    control, worn = blocks
    assert worn.mean("interaction") > 1.0
    for upward in (True, False):
        assert control.emg_per_acceleration(control, upward=upward, fast=False) == pytest.approx(0.0)
    assert worn.emg_per_acceleration(control, upward=True, fast=False) > 0.05


def test_a_load_is_learnt_from_movements(rng):
    true = LOAD_TRUST * rng.standard_normal((4, 8))
    load = np.zeros((4, 8))
    t = np.linspace(0.0, 1.0, 200)[:, None]
    for _ in range(8):
        size, phase = rng.uniform(0.3, 0.9, 4), rng.uniform(0.0, 6.0, 4)
        motion = [size * np.sin(6.0 * t + phase), 6.0 * size * np.cos(6.0 * t + phase), -36.0 * size * np.sin(6.0 * t)]
        felt = expected_torque(true, *motion)
        before = np.std(felt - expected_torque(load, *motion))
        load = learn_load(load, *motion, felt)
    assert load_features(*motion).shape == (4, 200, 8)
    assert before < 0.2 * np.std(felt)


def test_targets_go_up_and_down_and_every_second_pair_is_fast():
    targets = draw_targets(8, np.random.default_rng(1))
    assert [t.fast for t in targets] == [False, False, True, True] * 2
    assert isinstance(targets[0], PointingTarget)
