"""study.toml: what it may say, and what is said of a wrong one."""

import math

import numpy as np
import pytest

from pellucid._errors import IdentificationError, PellucidError, RecordingError, StudyError
from pellucid.emg.study.onset.onset_table import OnsetTable
from pellucid.orthosis.study.hinge.hinge_table import HingeTable
from pellucid.study.procedures.registry import ALL_PROCEDURES, open_study


def test_everything_is_si(make_study):
    study = make_study(
        None,
        ('torque_constant = "2 N*m/A"', 'torque_constant = "60 mN*m/A"\ngear_ratio = 28.0\nlimit = "900 mA"'),
        (
            "[processing]",
            '[rig.limits]\nposition_min = "-90 deg"\nvelocity = "60 rpm"\n\n[processing]\ndead_band = "6 deg/s"',
        ),
        append='[participants.P1]\nmass = "68 kg"\nheight = "178 cm"\nage = 31\n'
        '[model]\nknown = { inertia = "500 g*m^2" }\n',
    )
    assert study.name == "bench"
    assert (study.rig.joint, study.rig.motion, study.rig.lifts) == ("elbow", "rotary", "flexion")
    assert study.rig.drive.constant == pytest.approx(0.060)
    assert study.rig.drive.limit == pytest.approx(0.9)
    assert study.rig.loop is None
    assert study.rig.limits.position_min == pytest.approx(-math.pi / 2)
    assert study.rig.limits.velocity == pytest.approx(2 * math.pi)
    assert study.processing.lowpass == 20.0
    assert study.processing.dead_band == pytest.approx(math.radians(6))
    assert study.config.participants["P1"].height == pytest.approx(1.78)
    assert study.model.known == {"inertia": pytest.approx(0.5)}
    assert study.models_dir == study.folder / "models"
    assert study.results_path == study.folder / "results.json"
    assert study.report_dir == study.folder / "report"


def test_what_is_left_out_has_the_stated_default(make_study):
    study = make_study()
    assert study.model.gravity == "sine"
    assert study.model.families == ("symmetric", "directional", "load", "stribeck", "combined")
    assert study.model.confidence == 0.95
    assert study.processing.resample is None
    assert study.processing.order == 4
    assert study.rig.drive.gear_ratio == 1.0


