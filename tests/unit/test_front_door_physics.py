"""Logs whose numbers contradict what their names and headers say: physics must ask, refuse or doubt."""

import numpy as np
import pytest
from test_front_door_logs import COULOMB, GRAVITY, INERTIA, proposed, roles_of, swing, written

import pellucid as pl
from pellucid.start.propose_study import require_possible_clock
from pellucid.start.study_text import defaults_of
from pellucid.start.try_log import try_log
from pellucid.start.try_page import parameter_rows

GEAR = 80.0


def parameters_of(tried):
    return {p.name: p for joint in tried.joints for p in joint.parameters}


def geared_log(path, *names, speed=GEAR):
    """Write a log of a joint's angle [deg] with its motor's speed [rpm] and torque, by the names that are given."""
    t, q, v, tau = swing()
    columns = [t, np.degrees(q), speed * v * 30.0 / np.pi, tau / GEAR]
    chosen = [c for c, name in zip(columns, names, strict=True) if name]
    return written(path, ",".join(name for name in names if name), chosen)


@pytest.mark.parametrize(
    ("names", "default"),
    [
        (("Time [s]", "Joint Angle [deg]", "Motor Speed [rpm]", "Motor Torque [Nm]"), "80"),
        (("Time [s]", "Joint Angle [deg]", "", "Motor Torque [Nm]"), "1"),
        (("Time [s]", "Angle [deg]", "Speed [rpm]", "Torque [Nm]"), "1"),
    ],
)
def test_a_torque_before_a_gear_is_asked_for(tmp_path, names, default):
    path = geared_log(tmp_path / "log.csv", *names)
    asked = {question.key: question.default for question in proposed(path).asked}
    assert asked["gear_turns"] == default
    torque = next(r for r in proposed(path, gear_turns="80").main.channels if r.quantity == "torque")
    assert torque.keys["scale"] == GEAR


def test_a_gear_that_nobody_stated_is_no_plain_yes(tmp_path):
    path = geared_log(tmp_path / "log.csv", "Time [s]", "Joint Angle [deg]", "", "Motor Torque [Nm]")
    answer = try_log([path], out=tmp_path / "page").answer
    assert answer.badge == "Yes (scale not confirmed)"
    assert "assumed: motor turns per turn of the joint = " in answer.sentence
    tried = try_log([path], out=tmp_path / "sure", answers={"gear_turns": "80"})
    assert tried.answer.badge == "Yes"
    found = parameters_of(tried)
    assert found["inertia"].value == pytest.approx(INERTIA, rel=0.05)
    assert found["gravity"].value == pytest.approx(GRAVITY, rel=0.05)


def test_a_motors_speed_beside_a_joints_torque_is_no_doubt(tmp_path):
    names = ("Time [s]", "Joint Angle [deg]", "Motor Speed [rpm]", "Joint Torque [Nm]")
    found = proposed(geared_log(tmp_path / "log.csv", *names))
    assert "gear_turns" not in {question.key for question in found.asked}
    velocity = next(r for r in found.main.channels if r.quantity == "velocity")
    assert float(velocity.keys["scale"]) == pytest.approx(1.0 / GEAR, rel=0.02)


def test_a_speed_of_the_joint_shows_no_gear(tmp_path):
    names = ("Time [s]", "Angle [deg]", "Speed [rpm]", "Motor Torque [Nm]")
    found = proposed(geared_log(tmp_path / "log.csv", *names, speed=1.0))
    assert "gear_turns" not in {question.key for question in found.asked}


@pytest.mark.parametrize(("head", "factor", "right"), [("time [s]", 1e3, "ms"), ("time [ms]", 1.0, "s")])
def test_a_clock_by_which_no_joint_could_move_is_refused(tmp_path, head, factor, right):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", f"{head},angle [rad],torque [Nm]", [factor * t, q, tau])
    with pytest.raises(pl.PellucidError, match=rf'"{right}".*time_unit={right}'):
        try_log([path], out=tmp_path / "page")
    tried = try_log([path], out=tmp_path / "sure", answers={"time_unit": right})
    assert parameters_of(tried)["inertia"].value == pytest.approx(INERTIA, rel=0.05)


def test_a_slow_log_of_a_slow_joint_keeps_its_clock(tmp_path):
    t, q, v, _ = swing(rate=20.0)
    weight = GRAVITY * np.sin(q) + COULOMB * np.tanh(v / 0.01)
    tau = weight + 0.05 * np.random.default_rng(4).standard_normal(len(t))
    path = written(tmp_path / "log.csv", "time [s],angle [rad],torque [Nm]", [20.0 * t, q, tau])
    require_possible_clock(proposed(path))


