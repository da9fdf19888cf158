"""``[rig.instruments]`` of study.toml: one joint and several, what is not said, and what is refused."""

import math

import pytest

import pellucid
from pellucid._errors import StudyError
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.residual_compensator import design
from pellucid.controllers.study.rig_instruments import rig_instruments
from pellucid.study.procedures.registry import open_study
from pellucid_lab.knee.worn_compensator import WornCompensator

ONE = """
name = "bench"
[rig]
motion = "rotary"
[rig.drive]
kind = "current"
torque_constant = "0.06 N*m/A"
gear_ratio = 28.0
limit = "8 A"
[rig.instruments]
encoder_resolution = "0.1 mrad"
second_encoder = true
second_encoder_tolerance = "1 deg"
start_up_answer = "14 mJ"
drive_answer = 1.127
probe = true
probe_answer = [5.0, -1.0, 4.0, -2, 3.0, -3.0]
[rig.instruments.drive_sensor]
gain_error = "4 %"
offset = "100 mN*m"
[rig.instruments.force_sensor]
range = "25 N*m"
[channels]
time = { column = "t", unit = "s" }
"""
SEVERAL = """
name = "arm"
[rig.instruments]
second_encoder = true
[rig.instruments.drive_sensor]
gain_error = "2 %"
offset = "100 mN*m"
[[rig.joints]]
name = "shoulder"
motion = "rotary"
[rig.joints.drive]
kind = "torque"
[rig.joints.instruments.drive_sensor]
offset = "0.2 N*m"
[[rig.joints]]
name = "elbow"
motion = "rotary"
[rig.joints.drive]
kind = "torque"
limit = "5 N*m"
[rig.joints.instruments]
second_encoder_tolerance = "0.01 rad"
[[rig.joints]]
name = "wrist"
motion = "rotary"
[rig.joints.drive]
kind = "torque"
[rig.joints.instruments]
second_encoder = false
drive_sensor = { present = false }
[channels]
time = { column = "t", unit = "s" }
"""


def instruments_of(folder, text):
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return [rig_instruments(joint) for joint in open_study(folder).config.rig.joints]


def test_what_one_joint_states(tmp_path):
    assert pellucid.Instruments is Instruments
    (found,) = instruments_of(tmp_path, ONE)
    assert (found.encoder_resolution, found.joint_encoder, found.probe) == (pytest.approx(1e-4), True, True)
    assert found.probe_answer == (5.0, -1.0, 4.0, -2.0, 3.0, -3.0)
    assert found.joint_tolerance == pytest.approx(math.radians(1.0))
    assert (found.drive, found.drive_gain_error, found.drive_offset) == (True, 0.04, 0.1)
    assert found.drive_answer == 1.127
    assert found.drive_limit == pytest.approx(0.06 * 28.0 * 8.0)
    assert (found.force_range, found.start_up_answer) == (25.0, 0.014)
    assert (found.drive_noise, found.drive_lag, found.emg_range) == (None, 2e-3, 40.0)


def test_a_study_that_states_none_has_the_usual_ones(tmp_path):
    before, _, rest = ONE.partition("[rig.instruments]")
    text = before + "[channels]" + rest.partition("[channels]")[2]
    (found,) = instruments_of(tmp_path, text)
    assert found == Instruments(drive_limit=found.drive_limit)
    assert found.drive_limit == pytest.approx(0.06 * 28.0 * 8.0), "the drive's effort is known without a sensor of it"
    assert instruments_of(tmp_path, text.replace('limit = "8 A"\n', "")) == [Instruments()]


def test_a_spring_measures_the_drive(tmp_path):
    text = ONE.replace("[rig.instruments.drive_sensor]", 'spring_stiffness = "170 N*m/rad"\n[rig.instruments.other]')
    text = text.replace('[rig.instruments.other]\ngain_error = "4 %"\noffset = "100 mN*m"\n', "")
    (found,) = instruments_of(tmp_path, text)
    assert (found.drive, found.spring_stiffness, found.drive_offset) == (True, 170.0, None)


def test_joints_share_a_table_and_replace_keys_of_it(tmp_path):
    shoulder, elbow, wrist = instruments_of(tmp_path, SEVERAL)
    assert (shoulder.drive_gain_error, shoulder.drive_offset, shoulder.joint_tolerance) == (0.02, 0.2, 0.05)
    assert (elbow.drive_gain_error, elbow.drive_offset, elbow.joint_tolerance) == (0.02, 0.1, 0.01)
    assert (elbow.drive_limit, shoulder.drive_limit) == (5.0, math.inf)
    assert wrist == Instruments()


@pytest.mark.parametrize(
    ("text", "found", "given", "said"),
    [
        (ONE, "0.1 mrad", "0.1 mm", r'line 11: \[rig.instruments\] encoder_resolution: found the unit "mm"'),
        (ONE, "range", "rang", r'line 22: \[rig.instruments.force_sensor\] rang: unknown key "rang"; .* is "range"'),
        (ONE, "100 mN*m", "-1 N*m", r"line 20: \[rig.instruments.drive_sensor\] offset: found -1.0, expected at least"),
        (ONE, "probe = true", 'probe = "false"', r"\[rig.instruments\] probe: found 'false', expected true or false"),
        (ONE, "second_encoder = true", "second_encoder = 1", r"second_encoder: found 1, expected true or false"),
        (ONE, "second_encoder = true\n", "", "found second_encoder_tolerance, expected second_encoder = true"),
        (SEVERAL, "second_encoder = true\n", "", r"\[\[rig.joints\]\] elbow: .*expected second_encoder = true"),
        (SEVERAL, "0.2 N*m", "0.2 m", r'\[\[rig.joints\]\] 1 instruments.drive_sensor.offset: found the unit "m"'),
        (SEVERAL, 'name = "wrist"\nmotion = "rotary"', 'name = "wrist"\nmotion = "prismatic"', "whose units differ"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(tmp_path, text, found, given, said):
    assert found in text
    with pytest.raises(StudyError, match=said):
        instruments_of(tmp_path, text.replace(found, given))


def test_what_is_stated_later_leaves_a_card_valid(tmp_path):
    """The cards' inputs leave instruments out, as they leave out limits."""
    from pellucid.study.study import without_keys

    table = {"motion": "rotary", "instruments": {"probe": True}, "joints": [{"instruments": {}, "limits": {}}]}
    assert without_keys(table, "instruments") == {"motion": "rotary", "joints": [{"limits": {}}]}


def test_a_worn_compensator_watches_the_spring_that_its_instruments_have():
    coupling = Coupling(0.05, 0.02, 1.6, 0.05, 0.3, 0.1, 8.0, 14.0, 0.5, actuator_frequency=60.0, delay=0.002)
    made = design(coupling, 0.002)
    spring = Instruments(drive=True, joint_encoder=True, spring_stiffness=170.0)
    faults = {}
    for name, torque, drift in (("well", 0.0, 0.0), ("apart", 0.0, 0.01), ("stuck", 9.0, 0.0)):
        watched = WornCompensator(made, instruments=spring)
        bare = WornCompensator(made)
        for k in range(200):
            watched.step(0.002 * k, 0.5, torque, motor_position=0.5 + drift * k)
            bare.step(0.002 * k, 0.5, torque)
        faults[name] = (watched.fault, bare.fault)
    assert faults["well"] == ("none", "none")
    assert faults["apart"][0] != "none"
    assert faults["apart"][1] == "none"
    assert faults["stuck"][0].startswith("drive")
    assert not faults["stuck"][1].startswith("drive")
