"""Studies of robots: from files to motions of all joints, and what keeps them from being used."""

import re

import numpy as np
import pytest

from pellucid._errors import PellucidError, RecordingError, StudyError
from pellucid.arm.fit import friction_terms
from pellucid.arm.study.recorded_tree import recorded_tree, robot_of
from pellucid.arm.study.tree_table import FURTHER_TERMS
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.study.procedures.registry import asked, open_study
from pellucid.study.procedures.run import check

STUDY = """name = "arm"
[tree]
gravity = [0, 0, -2]
[[rig.joints]]
name = "shoulder"
motion = "rotary"
turns = { shoulder = -50.0 }
zero = "90 deg"
place = ["0 mm", "0 mm", "320 mm"]
axis = [0, 2, 0]
body = { mass = "2 kg", centre = ["0 m", "0 m", "-0.15 m"] }
[rig.joints.drive]
kind = "current"
torque_constant = "0.04 N*m/A"
[[rig.joints]]
name = "elbow"
motion = "rotary"
turns = { shoulder = 30.0, elbow = 30.0 }
place = ["0 mm", "0 mm", "-300 mm"]
axis = [0, 1, 0]
body = { mass = "1 kg", centre = ["0 m", "0 m", "-0.1 m"], inertia = ["0.01 kg*m^2", "0 kg*m^2", "0 kg*m^2", "0.02 kg*m^2", "0 kg*m^2", "0.01 kg*m^2"] }
[rig.joints.drive]
kind = "torque"
[channels]
time = { rate = "250 Hz" }
motor_position.shoulder = { column = 0, unit = "rad" }
motor_position.elbow = { column = 1, unit = "rad" }
[streams.drives]
join = true
offset = "0 s"
drift = 0
[streams.drives.channels]
time = { rate = "250 Hz" }
current.shoulder = { column = 0, unit = "mA" }
torque.elbow = { column = 1, unit = "N*m" }
[processing]
lowpass = "20 Hz"
decimate = 2
trim = 30
dead_band = "0.02 rad/s"
[[recordings]]
name = "sweep"
file = "motors.csv"
streams = { drives = "drives.csv" }
window = ["0 s", "12 s"]
[[recordings]]
name = "loaded"
file = "motors.csv"
streams = { drives = "drives.csv" }
payload = { mass = "1.5 kg" }
use = "validate"
window = ["12 s", "20 s"]
"""  # noqa: E501
GEARS = np.array([[-50.0, 0.0], [30.0, 30.0]])
TREE = Tree(
    [
        TreeJoint("shoulder", "base", "upper", axis=(0.0, 1.0, 0.0), place=(0.0, 0.0, 0.32)),
        TreeJoint("elbow", "upper", "lower", axis=(0.0, 1.0, 0.0), place=(0.0, 0.0, -0.3)),
    ],
    [
        Link.about_centre("upper", 2.0, (0.0, 0.0, -0.15), [0.0] * 6),
        Link.about_centre("lower", 1.0, (0.0, 0.0, -0.1), [0.01, 0.0, 0.0, 0.02, 0.0, 0.01]),
    ],
)


def played(shoulder=1.0, elbow=1.0):
    """Time (n,), and position, velocity, effort at the joints, (n, 2)."""
    t = np.arange(5000) / 250.0
    w = np.array([[2.1, 3.7], [2.9, 5.3]])
    amplitude = np.array([[0.5, 0.2], [0.6, 0.2]]) * np.array([[shoulder], [elbow]])
    phase = w[..., None] * t
    q = (amplitude[..., None] * np.sin(phase)).sum(axis=1).T
    v = (amplitude[..., None] * w[..., None] * np.cos(phase)).sum(axis=1).T
    a = -(amplitude[..., None] * w[..., None] ** 2 * np.sin(phase)).sum(axis=1).T
    effort = TREE.core.inverse_dynamics(q, v, a) + 0.3 * v + 0.8 * np.tanh(v / 0.005)
    return t, q, v, effort