def test_a_prismatic_rig_knows_no_gravity(make_study):
    study = make_study(
        None,
        ("rotary", "prismatic"),
        ('torque_constant = "2 N*m/A"', 'force_constant = "2 N/A"'),
        ('unit = "rad"', 'unit = "mm"'),
    )
    assert study.model.gravity == "none"
    assert study.recording("sweep").channels["position"].unit == "m"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("lowpass", "lowpas", 'line 18: [processing] lowpas: unknown key "lowpas"; the nearest valid one is "lowpass"'),
        ("torque_constant", "torque_const", 'the nearest valid one is "torque_constant"'),
        ("[processing]", "[procesing]", 'line 17: procesing: unknown key "procesing"; the nearest valid one is "proc'),
        ("protocol", "protocoll", '1 protocoll: unknown key "protocoll"; the nearest valid one is "protocol"'),
        ('column = "q"', 'colum = "q"', 'position.colum: unknown key "colum"; the nearest valid one is "column"'),
        (', unit = "rad"', "", 'line 14: [channels] position: no unit found, expected one such as "rad"'),
        ('unit = "rad"', 'unit = "m"', '[channels] position: found the unit "m", expected "rad"'),
        ('unit = "rad"', 'unit = "counts"', "counts need a scale"),
        ('unit = "A"', 'unit = "V"', '[channels] current: found the unit "V", expected "A"'),
        ('unit = "s"', 'unit = "sek"', '[channels] time: found the unknown unit "sek"; the nearest known one is "s'),
        ('"20 Hz"', "20", 'line 18: [processing] lowpass: found 20 without a unit, expected e.g. "20 Hz"'),
        ('"20 Hz"', '"-20 Hz"', "[processing] lowpass: found -20.0: input should be greater than 0"),
        ('"2 N*m/A"', '"2 N/A"', '[rig.drive] torque_constant: found the unit "N/A", expected "N*m/A"'),
        ("torque_constant", "force_constant", 'found force_constant with motion = "rotary", expected torque_constant'),
        ('"rotary"', '"rotational"', "[rig] motion: found 'rotational', expected 'rotary' or 'prismatic'"),
        ('"current"', '"amps"', "[rig.drive] kind: found 'amps', expected 'torque', 'current' or 'voltage'"),
        ('use = "fit"', 'use = "test"', "[[recordings]] 1 use: found 'test', expected 'fit' or 'validate'"),
        ('use = "fit"', 'window = ["3 s", "1 s"]', "window: found 3 s to 1 s, expected start before end"),
        ('use = "fit"', 'participant = "P9"', 'found the participant "P9", expected one of [participants]: none'),
        ('file = "recordings/sweep.csv"', "", "expected one of file and files, found neither"),
        ('name = "bench"', 'name = "my bench"', "name: found 'my bench', expected letters, digits"),
        ("time =", "times =", "no channel time found"),
        ("[processing]", "[processing", "not valid TOML"),
        ("trim = 20", 'trim = 20\n[rig.loop]\nkind = "cascade"\nkp = 1.0', "expects the gains kp, kv: missing kv"),
        ("trim = 20", "trim = 20\n[model]\nfamilies = []", "expected at least one, each once"),
        ("trim = 20", 'trim = 20\n[model]\nfamilies = ["symetric"]', "found 'symetric', expected 'symmetric'"),
        ("trim = 20", 'trim = 20\n[model]\nknown = { inertia = "1 kg" }', 'known: inertia: found the unit "kg"'),
        ("trim = 20", 'trim = 20\n[model]\nknown = { square_root = "1 N*m" }', 'square_root: found the unit "N*m"'),
        ("trim = 20", 'trim = 20\n[model]\nknown = { stribeck_velocity = "1 N*m" }', 'velocity: found the unit "N*m"'),
        ("trim = 20", 'trim = 20\n[model]\nknown = { load_friction = "1 N*m" }', 'load_friction: found the unit "N*m"'),
    ],
)  # fmt: skip
def test_a_wrong_study_file_names_line_key_found_and_expected(make_study, old, new, message):
    with pytest.raises(StudyError) as error:
        make_study(None, (old, new))
    assert message in str(error.value)
    assert "study.toml" in str(error.value)


def test_only_the_cause_is_told_of_a_wrong_motion(make_study):
    with pytest.raises(StudyError) as error:
        make_study(None, ('"rotary"', '"rotational"'))
    assert len(str(error.value).splitlines()) == 1


def test_every_problem_is_told_at_once(make_study):
    with pytest.raises(StudyError) as error:
        make_study(None, ("lowpass", "lowpas"), ('unit = "A"', 'unit = "V"'))
    assert len(str(error.value).splitlines()) == 2


def test_a_folder_without_a_study_file(tmp_path):
    with pytest.raises(StudyError, match=r"no such file; a study is a folder with a study.toml"):
        open_study(tmp_path)


def test_a_motion_without_gravity_cannot_have_it(make_study):
    changes = [("rotary", "prismatic"), ('torque_constant = "2 N*m/A"', ""), ('unit = "rad"', 'unit = "m"')]
    with pytest.raises(StudyError, match='found gravity = "sine" with motion = "prismatic"'):
        make_study(None, *changes, append='[model]\ngravity = "sine"\n')


def test_stored_numbers_become_si_in_the_stated_order(make_study):
    columns = {
        "t": np.arange(6.0) * 1000,
        "q": np.array([65530, 65535, 4, 9, 14, 19.0]),
        "i": np.array([1.0, -999, 2, 3, 4, 5]),
    }
    study = make_study(
        columns,
        ('"s" }', '"ms" }'),
        ('unit = "rad"', 'unit = "deg", scale = 0.1, sign = -1, offset = 1.0, wrap_bits = 16'),
        ('unit = "A"', 'unit = "mA", missing = -999'),
    )
    recording = study.recording("sweep")
    assert recording.time == pytest.approx(np.arange(6.0))
    counts = np.array([65530, 65535, 65540, 65545, 65550, 65555])
    assert recording["position"] == pytest.approx(np.radians(-0.1 * counts + 1.0))
    assert np.isnan(recording["current"][1])
    assert recording["current"][2] == pytest.approx(0.002)
    assert recording.fs == pytest.approx(1.0)


