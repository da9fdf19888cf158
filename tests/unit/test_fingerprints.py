"""Fingerprints of loggers: every file finds its own logger's table, and none a table of general names."""

import re
from dataclasses import fields

import pytest

from pellucid import PellucidError
from pellucid.start.inference import fingerprints
from pellucid.start.inference.fingerprints import (
    FINGERPRINTS_FOLDER,
    find_fingerprint,
    fold_name,
    load_fingerprints,
    read_fingerprint,
)
from pellucid.units import to_si_factor

# Tables as loggers write them: file, names, and of some columns quantity, unit and joint.
TABLES = [
    (
        "ros_bag_joint_state",
        ["rosbagTimestamp", "header.seq", "header.stamp.secs", "header.stamp.nsecs", "position", "velocity", "effort"],
        {"header.stamp.nsecs": ("time", "ns", None), "effort": ("torque", "N*m", None)},
    ),
    (
        "ros_bag_joint_state",
        ["time", "position.arm_1_joint", "velocity.arm_1_joint", "effort.arm_1_joint", "effort.gripper_finger_joint"],
        {
            "position.arm_1_joint": ("position", "rad", "arm_1_joint"),
            "effort.arm_1_joint": ("torque", "N*m", "arm_1_joint"),
        },
    ),
    (
        "ros_topic_echo",
        ["%time", "field.header.seq", "field.header.stamp", "field.position0", "field.position1", "field.effort0"],
        {
            "%time": ("ignore", None, None),
            "field.header.stamp": ("time", "ns", None),
            "field.position1": ("position", "rad", "1"),
        },
    ),
    (
        "plotjuggler_joint_state",
        ["__time", "/joint_states/hip/position", "/joint_states/hip/velocity", "/joint_states/hip/effort"],
        {"__time": ("time", "s", None), "/joint_states/hip/effort": ("torque", "N*m", "hip")},
    ),
    (
        "ros_control",
        ["t", "/arm/state/feedback/positions[0]", "/arm/state/reference/positions[0]", "/arm/state/error/positions[0]"],
        {"/arm/state/reference/positions[0]": ("reference", "rad", "0")},
    ),
    (
        "opensourceleg",
        ["time", "motor_position", "motor_velocity", "motor_current", "output_position", "output_torque"],
        {"motor_current": ("current", "mA", None), "output_position": ("position", "rad", None)},
    ),
    (
        "dephy_actpack",
        ["state_time", "mot_ang", "mot_vel", "mot_cur", "ank_ang", "batt_volt", "gyrox"],
        {"mot_ang": ("position", "counts", None), "mot_cur": ("current", "mA", None)},
    ),
    (
        "moteus",
        ["timestamp", "servo_stats.position", "servo_stats.velocity", "servo_stats.torque_Nm", "servo_stats.q_A"],
        {"servo_stats.position": ("position", "turn", None), "servo_stats.q_A": ("current", "A", None)},
    ),
    (
        "odrive_0_5",
        [
            "time",
            "axis0.encoder.pos_estimate",
            "axis0.motor.current_control.Iq_setpoint",
            "axis0.motor.current_control.Iq_measured",
        ],
        {
            "axis0.encoder.pos_estimate": ("position", "turn", "0"),
            "axis0.motor.current_control.Iq_setpoint": ("desired_current", "A", "0"),
        },
    ),
    (
        "odrive_0_6",
        ["time", "axis0.pos_estimate", "axis0.vel_estimate", "axis0.motor.foc.Iq_measured", "vbus_voltage"],
        {"axis0.vel_estimate": ("velocity", "turn/s", "0"), "axis0.motor.foc.Iq_measured": ("current", "A", "0")},
    ),
    (
        "dynamixel_x",
        ["realtime_tick_ms", "Present Position", "Present Velocity", "Present Current", "Goal Position"],
        {"Present Position": ("position", "counts", None), "Goal Position": ("reference", "counts", None)},
    ),
    (
        "feetech_sts",
        ["timestamp", "Present_Position", "Present_Velocity", "Present_Load", "Present_Voltage", "Goal_Position"],
        {"Present_Load": ("duty", "%", None), "Present_Position": ("position", "counts", None)},
    ),
    (
        "lerobot_dataset",
        ["timestamp", "frame_index", "observation.state.shoulder_pan.pos", "action.shoulder_pan.pos"],
        {"action.shoulder_pan.pos": ("reference", None, "shoulder_pan")},
    ),
    (
        "ur_rtde",
        ["timestamp", "actual_q_0", "actual_qd_0", "actual_current_0", "target_moment_0"],
        {"actual_current_0": ("current", "A", "0"), "target_moment_0": ("desired_torque", "N*m", "0")},
    ),
    (
        "franka",
        ["time", "state.q[0]", "state.dq[0]", "state.tau_J[0]", "state.tau_ext_hat_filtered[0]", "cmd.q_d[0]"],
        {"state.tau_J[0]": ("torque", "N*m", "0"), "state.tau_ext_hat_filtered[0]": ("ignore", "N*m", "0")},
    ),
    (
        "kuka",
        ["Sample Time [s]", "AxisAct_A1 [deg]", "AxisAct_A2 [deg]", "TorqueAct_A1 [Nm]"],
        {"AxisAct_A2 [deg]": ("position", "deg", "2"), "TorqueAct_A1 [Nm]": ("torque", "N*m", "1")},
    ),
    (
        "tmotor_can_control",
        ["pi_time", "motor_position", "motor_speed", "motor_current"],
        {"motor_current": ("current", "A", None)},
    ),
    ("tmotor_servo_registers", ["t", "pos_int", "spd_int", "cur_int"], {"pos_int": ("position", "deg", None)}),
    (
        "maxon_epos",
        ["Time", "Position actual value", "Velocity actual value averaged", "Current actual value averaged"],
        {
            "Current actual value averaged": ("current", "mA", None),
            "Position actual value": ("position", "counts", None),
        },
    ),
    (
        "cia_402",
        ["t", "Position actual value", "Velocity actual value", "Torque actual value", "Target position"],
        {"Torque actual value": ("torque", "%", None), "Position actual value": ("position", None, None)},
    ),
    (
        "hebi",
        ["time", "position_1", "velocity_1", "effort_1", "position_command_1", "effort_command_1", "deflection_1"],
        {"effort_1": ("torque", "N*m", "1"), "effort_command_1": ("desired_torque", "N*m", "1")},
    ),
    (
        "beckhoff_nc",
        ["Time", "Axis 1.ActPos", "Axis 1.ActVelo", "Axis 1.ActTorque", "Axis 1.SetPos"],
        {"Axis 1.ActTorque": ("torque", None, "Axis 1"), "Axis 1.SetPos": ("reference", None, "Axis 1")},
    ),
    (
        "mitsubishi_mr",
        ["Time [ms]", "Motor speed [r/min]", "Torque [%]", "Droop pulses (100p) [pulse]"],
        {"Torque [%]": ("torque", None, None), "Motor speed [r/min]": ("velocity", None, None)},
    ),
    (
        "rcbenchmark",
        ["Time (s)", "ESC signal (µs)", "AccX (g)", "Torque (N·m)", "Thrust (kgf)", "Motor Electrical Speed (RPM)"],
        {"ESC signal (µs)": ("ignore", None, None), "Torque (N·m)": ("torque", None, None)},
    ),
    (
        "openexo",
        ["Ankle Angle", "Measured Torque (R)", "Toe FSR (R)", "Heel FSR (R)", "Exoskeleton time (seconds)"],
        {"Measured Torque (R)": ("torque", None, "R"), "Exoskeleton time (seconds)": ("time", "s", None)},
    ),
    (
        "corc",
        ["Time (s)", "JointPositions_1", "JointPositions_2", "JointVelocities_1", "JointTorques_1"],
        {"JointPositions_2": ("position", None, "2"), "JointTorques_1": ("torque", None, "1")},
    ),
    (
        "vicon_plug_in_gait",
        ["LKneeAngles.x", "LKneeAngles.y", "LKneeMoment.x", "LASI.x"],
        {"LKneeAngles.x": ("position", "deg", "LKnee"), "LKneeMoment.x": ("torque", None, "LKnee")},
    ),
    (
        "delsys_trigno",
        ["X[s]", "Trigno IM sensor 2: EMG 2 (IM) [Volts]", "X[s].1", "Trigno IM sensor 2: Acc 2.X (IM) [g]"],
        {"Trigno IM sensor 2: EMG 2 (IM) [Volts]": ("emg", None, None), "X[s]": ("time", "s", None)},
    ),
    (
        "noraxon_mr3",
        ["time", "Activity", "Marker", "LT TIB.ANT. (uV)", "RT LAT. GASTRO (uV)"],
        {"LT TIB.ANT. (uV)": ("emg", None, None), "Marker": ("state", None, None)},
    ),
    ("lab_streaming_layer", ["lsl_timestamp", "a", "b"], {"lsl_timestamp": ("time", "s", None)}),
    ("biopac_acqknowledge", ["min", "CH1", "CH2"], {"min": ("time", "min", None)}),
    ("labview_measurement", ["X_Value", "Untitled", "Comment"], {"X_Value": ("time", "s", None)}),
    (
        "dspace_controldesk",
        ["HostService", "Model Root/plant/theta/Out1"],
        {"HostService": ("time", "s", None)},
    ),
    ("simulink", ["tout", "simout.signals.values_1"], {"tout": ("time", "s", None)}),
    (
        "kinova_gen3",
        ["t", "actuators_0.position", "actuators_0.torque", "actuators_0.current_motor"],
        {"actuators_0.position": ("position", "deg", "actuators_0")},
    ),
    (
        "abb_egm",
        ["time", "feedback.robot.joints.position.values_1", "planned.robot.joints.position.values_1"],
        {"planned.robot.joints.position.values_1": ("reference", "deg", "1")},
    ),
    (
        "simplefoc",
        ["time", "target", "Uq", "Ud", "Iq", "Id", "velocity", "angle"],
        {"Iq": ("current", "mA", None), "angle": ("position", "rad", None)},
    ),
    (
        "vesc_tool",
        ["ms_today", "input_voltage", "current_motor", "current_in", "erpm", "duty_cycle", "tachometer"],
        {"ms_today": ("time", "ms", None), "current_in": ("ignore", "A", None)},
    ),
    ("elmo", ["t", "PX", "VX", "IQ"], {"IQ": ("current", None, None)}),
    (
        "trinamic",
        ["t", "PID_POSITION_ACTUAL", "PID_VELOCITY_ACTUAL", "PID_TORQUE_ACTUAL"],
        {"PID_TORQUE_ACTUAL": ("current", None, None)},
    ),
    (
        "unitree",
        ["t", "motorState[3].q", "motorState[3].dq", "motorState[3].tauEst", "motorCmd[3].q"],
        {"motorState[3].tauEst": ("torque", "N*m", "3"), "motorCmd[3].q": ("reference", "rad", "3")},
    ),
]
TABLES_WITH_FACTS = [
    (
        "labchart",
        ["column_1", "Elbow angle"],
        {"Interval": "0.0025 s", "ExcelDateTime": "4.5e4", "ChannelTitle": "Elbow"},
    ),
    (
        "qualisys_qtm",
        ["Frame", "Time", "knee X", "knee Y", "knee Z"],
        {"NO_OF_FRAMES": "720", "NO_OF_CAMERAS": "7", "MARKER_NAMES": "knee"},
    ),
]