def test_the_lab_may_not_say_what_is_no_unit_of_time(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", "time [s],angle [rad],torque [Nm]", [t, q, tau])
    with pytest.raises(pl.PellucidError, match='found "deg"'):
        proposed(path, time_unit="deg")


def sprung_limb(seed=7, seconds=40.0, rate=200.0):
    """Return time, angle [rad] and torque of a joint with the spring of a limb, over some 70 deg."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    q, v, a = np.full(len(t), 0.85), np.zeros(len(t)), np.zeros(len(t))
    for f, size, phase in zip((0.21, 0.43, 0.9), (0.35, 0.18, 0.08), rng.uniform(0.0, 6.0, 3), strict=True):
        w = 2.0 * np.pi * f
        q += size * np.sin(w * t + phase)
        v += size * w * np.cos(w * t + phase)
        a -= size * w**2 * np.sin(w * t + phase)
    tau = 0.155 * a + 4.5 * np.sin(q) + 4.0 * (q - 0.9) + 0.7 * v + 0.3 * np.tanh(v / 0.01)
    return t, q + 5e-5 * rng.standard_normal(len(t)), tau + 0.02 * rng.standard_normal(len(t))


@pytest.mark.parametrize("worn", ["no", "yes"])
def test_a_worn_joint_has_its_limbs_spring_and_says_so(tmp_path, worn):
    t, q, tau = sprung_limb()
    path = written(tmp_path / "log.csv", "time_s,elbow_deg,actuator_torque_Nm", [t, np.degrees(q), tau])
    tried = try_log([path], out=tmp_path / "page", answers={"worn": worn})
    found = parameters_of(tried)
    gravity = found["gravity"]
    assert abs(gravity.value - 4.5) < 3.0 * gravity.standard_error
    assert found["parallel_stiffness"].value == pytest.approx(4.0, rel=0.25)
    said = "machine and limb together"
    assert (said in tried.answer.badge) == (said in parameter_rows(tried)[0][0]) == (worn == "yes")
    assert (said in tried.page.read_text()) == (worn == "yes")


def test_a_measured_current_comes_before_a_commanded_torque(tmp_path):
    t, q, v, tau = swing()
    model = INERTIA * np.gradient(v, t)
    path = written(
        tmp_path / "log.csv", "t,actual_q [rad],actual_current [A],target_moment [Nm]", [t, q, tau / 3, model]
    )
    found = proposed(path)
    assert found.drive == "current"
    assert {question.key for question in found.asked}.isdisjoint({"command_followed"})
    assert roles_of(found)["target_moment [Nm]"] == ("desired_torque", "N*m")


def test_a_current_that_explains_nothing_replaces_no_command(tmp_path):
    t, q, _, tau = swing()
    noise = 2.0 + 0.1 * np.random.default_rng(1).standard_normal(len(t))
    path = written(tmp_path / "log.csv", "t,q [rad],actual_current [A],target_moment [Nm]", [t, q, noise, tau])
    assert "command_followed" in {question.key for question in proposed(path).asked}


def test_a_command_that_is_not_delivered_is_no_effort(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", "t_s,q_rad,tau_cmd_Nm", [t, q, tau])
    with pytest.raises(pl.PellucidError, match=r"no effort was recorded.*tau_cmd_Nm"):
        try_log([path], out=tmp_path / "no", answers={"command_followed": "no"})
    with pytest.raises(pl.PellucidError, match=r'found "maybe", expected yes or no'):
        proposed(path, command_followed="maybe")
    # Who is not certain confirms nothing.
    open_one = proposed(path, command_followed="not certain")
    assert "command_followed" in {each.subject for each in defaults_of(open_one)}


@pytest.mark.parametrize("span", [0.8, 1.0])
def test_an_effort_that_only_carries_the_weight_is_of_no_machine(tmp_path, span):
    t, q, _, _ = swing(seconds=30.0)
    q = span * q
    tau = 4.0 * np.sin(q) + 0.02 * np.random.default_rng(1).standard_normal(len(t))
    tried = try_log([written(tmp_path / "log.csv", "t_s,q_rad,tau_Nm", [t, q, tau])], out=tmp_path / "page")
    assert tried.answer.verdict == "cannot say"
    assert "less than 1 cm from the axis" in tried.answer.reason
