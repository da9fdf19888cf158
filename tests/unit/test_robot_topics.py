"""Robots' logs: times of headers, several publishers on a topic, controllers' states, and topics that are left out."""

import contextlib
import json
import sqlite3

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.files.readers import read_columns

START = 1_700_000_000 * 10**9
STEP = 4_000_000


def stamp(k, start=START):
    seconds, rest = divmod(start + k * STEP, 10**9)
    return {"sec": seconds, "nanosec": rest}


def write(path, messages):
    """Write (topic, time of the log [ns], message) to an MCAP file as JSON."""
    writing = pytest.importorskip("mcap.writer")
    with path.open("wb") as file:
        writer = writing.Writer(file)
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        channels = {topic: writer.register_channel(topic, "json", schema) for topic, _, _ in messages}
        for topic, time, message in messages:
            writer.add_message(channels[topic], time, json.dumps(message).encode(), time)
        writer.finish()
    return path


def states(n, start=START, order=("hip", "knee")):
    """Joint states that the log gets with a delay that varies."""
    delays = np.random.default_rng(5).integers(0, 3_000_000, n).tolist()
    return [
        ("/joint_states", START + k * STEP + delay,
         {"header": {"stamp": stamp(k, start)}, "name": list(order), "position": [0.1 * k, -0.1 * k], "velocity": []})
        for k, delay in enumerate(delays)
    ]  # fmt: skip


@pytest.mark.parametrize(("start", "of_headers"), [(START, True), (5 * 10**9, True), (None, False)])
def test_times_are_those_of_the_headers(tmp_path, start, of_headers):
    """Also of a simulation's clock; those of the log only where the headers have none."""
    messages = states(200, start or START)
    if start is None:
        for _, _, message in messages:
            message["header"]["stamp"] = {"sec": 0, "nanosec": 0}
    columns = read_columns(write(tmp_path / "a.mcap", messages))
    jitter = np.std(np.diff(columns["joint_states.time"]))
    assert (jitter < 1e-8) == of_headers
    assert columns["joint_states.time"][0] == pytest.approx(0.0, abs=0.003)
    assert columns["joint_states.header.stamp"][0] == pytest.approx(
        (START if start is None else start) / 1e9 * of_headers
    )
    assert columns.units["joint_states.header.stamp"] == "s"


def test_an_arm_and_a_gripper_on_one_topic_are_apart(tmp_path):
    arm = states(60)
    for _, _, message in arm[30:]:
        message["name"] = message["name"][::-1]
        message["position"] = message["position"][::-1]
    gripper = [
        (
            "/joint_states",
            START + k * STEP + 100,
            {"header": {"stamp": stamp(k)}, "name": ["finger"], "position": [0.02]},
        )
        for k in range(0, 60, 4)
    ]
    columns = read_columns(write(tmp_path / "a.mcap", sorted(arm + gripper, key=lambda message: message[1])))
    assert columns["joint_states.position.hip"] == pytest.approx(0.1 * np.arange(60))
    assert len(columns["joint_states_finger.time"]) == len(columns["joint_states_finger.position.finger"]) == 15
    assert np.isfinite(columns["joint_states.position.knee"]).all()


def test_states_of_controllers_are_named_by_quantity_and_joint(tmp_path):
    dynamic = {
        "header": {"stamp": stamp(0)},
        "joint_names": ["hip", "knee"],
        "interface_values": [
            {"interface_names": ["position", "effort"], "values": [1.0, 2.0]},
            {"interface_names": ["position", "effort"], "values": [3.0, 4.0]},
        ],
    }
    trajectory = {
        "joint_names": ["hip", "knee"],
        "desired": {"positions": [1.0, 2.0], "velocities": [], "time_from_start": {"sec": 1, "nanosec": 500_000_000}},
        "actual": {"positions": [3.0, 4.0], "velocities": [5.0, 6.0]},
    }
    array = {"layout": {"dim": [{"label": "x", "size": 2, "stride": 2}], "data_offset": 0}, "data": [7.0, 8.0]}
    wrench = {"wrench": {"force": {"x": 1.0}, "torque": {"z": 2.0}}}
    messages = [("/d", 0, dynamic), ("/c/state", 1, trajectory), ("/commands", 2, array), ("/ft", 3, wrench)]
    columns = read_columns(write(tmp_path / "a.mcap", messages))
    found = {name: x[0] for name, x in columns.values.items() if not name.endswith((".time", ".stamp"))}
    assert found == {
        "d.position.hip": 1.0, "d.effort.hip": 2.0, "d.position.knee": 3.0, "d.effort.knee": 4.0,
        "c/state.desired.positions.hip": 1.0, "c/state.desired.positions.knee": 2.0,
        "c/state.desired.time_from_start": 1.5,
        "c/state.actual.positions.hip": 3.0, "c/state.actual.positions.knee": 4.0,
        "c/state.actual.velocities.hip": 5.0, "c/state.actual.velocities.knee": 6.0,
        "commands.data.0": 7.0, "commands.data.1": 8.0, "ft.wrench.force.x": 1.0, "ft.wrench.torque.z": 2.0,
    }  # fmt: skip


def test_pictures_are_left_out_and_said_so(tmp_path):
    picture = ("/camera", START, {"data": [0] * 5000})
    columns = read_columns(write(tmp_path / "a.mcap", [picture, *states(5)]))
    assert "joint_states.position.hip" in columns
    with pytest.raises(
        RecordingError, match='column "camera": holds 5000 numbers a message or more, such as a picture'
    ):
        columns["camera"]
    with pytest.raises(RecordingError, match=r"b\.mcap: found no message with numbers, .*; topic camera holds 5000"):
        read_columns(write(tmp_path / "b.mcap", [picture]))


def test_a_topic_that_a_bag_does_not_define_is_left_out(tmp_path):
    """A bag of ROS 2 before Iron has no definitions."""
    bags = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64 torque", "lab_msgs/msg/Drive"))
    drive, vector = store.types["lab_msgs/msg/Drive"], store.types["geometry_msgs/msg/Vector3"]
    with bags.Writer(tmp_path / "bag", version=8, storage_plugin=bags.StoragePlugin.SQLITE3) as writer:
        for topic, message in (("/drive", drive(torque=1.0)), ("/q", vector(x=1.0, y=2.0, z=3.0))):
            connection = writer.add_connection(topic, message.__msgtype__, typestore=store)
            for k in range(3):
                writer.write(connection, START + k * STEP, store.serialize_cdr(message, message.__msgtype__))
    path = next((tmp_path / "bag").glob("*.db3"))
    with contextlib.closing(sqlite3.connect(path)) as file, file:
        file.execute("DELETE FROM message_definitions")
    columns = read_columns(path)
    assert columns["q.y"].tolist() == [2.0] * 3
    with pytest.raises(RecordingError, match='"drive": holds messages of the type "lab_msgs/msg/Drive", which the bag'):
        columns["drive"]