def written(folder, motion=None, text=STUDY, rows=5000, gears=GEARS):
    """A study of the arm as its motors saw it."""
    _, q, _, effort = motion or played()
    noise = np.random.default_rng(4).normal(size=(2, *q.shape))
    motors = (q - [np.pi / 2, 0.0]) @ gears.T + 1e-4 * noise[0]
    torques = np.linalg.solve(gears.T, effort.T).T + 1e-4 * noise[1]
    drives = torques / [0.04e-3, 1.0]
    for name, columns in (("motors.csv", motors), ("drives.csv", drives[:rows])):
        np.savetxt(folder / name, columns, delimiter=",", fmt="%.9g")
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return open_study(folder)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return written(tmp_path_factory.mktemp("arm"))


def test_motors_are_turned_into_joints(study):
    robot, motions = recorded_tree(study)
    assert robot.names == ("shoulder", "elbow")
    np.testing.assert_allclose(robot.turns_array, [[1.0, 0.0], [1.0, 1.0]])
    np.testing.assert_allclose(robot.tree.gravity, (0.0, 0.0, -9.80665))
    np.testing.assert_allclose(robot.tree.links_array, TREE.links_array, atol=1e-12)
    fitted, loaded = motions
    _, q, v, effort = (x[30:-30:2] for x in played())
    q, v, effort = (x[: len(fitted)] for x in (q, v, effort))
    np.testing.assert_allclose(fitted.position, q, atol=1e-3)
    np.testing.assert_allclose(fitted.velocity, v, atol=1e-2)
    far = np.abs(v).min(axis=1) > 0.3  # away from reversals, which the low-pass rounds
    np.testing.assert_allclose(fitted.effort[far], effort[far], atol=0.1)
    np.testing.assert_allclose(fitted.effort, (fitted.gain * fitted.drive) @ robot.turns_array)
    assert fitted.drive_units == ("A", "N*m")
    assert fitted.gain_known == (True, True)
    np.testing.assert_allclose(fitted.gain, [-2.0, 30.0])
    assert fitted.rate == 125.0
    assert (loaded.use, loaded.payload.mass) == ("validate", 1.5)
    assert loaded.time[0] == pytest.approx(12.0 + 30 / 250)
    # Joints that never stop together: ten parts of each recording, numbered through.
    assert [(m.segment.min(), m.segment.max()) for m in motions] == [(0, 9), (10, 19)]


def test_it_is_asked_and_fit(study):
    assert [procedure.name for procedure in asked(study)] == ["tree"]
    assert [fault.message for fault in check(study) if fault.severity == "refuse"] == []


def test_terms_that_a_study_names_are_those_of_the_fit():
    assert FURTHER_TERMS == friction_terms.FURTHER_TERMS


def test_a_clock_may_count_from_1970(tmp_path):
    clock = changed(('[channels]\ntime = { rate = "250 Hz" }', '[channels]\ntime = { column = 2, unit = "ns" }'))
    clock = clock.replace('["0 s", "12 s"]', '["0 s", "1700000012 s"]').replace('window = ["12 s", "20 s"]\n', "")
    clock = clock.replace('[streams.drives.channels]\ntime = { rate = "250 Hz" }',
                          '[streams.drives.channels]\ntime = { column = 2, unit = "ns" }')  # fmt: skip
    written(tmp_path, text=clock)
    stamps = (1_700_000_000_000_000_000 + np.arange(5000) * 4_000_000).astype(str)
    for name in ("motors.csv", "drives.csv"):
        lines = (tmp_path / name).read_text(encoding="utf-8").splitlines()
        lines = [f"{line},{stamp}" for line, stamp in zip(lines, stamps, strict=True)]
        (tmp_path / name).write_text("\n".join(lines), encoding="utf-8")
    study = open_study(tmp_path)
    assert [fault.message for fault in check(study) if fault.channel == "time"] == []
    assert recorded_tree(study)[1][0].rate == pytest.approx(125.0)


def changed(*pairs):
    text = STUDY
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def refused(folder, **changes):
    """What `check` refuses, in one text."""
    return "\n".join(fault.message for fault in check(written(folder, **changes)) if fault.severity == "refuse")


def test_a_joint_that_never_moves_is_named(tmp_path):
    said = refused(tmp_path, motion=played(elbow=0.0))
    assert re.search(r"motors.csv, channel motor_position.elbow: found joint elbow within \S+ rad in all", said)
    assert "expected a joint that moves: record it moving" in said