def test_a_negative_number_stored_unsigned(make_study):
    columns = {"t": np.arange(4.0), "q": np.zeros(4), "i": np.array([0.0, 1.0, 65535.0, 32768.0])}
    study = make_study(columns, ('unit = "A"', 'unit = "A", signed_bits = 16'))
    assert study.recording("sweep")["current"].tolist() == [0.0, 1.0, -1.0, -32768.0]


def test_a_loop_takes_its_own_gains_and_reference(make_study):
    reference = ("[processing]", 'reference = { column = "q", unit = "deg/s" }\n[processing]')
    loop = '[rig.loop]\nkind = "velocity_pi"\nkp = 1.0\nki = 2.0\n'
    study = make_study(None, reference, append=loop)
    assert study.recording("sweep").channels["reference"].unit == "rad/s"
    with pytest.raises(StudyError, match='reference: found the unit "deg/s", expected "rad"'):
        make_study(None, reference)
    assert make_study(None, append='[rig.loop]\nkind = "cascade"\nkp = 1.0\nkv = 2.0\nki = 0.5\n').rig.loop.ki == 0.5
    with pytest.raises(StudyError, match=r"\[rig\] loop: kind = .p. expects the gains kp: unused kd"):
        make_study(None, append='[rig.loop]\nkind = "p"\nkp = 1.0\nkd = 2.0\n')


def test_a_recording_overrides_a_channel_in_part(make_study):
    study = make_study(
        None, append='channels.position = { sign = -1 }\nchannels.emg.biceps = { column = "i", unit = "mV" }\n'
    )
    recording = study.recording("sweep")
    assert recording["position"] == pytest.approx(-make_study.swing()["q"])
    assert recording["emg.biceps"] == pytest.approx(make_study.swing()["i"] / 1000)
    assert recording.channels["emg.biceps"].unit == "V"


def test_one_file_named_twice_shares_no_sample(make_study):
    study = make_study(
        None,
        ('use = "fit"', 'use = "fit"\nwindow = ["0 s", "6 s"]'),
        append='[[recordings]]\nname = "rest"\nfile = "recordings/sweep.csv"\nuse = "validate"\n'
        'window = ["6 s", "99 s"]\n',
    )
    first, rest = study.recordings()
    assert len(first) + len(rest) == 2000
    assert first.time[-1] < 6.0 <= rest.time[0]
    assert study.recordings("validate") == (rest,)
    assert study.recordings()[0] is first


def test_a_window_outside_the_file(make_study):
    study = make_study(None, ('use = "fit"', 'window = ["60 s", "70 s"]'))
    with pytest.raises(
        RecordingError, match=r"sweep.csv: window 60 s to 70 s holds no sample, found times from 0 s to 9.995 s"
    ):
        study.recordings()


def test_a_pattern_names_each_file(make_study):
    study = make_study(None, ('file = "recordings/sweep.csv"', 'files = "recordings/*.csv"'))
    assert [r.name for r in study.recordings()] == ["sweep"]
    (study.folder / "recordings" / "again.csv").write_bytes((study.folder / "recordings" / "sweep.csv").read_bytes())
    study = open_study(study.folder)
    assert [r.name for r in study.recordings()] == ["sweep.again", "sweep.sweep"]
    assert study.recording("sweep.again").path.name == "again.csv"
    with pytest.raises(RecordingError, match=r'no recording "swep", expected one of sweep.again, sweep.sweep'):
        study.recording("swep")


def test_a_study_opens_before_its_recordings_exist(make_study):
    study = make_study()
    (study.folder / "recordings" / "sweep.csv").unlink()
    study = open_study(study.folder)
    with pytest.raises(
        RecordingError, match=r'no such file, expected by \[\[recordings\]\] "sweep"; recordings holds nothing'
    ):
        study.recordings()


def test_samples_cannot_be_changed(make_study):
    recording = make_study().recording("sweep")
    with pytest.raises(ValueError, match="read-only"):
        recording["position"][0] = 1.0
    with pytest.raises(TypeError):
        recording.channels["position"] = None


