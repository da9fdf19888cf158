"""What gate and supervisor would have made of another lab's log: where it stops, what is cut, what energy flowed."""

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.live.log_verdict import ASSUMED_RATES_HZ, given_energy, judge_log, largest_gift

LIMITS = pl.Limits(effort=5.0, rate=300.0, velocity=8.0, position=(-0.5, 2.6))
TIME = np.arange(0.0, 4.0, 0.005)
ANGLE = 0.8 + 0.3 * np.sin(2.0 * TIME)


def test_a_quiet_log_passes():
    (verdict,) = judge_log(ANGLE, 0.5 * np.cos(2.0 * TIME), time=TIME, limits=LIMITS)
    assert (verdict.stopped_at, verdict.fault, verdict.cut) == (None, "none", 0)
    assert verdict.rate == pytest.approx(200.0)
    assert not verdict.is_rate_assumed
    assert "would not have stopped" in verdict.sentence()


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (lambda q, u: q.__setitem__(300, q[300] + 0.4), "overspeed"),
        (lambda q, u: q.__setitem__(slice(300, None), np.nan), "not_finite"),
        (lambda q, u: u.__setitem__(300, np.inf), "not_finite"),
    ],
)
def test_a_fault_is_found_at_its_sample(spoil, fault):
    angle, torque = ANGLE.copy(), 0.5 * np.cos(2.0 * TIME)
    spoil(angle, torque)
    (verdict,) = judge_log(angle, torque, time=TIME, limits=LIMITS)
    assert (verdict.stopped_at, verdict.fault, verdict.response) == (300, fault, "no power")
    assert f"at sample 300 of {len(TIME)}" in verdict.sentence()


def test_a_joint_that_leaves_its_range_stops():
    angle = np.linspace(0.0, 4.0, len(TIME))
    (verdict,) = judge_log(angle, np.zeros(len(TIME)), time=TIME, limits=LIMITS)
    assert verdict.fault == "range"
    assert LIMITS.position[1] < angle[verdict.stopped_at] < LIMITS.position[1] + 0.2


def test_what_the_gate_would_have_cut_is_counted():
    torque = 0.5 * np.cos(2.0 * TIME)
    torque[100] = 7.7e5
    (verdict,) = judge_log(ANGLE, torque, time=TIME, limits=LIMITS)
    assert (verdict.cut, verdict.first_cut) == (2, 100)  # its step up and its step down
    assert verdict.largest_torque == 7.7e5


def test_energy_needs_no_clock():
    angle = np.array([0.0, 0.1, 0.3, 0.2])
    assert given_energy(angle, np.array([1.0, 1.0, 2.0, 2.0])).tolist() == pytest.approx([0.0, 0.1, 0.4, 0.2])
    assert largest_gift(np.array([0.0, 0.4, -0.6, 0.1, -0.2])) == pytest.approx(0.7)
    assert given_energy(angle, np.array([1.0, np.nan, 2.0, 2.0])).tolist() == pytest.approx([0.0, 0.0, 0.0, -0.2])
    torque = np.cos(2.0 * TIME)
    (known,) = judge_log(ANGLE, torque, time=TIME, limits=LIMITS)
    unknown = judge_log(ANGLE, torque, limits=LIMITS)
    assert [one.rate for one in unknown] == list(ASSUMED_RATES_HZ)
    assert all(one.is_rate_assumed and "the log has no clock" in one.sentence() for one in unknown)
    assert {one.largest_gift for one in unknown} == {known.largest_gift}


def test_energy_before_and_after_a_stop_add_up():
    angle = ANGLE.copy()
    angle[300] += 0.4
    torque = np.cos(2.0 * TIME)
    (verdict,) = judge_log(angle, torque, time=TIME, limits=LIMITS)
    total = given_energy(angle, torque)
    assert verdict.energy_before == pytest.approx(total[300])
    assert verdict.energy_before + verdict.energy_after == pytest.approx(total[-1])


def test_arrays_that_do_not_belong_together_are_refused():
    with pytest.raises(PellucidError, match="expected one number a sample of both"):
        judge_log(ANGLE, TIME[:-1], limits=LIMITS)
    with pytest.raises(PellucidError, match="a time that does not increase"):
        judge_log(ANGLE, ANGLE, time=TIME[::-1], limits=LIMITS)


def test_logs_of_a_worn_elbow_suit_are_judged(data_folder):
    """Three people wore it; its path came from EMG, and the torque asked of it is beyond anything believable."""
    root = data_folder / "elbow_exosuit"
    if not root.exists():
        pytest.skip("public recordings: elbow_exosuit is not here")
    table = np.genfromtxt(root / "emg_threshold/P1/trial_1.csv", delimiter=",", names=True)
    angle = np.deg2rad(table["Desired_Position_deg"]) - table["Position_Error_rad"]
    asked = table["Feedforward_Torque_Nm"] + table["Feedback_Torque_Nm"]
    for verdict in judge_log(angle, asked, limits=LIMITS):
        assert verdict.stopped_at is not None
        assert verdict.stopped_at <= 10
        assert verdict.largest_torque > 7e5
        assert verdict.cut > 200
