"""Virtual drives obey `enable` by themselves within the time that integrators must keep, whatever was asked of them."""

import numpy as np
import pytest

from pellucid_lab.safety.fault_table import draw_worn_robot
from pellucid_lab.safety.worn_knee import draw_worn_knee

OBEYS = 3.0
"""Periods within which a power stage that is to have no power has none."""


@pytest.fixture(scope="module")
def worn():
    return draw_worn_robot(0, seed=20281101)


@pytest.mark.parametrize(
    ("fault", "why"), [("drive_stuck", "drive_stuck"), ("task_hangs", "watchdog"), ("encoder_nan", "not_finite")]
)
@pytest.mark.parametrize("seed", [2, 3])
def test_an_elbows_drive_has_no_effort_once_it_may_have_none(worn, fault, why, seed):
    """One that is stuck heeds no command: only `enable`, or the watchdog's in its place, can end it."""
    lived = worn.live(worn.law("compensation"), fault, onset=1.5, seconds=1.0, longest=4.0, seed=seed)
    assert (lived["fault"], lived["early"]) == (why, 0)
    assert 0 < lived["safe"] - lived["found"] <= OBEYS
    assert worn.rig.period * OBEYS == pytest.approx(3e-3)
    # Until then it gave what it was stuck at.
    if fault == "drive_stuck":
        assert lived["impulse"] >= 5.0 * worn.rig.period * lived["found"]


def test_a_drive_with_power_stays_stuck(worn):
    """So that the drives above cannot have obeyed anything else."""
    blind = worn.law("compensation", drive_expected=0.0, wearer_torque=np.inf, wearer_push=np.inf, power_limit=np.inf,
                     push_limit=np.inf, budget_store=np.inf, ringing_limit=np.inf,
                     raw_acceleration_limit=np.inf)  # fmt: skip
    lived = worn.live(blind, "drive_stuck", onset=1.5, seconds=0.05, longest=4.0, seed=2)
    assert (lived["fault"], lived["safe"]) == ("none", -1)
    assert lived["impulse"] == pytest.approx(0.05 * 5.0, rel=0.05)


@pytest.mark.parametrize("seed", [2, 3])
def test_a_knees_motor_lets_go_once_it_may_have_no_power(seed):
    """Its spring is stuck at 5 N m either way until then; without power only its motor's friction, 2.6 N m, is left."""
    worn = draw_worn_knee(301)
    plant, acting = worn.start(1500)
    seen, faulty = plant.step(0.0, float("nan")), 0
    for k in range(1400):
        if k == 600:
            plant.begin("drive_stuck", seed)
        muscle = acting.step(k, *seen[:3])
        seen = plant.step(muscle, worn.emg_gain * muscle)
        faulty += plant.fault != "none"
        assert (plant.off >= OBEYS) == (faulty >= OBEYS)
        if faulty == 60:
            break
    assert plant.fault.startswith("drive_")
    assert plant.mode == "latched"
    assert abs(seen[3]) < 3.5
