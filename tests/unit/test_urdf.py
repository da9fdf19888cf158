"""URDF files: read as Pinocchio reads them, and what cannot be a robot is named."""

import contextlib
import re

import numpy as np
import pytest

import pellucid
from pellucid._errors import IdentificationError, PellucidError, RecordingError, StudyError
from pellucid.arm.urdf import read_urdf
from pellucid.models.kinematic_tree import roll_pitch_yaw

BRANCHED = """<?xml version="1.0"?>
<robot name="two_arms">
  <link name="world"/>
  <link name="torso"><inertial><origin xyz="0 0 0.2" rpy="0.3 0 0"/><mass value="8"/>
    <inertia ixx="0.2" ixy="0.01" ixz="0" iyy="0.25" iyz="0.02" izz="0.2"/></inertial></link>
  <link name="slide"><inertial><origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 0.6"/><mass value="3"/>
    <inertia ixx="0.03" ixy="0.001" ixz="0.002" iyy="0.02" iyz="0.003" izz="0.04"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/slide.stl"/></geometry></visual></link>
  <link name="bracket"><inertial><origin xyz="0 0.1 0"/><mass value="0.5"/>
    <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.004"/></inertial></link>
  <link name="left"><inertial><origin xyz="0.2 0 0"/><mass value="1.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <link name="right"><inertial><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="tool"/>
  <joint name="stand" type="fixed"><parent link="world"/><child link="torso_base"/></joint>
  <link name="torso_base"/>
  <joint name="turn" type="revolute"><parent link="torso_base"/><child link="torso"/>
    <origin xyz="0 0 0.5" rpy="0.1 1.5707963267948966 -0.2"/><axis xyz="0 0 2"/>
    <limit lower="-1" upper="1.5" velocity="0" effort="20"/></joint>
  <joint name="lift" type="prismatic"><parent link="torso"/><child link="slide"/>
    <origin xyz="0.1 0.2 0.3" rpy="-0.7 0.2 0.9"/><axis xyz="0.6 0 0.8"/>
    <limit lower="0" upper="0.3" velocity="1" effort="100"/></joint>
  <joint name="weld" type="fixed"><parent link="slide"/><child link="bracket"/>
    <origin xyz="0 0.05 -0.1" rpy="1.2 -0.4 0.3"/></joint>
  <joint name="left_arm" type="revolute"><parent link="bracket"/><child link="left"/>
    <origin xyz="0 0.2 0" rpy="0.5 1.5707963267948966 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
  <joint name="right_arm" type="revolute"><parent link="bracket"/><child link="right"/>
    <origin xyz="0 -0.2 0"/><axis xyz="1 0 0"/><limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
  <joint name="flange" type="fixed"><parent link="left"/><child link="tool"/><origin xyz="0.4 0 0"/></joint>
</robot>
"""


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "robot.urdf"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def difference_to_pinocchio(path, seed=1):
    """Largest difference of inverse dynamics over random states [N m; N]."""
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(path))
    data, rng = model.createData(), np.random.default_rng(seed)
    robot, _ = read_urdf(path).tree(gravity=(0.0, 0.0, -9.81))
    theirs = [model.joints[model.getJointId(joint.name)].idx_v for joint in robot.moving]
    worst = 0.0
    for _ in range(5):
        q, v, a = rng.normal(size=(3, model.nv))
        made = robot.core.inverse_dynamics(q[theirs], v[theirs], a[theirs])
        worst = max(worst, np.abs(pin.rnea(model, data, q, v, a)[theirs] - made).max())
    return worst


def test_a_branched_robot_is_read_as_pinocchio_reads_it(written):
    assert difference_to_pinocchio(written(BRANCHED)) < 1e-10


@pytest.mark.parametrize("file", ["staubli_tx40/tx40_mdh_modified.urdf", "ur10e/ur10e.urdf"])
def test_real_robots_are_read_as_pinocchio_reads_them(file, data_folder):
    if not (data_folder / file).is_file():
        pytest.skip(f"{data_folder / file} is not here")
    assert difference_to_pinocchio(data_folder / file) < 1e-10


def test_what_a_file_says_beside_bodies(written):
    robot = read_urdf(written(BRANCHED))
    tree, on = robot.tree()
    assert robot.name == "two_arms"
    assert [joint.name for joint in tree.moving] == ["turn", "lift", "left_arm", "right_arm"]
    assert [joint.kind for joint in tree.moving] == ["revolute", "prismatic", "revolute", "revolute"]
    assert tree.base == "world"
    said = robot.limits["turn"]
    # A speed of 0 is what files say of what they do not know.
    assert (said.lower, said.upper, said.velocity, said.effort) == (-1.0, 1.5, None, 20.0)
    assert on["tool"][0] == "left"
    np.testing.assert_allclose(on["tool"][1][1], [0.4, 0.0, 0.0])
    assert on["bracket"][0] == "slide"
    assert robot.notes == ()