@pytest.mark.parametrize(("stem", "names", "columns"), TABLES, ids=[stem for stem, *_ in TABLES])
def test_a_fingerprint_recognises_a_table_of_its_logger(stem, names, columns):
    found = find_fingerprint(names)
    assert found is not None
    assert found.name == _read(stem).name
    assert {name: (c.quantity, c.unit, c.joint) for name, c in found.columns.items() if name in columns} == columns


@pytest.mark.parametrize(("stem", "names", "facts"), TABLES_WITH_FACTS, ids=[stem for stem, *_ in TABLES_WITH_FACTS])
def test_facts_beside_general_names_show_a_logger(stem, names, facts):
    found = find_fingerprint(names, facts)
    assert found is not None
    assert found.name == _read(stem).name
    assert find_fingerprint(names) is None


def test_every_file_has_a_table_here():
    tried = {stem for stem, *_ in TABLES} | {stem for stem, *_ in TABLES_WITH_FACTS}
    assert {path.stem for path in FINGERPRINTS_FOLDER.glob("*.toml")} == tried


@pytest.mark.parametrize(
    "names",
    [
        ["time", "position", "velocity", "torque"],
        ["time", "position", "velocity", "effort"],
        ["t", "q", "dq", "tau"],
        ["time_s", "joint_angle_rad", "current_mA"],
        ["t", "pos_cmd", "vel_cmd", "torque_cmd", "pos_act", "vel_act", "torque_act"],
        ["time", "motor_angle", "motor_speed", "motor_current", "joint_torque"],
        ["t", "theta_mech", "omega_mech", "i_q", "i_d", "v_q", "v_d", "torque_est", "v_bus"],
        ["t", "px", "py", "vx", "vy"],
        ["frame", "knee X", "knee Y", "knee Z"],
        ["time", "knee_angle_r", "knee_angle_r_moment"],
        ["Zeit", "Winkel", "Drehmoment"],
        [],
        [""],
        ["x" * 5000],
    ],
)
def test_general_names_are_no_fingerprint(names):
    assert find_fingerprint(names) is None


