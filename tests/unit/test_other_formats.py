"""Workbooks, HDF5, NumPy, Parquet, MATLAB's tables, TRC, force plates, robots' logs, and text with several clocks."""

import datetime
import json
import sys

import h5py
import numpy as np
import openpyxl
import pyarrow
import pytest
from pyarrow import ipc, parquet
from research.evidence._healthy import WRITERS, swing

from pellucid._errors import PellucidError, RecordingError
from pellucid.files.readers import Columns, mat, mcap, read_columns, ros_bag
from pellucid.files.readers._unread_formats import UNREAD_FORMATS
from pellucid.files.readers._wall_clock import stamp_seconds
from pellucid.files.readers.read import readers_by_ending

T = np.arange(50) / 100.0
Q = np.sin(3.0 * T)


def test_columns_are_a_mapping(tmp_path):
    (tmp_path / "a.csv").write_text("t [s],q,who\n0,1,x\n1,2,y\n")
    columns = read_columns(tmp_path / "a.csv")
    assert len(columns) == 3
    assert list(columns) == list(columns.keys()) == ["t [s]", "q", "who"]
    assert "t" in columns
    assert "t [s]" in columns
    assert 2 in columns
    assert "v" not in columns
    assert 3 not in columns
    assert columns[1].tolist() == [1.0, 2.0]
    assert columns["t"].tolist() == [0.0, 1.0]


def test_a_data_frame_holds_columns_of_several_lengths(tmp_path):
    pytest.importorskip("pandas")
    np.savez(tmp_path / "a.npz", t=T, slow=Q[:10])
    frame = read_columns(tmp_path / "a.npz").to_frame()
    assert list(frame.columns) == ["t", "slow"]
    assert len(frame) == len(T)
    assert int(frame["slow"].notna().sum()) == 10
    words = Columns(tmp_path / "a", {"t": T, "who": "text"})
    assert list(words.to_frame().columns) == ["t"]


@pytest.mark.parametrize(
    ("ending", "number"), [(ending, number) for ending, writers in WRITERS.items() for number in range(len(writers))]
)
def test_every_format_reads_back_what_its_writer_was_given(tmp_path, ending, number):
    write, names = WRITERS[ending][number]
    path, known = tmp_path / f"sweep{ending}", swing(400)
    write(path, known)
    columns = read_columns(path)
    for name, expected in zip(names, known.values(), strict=True):
        assert columns[name] == pytest.approx(expected, rel=1e-5, abs=2e-4)


def test_a_workbook_of_several_sheets(tmp_path):
    book = openpyxl.Workbook()
    first, second, notes = book.active, book.create_sheet("EMG"), book.create_sheet("notes")
    first.title = "robot"
    first.append(["Torque constant", 0.06])
    first.append([])
    first.append(["when", "q [rad]", "i [A]"])
    start = datetime.datetime(2026, 5, 3, 14, 22, 31)
    for k in range(40):
        first.append([start + datetime.timedelta(milliseconds=10 * k), float(Q[k]), 0.5])
        second.append([float(T[k]), 2.0 * float(Q[k])])
    notes.append(["nothing to see"])
    book.save(tmp_path / "a.xlsx")
    columns = read_columns(tmp_path / "a.xlsx")
    assert list(columns) == ["robot.when", "robot.q [rad]", "robot.i [A]", "EMG.0", "EMG.1"]
    assert columns["robot.q"] == pytest.approx(Q[:40], abs=1e-15)
    assert columns["EMG.1"] == pytest.approx(2.0 * Q[:40], abs=1e-15)
    assert np.diff(columns["robot.when"]) == pytest.approx(0.01, abs=1e-6)
    assert columns.units == {"robot.when": "s"}