def test_enabled_is_everywhere_unless_recorded(make_study):
    columns = make_study.swing(10) | {"on": np.array([1.0] * 4 + [0.0] * 6)}
    assert make_study(columns).recording("sweep").enabled.all()
    study = make_study(columns, ("[processing]", 'enabled = { column = "on", unit = "1" }\n[processing]'))
    assert study.recording("sweep").enabled.sum() == 4


def test_the_schema_for_editors_accepts_what_is_accepted(make_study):
    import tomllib

    import jsonschema

    from pellucid.study.procedures.registry import study_model
    from pellucid.study.study_file import json_schema

    schema = json_schema(study_model())
    raw = tomllib.loads((make_study().folder / "study.toml").read_text())
    jsonschema.validate(raw, schema)
    raw["processing"]["lowpas"] = "3 Hz"
    with pytest.raises(jsonschema.ValidationError, match="lowpas"):
        jsonschema.validate(raw, schema)


SHOULDER = """
[[rig.joints]]
name = "shoulder"
motion = "rotary"

[rig.joints.drive]
kind = "current"
torque_constant = "0.1 N*m/A"

"""
RAIL = """
[[rig.joints]]
name = "rail"
motion = "prismatic"

[rig.joints.drive]
kind = "current"
force_constant = "3 N/A"

[rig.joints.limits]
velocity = "50 mm/s"
"""
CHANNELS = {
    "shoulder": 'position.shoulder = { column = "q", unit = "deg" }\ncurrent.shoulder = { column = "i", unit = "A" }\n',
    "rail": 'position.rail = { column = "q", unit = "mm" }\ncurrent.rail = { column = "i", unit = "mA" }\n',
}


@pytest.fixture
def make_joints(make_study):
    """A study whose [rig] is a list of joints, with the channels of a shoulder and a rail."""

    def make(tables, *changes, channels=("shoulder", "rail")):
        whole = make_study().folder.joinpath("study.toml").read_text(encoding="utf-8")
        rig = whole[whole.index("[rig]") : whole.index("[channels]")]
        plain = whole[whole.index("position =") : whole.index("[processing]")]
        named = "".join(CHANNELS[name] for name in channels)
        return make_study(None, (rig, tables), (plain, named + "\n"), *changes)

    return make


def test_a_machine_of_several_joints_is_read_joint_by_joint(make_joints):
    study = make_joints(SHOULDER + RAIL)
    shoulder, rail = study.rig.joints
    assert (shoulder.name, shoulder.joint, rail.name) == ("shoulder", "shoulder", "rail")
    assert shoulder.drive.constant == pytest.approx(0.1)
    assert (rail.drive.constant, rail.limits.velocity) == (pytest.approx(3.0), pytest.approx(0.05))
    recording = study.recording("sweep")
    assert recording.channels["position.shoulder"].unit == "rad"
    assert recording.channels["position.rail"].unit == "m"
    both = recording.of_joints("current", ["rail", "shoulder"])
    assert both.shape == (len(recording), 2)
    assert both[:, 0] == pytest.approx(1e-3 * both[:, 1])
    with pytest.raises(RecordingError, match=r"position.rail: found the units rad, m, expected one"):
        recording.of_joints("position", ["shoulder", "rail"])
    with pytest.raises(RecordingError, match=r"no channel position.wrist"):
        recording.of_joints("position", ["wrist", "rail"])


def test_what_takes_one_joint_refuses_several(make_joints):
    from pellucid import identify

    study = make_joints(SHOULDER + RAIL)
    expected = r"found 2 joints in \[\[rig.joints\]\] \(shoulder, rail\), expected one: .* one at a time"
    with pytest.raises(StudyError, match=expected):
        _ = study.rig.motion
    asks = '[transfer_function]\ninput = "current.rail"\noutput = "position.rail"\npoles = 2\n[processing]'
    with pytest.raises(PellucidError, match=expected):
        identify(make_joints(SHOULDER + RAIL, ("[processing]", asks)))


def test_known_values_and_dead_bands_are_of_one_joint(make_joints):
    known = ("[processing]", '[model]\nknown = { inertia = "1 kg*m^2" }\n[processing]')
    with pytest.raises(StudyError, match=r"\[model\] known: found values with 2 joints"):
        make_joints(SHOULDER + SHOULDER.replace("shoulder", "elbow"), known, channels=("shoulder",))


