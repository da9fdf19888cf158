"""How `init` reads logs that encode, scale, name or sign their numbers in the ways of real loggers."""

import tomllib
from itertools import pairwise

import numpy as np
import pytest

from pellucid._errors import StudyError
from pellucid.files.name_evidence import read_name
from pellucid.files.readers import read_columns
from pellucid.start.assumptions import assumptions_of
from pellucid.start.given_files import read_given
from pellucid.start.inference.clocks import find_clock_period
from pellucid.start.inference.encodings import find_encoding
from pellucid.start.inference.joint_keys import joint_keys, matching_joint
from pellucid.start.propose_study import propose_study, require_agreeing_units
from pellucid.start.study_text import study_text

RATE = 100.0
T = np.arange(3000) / RATE
RNG = np.random.default_rng(7)


def swing(seed=0, size=1.0):
    """Return angle, speed and effort of a joint whose effort is written here, and not by the package."""
    rng = np.random.default_rng(seed)
    w, phase = 2.0 * np.pi * np.array([0.13, 0.41, 0.97, 1.6]), rng.uniform(0.0, 6.0, 4)
    sizes = size * np.array([0.7, 0.35, 0.15, 0.05])
    angle = np.outer(T, w) + phase
    q, v, a = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * w), -np.sin(angle) @ (sizes * w**2)
    effort = 0.05 * a + 2.0 * np.sin(q) + 0.1 * v + 0.2 * np.sign(v)
    return q, v, effort + 0.005 * rng.standard_normal(len(T))


def proposed(tmp_path, header, columns, answers=None, before=""):
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=before + header, comments="", fmt="%.8g")
    return propose_study(read_given([path]), "made", answers)


def roles_of(proposal):
    return {role.column: role for role in proposal.main.roles.roles}


@pytest.mark.parametrize("period", [2.0**15, 2.0**32, 86400.0, 12345.0])
def test_a_clock_that_starts_again_has_its_period(period):
    step = period / 700.0
    stored = (step * np.arange(2500) + 0.3 * period) % period
    assert find_clock_period(stored) == pytest.approx(period, rel=1e-3)
    assert find_clock_period(step * np.arange(2500)) is None


def test_the_sign_of_a_count_is_decoded_by_the_motion_across_zero():
    q, _, _ = swing()
    counts = np.round(q * 4096 / (2.0 * np.pi))
    for stored, keys in (
        (np.abs(counts) + 32768.0 * (counts < 0.0), {"sign_bit": 15}),
        (np.abs(counts) + 1024.0 * (counts < 0.0), {"sign_bit": 10}),
        (counts % 65536.0, {"signed_bits": 16}),
    ):
        found = find_encoding(stored)
        assert found is not None
        assert found.keys == keys
        np.testing.assert_array_equal(found.values, counts)
    assert find_encoding(counts + 2048.0) is None


def test_an_angle_that_rolls_over_is_unwrapped_and_a_trigger_is_not():
    q, _, _ = swing(size=3.0)
    for period, unit in ((360.0, "deg"), (2.0 * np.pi, "rad"), (1.0, "turn")):
        whole = q * period / (2.0 * np.pi)
        found = find_encoding(whole % period)
        assert found is not None
        assert str(found.keys["wrap"]).endswith(unit)
        np.testing.assert_allclose(np.diff(found.values), np.diff(whole), atol=1e-9)
    assert find_encoding((np.sin(3.0 * T) > 0.0).astype(float)) is None


def test_joints_are_told_by_the_words_in_which_columns_differ():
    keys = joint_keys(["position.torso_lift_joint", "position.arm_1_joint", "position.arm_2_joint"])
    assert [key.text for key in keys.values()] == ["torso_lift_joint", "arm_1_joint", "arm_2_joint"]
    assert matching_joint("effort.arm_2_joint", keys) == "position.arm_2_joint"
    assert joint_keys(["motor_position", "output_position"]) == {}