def test_a_joint_that_is_held_is_part_of_what_carries_it(written):
    robot = read_urdf(written(BRANCHED))
    whole, _ = robot.tree()
    held, _ = robot.tree({"lift": 0.07, "right_arm": -0.4})
    assert [joint.name for joint in held.moving] == ["turn", "left_arm"]
    q, v, a = np.random.default_rng(2).normal(size=(3, 2))
    still = np.zeros(4)
    states = [still.copy(), still.copy(), still.copy()]
    for state, values in zip(states, (q, v, a), strict=True):
        state[[0, 2]] = values
    states[0][[1, 3]] = 0.07, -0.4
    np.testing.assert_allclose(
        held.core.inverse_dynamics(q, v, a), whole.core.inverse_dynamics(*states)[[0, 2]], atol=1e-12
    )


def test_roll_pitch_and_yaw_are_exact_at_right_angles():
    from pellucid.models.kinematic_tree import rotation

    rng = np.random.default_rng(3)
    for pitch in (np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, 0.3):
        turn = rotation((rng.normal(), pitch, rng.normal())) @ np.eye(3)
        np.testing.assert_allclose(rotation(roll_pitch_yaw(turn)), turn, atol=1e-14)


LINK = '<link name="{}"><inertial><mass value="{}"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>'
TWO = f"""<robot name="r"><link name="base"/>{LINK.format("a", 1)}{LINK.format("b", 1)}
<joint name="one" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="two" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/></joint>
{{}}</robot>"""


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('<axis xyz="0 1 0"/>', ""), r"robot.urdf, joint 'two': found no <axis>, expected one such as"),
        (('xyz="0 1 0"', 'xyz="0 0 0"'), "joint 'two': found <axis xyz=\"0 0 0\"/>, expected a direction"),
        (('xyz="0 1 0"', 'xyz="0 1"'), "joint 'two', <axis>: found xyz = '0 1', expected three numbers"),
        (('xyz="0.3 0 0"', 'xyz="300 0 0"'), "joint 'two': found place .* are these millimetres"),
        (('xyz="0.3 0 0"', 'xyz="${l} 0 0"'), "found xyz = '\\${l}', expected a number; make URDF of it with xacro"),
        (('<parent link="a"/>', '<parent link="arm"/>'), "joint 'two': found the parent 'arm', which is no <link>"),
        (('<child link="b"/>', ""), "joint 'two': found no <child>, expected"),
        (
            ('type="revolute"><parent link="a"', 'type="floating"><parent link="a"'),
            "type 'floating'.*fix its base",
        ),
        (('<mass value="1"/>', '<mass value="-1"/>'), "link 'a': found the mass '-1', expected a number >= 0"),
        (('<mass value="1"/>', ""), "link 'a': found an <inertial> without <mass>"),
        (('<robot name="r">', '<sdf name="r">'), "not readable as XML"),
        (("</robot>", ""), "robot.urdf: not readable as XML, truncated or damaged"),
        (('ixx="0.01"', 'ixx="10000"'), "link 'a': found moments of inertia as of a body .* are these kg mm"),
        (("<robot", "<!DOCTYPE r [<!ENTITY a 'b'>]><robot"), "found a document type"),
        (('<joint name="two"', '<joint name="one"'), "found two joints named 'one'"),
        (('<link name="base"/>', '<link name="base"/>' * 600), "found 602 times <link>, expected at most 500"),
    ],
)
def test_what_cannot_be_a_robot_is_named(written, change, message):
    text = TWO.format("")
    assert change[0] in text
    with pytest.raises((RecordingError, IdentificationError), match=message):
        read_urdf(written(text.replace(*change))).tree()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            '<joint name="back" type="fixed"><parent link="base"/><child link="b"/></joint>',
            "child of two joints, .*loop",
        ),
        ('<link name="c"/>', "link 'c' has no joint"),
        (
            '<link name="d"/><link name="c"/><joint name="x" type="fixed"><parent link="d"/><child link="c"/></joint>',
            "links without a parent: 'base', 'd'",
        ),
        (
            '<link name="c"/><joint name="x" type="revolute"><parent link="b"/><child link="c"/>'
            '<axis xyz="1 0 0"/></joint>',
            "robot.urdf: link 'c': found mass 0 on joint 'x', which moves",
        ),
        (
            LINK.format("c", 1)
            + '<joint name="x" type="revolute"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>'
            '<mimic joint="two"/></joint>',
            "joint 'x': found that it follows 'two', .*hold it",
        ),
    ],
)
def test_what_hangs_together_wrongly_is_named(written, more, message):
    with pytest.raises(IdentificationError, match=message):
        read_urdf(written(TWO.format(more))).tree()