def test_registers_keep_scale_encoding_and_rollover():
    found = find_fingerprint(["Realtime Tick", "Present Position", "Present Current", "Present Load"]).columns
    assert found["Realtime Tick"].wrap == 32768
    assert found["Present Position"].counts_per_turn == 4096
    assert found["Present Position"].side == "output"
    current = found["Present Current"]
    assert (current.scale, current.other_scales, current.encoding) == (0.00269, (0.001,), "twos_complement 16")
    load = find_fingerprint(["Present_Position", "Present_Load", "Present_Voltage"]).columns["Present_Load"]
    assert (load.scale, load.encoding) == (0.1, "sign_bit 10")


def test_what_a_controller_asks_for_is_a_command():
    found = find_fingerprint(["axis1.controller.input_pos", "axis1.encoder.pos_estimate"]).columns
    assert found["axis1.controller.input_pos"].is_command
    assert not found["axis1.encoder.pos_estimate"].is_command


def test_the_fingerprint_that_recognises_most_columns_counts():
    # EPOS Studio's names are those of CiA 402, and "averaged" is the maker's own word.
    names = ["Position actual value", "Torque actual value averaged", "Velocity actual value"]
    assert find_fingerprint(names).name == _read("maxon_epos").name
    assert find_fingerprint([names[0], names[2]]).name == _read("cia_402").name