def test_names_of_joints_of_robots_are_no_joints_of_people(tmp_path):
    (q, v, tau), (q2, v2, tau2) = swing(1), swing(2)
    header = ",".join(["time", *(f"/arm/{j}/{x}" for j in ("hip", "knee") for x in ("position", "velocity", "effort"))])
    proposal = proposed(tmp_path, header, [T, q, v, tau, q2, v2, tau2])
    assert not proposal.is_person
    assert proposal.main.roles.joints == ("hip", "knee")


def test_a_speed_without_a_unit_gets_one_from_the_position(tmp_path):
    q, v, tau = swing()
    proposal = proposed(tmp_path, "time [s],angle [rad],speed,torque [Nm]", [T, q, np.round(-37.5 * v, 4), tau])
    speed = roles_of(proposal)["speed"]
    assert speed.unit == "rad/s"
    assert speed.keys["sign"] == -1
    assert float(speed.keys["scale"]) == pytest.approx(1.0 / 37.5, rel=0.02)


def test_a_speed_with_a_unit_tells_the_counts_of_a_turn(tmp_path):
    q, v, tau = swing()
    columns = [T, np.round(q * 16384 / (2.0 * np.pi)), v * 30.0 / np.pi, tau]
    proposal = proposed(tmp_path, "time [s],position [inc],speed [rpm],torque [Nm]", columns)
    position = roles_of(proposal)["position [inc]"]
    assert (position.unit, position.keys["counts_per_turn"]) == ("counts", 16384)
    assert "counts_per_turn" not in {question.key for question in proposal.asked}


def test_an_effort_against_the_motion_has_the_other_sign(tmp_path):
    q, v, tau = swing()
    for sign in (1.0, -1.0):
        proposal = proposed(tmp_path, "time [s],q [rad],dq [rad/s],torque [Nm]", [T, q, v, sign * tau])
        assert roles_of(proposal)["torque [Nm]"].keys.get("sign", 1) == sign
        assert any("sign is reversed" in remark for remark in proposal.remarks) == (sign < 0.0)


def test_a_share_of_a_rated_torque_has_its_unit_if_the_file_states_that(tmp_path):
    q, v, tau = swing()
    columns = [T, q, v, tau / 1.3 * 1000.0]
    header = "time [s],position [rad],velocity [rad/s],torque actual value [‰]"
    role = roles_of(proposed(tmp_path, header, columns, before="# rated torque: 1.3 Nm\n# \n"))[header.split(",")[3]]
    assert (role.quantity, role.unit) == ("torque", "N*m")
    assert float(role.keys["scale"]) == pytest.approx(0.0013)
    unknown = proposed(tmp_path, header, columns)
    assert "rated" in {question.key for question in unknown.asked}
    assert roles_of(unknown)[header.split(",")[3]].quantity == "current"
    said = proposed(tmp_path, header, columns, {"rated": "1.3 N*m"})
    assert roles_of(said)[header.split(",")[3]].quantity == "torque"


def test_both_sides_of_a_gear_stay_apart(tmp_path):
    q, v, tau = swing()
    header = "time,motor_position,motor_velocity,output_position,output_velocity,output_torque"
    proposal = proposed(tmp_path, header, [T, 9.0 * q, 9.0 * v, q, v, tau])
    roles = roles_of(proposal)
    assert roles["output_position"].quantity == "position"
    assert roles["output_velocity"].quantity == "velocity"
    assert roles["output_velocity"].keys.get("scale", 1.0) == 1.0
    assert "gear_turns" not in {question.key for question in proposal.asked}


def test_a_machine_beside_emg_is_no_joint_of_a_person(tmp_path):
    q, _, tau = swing()
    emg = 0.05 * RNG.standard_normal((2, len(T)))
    header = "time [s],Goniometer [rad],Torque [Nm],EMG Biceps [mV],EMG Triceps [mV]"
    proposal = proposed(tmp_path, header, [T, q, tau, *emg])
    assert (proposal.is_person, proposal.drive, proposal.is_worn) == (False, "torque", True)


