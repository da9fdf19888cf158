"""Margins of several joints: those of one where there is one, and of joints apart where nothing couples them."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.residual_compensator import Law, design
from pellucid.controllers.stability import LinearSystem, closed_loop, radius, sampled, worn_orthosis
from pellucid.controllers.tree_stability import (
    DRAWN_LIMBS,
    TreeCoupling,
    closed_tree,
    sampled_each,
    with_limb,
    worn_tree,
)
from pellucid_lab.arm.tree_margins import least_margins, margins_over, passivity, tree_margins
from pellucid_lab.knee.loop_margins import margins

PERIOD = 0.002
KNEE = Coupling(
    orthosis_inertia=0.048, orthosis_viscous=0.008, orthosis_gravity=1.56, coulomb=0.015, limb_inertia=0.33,
    limb_viscous=0.15, limb_gravity=8.0, strap_stiffness=14.0, strap_damping=0.42, actuator_frequency=55.0,
    actuator_damping=0.2, delay=0.0033, actuator_inertia=0.055, actuator_viscous=0.1, actuator_coulomb=2.6,
    actuator_leak=1.7,
)  # fmt: skip
TREE = TreeCoupling(
    0.048, 0.008, 1.56, 0.015, 0.33, 0.15, 8.0, 14.0, 0.42, 55.0, 0.2, 0.0033, 0.055, 0.1, 2.6, 1.7
)  # fmt: skip


def proportional(gain: np.ndarray) -> LinearSystem:
    """Of positions alone."""
    m = len(gain)
    return LinearSystem(np.zeros((0, 0)), np.zeros((0, m)), np.zeros((m, 0)), -np.asarray(gain, float))


def pair(apart: bool) -> TreeCoupling:
    """Two such joints, with or without inertia between them."""
    mass = np.diag([0.048, 0.06]) if apart else np.array([[0.048, 0.02], [0.02, 0.06]])
    limb = np.diag([0.33, 0.25]) if apart else np.array([[0.33, 0.1], [0.1, 0.25]])
    return TreeCoupling(
        mass, 0.008, 1.56, 0.015, limb, 0.15, 8.0, np.diag([14.0, 20.0]), np.diag([0.42, 0.6]), [55.0, 70.0], 0.4, 0.002
    )


def test_one_joint_is_what_the_orthosis_s_own_equations_say():
    for mine, theirs in zip(
        (worn_tree(TREE, 1.5), worn_tree(replace(TREE, drive_leak=np.zeros(1)), 1.5)),
        (worn_orthosis(KNEE, 1.5), worn_orthosis(replace(KNEE, actuator_leak=0.0), 1.5)),
        strict=True,
    ):
        for name in "abcd":
            np.testing.assert_allclose(getattr(mine, name), getattr(theirs, name), rtol=1e-12, atol=1e-12)


def test_one_joint_s_margins_are_the_orthosis_s():
    controller = design(KNEE, PERIOD, law=Law(0.8, 0.8, 0.5, 0.7, proportional=3.0, torque_gain=0.0)).linear(1.5)
    own, tree = margins(KNEE, controller, PERIOD, speed=1.5), tree_margins(TREE, controller, PERIOD, speed=1.5)
    assert own.stable
    assert tree.stable
    assert tree.radius == pytest.approx(own.radius, rel=1e-9)
    assert tree.gain_db[0] == pytest.approx(own.gain_db, abs=5e-3)
    assert tree.delay[0] == pytest.approx(own.delay, abs=2e-5)
    assert tree.gain_together_db == pytest.approx(tree.gain_db[0], abs=2e-3)
    assert tree.delay_together == pytest.approx(tree.delay[0], abs=2e-5)


def test_dead_times_of_each_input_are_exact():
    plant = worn_orthosis(KNEE)
    one, other = sampled(plant, PERIOD, 0.0047), sampled_each(plant, PERIOD, [0.0047, 0.0047])
    first, second = (x.c @ np.linalg.matrix_power(x.a, 9) @ x.b for x in (one, other))
    np.testing.assert_allclose(second, first, rtol=1e-9, atol=1e-12)
    uneven = sampled_each(plant, PERIOD, [0.0047, 0.001])
    late = sampled(plant, PERIOD, 0.001)
    made = uneven.c @ np.linalg.matrix_power(uneven.a, 9) @ uneven.b
    np.testing.assert_allclose(made[:, 0], first[:, 0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(made[:, 1], (late.c @ np.linalg.matrix_power(late.a, 9) @ late.b)[:, 1], atol=1e-12)


def test_joints_that_nothing_couples_have_the_margins_of_each_alone():
    both = pair(apart=True)
    gain = np.diag([3.0, 4.0])
    found = tree_margins(both, proportional(gain), PERIOD)
    for k in range(2):
        one = TreeCoupling(**{
            name: value if name == "delay" else (value[k, k] if value.ndim == 2 else value[k])
            for name, value in vars(both).items()
        })  # fmt: skip
        alone = tree_margins(one, proportional(gain[k : k + 1, k : k + 1]), PERIOD)
        assert found.gain_db[k] == pytest.approx(alone.gain_db[0], abs=5e-3)
        assert found.delay[k] == pytest.approx(alone.delay[0], abs=5e-5)
    assert found.gain_together_db == pytest.approx(found.gain_db.min(), abs=5e-3)
    assert found.delay_together == pytest.approx(found.delay.min(), abs=5e-5)


def test_margins_of_coupled_joints_are_where_the_closed_loop_leaves_the_circle():
    both, controller = pair(apart=False), proportional(np.array([[3.0, 0.3], [0.3, 4.0]]))
    found = tree_margins(both, controller, PERIOD)
    plant = worn_tree(both)
    plant = LinearSystem(plant.a, plant.b[:, :2], plant.c[:2], plant.d[:2, :2])
    held = sampled_each(plant, PERIOD, [0.002, 0.002])
    for which, decibel in (((1, 0), found.gain_db[0]), ((0, 1), found.gain_db[1]), ((1, 1), found.gain_together_db)):
        for more, unstable in ((-0.05, False), (0.05, True)):
            factors = np.where(which, 10 ** ((decibel + more) / 20), 1.0)
            assert (radius(closed_tree(held, controller, factors)) >= 1.0) == unstable
    for which, delay in (((1, 0), found.delay[0]), ((0, 1), found.delay[1]), ((1, 1), found.delay_together)):
        for more, unstable in ((-2e-4, False), (2e-4, True)):
            late = sampled_each(plant, PERIOD, 0.002 + (delay + more) * np.array(which))
            assert (radius(closed_tree(late, controller)) >= 1.0) == unstable


def test_one_input_s_closed_loop_is_that_of_one_joint():
    plant, controller = worn_orthosis(KNEE), proportional(np.array([[2.0]]))
    plant = LinearSystem(plant.a, plant.b[:, :1], plant.c[:1], plant.d[:1, :1])
    held = sampled(plant, PERIOD, 0.0)
    np.testing.assert_array_equal(closed_tree(held, controller, np.ones(1)), closed_loop(held, controller))


def test_a_robot_without_a_law_is_passive_and_one_that_is_driven_is_not():
    both = pair(apart=False)
    assert passivity(both, proportional(np.zeros((2, 2))), PERIOD).shortage == 0.0
    # A positive feedback of position is a negative spring: passive in no frequency where it outweighs damping by lag.
    driven = passivity(both, proportional(np.diag([5.0, 5.0])), PERIOD, speed=10.0)
    assert driven.shortage > 0.0
    assert np.isfinite(driven.below)


def test_the_least_over_limbs_is_no_more_than_with_each():
    both, controller = pair(apart=False), proportional(np.diag([3.0, 3.0]))
    rows = list(margins_over({"down": both}, {"down": controller}, PERIOD, limbs=DRAWN_LIMBS[:3]))
    least = least_margins(rows)
    assert all((least.gain_db <= row.margins.gain_db).all() for row in rows)
    assert least.delay_together == min(row.margins.delay_together for row in rows)
    stiff = with_limb(both, DRAWN_LIMBS[4])
    assert (np.diag(stiff.limb_slope) == np.diag(both.limb_slope) + 40.0).all()


def test_what_is_no_robot_is_refused():
    with pytest.raises(PellucidError, match="not positive definite"):
        replace(pair(apart=True), mass=np.diag([1.0, -1.0]))
    with pytest.raises(PellucidError, match="expected 2, 4 or 6"):
        tree_margins(pair(apart=True), proportional(np.ones((1, 1))), PERIOD)
