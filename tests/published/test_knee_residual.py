"""The residual compensator on the virtual orthosis: half the strap's torque at most, no sway, and a safe way back."""

import numpy as np
import pytest

from pellucid.controllers.residual_compensator import Law
from pellucid.controllers.worn import WornCompensator
from pellucid.lab.knee_protocol import Faults, KneeTrial
from pellucid.lab.knee_rig import NAMES, knee_orthosis
from pellucid.lab.knee_trial import run_trial
from pellucid.lab.knee_wearer import relaxed
from pellucid.published.knee_cards import simulated_cards
from pellucid.published.knee_residual import compare_controllers, for_wearer, root_mean_square, swing

CORE = {
    "orthosis_inertia": "orthosis_inertia",
    "orthosis_viscous": "bearing_viscous",
    "orthosis_gravity": "gravity_sine",
    "coulomb": "bearing_coulomb",
    "limb_inertia": "limb_inertia",
    "limb_viscous": "limb_viscous",
    "limb_gravity": "limb_gravity",
    "strap_stiffness": "strap_stiffness",
    "strap_damping": "strap_damping",
}


@pytest.fixture(scope="module")
def rig():
    return knee_orthosis()


@pytest.fixture(scope="module")
def cards(rig):
    """As an identification leaves them: the rig's bodies with errors, the rest from simulated recordings."""
    rng = np.random.default_rng(3)
    spread = {"orthosis_gravity": 0.005, "limb_gravity": 0.01, "orthosis_inertia": 0.02, "limb_inertia": 0.05}
    bodies = {}
    for name in ("S1", "S3"):
        plant = dict(zip(NAMES, rig.plant(rig.subjects[name]), strict=True))
        bodies[name] = {
            key: float(plant[core] * np.exp(spread.get(key, 0.1) * rng.standard_normal())) for key, core in CORE.items()
        }
    return simulated_cards(rig, ("S1", "S3"), bodies, 12)


def test_the_actuator_is_found_from_its_own_sines(rig, cards):
    found, loop, motor = cards["S1"].coupling, rig["torque_loop"], rig["actuator"]
    share = 1 + loop["kp"]
    assert found.actuator_inertia == pytest.approx(motor["inertia"] / share, rel=0.05)
    assert found.actuator_leak == pytest.approx(loop["ki"] / share, rel=0.15)
    assert found.actuator_frequency == pytest.approx(np.sqrt(170.0 * share / motor["inertia"]), rel=0.05)
    assert 4.0 / share < found.actuator_coulomb < 1.5 * 4.0 / share  # the gear's losses under load count as Coulomb


def test_the_strap_carries_less_than_half_within_the_margins(rig, cards):
    rows = compare_controllers(
        rig, cards, ("S1", "S3"), (31,), duration=14.0, only=("residual compensator", "disturbance observer", "fuzzy")
    )
    by = {(row.controller, row.subject): row for row in rows}
    for subject in ("S1", "S3"):
        row = by["residual compensator", subject]
        assert row.ratio < 0.5
        assert row.gain_db >= 6
        assert row.delay >= 0.020
        assert row.fault == "none"
        assert row.strap_torque < by["disturbance observer", subject].strap_torque
        assert row.strap_torque < by["fuzzy", subject].strap_torque
        assert by["zero impedance", subject].ratio == 1


def test_a_relaxed_wearer_is_not_swayed(rig, cards):
    """No limit cycle: a leg let go from half a radian comes to rest, and stays there."""
    made = for_wearer(cards["S1"].coupling, rig.period, Law())
    controller = WornCompensator(made, cards["S1"].emg)
    trial = KneeTrial("let_go", "free_swing", "fit", "torque", np.zeros(6000), start=0.5)
    taken = run_trial(rig, relaxed(rig.subjects["S1"]), trial, rng=np.random.default_rng(5), controller=controller)
    speed = np.abs(taken.truth.limb_velocity)
    assert controller.fault == "none"
    assert np.abs(taken.truth.limb_position[-1500:]).max() < 0.25
    assert np.sqrt(np.mean(speed[-1500:] ** 2)) < 0.05


def test_detached_electrodes_leave_what_needs_none(rig, cards):
    made = for_wearer(cards["S1"].coupling, rig.period, Law())
    plain = root_mean_square(swing(rig, "S1", 32, None, duration=14.0, faults=Faults()))[1]
    controller = WornCompensator(made, cards["S1"].emg)
    faults = Faults(emg_detached={0: 6.0, 1: 6.0})
    taken = swing(rig, "S1", 32, controller, duration=14.0, faults=faults)
    assert controller.fault == "none"
    assert controller.core.estimate[-1] == 0.0  # found by its hum, and faded out
    assert np.abs(taken.command).max() < 10
    assert root_mean_square(taken)[1] < plain