def test_joints_that_move_only_together_are_named(tmp_path):
    t, q, v, _ = played()
    q, v = (np.column_stack([x[:, 0], 0.5 * x[:, 0]]) for x in (q, v))
    a = np.gradient(v, t, axis=0)
    effort = TREE.core.inverse_dynamics(q, v, a) + 0.3 * v + 0.8 * np.tanh(v / 0.005)
    said = refused(tmp_path, motion=(t, q, v, effort))
    assert "found joints shoulder and elbow moving only together (speeds 0.5 to 1, correlation" in said


def test_an_effort_of_the_wrong_sign_is_named(tmp_path):
    text = changed(("current.shoulder = { column = 0", "current.shoulder = { sign = -1, column = 0"))
    said = refused(tmp_path, text=text)
    assert "channel motor_position.shoulder: found friction of joint shoulder that delivers energy" in said
    assert "write sign = -1 for the drive's channel, or, of turns.shoulder, for the position's" in said


def test_a_gear_of_the_wrong_sign_is_named(tmp_path):
    """Of a motor that others share the torques no longer fit; of one alone the robot is another one."""
    said = refused(tmp_path, text=changed(("shoulder = -50.0", "shoulder = 50.0")))
    assert "motor_position.elbow: found friction of joint elbow that delivers energy" in said
    assert "or of a joint that shares its motor" in said
    alone = changed(("shoulder = -50.0", "shoulder = 50.0"), ("{ shoulder = 30.0, elbow", "{ elbow"))
    said = refused(tmp_path, text=alone, gears=np.diag([-50.0, 30.0]))
    assert "channel motor_position.shoulder: found" in said
    assert "of the efforts unexplained as with the sign of joint shoulder" in said
    assert "try the opposite sign of turns.shoulder" in said


def test_a_sensor_behind_the_friction_shows_signs_by_what_bodies_need(tmp_path):
    _, q, v, a = (*played()[:3], np.gradient(played()[2], 1 / 250, axis=0))
    needed = TREE.core.inverse_dynamics(q, v, a)
    late = np.vstack([needed[:2], needed[:-2]])  # 8 ms: friction seems to give some energy
    sensed = changed(
        ('turns = { shoulder = -50.0 }\nzero = "90 deg"', "# joint"),
        ("turns = { shoulder = 30.0, elbow = 30.0 }", "# joint"),
        ("motor_position.", "position."),
        ('kind = "current"\ntorque_constant = "0.04 N*m/A"', 'kind = "torque"'),
        ('current.shoulder = { column = 0, unit = "mA" }', 'torque.shoulder = { column = 0, unit = "N*m" }'),
    )

    def refused_of(effort):
        written(tmp_path, text=sensed)
        for name, columns in (("motors.csv", q), ("drives.csv", effort)):
            np.savetxt(tmp_path / name, columns + 1e-5 * np.random.default_rng(6).normal(size=q.shape), delimiter=",")
        return "\n".join(f.message for f in check(open_study(tmp_path)) if f.severity == "refuse")

    assert refused_of(late) == ""
    said = refused_of(-needed)
    assert "found efforts that oppose what the stated bodies need (correlation -1.00)" in said
    said = refused_of(needed * [1.0, -1.0])
    assert "of the efforts unexplained as with the sign of the effort of joint" in said


def test_files_of_other_lengths_are_told(tmp_path):
    told = [fault for fault in check(written(tmp_path, rows=4000)) if fault.kind == "lengths"]
    assert "motors.csv, channel time: found 2000 samples, of which drives.csv has 1000" in told[0].message


def test_degrees_said_as_radians_are_named(tmp_path):
    q = played()[1]
    joints = changed(
        ('turns = { shoulder = -50.0 }\nzero = "90 deg"', "# joint"),
        ("turns = { shoulder = 30.0, elbow = 30.0 }", "# joint"),
        ("motor_position.", "position."),
    )
    written(tmp_path, text=joints)
    np.savetxt(tmp_path / "motors.csv", np.degrees(q), delimiter=",")
    faults = [fault for fault in check(open_study(tmp_path)) if fault.severity == "refuse"]
    assert {fault.channel for fault in faults} == {"position.shoulder", "position.elbow"}
    assert all("which looks like deg taken for rad" in fault.message for fault in faults)


