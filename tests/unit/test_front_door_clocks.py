"""Logs of dashboards, radios and drives, each of which was once read wrongly or refused."""

import warnings

import numpy as np
import pytest
from test_front_door_names import GRAVITY, INERTIA, controlled, proposed, roles_of, swing, written

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.files.delay import _resample
from pellucid.files.name_evidence import read_name
from pellucid.files.readers._wall_clock import stamp_seconds
from pellucid.files.readers.read import read_columns
from pellucid.start.inference.clocks import find_clock, find_clock_period
from pellucid.start.init_from_files import init_from_files
from pellucid.start.try_log import try_log
from pellucid.units import to_si_factor


def cells_of(path, head, columns, units):
    """Write rows whose cells hold units, each chosen by the number, as dashboards print them."""
    rows = [",".join(unit(x) for x, unit in zip(row, units, strict=True)) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    return path


def amperes(x):
    """Return a current as dashboards print it: small ones in milliamperes."""
    return f"{1000.0 * x:.0f} mA" if abs(x) < 1.0 else f"{x:.3f} A"


def currents_of(found):
    """Return the current of a proposal's recording [A]."""
    (role,) = (r for r in found.main.channels if r.quantity == "current")
    return found.main.tables[0].columns[role.column] * to_si_factor(role.unit, "A")[0]


def test_cells_of_one_column_may_have_units_of_several_sizes(tmp_path):
    t, _, q, tau = controlled()
    path = cells_of(
        tmp_path / "grafana.csv", "Time,angle,i_q", (t, q, tau), ("{:.2f} s".format, "{:.4f}°".format, amperes)
    )
    np.testing.assert_allclose(currents_of(proposed(path)), tau, atol=6e-4)


def test_labelled_rows_may_have_units_of_several_sizes(tmp_path):
    t, _, q, tau = controlled()
    lines = [f"t: {a:.2f} s angle: {b:.4f} deg current: {amperes(c)}" for a, b, c in zip(t, q, tau, strict=True)]
    (tmp_path / "monitor.log").write_text("\n".join(lines), encoding="utf-8")
    np.testing.assert_allclose(currents_of(proposed(tmp_path / "monitor.log")), tau, atol=6e-4)


@pytest.mark.parametrize(
    ("motor", "joint"),
    [
        ("电机位置(rad)", "关节角度(rad)"), ("モータ位置[rad]", "関節角度[rad]"), ("모터 위치(rad)", "관절 각도(rad)"),
        ("Position moteur [rad]", "Position articulation [rad]"), ("Motorwinkel [rad]", "Gelenkwinkel [rad]"),
        ("Posizione motore [rad]", "Posizione giunto [rad]"),
    ],
)  # fmt: skip
def test_the_joint_is_told_from_its_motor_in_many_languages(tmp_path, motor, joint):
    t, q, tau = swing()
    path = written(tmp_path / "drive.csv", f"time_s,{motor},{joint},torque_Nm", (t, 36.0 * q, q, tau))
    found = proposed(path)
    assert [r.column for r in found.main.channels if r.quantity == "position"] == [joint]


def test_a_speed_in_counts_has_the_turn_of_its_position(tmp_path):
    t, q, tau = swing(rate=500.0)
    turn = 2**19 / (2.0 * np.pi)
    counts, speed = np.round(turn * q), np.round(turn * np.gradient(q, t))
    columns = (t, counts, speed, np.round(1000.0 * tau / 2.4))
    head = "time_s,0x6064 Position actual value,0x606C Velocity actual value,0x6077 Torque actual value"
    path = tmp_path / "ecat.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.10g")
    by = {r.quantity: r for r in proposed(path).main.channels}
    assert by["position"].keys["counts_per_turn"] == by["velocity"].keys["counts_per_turn"] == 2**19