@pytest.mark.parametrize("suffix", ["", ".shoulder"])
def test_a_list_of_one_joint_is_a_machine_of_one(make_joints, suffix):
    study = make_joints(SHOULDER, ("position.shoulder", f"position{suffix}"), channels=("shoulder",))
    assert study.rig.joints == (study.rig,)
    assert (study.rig.joint, study.rig.motion) == ("shoulder", "rotary")
    recording = study.recording("sweep")
    assert set(recording.channels) == {"time", "position", "current"}
    assert np.array_equal(recording.of_joints("position", ["shoulder"])[:, 0], recording["position"])


def test_today_s_rig_is_one_joint(make_study):
    rig = make_study().rig
    assert [joint.joint for joint in rig.joints] == ["elbow"]
    assert rig.joints[0].drive is rig.drive


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "rail"', 'name = "shoulder"', "found the joints shoulder, shoulder, expected each name once"),
        ('"prismatic"', '"sliding"', "line 15: [[rig.joints]] 2 motion: found 'sliding', expected 'rotary' or 'pris"),
        ("force_constant", "torque_constant", "[[rig.joints]] 2 drive: found torque_constant with"),
        (
            '"50 mm/s"',
            '"50 deg/s"',
            'line 22: [[rig.joints]] 2 limits.velocity: found the unit "deg/s", expected "m/s"',
        ),
        ("force_constant", "force_const", 'unknown key "force_const"; the nearest valid one is "force_constant"'),
        ('name = "rail"', 'nam = "rail"', '[[rig.joints]] 2 nam: unknown key "nam"; the nearest valid one is "name"'),
        ("current.rail", "current.elbow", 'current.elbow: found the joint "elbow", expected one of shoulder, rail'),
        ("current.rail", "current", "found no joint's name in it, expected one of current.shoulder, current.rail"),
        (
            '0.1 N*m/A"',
            '0.1 N*m/A"\n[rig.joints.slider]\nlow = "0 m"\nhigh = "1 m"',
            "a slider in a machine of 2 joints",
        ),
        ('unit = "mm"', 'unit = "deg"', '[channels] position.rail: found the unit "deg", expected "m"'),
        ("lowpass", "lowpas", 'unknown key "lowpas"; the nearest valid one is "lowpass"'),
    ],
)
def test_what_is_wrong_with_one_of_several_joints_is_told(make_joints, old, new, message):
    changes = [(old, new)]
    if new == "current":  # a table cannot be a channel as well
        changes = [(CHANNELS["shoulder"], CHANNELS["shoulder"].split("\n")[0] + "\n"), ("current.rail", "current")]
    with pytest.raises(StudyError) as error:
        make_joints(SHOULDER + RAIL, *changes)
    assert message in str(error.value)


def test_a_joint_s_keys_stand_in_one_of_both_places(make_joints):
    with pytest.raises(StudyError, match=r'\[rig\] lifts: unknown key "lifts"'):
        make_joints('[rig]\nlifts = "flexion"\n' + SHOULDER + RAIL)


def test_the_schema_for_editors_knows_both_forms_of_a_rig(make_joints):
    import tomllib

    import jsonschema

    from pellucid.study.study_file import json_schema

    raw = tomllib.loads((make_joints(SHOULDER + RAIL).folder / "study.toml").read_text())
    jsonschema.validate(raw, json_schema())
    raw["rig"]["joints"][0]["motions"] = "rotary"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(raw, json_schema())


def test_a_table_is_taken_by_its_class(make_study):
    study = make_study(append='[onset]\npause = "50 ms"\n')
    assert study.table(OnsetTable) is study.find_table(OnsetTable) is study.config.table(OnsetTable)
    assert study.table(OnsetTable).pause == pytest.approx(0.05)
    assert study.find_table(HingeTable) is None
    with pytest.raises(IdentificationError, match=r"bench: found no table \[hinge\] in study.toml, expected one"):
        study.table(HingeTable)
    with pytest.raises(IdentificationError, match=r"study.toml: found no table \[hinge\], expected one"):
        study.config.table(HingeTable)
    assert all(p.table.table_name() == p.name for p in ALL_PROCEDURES if p.table is not None)
