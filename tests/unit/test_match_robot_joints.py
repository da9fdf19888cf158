"""Columns are matched to a robot's joints by name, then by order; gravity and what is missing may refuse a match."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import StudyError
from pellucid.arm.urdf import read_urdf
from pellucid.start.inference.assign_roles import ColumnRole, TableRoles
from pellucid.start.inference.clocks import FoundClock
from pellucid.start.match_robot_joints import match_names, match_robot_joints

RATE = 100.0
UR = [
    *(f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow")),
    *(f"wrist_{i}_joint" for i in (1, 2, 3)),
]
PANDA = [*(f"panda_joint{i}" for i in range(1, 8)), "panda_finger_joint1", "panda_finger_joint2"]


@pytest.mark.parametrize(
    ("logged", "names", "expected"),
    [
        ([f"A{i}" for i in range(1, 7)], [f"joint_a{i}" for i in range(1, 7)], list(range(6))),
        ([f"joint_{i}" for i in range(6)], [f"joint_{i}" for i in range(1, 7)], list(range(6))),
        ([f"joint_{i}" for i in range(7)], PANDA, list(range(7))),
        (["joint_2", "joint_3"], [f"joint_{i}" for i in range(1, 7)], [1, 2]),
        (["LeftHip", "LeftKnee", "RightHip"], ["r_hip", "l_hip", "l_knee"], [1, 2, 0]),
        (["hip", "knee"], ["left_hip_joint", "left_knee_joint", "left_ankle_joint"], [0, 1]),
        (["S", "L", "U"], ["joint_1_s", "joint_2_l", "joint_3_u"], [0, 1, 2]),
        (["Wrist 1", "Elbow", "Wrist 2"], UR, [3, 2, 4]),
        (["torso_lift_joint", "arm_1_joint"], ["arm_1_joint", "arm_2_joint"], [None, 0]),
        ([f"joint_{i}" for i in range(1, 7)], UR, [None] * 6),
        (["hip", "knee"], ["elbow", "wrist"], [None, None]),
    ],
)
def test_names_tell_joints(logged, names, expected):
    found = match_names(logged, names)
    assert found == {own: names[i] for own, i in zip(logged, expected, strict=True) if i is not None}


def written_robot(path, names, kinds=None, bodies=True, carriers=None):
    """Write a chain of links of 0.3 m that turn about y, or slide along z; `carriers` names other parents."""
    links, joints = ['<link name="base"/>'], []
    for i, name in enumerate(names):
        parent = (carriers or {}).get(name, f"{names[i - 1]}_link" if i else "base")
        kind, axis = ("prismatic", "0 0 1") if kinds and kinds[i] == "prismatic" else ("revolute", "0 1 0")
        joints.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>'
            f'<origin xyz="0 0 {0.3 * (i > 0)}"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
        )
        body = (
            f'<inertial><origin xyz="0 0 0.15"/><mass value="{3.0 - 0.8 * i}"/>'
            '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
        )
        links.append(f'<link name="{name}_link">{body if bodies else ""}</link>')
    path.write_text(f'<robot name="arm">{"".join(links)}{"".join(joints)}</robot>')
    return path


def recorded(robot, joints, rng, moving=None, unit="rad"):
    """Return roles and columns of `joints`, in the robot's file `moving`, whose efforts are those of its bodies."""
    t = np.arange(2000) / RATE
    w = 2.0 * np.pi * np.array([0.13, 0.31, 0.57])
    tree = read_urdf(robot).tree()[0]
    place = np.array([0.6, 0.3, 0.15])
    phases = np.stack([np.outer(t, w) + rng.uniform(0.0, 6.0, 3) for _ in tree.moving])
    q, v, a = np.sin(phases) @ place, np.cos(phases) @ (place * w), -np.sin(phases) @ (place * w**2)
    effort = tree.core.inverse_dynamics(q.T, v.T, a.T)
    order = [joint.name for joint in tree.moving]
    columns, roles = {}, []
    for joint, name in zip(joints, moving or order, strict=True):
        k = order.index(name)
        columns |= {f"q_{joint}": q[k], f"tau_{joint}": effort[:, k] + 0.05 * np.sign(v[k])}
        roles += [role(f"q_{joint}", "position", unit, joint), role(f"tau_{joint}", "torque", "N*m", joint)]
    clock = FoundClock(None, "s", RATE, "made", True)
    return TableRoles(clock, RATE, tuple(roles), tuple(joints)), columns


def role(column, quantity, unit, label):
    return ColumnRole(column, quantity, unit, "made", label=label)


def with_still(roles, columns, joint, place):
    """Add the columns of a joint that rests."""
    more = (role(f"q_{joint}", "position", "rad", joint), role(f"tau_{joint}", "torque", "N*m", joint))
    zero = np.zeros(2000)
    columns |= {f"q_{joint}": zero + place, f"tau_{joint}": zero}
    return replace(roles, roles=(*roles.roles, *more), joints=(*roles.joints, joint)), columns