def test_topics_that_leave_each_others_cells_empty_have_rows_of_their_own(tmp_path):
    lines = ["__time,/joint/position,/battery/voltage"]
    for i in range(200):
        lines.append(f"{0.01 * i:.4f},{np.sin(0.05 * i):.6f},")
        if i % 3 == 0:
            lines.append(f"{0.01 * i + 0.003:.4f},,{48.0 - 0.001 * i:.4f}")
    (tmp_path / "export.csv").write_text("\n".join(lines) + "\n")
    values = read_columns(tmp_path / "export.csv").values
    assert [len(values[name]) for name in ("__time", "/joint/position")] == [200, 200]
    assert [len(values[name]) for name in ("__time 2", "/battery/voltage")] == [67, 67]
    assert all(np.isfinite(x).all() for x in values.values())


def test_lost_samples_of_one_channel_part_no_rows(tmp_path):
    x = np.column_stack([0.01 * np.arange(200), np.sin(0.05 * np.arange(200)), np.cos(0.05 * np.arange(200))])
    x[40:60, 2] = np.nan
    np.savetxt(tmp_path / "log.csv", x, delimiter=",", header="time,q,tau", comments="")
    values = read_columns(tmp_path / "log.csv").values
    assert list(values) == ["time", "q", "tau"]
    assert {len(column) for column in values.values()} == {200}


def test_a_unit_stands_before_the_joint_in_a_dotted_name():
    for name, quantity, unit in (
        ("velocity_rad_s.pan", "velocity", "rad/s"),
        ("position_deg.tilt", "position", "deg"),
        ("tau_N.m", "torque", "N*m"),
    ):
        found = read_name(name)
        assert (found.quantity, found.unit) == (quantity, unit)


def test_a_droop_in_pulses_is_no_speed(tmp_path):
    q, v, tau = swing()
    columns = [T, v * 30.0 / np.pi, 100.0 * tau, np.round(q * 2**22 / (2.0 * np.pi)), np.round(4000.0 * v)]
    header = "Time [s],Motor speed [r/min],Torque [Nm],Cumulative feedback pulses [pulse],Droop pulses [pulse]"
    roles = roles_of(proposed(tmp_path, header, columns))
    assert roles["Motor speed [r/min]"].quantity == "velocity"
    assert roles["Droop pulses [pulse]"].quantity != "velocity"
    assert roles["Cumulative feedback pulses [pulse]"].keys["counts_per_turn"] == 2**22


def test_the_dead_band_follows_the_counts_of_a_turn(tmp_path):
    q, v, tau = swing()
    bands = {}
    for bits in (12, 22):
        path = tmp_path / f"log_{bits}.csv"
        columns = [T, np.round(q * 2**bits / (2.0 * np.pi)), v * 30.0 / np.pi, tau]
        header = "Time [s],position [inc],speed [rpm],torque [Nm]"
        np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.8g")
        proposal = propose_study(read_given([path]), "made")
        text = study_text(proposal, {id(recording.table): "log.csv" for recording in proposal.recordings})
        bands[bits] = float(tomllib.loads(text)["processing"]["dead_band"].split()[0])
    assert 0.0 < bands[22] <= 1.05 * bands[12] < 0.5


def test_a_place_in_a_list_is_no_unit_and_a_motors_speed_leaves_the_counts_open(tmp_path):
    assert [read_name(name).unit for name in ("actuators[1].torque", "q[1]", "duty [1]")] == [None, None, "1"]
    assert read_name("トルク[kgf・cm]").unit == "kgf*cm"
    q, v, tau = swing()
    columns = [T, np.round(51.0 * q * 4096 / (2.0 * np.pi)), 51.0 * v * 30.0 / np.pi, tau]
    header = "Time [s],position [inc],speed [rpm],torque [Nm]"
    assert "counts_per_turn" in {question.key for question in proposed(tmp_path, header, columns).asked}
    answered = proposed(tmp_path, header, columns, {"counts_per_turn": str(51 * 4096)})
    assert answered.gravity == "sine+cosine"