def test_defects_of_each_joint_are_cut(tmp_path):
    written(tmp_path)
    rows = np.loadtxt(tmp_path / "motors.csv", delimiter=",")
    rows[2000, 1] += 5.0
    np.savetxt(tmp_path / "motors.csv", rows, delimiter=",")
    study = open_study(tmp_path)
    cut = {(f.kind, f.channel) for f in check(study) if f.severity == "cut"}
    assert ("spike", "motor_position.elbow") in cut
    _, motions = recorded_tree(study)
    sweep = [m for m in motions if m.recording == "sweep"]
    assert len(sweep) == 2
    # A cut makes no segments.
    assert (sweep[0].segment.min(), sweep[1].segment.max()) == (0, 9)


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ([("motor_position.elbow =", "motor_position.wrist =")], 'found the joint "wrist", expected one of shoulder'),
        ([("[tree]\ngravity = [0, 0, -2]", "")], "shoulder: found turns|found rotor_inertia|expected a table .tree."),
        ([("gravity = [0, 0, -2]", "gravity = [0, 0, 0]")], "points nowhere"),
        ([("axis = [0, 1, 0]\n", "")], r"\[\[rig.joints\]\] elbow: found place, expected place and axis"),
        ([("turns = { shoulder = -50.0 }", "turns = { elbow = 2.0 }")], "how often the motor turns with shoulder"),
        ([("turns = { shoulder = -50.0 }", "turns = { shoulder = 2.0, arm = 1.0 }")], 'turns: found "arm"'),
        ([("[tree]", "[tree]\nsegments = { other = [\"1 s\", \"2 s\"] }")], 'segments: found "other", expected names'),
        ([("[tree]", "[tree]\nsegments = { sweep = [\"2 s\", \"1 s\"] }")], "at least two times that increase"),
        ([("[tree]", "[tree]\nheld = { finger = \"2 mm\" }")], "expected .tree. urdf to name the file"),
        ([("[tree]", "[tree]\nurdf = \"arm.urdf\"")], "found place and .tree. urdf, expected one of them"),
        ([("lowpass = \"20 Hz\"\n", "")], "lowpass: found none, expected a cut-off"),
        ([("[rig.joints.drive]\nkind = \"torque\"\n", "")], "elbow: found no .rig.joints.drive."),
        ([("motion = \"rotary\"\nturns = { shoulder = 30.0, ", "motion = \"prismatic\"\nturns = { shoulder = 30.0, "),
          ("kind = \"torque\"\n", "kind = \"torque\"\n"), ("dead_band = \"0.02 rad/s\"", "dead_band = \"0.02 m/s\"")],
         "dead_band: found one for joints that turn and joints that slide"),
    ],
)  # fmt: skip
def test_what_a_table_cannot_say_is_named(tmp_path, pairs, message):
    (tmp_path / "study.toml").write_text(changed(*pairs), encoding="utf-8")
    with pytest.raises(StudyError, match=message):
        open_study(tmp_path)


def test_motors_that_share_joints_need_their_constants(tmp_path):
    study = written(tmp_path, text=changed(('torque_constant = "0.04 N*m/A"\n', "")))
    with pytest.raises(StudyError, match="shoulder: found no torque constant, expected one: its motor or another"):
        recorded_tree(study)


def test_a_drive_without_a_constant_stays_in_its_unit(tmp_path):
    alone = changed(
        ('torque_constant = "0.04 N*m/A"\n', ""),
        ("turns = { shoulder = 30.0, elbow = 30.0 }", "turns = { elbow = 30.0 }"),
    )
    _, (motion, _) = recorded_tree(written(tmp_path, text=alone))
    assert motion.gain_known == (False, True)
    np.testing.assert_array_equal(motion.gain, [-1.0, 30.0])


def test_a_channel_that_is_not_there_is_named(tmp_path):
    study = written(tmp_path, text=changed(('motor_position.elbow = { column = 1, unit = "rad" }', "")))
    with pytest.raises(RecordingError, match=r"found no channel motor_position\.elbow, expected one in \[channels\]"):
        recorded_tree(study)
    said = "\n".join(fault.message for fault in check(study))
    assert "channel motor_position.elbow: found only time, motor_position.shoulder" in said