def test_a_joint_that_follows_one_that_is_held_is_held_too(written):
    follower = (
        LINK.format("c", 1) + '<joint name="x" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>'
        '<mimic joint="two" multiplier="2" offset="0.1"/></joint>'
    )
    robot = read_urdf(written(TWO.format(follower)))
    assert [joint.name for joint in robot.moving] == ["one", "two"]
    tree, on = robot.tree({"two": 0.2})
    assert [joint.name for joint in tree.moving] == ["one"]
    np.testing.assert_allclose(on["c"][1][1], [0.3 + 0.5 * np.cos(0.2), 0.0, -0.5 * np.sin(0.2)], atol=1e-15)
    with pytest.raises(IdentificationError, match="found no joint 'three' to hold, expected one of one, two, x"):
        robot.tree({"three": 0.0})


def test_crude_bodies_are_told_and_used(written):
    text = TWO.format("").replace('ixx="0.01" iyy="0.01" izz="0.01"', 'ixx="0.01" iyy="0.01" izz="0.05"', 1)
    (note,) = read_urdf(written(text)).notes
    assert "link 'a': found moments of inertia 0.01, 0.01 and 0.05 kg m^2, of which no body has" in note
    text = TWO.format("").replace('ixx="0.01" iyy="0.01" izz="0.01"', 'ixx="0" iyy="0.01" izz="0.01"', 1)
    (note,) = read_urdf(written(text)).notes
    assert "link 'a': found a moment of inertia of 0 kg m^2 about its centre, expected > 0" in note


def test_a_study_is_written_for_a_robot(written, tmp_path):
    pair = ("\n" + LINK.format("c", 1)).join(BRANCHED.split("</robot>"))
    follower = (
        '<joint name="finger" type="prismatic"><parent link="tool"/><child link="c"/><axis xyz="1 0 0"/>'
        '<limit lower="0" upper="0.04" velocity="1" effort="9"/><mimic joint="lift" offset="0.01"/></joint></robot>'
    )
    made = pellucid.init(tmp_path / "my arm", urdf=written(pair + follower))
    assert made == tmp_path / "my arm" / "study.toml"
    study = pellucid.open(made.parent)
    assert (study.name, study.config.tree.urdf) == ("my-arm", "robot.urdf")
    assert study.config.tree.held == {"finger": 0.01}
    assert [joint.motion for joint in study.rig.joints] == ["rotary", "prismatic", "rotary", "rotary"]
    turn, lift, *_ = study.rig.joints
    assert (turn.limits.position_min, turn.limits.position_max, turn.limits.velocity) == (-1.0, 1.5, None)
    assert (turn.limits.effort, lift.limits.position_max, lift.dead_band) == (20.0, 0.3, 0.002)
    assert {"position.lift", "force.lift", "torque.turn"} <= set(study.config.channels)
    # What is missing is said next.
    with pytest.raises(RecordingError, match=r"first\.csv: no such file, expected by"):
        pellucid.check(study)
    with pytest.raises(StudyError, match=r"expected a new or empty folder"):
        pellucid.init(tmp_path / "my arm", urdf=written(BRANCHED))
    with pytest.raises(PellucidError, match=r"nothing\.urdf: not readable: no such file$"):
        pellucid.init(tmp_path / "other", urdf=tmp_path / "nothing.urdf")
    assert not (tmp_path / "other").exists()
    with pytest.raises(StudyError, match=r"found a joint 'a/b', expected letters"):
        pellucid.init(tmp_path / "other", urdf=written(TWO.format("").replace('name="two"', 'name="a/b"')))


def test_a_file_without_bodies_gets_stand_ins(written):
    shapes = re.sub("<inertial>.*?</inertial>", "", BRANCHED, flags=re.DOTALL)
    robot = read_urdf(written(shapes))
    (note,) = robot.notes
    assert "found no link with a mass, expected <inertial> of each: bodies of 1 kg are assumed" in note
    assert {link.mass for link in robot.tree()[0].links} == {1.0}


def test_damaged_files_are_refused_in_words(written):
    """Cut off, or with a byte changed, a file is a robot's or not, and nothing else."""
    rng, whole = np.random.default_rng(5), BRANCHED.encode()
    for n in range(150):
        at = int(rng.integers(len(whole)))
        damaged = whole[:at] if n % 3 == 0 else whole[:at] + bytes([rng.integers(256)]) + whole[at + 1 :]
        path = written("")
        path.write_bytes(damaged)
        with contextlib.suppress(PellucidError):
            read_urdf(path).tree()