@pytest.mark.parametrize("fingerprint", load_fingerprints(), ids=lambda each: each.name)
def test_units_scales_and_requirements_of_every_file(fingerprint):
    assert fingerprint.requires or len(fingerprint.facts) >= fingerprint.min_matched
    assert fingerprint.min_matched <= len(fingerprint.columns) + len(fingerprint.facts)
    si = {
        "position": ("rad", "count"), "reference": ("rad", "count"), "error": ("rad", "count"), "marker": ("m",),
        "velocity": ("rad/s", "count/s"), "desired_velocity": ("rad/s", "count/s"), "acceleration": ("rad/s^2",),
        "torque": ("N*m", "1"), "desired_torque": ("N*m", "1"), "current": ("A", "1"), "desired_current": ("A", "1"),
        "voltage": ("V",), "supply": ("V",), "duty": ("1",), "temperature": ("K",), "time": ("s",),
        "linear_acceleration": ("m/s^2",), "angular_velocity": ("rad/s",),
    }  # fmt: skip
    for column in fingerprint.columns:
        if column.unit is not None and column.quantity != "ignore":
            assert any(_is_unit_of(column.unit, unit) for unit in si[column.quantity]), column
        if column.scale is not None:
            assert column.scale > 0.0, column
            assert column.unit is not None, column
        if column.counts_per_turn is not None:
            assert column.unit == "counts", column