def test_a_slower_sensor_in_a_faster_table_has_rows_of_its_own(tmp_path):
    t, q, tau = swing(rate=500.0)
    angle = np.where(np.arange(len(t)) % 5 == 0, np.degrees(q), np.nan)
    path = tmp_path / "daq.csv"
    rows = [f"{a:.3f},{'' if np.isnan(b) else f'{b:.5f}'},{c:.5f}" for a, b, c in zip(t, angle, tau, strict=True)]
    path.write_text("\n".join(["time_s,imu_angle_deg,torque_Nm", *rows, ""]), encoding="utf-8")
    found = proposed(path)
    assert roles_of(found) == {"imu_angle_deg": "position", "torque_Nm": "torque"}
    assert found.rate == pytest.approx(100.0)


@pytest.mark.parametrize("share", [0.5, 0.7])
def test_random_losses_are_no_slower_sensor(tmp_path, share):
    t, q, tau = swing(rate=500.0)
    lost = np.random.default_rng(3).random(len(t)) < share
    path = tmp_path / "radio.csv"
    rows = [f"{a:.3f},{'' if x else f'{b:.5f}'},{c:.5f}" for a, b, c, x in zip(t, q, tau, lost, strict=True)]
    path.write_text("\n".join(["time_s,angle_rad,torque_Nm", *rows, ""]), encoding="utf-8")
    assert {len(x) for x in read_columns(path).values.values()} == {len(t)}


def test_a_faster_stream_that_begins_with_the_recording_has_no_missing_end():
    slow, fast = np.arange(0.0, 10.0, 0.01), np.arange(0.0, 9.995, 0.002)
    joined = _resample(fast, np.sin(fast), slow, 0.01, hold=False)
    np.testing.assert_allclose(joined, np.sin(slow), atol=3e-3)


@pytest.mark.parametrize("form", ["{} Run #{}", "Run {1}: {0}"])
def test_runs_beside_each_other_are_recordings_of_one_joint(tmp_path, form):
    path, columns, names = tmp_path / "capstone.csv", [], []
    for run in (1, 2):
        columns += swing(seed=run)
        names += [form.format(name, run) for name in ("Time (s)", "Angle (rad)", "Torque (N·m)")]
    found = proposed(written(path, ",".join(names), columns))
    assert sorted(roles_of(found).values()) == ["position", "torque"]
    assert found.main.roles.joints == ()
    assert len(found.recordings) == 2


@pytest.mark.parametrize(
    ("name", "is_command"),
    [
        ("reference_encoder_deg", False), ("Ref sensor torque [Nm]", False), ("reference_deg", True),
        ("encoder_setpoint", True), ("target encoder", True),
    ],
)  # fmt: skip
def test_what_a_reference_instrument_shows_was_measured(name, is_command):
    assert read_name(name).is_command == is_command


def with_dropouts(share):
    """Return which rows a radio loses, in bursts of 30 rows, shape (RADIO_ROWS,) bool."""
    starts = np.random.default_rng(3).choice(RADIO_ROWS - 30, round(share * RADIO_ROWS / 30), replace=False)
    lost = np.zeros(RADIO_ROWS, bool)
    for start in starts:
        lost[start : start + 30] = True
    return lost


RADIO_ROWS = 15000


def logged_by_radio(path, lost):
    """Write a log whose position and torque are missing together in the rows `lost`, and return its path."""
    t, q, tau = swing(seconds=RADIO_ROWS / 250.0, rate=250.0)
    rows = [f"{a:.3f},," if x else f"{a:.3f},{b:.4f},{c:.4f}" for a, b, c, x in zip(t, q, tau, lost, strict=True)]
    path.write_text("\n".join(["time_s,angle_rad,torque_Nm", *rows, ""]), encoding="utf-8")
    return path