def test_hdf5_has_units_fields_and_channels_along_either_side(tmp_path):
    rows = np.array(list(zip(T, Q, strict=True)), dtype=[("t", "f8"), ("q", "f4")])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["robot/angle"] = Q
        file["robot/angle"].attrs["units"] = "rad"
        file["robot/torque"] = Q
        file["robot/torque"].attrs["unit"] = "no unit at all"
        file["emg"] = np.stack([Q, 2.0 * Q, T])
        file["table"] = rows
        file["who"] = "me"
    columns = read_columns(tmp_path / "a.h5")
    assert columns["robot.angle"].tolist() == Q.tolist()
    assert columns.units == {"robot.angle": "rad", "robot.torque": "no unit at all"}
    assert columns["emg.1"].tolist() == (2.0 * Q).tolist()
    assert columns["table.q"] == pytest.approx(Q, abs=1e-7)
    assert "who" not in columns


def test_arrays_that_swell_or_run_a_program_are_refused(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", q=np.zeros(30_000_000))
    with pytest.raises(RecordingError, match=r"a\.npz: found 3e\+07 numbers .* expected at most 128 MB"):
        read_columns(tmp_path / "a.npz")
    np.save(tmp_path / "b.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(RecordingError, match=r"b\.npy: not readable as NumPy's arrays"):
        read_columns(tmp_path / "b.npy")


def test_parquet_has_missing_values_times_and_structs(tmp_path):
    stamp = datetime.datetime(2026, 5, 3, 14, 22, 31, 250000)
    table = pyarrow.table(
        {
            "q": pyarrow.array([1.5, None, 2.5]),
            "n": pyarrow.array([1, None, 3]),
            "when": pyarrow.array([stamp, None, datetime.datetime(1970, 1, 1, 0, 0, 1)]),
            "imu": [{"x": 1.0, "y": 2}] * 3,
            "emg": pyarrow.array([[1, 2], [3, 4], [5, 6]], pyarrow.list_(pyarrow.int32(), 2)),
            "who": ["a", "b", "c"],
        }
    )
    parquet.write_table(table, tmp_path / "a.parquet")
    with ipc.new_file(tmp_path / "a.feather", table.schema) as file:
        file.write_table(table)
    for name in ("a.parquet", "a.feather"):
        columns = read_columns(tmp_path / name)
        np.testing.assert_array_equal(columns["q"], [1.5, np.nan, 2.5])
        np.testing.assert_array_equal(columns["n"], [1.0, np.nan, 3.0])
        np.testing.assert_array_equal(columns["when"], [1777818151.25, np.nan, 1.0])
        assert columns["imu.y"].tolist() == [2.0, 2.0, 2.0]
        assert columns["emg.1"].tolist() == [2.0, 4.0, 6.0]
        assert columns.units["when"] == "s"
        with pytest.raises(RecordingError, match='column "who": holds values of the type'):
            columns["who"]


@pytest.mark.slow
@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_tables_of_matlab(tmp_path, version, monkeypatch):
    pandas, matio = pytest.importorskip("pandas"), pytest.importorskip("matio")
    table = pandas.DataFrame({"t": T, "q": Q, "who": ["x"] * len(T)})
    path = tmp_path / "a.mat"
    matio.save_to_mat(str(path), {"log": table, "plain": Q, "s": {"deep": table, "a": T}}, version=version)
    columns = read_columns(path)
    assert columns["log.q"].tolist() == columns["s.deep.q"].tolist() == columns["plain"].tolist() == Q.tolist()
    monkeypatch.setitem(sys.modules, "matio", None)
    without = mat.read(path)
    assert without["plain"].tolist() == Q.tolist()
    with pytest.raises(RecordingError, match=r'needs mat-io: pip install "mat-io>=[0-9.]+" "h5py'):
        without[mat.OBJECTS_COLUMN]
    matio.save_to_mat(str(path), {"log": table}, version=version)
    with pytest.raises(RecordingError, match=r"a\.mat: a table .* needs mat-io: .*; or save it in MATLAB as a struct"):
        mat.read(path)


def test_a_force_plate_stands_beside_the_markers(tmp_path):
    import ezc3d

    made, n = ezc3d.c3d(), 20
    made["parameters"]["POINT"]["RATE"]["value"], made["parameters"]["POINT"]["UNITS"]["value"] = [100.0], ("mm",)
    made["parameters"]["POINT"]["LABELS"]["value"] = ("heel",)
    made["data"]["points"] = np.ones((4, 1, n))
    made["parameters"]["ANALOG"]["RATE"]["value"] = [1000.0]
    made["parameters"]["ANALOG"]["LABELS"]["value"] = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    made["parameters"]["ANALOG"]["UNITS"]["value"] = ("N", "N", "N", "Nmm", "Nmm", "Nmm")
    # A plate of type 2 whose axes are turned by 90 degrees in the laboratory, its corners 300 mm by 400 mm.
    corners = np.array([[[300, 0, 0], [300, 400, 0], [0, 400, 0], [0, 0, 0]]], float).transpose(2, 1, 0)
    told = {"USED": [1], "TYPE": [2], "ZERO": [1, 0], "CORNERS": corners, "ORIGIN": np.array([[0.0], [0.0], [-40.0]]),
            "CHANNEL": np.arange(1, 7)[:, None]}  # fmt: skip
    for name, value in told.items():
        made.add_parameter("FORCE_PLATFORM", name, np.asarray(value, float))
        if name not in ("CORNERS", "ORIGIN"):
            made["parameters"]["FORCE_PLATFORM"][name]["type"] = 2  # whole numbers
            made["parameters"]["FORCE_PLATFORM"][name]["value"] = np.asarray(value)
    analog = np.zeros((1, 6, 10 * n))
    analog[0, 0], analog[0, 2] = 10.0, -700.0
    made["data"]["analogs"] = analog
    made.write(str(tmp_path / "a.c3d"))
    columns = read_columns(tmp_path / "a.c3d")
    assert len(columns["plate1.force_x"]) == len(columns["analog.time"]) == 10 * n
    across, along = columns["plate1.force_x"][0], columns["plate1.force_y"][0]
    assert np.hypot(across, along) == pytest.approx(10.0)
    assert columns["plate1.force_z"] == pytest.approx(-700.0)
    assert columns.units["plate1.moment_x"] == "N*mm"


def test_trc_has_lost_markers_and_says_where_it_is_cut(tmp_path):
    head = "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n100\t100\t2\t2\tmm\n"
    head += "Frame#\tTime\twrist\t\t\telbow\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    (tmp_path / "a.trc").write_text(head + "1\t0.00\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t\t\t\n")
    columns = read_columns(tmp_path / "a.trc")
    assert columns["point.time"].tolist() == [0.0, 0.01]
    np.testing.assert_array_equal(columns["elbow_y"], [5.0, np.nan])
    assert columns.units["wrist_x"] == "mm"
    (tmp_path / "b.trc").write_text(head + "1\t0.00\t1\t2\t3\t4\t5\t6\n")
    with pytest.raises(RecordingError, match=r"b\.trc: the header says NumFrames=2, found 1"):
        read_columns(tmp_path / "b.trc")
    (tmp_path / "c.trc").write_text("t,q\n0,1\n")
    with pytest.raises(RecordingError, match=r"c\.trc: not readable as a TRC file: found no line PathFileType"):
        read_columns(tmp_path / "c.trc")


def test_joint_states_are_named_by_their_joints(tmp_path):
    bags = pytest.importorskip("rosbags.rosbag1")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    names = ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    state, header, stamp = (store.types[name] for name in names)
    with bags.Writer(tmp_path / "a.bag") as writer:
        topic = writer.add_connection("/arm/joint_states", state.__msgtype__, typestore=store)
        for k, angle in enumerate(Q):
            message = state(
                header=header(seq=k, stamp=stamp(sec=5, nanosec=k * 10**7), frame_id=""), name=["shoulder", "elbow"],
                position=np.array([angle, 2.0 * angle]), velocity=np.array([]), effort=np.array([0.0, 1.0]),
            )  # fmt: skip
            writer.write(topic, 10**18 + k * 10**7, store.serialize_ros1(message, state.__msgtype__))
    columns = read_columns(tmp_path / "a.bag")
    assert columns["arm/joint_states.position.elbow"].tolist() == (2.0 * Q).tolist()
    assert columns["arm/joint_states.time"] == pytest.approx(T, abs=1e-12)
    assert columns["arm/joint_states.header.stamp"] == pytest.approx(5.0 + T)


def test_what_mcap_cannot_decode_is_named(tmp_path):
    writing = pytest.importorskip("mcap.writer")
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = writing.Writer(file)
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        joint = writer.register_channel("/joint", "json", schema)
        other = writer.register_channel("/camera", "protobuf", schema)
        for k in range(3):
            writer.add_message(joint, 10**9 * k, json.dumps({"q": k, "who": "x", "f": [1, 2]}).encode(), 10**9 * k)
        writer.add_message(other, 0, b"x", 0)
        writer.finish()
    columns = read_columns(tmp_path / "a.mcap")
    assert columns["joint.q"].tolist() == columns["joint.time"].tolist() == [0.0, 1.0, 2.0]
    assert columns["joint.f.1"].tolist() == [2.0, 2.0, 2.0]
    with pytest.raises(RecordingError, match='column "camera": holds messages in "protobuf", expected JSON'):
        columns["camera"]


@pytest.mark.parametrize(("reader", "package"), [(mcap, "mcap"), (ros_bag, "rosbags")])
def test_a_missing_extra_is_named(tmp_path, monkeypatch, reader, package):
    for name in ("mcap.reader", "rosbags.highlevel", "rosbags.typesys"):
        monkeypatch.setitem(sys.modules, name, None)
    (tmp_path / "a.log").write_bytes(b"x")
    with pytest.raises(PellucidError, match=rf'found no package {package}, .*pip install "mcap.* "rosbags'):
        reader.read(tmp_path / "a.log")


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        (["2026-05-03 14:22:31.5", "2026-05-03T14:22:32"], [1777818151.5, 1777818152.0]),
        (["2026-05-03 14:22:31+02:00", "2026-05-03 12:22:32Z"], [1777810951.0, 1777810952.0]),
        (["3.5.2026 14:22:31,25", "3.5.2026 14:22:32,25"], [1777818151.25, 1777818152.25]),
        (["5/13/2026 2:22:31 PM", "5/13/2026 2:22:32 PM"], [1778682151.0, 1778682152.0]),
        # 12 May and 1 June, or 5 December and 6 January: the shorter of both readings.
        (["12.5.2026 23:59:59", "13.5.2026 00:00:01"], [1778630399.0, 1778630401.0]),
        (["23:59:59.5", "0:00:00.5", "0:00:01.5"], [86399.5, 86400.5, 86401.5]),
        (["2026-05-03", "2026-05-04"], None),
        (["14:22:31", "rest"], None),
        (["25:00:00"], None),
        (["2026-02-30 10:00:00"], None),
        ([], None),
    ],
)
def test_stamps_of_a_wall_clock(stamps, seconds):
    found = stamp_seconds(stamps)
    if seconds is None:
        assert found is None
    else:
        assert found.tolist() == seconds