FILE = """<robot name="r"><link name="base"/><link name="a"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link><link name="b"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
<joint name="{}" type="{}"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>"""
OF_A_FILE = re.sub(r"^(place|axis|body) = .*\n", "", STUDY, flags=re.MULTILINE)


def of_a_file(folder, joint="elbow", kind="revolute", more=""):
    (folder / "arm.urdf").write_text(FILE.format(joint, kind), encoding="utf-8")
    text = OF_A_FILE.replace("[tree]", f'[tree]\nurdf = "arm.urdf"\n{more}')
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return open_study(folder)


def test_joints_are_those_of_the_robots_file(tmp_path):
    assert robot_of(of_a_file(tmp_path)).names == ("shoulder", "elbow")
    for joint, kind, message in (
        ("wrist", "revolute", "found 'elbow', expected joints that move in arm.urdf: shoulder, wrist"),
        ("elbow", "prismatic", 'elbow: found motion = "rotary", expected that of arm.urdf, where it is prismatic'),
    ):
        with pytest.raises(PellucidError, match=message):
            robot_of(of_a_file(tmp_path, joint, kind))
    held = of_a_file(tmp_path, more='held = { elbow = "0.2 rad" }\n')
    with pytest.raises(PellucidError, match=r"found 'elbow', expected joints that move in arm\.urdf: shoulder"):
        robot_of(held)


def test_a_robots_file_that_is_not_there_is_named(tmp_path):
    written(tmp_path)
    study = of_a_file(tmp_path)
    (tmp_path / "arm.urdf").unlink()
    (fault,) = [fault for fault in check(study) if fault.severity == "refuse"]
    assert "arm.urdf: no such file, expected by [tree] urdf: the robot's file, in the study's folder" in fault.message


def test_a_payload_is_on_what_carries_its_link(tmp_path):
    written(tmp_path)
    weld = '<link name="tool"/><joint name="w" type="fixed"><parent link="b"/><child link="tool"/>'
    weld += '<origin xyz="0 0 -0.2" rpy="0 1.5707963267948966 0"/></joint></robot>'
    (tmp_path / "arm.urdf").write_text(FILE.format("elbow", "revolute").replace("</robot>", weld), encoding="utf-8")
    text = OF_A_FILE.replace("[tree]", '[tree]\nurdf = "arm.urdf"')
    carried = '{ mass = "1.5 kg", link = "tool", centre = ["0.1 m", "0 m", "0 m"] }'
    text = text.replace('{ mass = "1.5 kg" }', carried)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    loaded = recorded_tree(open_study(tmp_path))[1][-1].payload
    assert (loaded.mass, loaded.link) == (1.5, "b")
    np.testing.assert_allclose(loaded.centre, [0.0, 0.0, -0.3], atol=1e-12)
    (tmp_path / "study.toml").write_text(text.replace('"tool"', '"hand"'), encoding="utf-8")
    said = "\n".join(fault.message for fault in check(open_study(tmp_path)))
    assert 'loaded: a payload on the link "hand", expected one of a, b, base, tool' in said


def test_a_robots_file_is_read_within_the_study(tmp_path):
    of_a_file(tmp_path)
    text = (tmp_path / "study.toml").read_text(encoding="utf-8").replace("arm.urdf", "../arm.urdf")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(PellucidError, match=r"arm\.urdf"):
        robot_of(open_study(tmp_path))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"[tree]": '[tree]\ngains = "payload"'},
            '[tree] gains = "payload" and no recording with a payload and use = "fit"',
        ),
        (
            {'use = "validate"': 'use = "fit"', 'window = ["0 s"': 'use = "validate"\nwindow = ["0 s"'},
            'no recording with use = "fit" and without a payload',
        ),
    ],
)
def test_what_may_be_fitted_must_be_marked_so(tmp_path, changes, said):
    text = STUDY
    for before, after in changes.items():
        text = text.replace(before, after)
    assert said in "\n".join(fault.message for fault in check(written(tmp_path, text=text)))