@pytest.mark.parametrize(("stated", "meant", "factor"), [("deg", "rad", 1.0), ("rad", "deg", 180.0 / np.pi)])
def test_a_stated_unit_that_the_weight_refutes_is_an_error_that_names_it(tmp_path, stated, meant, factor):
    q, _, tau = swing()
    header = f"time [s],angle [{stated}],torque [Nm]"
    proposal = proposed(tmp_path, header, [T, factor * q, tau])
    assert roles_of(proposal)[f"angle [{stated}]"].fitting_unit == meant
    with pytest.raises(StudyError, match=rf'angle \[{stated}\].*found the unit "{stated}".*position_unit={meant}'):
        require_agreeing_units(proposal)
    answered = proposed(tmp_path, header, [T, factor * q, tau], {"position_unit": meant})
    require_agreeing_units(answered)
    assert roles_of(answered)[f"angle [{stated}]"].unit == meant
    right = proposed(tmp_path, f"time [s],angle [{meant}],torque [Nm]", [T, factor * q, tau])
    assert not roles_of(right)[f"angle [{meant}]"].fitting_unit
    require_agreeing_units(right)


def test_a_supply_is_told_from_what_drives(tmp_path):
    q, _, tau = swing()
    volts = 7.4 + 0.3 * np.sin(3.0 * T) + 0.05 * RNG.standard_normal(len(T))
    duty = np.round(885.0 * tau / 6.0)
    proposal = proposed(tmp_path, "time [s],position [rad],duty,input_volts", [T, q, duty, volts])
    quantities = {column: role.quantity for column, role in roles_of(proposal).items()}
    assert quantities["input_volts"] == "supply"
    assert quantities["duty"] == "duty"
    assert proposal.drive == "voltage"


def test_a_torque_that_no_joint_has_is_in_a_smaller_unit(tmp_path):
    q, _, tau = swing()
    role = roles_of(proposed(tmp_path, "t,q,tau", [T, q, 1000.0 * tau]))["tau"]
    assert (role.quantity, role.unit, role.unit_is_certain) == ("torque", "mN*m", False)


def test_a_reversed_effort_is_among_the_assumptions(tmp_path):
    q, _, tau = swing()
    for header in ("t,q,tau", "time [s],q [rad],torque [Nm]"):
        proposal = proposed(tmp_path, header, [T, q, -tau])
        files = {id(r.table): "log.csv" for r in proposal.recordings}
        told = [a.sentence for a in assumptions_of(proposal, study_text(proposal, files))]
        assert any("its sign is reversed" in sentence for sentence in told)


def test_a_sweep_is_held_out_by_pieces_and_an_even_motion_at_its_end(tmp_path):
    q, _, tau = swing()
    even = proposed(tmp_path, "time [s],q [rad],torque [Nm]", [T, q, tau])
    assert [r.use for r in even.recordings] == ["fit", "validate"]
    sweep = 0.5 * np.sin(2.0 * np.pi * (0.1 + 0.03 * T) * T)
    swept = proposed(tmp_path, "time [s],q [rad],torque [Nm]", [T, sweep, np.gradient(np.gradient(sweep, T), T)])
    assert [r.use for r in swept.recordings] == ["fit", "validate"] * 3 + ["fit"]
    windows = [r.window for r in swept.recordings]
    assert all(a[1] == b[0] for a, b in pairwise(windows))
    assert (windows[0][0], windows[-1][1]) == (0.0, pytest.approx(T[-1] + 1.0 / RATE))
    held_out = sum(b - a for (a, b), r in zip(windows, swept.recordings, strict=True) if r.use == "validate")
    assert held_out == pytest.approx(T[-1] / 3.0)
    assert "in 7 parts" in swept.summary