def test_a_wall_clock_in_a_text_table(tmp_path):
    rows = "".join(f"2026-05-03 14:22:{31 + k // 4};{k};1990-02-03\n" for k in range(12))
    (tmp_path / "a.csv").write_text("when;q;born\n" + rows)
    columns = read_columns(tmp_path / "a.csv")
    assert (columns["when"] - columns["when"][0]).tolist() == [k // 4 for k in range(12)]
    assert columns.units == {"when": "s"}
    with pytest.raises(RecordingError, match=r"tells who was recorded \(birth date\), which is not shown") as told:
        columns["born"]
    assert "1990" not in str(told.value)


def test_signals_of_delsys_have_times_of_their_own(tmp_path):
    label = "Label: {} Sampling frequency: {} Number of points: {} start: 0 Unit: {} Domain Unit: s\n"
    head = label.format("RF: EMG 1", 2000, 4, "V") + label.format("RF: ACC X", 1000, 2, "g")
    table = 'X[s],"RF: EMG 1",X[s],"RF: ACC X"\n0,1e-6,0,0.1\n0.0005,2e-6,0.001,0.2\n'
    table += "0.001,3e-6,{0},{0}\n0.0015,4e-6,{0},{0}\n"
    for name, filling in (("a.csv", ""), ("b.csv", "0")):
        (tmp_path / name).write_text(head + "\n" + table.format(filling))
        columns = read_columns(tmp_path / name)
        assert columns["RF: EMG 1"].tolist() == [1e-6, 2e-6, 3e-6, 4e-6]
        assert columns["RF: ACC X"].tolist() == [0.1, 0.2]
        assert columns["RF: ACC X.time"].tolist() == [0.0, 0.001]
        assert columns.units["RF: EMG 1"] == "V"
    (tmp_path / "c.csv").write_text(
        "Application:,Trigno Discover\n\nRF Time Series (s),RF EMG 1 (mV),RF ACC Time Series (s),RF ACC X (G)\n"
        "0,1e-3,0,0.1\n0.0005,2e-3,,\n"
    )
    columns = read_columns(tmp_path / "c.csv")
    assert columns["RF EMG 1 (mV)"].tolist() == [1e-3, 2e-3]
    assert len(columns["RF ACC X (G).time"]) == 1
    assert columns.units["RF EMG 1 (mV)"] == "mV"
    (tmp_path / "d.csv").write_text("X[s],RF\n0,1\n0.1,x\n")
    with pytest.raises(RecordingError, match=r'd\.csv: row 3, column 2: found the text "x", expected a number'):
        read_columns(tmp_path / "d.csv")


def test_text_of_noraxon_and_maxon(tmp_path):
    rows = "".join(f"{k / 2000:.4f},1,,{k}.5,3.{k}\n" for k in range(9))
    head = 'Measurement,walk\nPerson,Jane Doe\n\n"Time,s","Activity","Marker","RT VMO,uV","LT VMO,uV"\n'
    (tmp_path / "noraxon.csv").write_text(head + rows)
    columns = read_columns(tmp_path / "noraxon.csv")
    assert columns["RT VMO"].tolist() == [k + 0.5 for k in range(9)]
    assert not any("Jane" in name for name in columns)
    head = "EPOS Studio Data Recorder\nDate: 03.05.2026\nSampling period: 1000 us\n\n"
    rows = "".join(f"{k};{100 + k};{k},5\n" for k in range(30))
    (tmp_path / "maxon.txt").write_text(head + "Time;Position actual value;Current actual value\nms;inc;mA\n" + rows)
    columns = read_columns(tmp_path / "maxon.txt")
    assert columns["Current actual value"].tolist() == [k + 0.5 for k in range(30)]


def test_what_is_not_read_is_named_with_what_to_export(tmp_path):
    assert not set(UNREAD_FORMATS) & set(readers_by_ending())
    (tmp_path / "a.slx").write_bytes(b"x")
    with pytest.raises(RecordingError, match=r'a\.slx: .* "\.slx", a Simulink model.*; export instead the'):
        read_columns(tmp_path / "a.slx")


def test_a_unit_that_means_the_same_is_no_contradiction():
    from pellucid.units import contradicts_unit

    assert not contradicts_unit("Nm", "N*m")
    assert not contradicts_unit("degrees", "deg")
    assert not contradicts_unit("volt-ish", "V")
    assert contradicts_unit("mV", "V")
    assert contradicts_unit("rad", "1")