def test_a_name_is_folded_to_words_without_its_unit():
    assert fold_name("AxisAct_A1 [deg]") == "axis act a 1"
    assert fold_name("/joint_states/hip/position") == "joint states hip position"
    assert fold_name("motorState[3].tauEst") == "motor state 3 tau est"


def test_a_joint_has_the_name_that_the_table_gives_it():
    names = ["/joint_states/left_hip-pitch/position", "/joint_states/left_hip-pitch/effort"]
    found = find_fingerprint(["__time", *names])
    assert {found.columns[name].joint for name in names} == {"left_hip-pitch"}


def test_one_new_file_is_a_new_logger(tmp_path, monkeypatch):
    (tmp_path / "own.toml").write_text(VALID, encoding="utf-8")
    monkeypatch.setattr(fingerprints, "FINGERPRINTS_FOLDER", tmp_path)
    fingerprints._requirements.cache_clear()
    try:
        found = find_fingerprint(["Winkelgeber", "Momentgeber", "other"])
    finally:
        fingerprints._requirements.cache_clear()
    assert found.name == "Own"
    assert set(found.columns) == {"Winkelgeber", "Momentgeber"}


VALID = """
name = "Own"
source = "https://example.org/own"
requires = ["winkelgeber"]
[[columns]]
pattern = "winkelgeber"
quantity = "position"
unit = "deg"
[[columns]]
pattern = "momentgeber"
quantity = "torque"
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "Own"', "", "found no name"),
        ("https://example.org/own", "a manual", "an address with https://"),
        ('quantity = "torque"', 'quantity = "twist"', "found quantity 'twist'"),
        ('"momentgeber"', '"moment("', "no regular expression"),
        ('unit = "deg"', 'unit = "deg"\nencoding = "sign_bit 3"', "found encoding 'sign_bit 3'"),
        ('unit = "deg"', 'unit = "deg"\nside = "left"', "found side 'left'"),
        ('unit = "deg"', 'unit = "deg"\njoint_group = 1', "expected a group of the pattern"),
        ('unit = "deg"', 'units = "deg"', "found the key 'units'"),
        ('requires = ["winkelgeber"]', 'require = ["winkelgeber"]', "found the key 'require'"),
        ("[[columns]]", "[[columns", "not valid TOML"),
    ],
)
def test_a_file_that_is_not_valid_is_refused_by_name(tmp_path, old, new, message):
    path = tmp_path / "own.toml"
    path.write_text(VALID.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(PellucidError, match=re.escape(message)) as error:
        read_fingerprint(path)
    assert "own.toml" in str(error.value)


def test_a_file_may_set_each_field_but_the_joint(tmp_path):
    path = tmp_path / "own.toml"
    more = 'scale = 0.1\nother_scales = [1.0]\nencoding = "sign_bit 15"\nwrap = 9\nside = "motor"\nis_command = true\n'
    text = VALID.replace('"winkelgeber"\nq', '"winkelgeber(.*)"\nq')
    path.write_text(text.replace('unit = "deg"\n', f'unit = "deg"\njoint_group = 1\n{more}'), encoding="utf-8")
    column = read_fingerprint(path).columns[0]
    assert column.is_command
    assert column.other_scales == (1.0,)
    assert column.joint_group == 1
    unset = {field.name for field in fields(column) if getattr(column, field.name) in (None, ())}
    assert unset == {"counts_per_turn", "joint"}


def _read(stem):
    return read_fingerprint(FINGERPRINTS_FOLDER / f"{stem}.toml")


def _is_unit_of(unit, si):
    try:
        return bool(to_si_factor(unit, si))
    except ValueError:
        return False