def test_what_a_radio_loses_is_cut_and_the_rest_identified(tmp_path):
    path = logged_by_radio(tmp_path / "wireless.csv", with_dropouts(0.2))
    whole = proposed(logged_by_radio(tmp_path / "whole.csv", with_dropouts(0.0))).processing
    found = proposed(path).processing
    assert whole.cut_share is None
    assert 0.2 <= found.cut_share <= 0.4
    assert found.lowpass == pytest.approx(whole.lowpass, rel=0.5)
    init_from_files(tmp_path / "study", [path])
    assert "cut_share" in (tmp_path / "study" / "study.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("lost", [with_dropouts(1.2), np.arange(RADIO_ROWS) % 1500 < 900], ids=["bursts", "blocks"])
def test_a_log_that_is_mostly_missing_keeps_the_usual_share(tmp_path, lost):
    assert proposed(logged_by_radio(tmp_path / "wireless.csv", lost)).processing.cut_share is None


def test_the_advised_answer_to_a_refuted_unit_also_corrects_the_speed(tmp_path):
    t, q, tau = swing()
    angle, speed = np.degrees(q), np.degrees(np.gradient(q, t))
    path = written(tmp_path / "bench.csv", "time [s],angle [rad],velocity [rad/s],torque [Nm]", (t, angle, speed, tau))
    with pytest.raises(PellucidError, match="position_unit=deg"):
        init_from_files(tmp_path / "refused", [path])
    init_from_files(tmp_path / "study", [path], answers={"position_unit": "deg"})
    assert 'unit = "deg/s"' in (tmp_path / "study" / "study.toml").read_text(encoding="utf-8")


def test_the_number_of_a_row_is_no_clock_beside_coarse_stamps(tmp_path):
    t, q, tau = swing(rate=125.0)
    rows = [f"{i},{3312.4 + a:.2f},{b:.5f},{c:.5f}" for i, (a, b, c) in enumerate(zip(t, q, tau, strict=True))]
    (tmp_path / "rtde.csv").write_text("\n".join([",timestamp,q_rad,torque_Nm", *rows, ""]), encoding="utf-8")
    assert proposed(tmp_path / "rtde.csv").rate == pytest.approx(125.0, rel=0.01)


OSCILLOSCOPE = (
    '"Model Name","DL850E"', '"TraceName","Angle","Torque"', '"BlockSize",2000,2000', '"VUnit","deg","Nm"',
    '"SampleRate",100,100', '"HResolution",0.01,0.01', '"HUnit","s","s"',
)  # fmt: skip


def test_an_oscilloscopes_header_gives_names_units_and_rate(tmp_path):
    _, q, tau = swing()
    rows = [f",{a:.5g},{b:.5g}" for a, b in zip(np.degrees(q), tau, strict=True)]
    (tmp_path / "0001.csv").write_text("\n".join([*OSCILLOSCOPE, *rows, ""]), encoding="utf-8")
    found = proposed(tmp_path / "0001.csv")
    assert {r.column: (r.quantity, r.unit) for r in found.main.channels} == {
        "Angle": ("position", "deg"), "Torque": ("torque", "N*m"),
    }  # fmt: skip
    assert found.rate == pytest.approx(100.0)


def test_a_motion_without_times_or_a_rate_is_no_study(tmp_path):
    _, q, tau = swing()
    path = written(tmp_path / "run.csv", "angle_rad,torque_Nm", (q, tau))
    with pytest.raises(PellucidError, match=r"no sampling rate.*rate=500 Hz"):
        init_from_files(tmp_path / "refused", [path])
    assert {q.key: q.default for q in proposed(path).asked}["rate"] == "unknown"
    assert not (tmp_path / "refused").exists()
    init_from_files(tmp_path / "study", [path], answers={"rate": "100 Hz"})


def in_bursts(path):
    """Write samples of 500 Hz that a serial port delivers eight at a time, with one stamp each time."""
    t, q, tau = swing(rate=500.0)
    late = np.abs(0.002 * np.random.default_rng(5).standard_normal(len(t)))
    stamp = 1772619751.0 + t[7::8].repeat(8) + late[7::8].repeat(8)
    rows = [f"{a:.3f},{b:.5f},{c:.5f}" for a, b, c in zip(stamp, q, tau, strict=True)]
    path.write_text("\n".join(["host_time,angle_rad,torque_Nm", *rows, ""]), encoding="utf-8")
    return path


def test_a_lab_may_say_the_rate_of_samples_that_share_stamps(tmp_path):
    path = in_bursts(tmp_path / "putty.log")
    assert proposed(path).rate == pytest.approx(500.0, rel=0.01)
    found = proposed(path, rate="500 Hz")
    assert found.rate == 500.0
    init_from_files(tmp_path / "study", [path], answers={"rate": "500 Hz"})
    (line,) = [x for x in (tmp_path / "study" / "study.toml").read_text().splitlines() if x.startswith("time = ")]
    assert 'rate = "500 Hz"' in line
    assert "GUESS" not in line
    with pytest.raises(PellucidError, match="stamps"):
        proposed(path, rate="100 Hz")


@pytest.mark.parametrize("first", [46085.4323, 739800.43])
def test_dates_in_days_are_a_clock(tmp_path, first):
    t, q, tau = swing()
    path = tmp_path / "run.csv"
    rows = [f"{first + a / 86400.0:.12f},{b:.5f},{c:.5f}" for a, b, c in zip(t, q, tau, strict=True)]
    path.write_text("\n".join(["t,theta_rad,tau_Nm", *rows, ""]), encoding="utf-8")
    assert proposed(path).rate == pytest.approx(100.0, rel=1e-3)
    init_from_files(tmp_path / "study", [path])


def test_a_clock_of_megahertz_is_refused(tmp_path):
    t, q, tau = swing()
    path = tmp_path / "run.csv"
    rows = [f"{a / 86400.0:.12f},{b:.5f},{c:.5f}" for a, b, c in zip(t, q, tau, strict=True)]
    path.write_text("\n".join(["t,theta_rad,tau_Nm", *rows, ""]), encoding="utf-8")
    with pytest.raises(PellucidError, match="time_unit="):
        init_from_files(tmp_path / "refused", [path])
    init_from_files(tmp_path / "study", [path], answers={"time_unit": "days"})


def test_stamps_may_have_a_colon_before_their_milliseconds():
    found = stamp_seconds(["10:22:31:980", "10:22:31:990", "10:22:32:000"])
    np.testing.assert_allclose(found, 37351.98 + np.array([0.0, 0.01, 0.02]))


def test_a_log_that_begins_at_rest_is_identified(tmp_path):
    _, q, tau = swing(seconds=40.0)
    rest, noise = np.ones(4000), 0.01 * np.random.default_rng(2).standard_normal(4000)
    rows = (np.arange(8000) / 100.0, np.concatenate([q[0] * rest, q]), np.concatenate([tau[0] * rest + noise, tau]))
    path = written(tmp_path / "idle.csv", "time_s,angle_rad,torque_Nm", rows)
    tried = try_log([path], out=tmp_path / "page")
    assert tried.answer.verdict == "yes"


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_the_middle_of_a_converters_range_is_an_offset_and_no_size(tmp_path, noise):
    t, q, tau = swing()
    measured = tau + noise * np.random.default_rng(7).standard_normal(len(t))
    path = written(tmp_path / "adc.csv", "t_s,angle_rad,current_adc", (t, q, np.round(2048.0 + 250.0 * measured)))
    init_from_files(tmp_path / "study", [path])
    lost = written(tmp_path / "lost.csv", "t_s,angle_rad,current_adc", (t, q, np.round(250.0 * np.abs(tau))))
    with pytest.raises(PellucidError, match="with its sign"):
        init_from_files(tmp_path / "refused", [lost])


@pytest.mark.parametrize("names", [("encoder_deg", "imu_pitch_deg"), ("imu_pitch_deg", "encoder_deg")])
def test_of_two_sensors_the_one_that_explains_the_effort_is_the_joint(tmp_path, names):
    t, q, tau = swing(rate=200.0)
    late = swing(rate=200.0, late=0.03)[1] + 0.001 * np.random.default_rng(4).standard_normal(len(t))
    step = 2.0 * np.pi / 8192
    by = {"encoder_deg": np.degrees(np.round(q / step) * step), "imu_pitch_deg": np.degrees(late)}
    path = written(tmp_path / "two.csv", f"time_s,{','.join(names)},torque_Nm", (t, *(by[n] for n in names), tau))
    assert roles_of(proposed(path))["encoder_deg"] == "position"


def test_a_straps_force_on_a_joint_that_turns_keeps_no_study_from_being_made(tmp_path):
    t, q, tau = swing()
    force = 20.0 * np.sin(2.5 * t) + np.random.default_rng(4).standard_normal(len(t))
    head = "time_s,knee_angle_deg,strap_force_N,actuator_torque_Nm"
    path = written(tmp_path / "exo.csv", head, (t, np.degrees(q), force, tau))
    init_from_files(tmp_path / "study", [path])


def test_two_positions_in_the_ratio_of_a_gear_are_one_joint(tmp_path):
    t, q, tau = swing(rate=200.0)
    noise = 0.01 * np.random.default_rng(4).standard_normal((2, len(t)))
    columns = (t, 100.0 * np.degrees(q) + noise[0], np.degrees(q) + noise[1], tau / 100.0)
    path = written(tmp_path / "d.csv", "time_s,Feedback1.Position [deg],Feedback2.Position [deg],Torque [Nm]", columns)
    assert proposed(path).main.roles.joints == ()
    with pytest.raises(PellucidError, match="gear_turns=100"):
        init_from_files(tmp_path / "refused", [path])
    init_from_files(tmp_path / "study", [path], answers={"gear_turns": "100"})
    text = (tmp_path / "study" / "study.toml").read_text(encoding="utf-8")
    assert 'position = { column = "Feedback2.Position [deg]"' in text


@pytest.mark.parametrize("other", [1.1 * swing(rate=200.0)[1], swing(seed=2, rate=200.0)[1]], ids=["sensor", "joint"])
def test_two_angles_without_a_gear_between_them_are_no_motor_and_joint(tmp_path, other):
    t, q, tau = swing(rate=200.0)
    path = written(tmp_path / "d.csv", "time_s,first [rad],second [rad],torque_Nm", (t, q, other, tau))
    assert dict(proposed(path).main.roles.geared) == {}


@pytest.mark.parametrize("share", [0.1, 0.001])
def test_two_joints_that_move_alike_stay_joints(tmp_path, share):
    t, q, tau = swing(rate=200.0)
    other = 2.0 * swing(seed=2, rate=200.0)[1]
    columns = (t, q, 2.0 * q + share * other, tau, 2.0 * tau)
    path = written(tmp_path / "d.csv", "time_s,hip_q [rad],knee_q [rad],hip_tau [Nm],knee_tau [Nm]", columns)
    assert proposed(path).main.roles.joints == ("hip_q", "knee_q")


def test_names_in_letters_of_other_countries_are_drawn_without_a_warning(tmp_path):
    t, q, tau = swing()
    path = written(tmp_path / "drive.csv", "时间(s),关节角度(rad),力矩(N.m)", (t, q, tau))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        init_from_files(tmp_path / "study", [path])


def test_weight_gives_the_default_turn_of_stated_counts(tmp_path):
    t, q, tau = swing(rate=200.0)
    counts = 20000.0 + np.round(8192.0 * q / (2.0 * np.pi))
    found = proposed(written(tmp_path / "adc.csv", "t_s,enc_counts,torque_Nm", (t, counts, tau)))
    (position,) = (r for r in found.main.channels if r.quantity == "position")
    assert (position.unit, position.keys["counts_per_turn"]) == ("counts", 8192)
    assert {question.key: question.default for question in found.asked}["counts_per_turn"] == "8192"


def test_a_further_column_named_like_a_channel_is_none(tmp_path):
    t, q, tau = swing()
    columns = (t, 50.0 * np.degrees(q + tau / 2000.0), np.degrees(q), tau)
    head = "time_s,motor position [deg],joint position [deg],joint torque [Nm]"
    path = written(tmp_path / "drive.csv", head, columns)
    init_from_files(tmp_path / "study", [path])
    assert roles_of(proposed(path))["motor position [deg]"] == "further_motor_position"


def test_losses_that_leave_no_stretch_are_refused_by_their_name(tmp_path):
    path = logged_by_radio(tmp_path / "radio.csv", np.arange(RADIO_ROWS) % 40 < 15)
    with pytest.raises(PellucidError, match="missing sample"):
        init_from_files(tmp_path / "refused", [path])


@pytest.mark.parametrize("share", [0.001, 0.15, 0.3])
def test_single_missing_samples_are_bridged_and_their_share_is_stated(tmp_path, share):
    t, q, tau = swing(seconds=RADIO_ROWS / 250.0, rate=250.0)
    rng = np.random.default_rng(6)
    columns = [np.where(rng.random(RADIO_ROWS) < share, np.nan, x) for x in (q, tau)]
    rows = [",".join("" if np.isnan(x) else f"{x:.4f}" for x in row) for row in zip(t, *columns, strict=True)]
    path = tmp_path / "radio.csv"
    path.write_text("\n".join(["time_s,angle_rad,torque_Nm", *rows, ""]), encoding="utf-8")
    init_from_files(tmp_path / "study", [path])
    study = pl.open(tmp_path / "study")
    found = {row.id.removeprefix("study.headline."): row.value for row in pl.identify(study).rows}
    assert found["inertia"] == pytest.approx(INERTIA, rel=0.02)
    assert found["gravity"] == pytest.approx(GRAVITY, rel=0.01)
    noted = [fault.found for fault in pl.check(study) if fault.kind == "missing_samples" and fault.severity == "note"]
    assert noted
    percent = 100.0 * (1.0 - (1.0 - share) ** 2)
    assert float(noted[0].partition("(")[2].partition(" %")[0]) == pytest.approx(percent, rel=0.2)


def test_a_long_loss_among_short_ones_stays_a_gap(tmp_path):
    lost = np.random.default_rng(6).random(RADIO_ROWS) < 0.05
    lost[7000:7400] = True
    path = logged_by_radio(tmp_path / "radio.csv", lost)
    init_from_files(tmp_path / "study", [path])
    recordings = pl.open(tmp_path / "study").recordings()
    cuts = {(cut.samples, cut.kind) for recording in recordings for cut in recording.cuts}
    assert (400, "missing_samples") in cuts
    assert all(cut[0] >= 400 for cut in cuts)
    assert sum(recording.bridged for recording in recordings) == pytest.approx(0.05 * (RADIO_ROWS - 400), rel=0.1)


@pytest.mark.parametrize(("late", "clocks"), [(0.0005, {"time_s"}), (0.005, {"time_s.hip", "time_s.knee"})])
def test_labels_share_a_clock_if_their_messages_are_sent_in_turn(tmp_path, late, clocks):
    t, q, _ = swing()
    turns = [(("hip", a, b), ("knee", a + late, 2.0 * b)) for a, b in zip(t, q, strict=True)]
    rows = [f"{a:.4f},{name},{b:.5f}" for pair in turns for name, a, b in pair]
    path = tmp_path / "bus.csv"
    path.write_text("\n".join(["time_s,joint,angle_rad", *rows, ""]), encoding="utf-8")
    columns = read_columns(path).values
    assert {name for name in columns if name.startswith("time")} == clocks


def test_milliseconds_within_a_second_start_again_after_a_thousand():
    assert find_clock_period((10.0 * np.arange(2500)) % 1000.0) == 1000.0


@pytest.mark.parametrize("lengths", [(2000, 2000, 2000), (2000, 1400, 1700)])
def test_trials_in_one_file_are_parted_by_gaps(tmp_path, lengths):
    rows = []
    for trial, n in enumerate(lengths, 1):
        columns = (x[:n] for x in swing(seed=trial))
        rows += [f"{trial},{a:.3f},{b:.5f},{c:.5f}" for a, b, c in zip(*columns, strict=True)]
    path = tmp_path / "all.csv"
    path.write_text("\n".join(["trial,time,angle_rad,torque_Nm", *rows, ""]), encoding="utf-8")
    init_from_files(tmp_path / "study", [path])
    study = pl.open(tmp_path / "study")
    parts = [np.diff(recording.time) for recording in study.recordings()]
    assert sum(int(np.sum(steps > 1.0)) for steps in parts) in (len(lengths) - 2, len(lengths) - 1)
    assert all(np.all(steps > 0.0) for steps in parts)
    found = {row.id.removeprefix("study.headline."): row.value for row in pl.identify(study).rows}
    assert found["inertia"] == pytest.approx(INERTIA, rel=0.03)


def test_a_clock_that_rolls_over_in_motion_has_no_gap(tmp_path):
    t, q, tau = swing(seconds=180.0, rate=50.0)
    found = proposed(written(tmp_path / "minute.csv", "time_s,angle_rad,torque_Nm", (t % 60.0, q, tau)))
    assert found.main.roles.clock.period == 60.0


def test_two_clocks_that_roll_over_together_have_no_gap():
    t = 0.01 * np.arange(20_000)
    columns = {"time [s]": t % 60.0, "time_ms": (1000.0 * t) % 60_000.0, "q": np.sin(0.7 * t)}
    found = find_clock(columns, [read_name(name) for name in columns])
    np.testing.assert_allclose(found.seconds(columns[found.column]), t, atol=1e-9)


def test_a_leap_across_the_gap_between_trials_is_no_rollover(tmp_path):
    t, q, tau = swing(seconds=40.0)
    high, low = int(np.argmax(q[1000:])) + 1001, int(np.argmin(q[:3000]))
    parts = [slice(0, high), slice(low, len(q))]
    columns = [np.concatenate([t[part] - t[part.start] for part in parts])]
    columns += [np.concatenate([x[part] for part in parts]) for x in (q, tau)]
    init_from_files(tmp_path / "study", [written(tmp_path / "two.csv", "time_s,angle_rad,torque_Nm", columns)])


def test_the_joint_of_a_machine_in_opensims_files_is_no_persons(tmp_path):
    t, q, tau = swing()
    head = "Coordinates\nversion=1\nnRows={}\nnColumns=2\ninDegrees={}\nendheader\n"
    motion, drive = tmp_path / "exo_q.mot", tmp_path / "exo_actuation.sto"
    files = (motion, "yes", "exo_knee", np.degrees(q)), (drive, "no", "exo_knee_motor_torque", tau)
    for path, is_in_degrees, name, x in files:
        rows = "\n".join(f"{a:.3f}\t{b:.6f}" for a, b in zip(t, x, strict=True))
        path.write_text(f"{head.format(len(t), is_in_degrees)}time\t{name}\n{rows}\n", encoding="utf-8")
    found = proposed(motion, drive)
    assert roles_of(found) == {"exo_knee": "position", "exo_knee_motor_torque": "torque"}
    assert not found.is_person


def test_runs_of_different_lengths_have_clocks_of_their_own(tmp_path):
    columns, names = [], []
    for run, n in ((1, 2000), (2, 1500), (3, 1800)):
        columns += [np.concatenate([x[:n], np.full(2000 - n, np.nan)]) for x in swing(seed=run)]
        names += [f"{name} Run #{run}" for name in ("Time (s)", "Angle (rad)", "Torque (N·m)")]
    path = tmp_path / "capstone.csv"
    rows = [",".join("" if np.isnan(x) else f"{x:.6g}" for x in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([",".join(names), *rows, ""]), encoding="utf-8")
    init_from_files(tmp_path / "study", [path])
    assert [len(recording) for recording in pl.open(tmp_path / "study").recordings()] == [2000, 1500, 1800]


@pytest.mark.parametrize("spare", [None, 0.0, np.nan])
def test_files_without_a_header_continue_the_one_with_it(tmp_path, spare):
    columns = swing(seconds=60.0)
    names = "time_s,angle_rad,torque_Nm"
    if spare is not None:
        columns, names = (*columns, np.full(len(columns[0]), spare)), f"{names},spare"
    for k, header in enumerate((f"{names}\n", "", "")):
        rows = np.column_stack(columns)[2000 * k : 2000 * (k + 1)]
        text = "\n".join(",".join(f"{x:.5f}" for x in row) for row in rows)
        (tmp_path / f"log_{k}.csv").write_text(f"{header}{text}\n", encoding="utf-8")
    found = init_from_files(tmp_path / "study", sorted(tmp_path.glob("log_*.csv"))).proposal
    assert len(found.recordings) == 3
    assert [question.key for question in found.asked] == ["worn", "angle_zero"]
    assert [len(recording) for recording in pl.open(tmp_path / "study").recordings()] == [2000, 2000, 2000]