def test_columns_without_names_are_taken_in_the_order_of_the_chain(tmp_path, rng):
    robot = written_robot(tmp_path / "arm.urdf", ["lift", "tilt"])
    roles, columns = recorded(robot, ["joint_1", "joint_2"], rng)
    found = match_robot_joints(robot, roles, [columns])
    assert found.names == {"joint_1": "lift", "joint_2": "tilt"}
    assert any("matched by order" in text for text in found.remarks)


@pytest.mark.parametrize(
    ("joints", "moving"),
    [(["joint_1", "joint_2"], ["tilt", "lift"]), (["lift", "tilt"], ["tilt", "lift"])],
    ids=["by order", "by name"],
)
def test_gravity_refuses_an_order_that_the_efforts_contradict(tmp_path, rng, joints, moving):
    robot = written_robot(tmp_path / "arm.urdf", ["lift", "tilt"])
    roles, columns = recorded(robot, joints, rng, moving)
    with pytest.raises(StudyError, match=rf"joints lift, tilt, .* {joints[0]}, {joints[1]}: .* much better with"):
        match_robot_joints(robot, roles, [columns])
    # Without bodies nothing contradicts.
    bare = written_robot(tmp_path / "bare.urdf", ["lift", "tilt"], bodies=False)
    assert match_robot_joints(bare, roles, [columns]).names == dict(zip(joints, ["lift", "tilt"], strict=True))


@pytest.mark.parametrize(
    ("joints", "names"),
    [(["hip", "knee"], ["elbow", "wrist"]), (["joint_1", "joint_2"], ["lift", "tilt", "roll"])],
    ids=["other names", "another count"],
)
def test_a_mismatch_names_both_lists(tmp_path, rng, joints, names):
    robot = written_robot(tmp_path / "arm.urdf", names)
    roles, columns = recorded(robot, joints, rng, names[:2])
    with pytest.raises(StudyError, match=rf"found the joints {', '.join(names)}, but .*{', '.join(joints)}: expected"):
        match_robot_joints(robot, roles, [columns])


def test_a_recorded_joint_that_the_file_lacks_is_left_out(tmp_path, rng):
    robot = written_robot(tmp_path / "arm.urdf", ["lift", "tilt"])
    roles, columns = recorded(robot, ["lift", "tilt"], rng)
    more = (role("q_gripper", "position", "rad", "gripper"), role("tau_gripper", "torque", "N*m", "gripper"))
    columns |= {"q_gripper": columns["q_lift"][::-1], "tau_gripper": columns["tau_lift"]}
    roles = replace(roles, roles=(*roles.roles, *more), joints=(*roles.joints, "gripper"))
    found = match_robot_joints(robot, roles, [columns])
    assert found.names == {"lift": "lift", "tilt": "tilt"}
    assert any(text.startswith("gripper: excluded") for text in found.remarks)


def test_what_is_missing_must_carry_nothing_that_moved(tmp_path, rng):
    robot = written_robot(tmp_path / "arm.urdf", ["lift", "tilt", "roll"])
    roles, columns = recorded(robot, ["lift", "tilt"], rng, ["lift", "tilt"])
    found = match_robot_joints(robot, roles, [columns])
    assert found.held == {"roll": "0 rad"}
    roles, columns = recorded(robot, ["tilt", "roll"], rng, ["tilt", "roll"])
    with pytest.raises(StudyError, match="a column with the position of lift, which carries joints that moved"):
        match_robot_joints(robot, roles, [columns])
    # A constant column says where it was.
    roles = replace(roles, roles=(*roles.roles, replace(role("q_lift", "position", "rad", ""), quantity=None)))
    found = match_robot_joints(robot, roles, [{**columns, "q_lift": np.full(2000, 0.25)}])
    assert found.held == {"lift": "0.25 rad"}


def test_a_joint_that_rests_is_held_where_it_was(tmp_path, rng):
    names = ["rail", "lift", "tilt"]
    robot = written_robot(tmp_path / "arm.urdf", names, kinds=["prismatic", "revolute", "revolute"])
    roles, columns = with_still(*recorded(robot, names[1:], rng, names[1:]), "rail", 0.15)
    found = match_robot_joints(robot, roles, [columns])
    assert (found.names, found.held) == ({"lift": "lift", "tilt": "tilt"}, {"rail": "0.15 m"})


def test_a_stated_unit_of_another_kind_refuses(tmp_path, rng):
    robot = written_robot(tmp_path / "arm.urdf", ["lift", "rail"], kinds=["revolute", "prismatic"])
    roles, columns = recorded(robot, ["lift", "rail"], rng)
    assert match_robot_joints(robot, roles, [columns]).kinds == {"lift": "rotary", "rail": "prismatic"}
    stated = tuple(
        replace(r, column=f"{r.column} [deg]", unit="deg") if r.column == "q_rail" else r for r in roles.roles
    )
    columns["q_rail [deg]"] = columns.pop("q_rail")
    with pytest.raises(StudyError, match="rail is rotary in the recordings, but rail is prismatic in the file"):
        match_robot_joints(robot, replace(roles, roles=stated), [columns])
