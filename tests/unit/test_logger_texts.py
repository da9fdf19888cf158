"""Text logs of laboratories' programs: names, units, clocks and streams are read from what each program writes.

The numbers are made up; the layouts follow the makers' documents or public readers of such files.
"""

import json

import numpy as np
import pytest

from pellucid._errors import DamagedRowsWarning, RecordingError
from pellucid.files import readers
from pellucid.files.readers import read_columns
from pellucid.files.readers._row_streams import parse_list

N = 30
T = np.arange(N) / 100.0
Q = np.round(np.sin(2.0 * T), 4)
U = np.round(1.5 + np.cos(3.0 * T), 4)


def table(*columns, mark=",", end=""):
    """Rows of numbers and texts."""
    cells = [[x if isinstance(x, str) else f"{x:.4f}" for x in column] for column in columns]
    return "".join(mark.join(row) + end + "\n" for row in zip(*cells, strict=True))


def read_text(tmp_path, content, name="log.csv", encoding="utf-8"):
    path = tmp_path / name
    path.write_bytes(content.encode(encoding))
    return read_columns(path)


EPOS = (
    "EPOS Studio Data Recorder\nNode: EPOS4 50/5 [Node 1]\nNumber of samples: 30\nSampling period: 10000 us\n\n"
    "Time;Position actual value;Torque actual value averaged\nms;inc;mNm\n"
)
ACQKNOWLEDGE = "a.acq\n10 msec/sample\n2 channels\nGoniometer\ndeg\nTorque\nNm\nmin\tCH1\tCH2\n\t30\t30\n"
LABCHART = (
    "Interval=\t0.01 s\nTimeFormat=\tStartOfBlock\nChannelTitle=\tAngle\tTorque\nRange=\t180 deg\t5 Nm\n"
    "UnitName=\tdeg\tNm\n"
)
MELSERVO = (
    "MR Configurator2,グラフ\r\nサンプリング時間,10 ms\r\nデータ名,モータ回転速度,トルク\r\n単位,r/min,%\r\n"
    "時間[ms],CH1,CH2\r\n"
)
CONTROLDESK = 'version;3.0;;\nname;"x_axis";"theta";"tau"\ndescription;"";"";""\nunit;"s";"rad";"Nm"\ntrace_values;;;\n'
FLEXLOGGER = "FlexLogger\nSample rate,100 Hz\n\nTime,Torque,Angle,\n,N·m,deg,\n"
LISTED = "Logger\nSampling rate: 100 Hz\nCH1: Torque [Nm]\nCH2: Angle [deg]\n\nTime\tCH1\tCH2\n"
QUALISYS = "NO_OF_MARKERS\t2\nFREQUENCY\t100\nDESCRIPTION\t--\nDATA_INCLUDED\t3D\nMARKER_NAMES\tankle\tknee\n"


@pytest.mark.parametrize(
    ("content", "encoding", "names", "units"),
    [
        (
            EPOS + table(1e3 * T, Q, U, mark=";"),
            "utf-8",
            ["Time", "Position actual value", "Torque actual value averaged"],
            ["ms", "counts", "mN*m"],
        ),
        (
            ACQKNOWLEDGE + table(T / 60, Q, U, mark="\t"),
            "utf-8",
            ["min", "Goniometer", "Torque"],
            ["min", "deg", "N*m"],
        ),
        (LABCHART + table(T, Q, U, mark="\t"), "utf-8", ["time", "Angle", "Torque"], ["s", "deg", "N*m"]),
        (MELSERVO + table(1e3 * T, Q, U), "cp932", ["時間[ms]", "モータ回転速度", "トルク"], [None, "rpm", "%"]),
        (CONTROLDESK + table([""] * N, T, Q, U, mark=";"), "utf-8", ["x_axis", "theta", "tau"], ["s", "rad", "N*m"]),
        (FLEXLOGGER + table(T, U, Q, end=","), "utf-8", ["Time", "Torque", "Angle"], [None, "N*m", "deg"]),
        (LISTED + table(T, U, Q, mark="\t"), "utf-8", ["Time", "Torque [Nm]", "Angle [deg]"], [None, None, None]),
        (
            QUALISYS + table(*[Q] * 6, mark="\t"),
            "utf-8",
            ["ankle_x", "ankle_y", "ankle_z", "knee_x", "knee_y", "knee_z"],
            [None] * 6,
        ),
        (
            ",Hip,,Knee,\nTime,Angle,Torque,Angle,Torque\ns,deg,Nm,deg,Nm\n" + table(T, Q, U, Q, U),
            "utf-8",
            ["Time", "Hip.Angle", "Hip.Torque", "Knee.Angle", "Knee.Torque"],
            ["s", "deg", "N*m", "deg", "N*m"],
        ),
        (
            "hip,hip,knee,knee\npos [rad],tau [Nm],pos [rad],tau [Nm]\n" + table(Q, U, Q, U),
            "utf-8",
            ["hip.pos [rad]", "hip.tau [Nm]", "knee.pos [rad]", "knee.tau [Nm]"],
            [None] * 4,
        ),
        (
            "time,q,tau\n" + table([str(i) for i in range(N)], T, Q, U),
            "utf-8",
            ["index", "time", "q", "tau"],
            [None] * 4,
        ),
        (
            "time,q,tau\n" + table([str(i) for i in range(N)], T, Q, U, end=","),
            "utf-8",
            ["index", "time", "q", "tau"],
            [None] * 4,
        ),
        (
            '"time" "q" "tau"\n' + table([f'"{i + 1}"' for i in range(N)], T, Q, U, mark=" "),
            "utf-8",
            ["index", "time", "q", "tau"],
            [None] * 4,
        ),
        ("# t, q, tau\n" + table(T, Q, U, mark=" "), "utf-8", ["t", "q", "tau"], [None] * 3),
        (
            "Time [s]   Joint angle [deg]  Torque [Nm]\n" + table(T, Q, U, mark="   "),
            "utf-8",
            ["Time [s]", "Joint angle [deg]", "Torque [Nm]"],
            [None] * 3,
        ),
        ("t;q;u\n" + table(T, Q, U, mark=";").replace(".", ","), "utf-16-le", ["t", "q", "u"], [None] * 3),
        (
            "Time (s),Torque (lbf·in),App message\n" + table(T, U, ["start", *[""] * (N - 1)]),
            "utf-8",
            ["Time (s)", "Torque (lbf·in)", "App message"],
            [None] * 3,
        ),
    ],
)
def test_names_and_units_above_a_table(tmp_path, content, encoding, names, units):
    found = read_text(tmp_path, content, encoding=encoding)
    assert list(found.values) == names
    assert [found.units.get(name) for name in names] == units
    numbers = [x for x in found.values.values() if not isinstance(x, str)]
    assert [len(x) for x in numbers] == [N] * len(numbers)
    assert any(np.allclose(x, Q) for x in numbers) or any(np.allclose(x, U) for x in numbers)


def test_a_period_and_a_rate_without_a_label_are_facts(tmp_path):
    assert read_text(tmp_path, ACQKNOWLEDGE + table(T / 60, Q, U, mark="\t")).facts["sampling period"] == "10 ms"
    assert read_text(tmp_path, "Logger\n500 samples/sec\nq,u\n" + table(Q, U)).facts["sampling rate"] == "500 Hz"


TWINCAT = (
    "Name;run\nFile;c.csv\n\nName;Axis.ActPos;Name;Axis.ActTorque\nSymbolComment;;SymbolComment;\n"
    "Data-Type;REAL64;Data-Type;REAL64\nSampleTime[ms];10;SampleTime[ms];10\nUnit;deg;Unit;Nm (Torque)\n\n"
)


def test_channels_with_times_of_their_own(tmp_path):
    found = read_text(tmp_path, TWINCAT + table(1e3 * T, Q, 1e3 * T, U, mark=";").replace(".", ","))
    assert list(found.values) == ["time", "Axis.ActPos", "Axis.ActTorque"]
    assert dict(found.units) == {"time": "ms", "Axis.ActPos": "deg", "Axis.ActTorque": "N*m"}
    slow = [*(f"{x:.4f}" for x in 1e3 * T[::2]), *[""] * (N // 2)]
    slower = [*(f"{x:.4f}" for x in U[::2]), *[""] * (N // 2)]
    found = read_text(tmp_path, TWINCAT + table(1e3 * T, Q, slow, slower, mark=";"))
    assert list(found.values) == ["Axis.ActPos.time", "Axis.ActPos", "Axis.ActTorque.time", "Axis.ActTorque"]
    np.testing.assert_allclose(found["Axis.ActTorque"], U[::2])
    np.testing.assert_allclose(found["Axis.ActTorque.time"], 1e3 * T[::2])


LABVIEW_FILE = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    "Multi_Headings\tYes\nX_Columns\t{}\nTime_Pref\tRelative\nOperator\tAnna Muster\n***End_of_Header***\t\n\t\n"
)
LABVIEW_SEGMENT = (
    "Channels\t2\t\t\nSamples\t30\t30\t\nDate\t2024/01/02\t2024/01/02\t\nTime\t10:00:00\t10:00:00\t\n"
    "Y_Unit_Label\tdeg\tN.m\t\nX_Dimension\tTime\tTime\t\nX0\t{0}\t{0}\t\nDelta_X\t0.01\t0.01\t\n"
    "***End_of_Header***\t\t\t\n"
)


@pytest.mark.parametrize("ending", ["lvm", "txt"])
@pytest.mark.parametrize("clocks", ["One", "No", "Multi", "segments", "no headings"])
def test_a_labview_measurement_file(tmp_path, ending, clocks):
    columns = {"One": [T, Q, U], "No": [[""] * N, Q, U], "Multi": [T, Q, T, U]}.get(clocks, [T, Q, U])
    names = "X_Value\tangle\tX_Value\ttorque\tComment\n" if clocks == "Multi" else "X_Value\tangle\ttorque\tComment\n"
    content = LABVIEW_FILE.format(clocks if clocks in ("No", "Multi") else "One")
    if clocks != "no headings":
        content += LABVIEW_SEGMENT.format("0")
    content += names + table(*columns, mark="\t")
    if clocks == "segments":
        content += "\n" + LABVIEW_SEGMENT.format("0.3") + names + table(T + 0.3, Q, U, mark="\t")
    found = read_text(tmp_path, content, f"log.{ending}")
    assert list(found.values) == ["X_Value", "angle", "torque"]
    assert found.units["X_Value"] == "s"
    assert [found.units.get(name) for name in ("angle", "torque")] == (
        [None, None] if clocks == "no headings" else ["deg", "N*m"]
    )
    expected = np.concatenate([T, T + 0.3]) if clocks == "segments" else T
    np.testing.assert_allclose(found["X_Value"], expected, atol=1e-12)
    np.testing.assert_allclose(found["torque"], np.resize(U, len(expected)))
    assert "Anna" not in str(found.facts)


def test_a_labview_file_of_two_rates_and_a_damaged_one(tmp_path):
    slow = LABVIEW_SEGMENT.format("0").replace("0.01\t0.01", "0.01\t0.02")
    torque = [*(f"{x:.4f}" for x in U[::2]), *[""] * (N // 2)]
    names = "X_Value\tangle\ttorque\tComment\n"
    found = read_text(
        tmp_path, LABVIEW_FILE.format("No") + slow + names + table([""] * N, Q, torque, mark="\t"), "a.lvm"
    )
    np.testing.assert_allclose(found["torque.time"], 0.02 * np.arange(N // 2))
    assert len(found["angle"]) == len(found["angle.time"]) == N
    with pytest.raises(RecordingError, match=r'row 1: found the text "x", expected a number'):
        read_text(tmp_path, LABVIEW_FILE.format("One") + slow + names + "0\tx\t1\n", "a.lvm")
    with pytest.raises(RecordingError, match=r"found no line .*End_of_Header"):
        read_text(tmp_path, "LabVIEW Measurement\nX_Columns\tOne\n", "a.lvm")


def test_blocks_of_nexus_have_a_clock_each(tmp_path):
    frame, sub = [str(1 + i // 3) for i in range(N)], [str(i % 3) for i in range(N)]
    few, zero = [str(1 + i) for i in range(10)], ["0"] * 10
    content = (
        "Devices\n300\n,,AMTI #1 - Force,,EMG - Voltage\nFrame,Sub Frame,Fx,Fy,VL\n,,N,N,V\n"
        + table(frame, sub, Q, U, Q)
        + "\nModel Outputs\n100\n,,P1:LKneeAngles,,\nFrame,Sub Frame,X,Y,Z\n,,deg,deg,deg\n"
        + table(few, zero, *[Q[:10]] * 3)
        + "\nTrajectories\n100\n,,P1:LASI,,,P1:RASI,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
        + table(few, zero, *[U[:10]] * 3, *[[""] * 10] * 3)
    )
    found = read_text(tmp_path, content)
    assert list(found.values)[:4] == ["Devices.time", "AMTI #1 - Force.Fx", "AMTI #1 - Force.Fy", "EMG - Voltage.VL"]
    np.testing.assert_allclose(found["Devices.time"], np.arange(N) / 300)
    np.testing.assert_allclose(found["Trajectories.time"], np.arange(10) / 100)
    np.testing.assert_allclose(found["P1:LKneeAngles_x"], Q[:10])
    assert np.isnan(found["P1:RASI_z"]).all()
    assert [found.units[name] for name in ("EMG - Voltage.VL", "P1:LKneeAngles_x", "P1:LASI_y")] == ["V", "deg", "mm"]


def test_rows_about_joints_by_turns(tmp_path):
    rows = "".join(
        f"{t:.2f},{joint},{k * q:.4f},{u:.4f}\n"
        for t, q, u in zip(T, Q, U, strict=True)
        for k, joint in ((1, "hip"), (2, "knee"))
    )
    found = read_text(tmp_path, "time [s],joint,position,effort\n" + rows)
    assert list(found.values) == ["time [s]", "position.hip", "position.knee", "effort.hip", "effort.knee"]
    np.testing.assert_allclose(found["position.knee"], 2 * Q, atol=1e-4)
    # A phase that lasts, and a state beside one joint's numbers, take no turns.
    phases = table(T, ["rest"] * 10 + ["move"] * 20, Q)
    assert list(read_text(tmp_path, "time,phase,q\n" + phases).values) == ["time", "phase", "q"]


def test_rows_about_motors_by_number_have_their_own_times(tmp_path):
    rows = "".join(f"{t + 0.001 * k:.3f},{k},{k * q:.4f}\n" for t, q in zip(T, Q, strict=True) for k in (1, 2, 3))
    found = read_text(tmp_path, "timestamp,motor_id,position\n" + rows)
    assert list(found.values) == [f"{name}.motor_{k}" for name in ("timestamp", "position") for k in (1, 2, 3)]
    np.testing.assert_allclose(found["timestamp.motor_2"], T + 0.002)
    np.testing.assert_allclose(found["position.motor_3"], 3 * Q, atol=1e-3)


def test_a_reading_of_few_steps_is_no_label(tmp_path, rng):
    steps = [str(x) for x in rng.integers(0, 4, N)]
    for name in ("sensor", "motor", "axis"):
        found = read_text(tmp_path, f"time,{name},position\n" + table(T, steps, Q))
        assert list(found.values) == ["time", name, "position"]


def test_signals_below_each_other_and_topics_with_fields_of_their_own(tmp_path):
    melted = table(T, ["q"] * N, Q) + table(T, ["tau"] * N, U)
    found = read_text(tmp_path, "time,variable,value\n" + melted)
    assert list(found.values) == ["time", "q", "tau"]
    np.testing.assert_allclose(found["tau"], U)
    rows = "".join(
        f"{t:.2f},/enc,{q:.4f},\n" if i % 2 else f"{t:.2f},/cell,,{u:.4f}\n"
        for i, (t, q, u) in enumerate(zip(T, Q, U, strict=True))
    )
    found = read_text(tmp_path, "stamp,topic,position,force\n" + rows)
    assert list(found.values) == ["stamp./cell", "stamp./enc", "position./enc", "force./cell"]


def test_lists_in_cells_are_named_and_split_by_their_names(tmp_path):
    rows = ""
    for i, (t, q, u) in enumerate(zip(T, Q, U, strict=True)):
        if i % 3 == 2:
            rows += f'{t:.2f},"[\'finger\']","[{q:.4f}]","array(\'d\', [{u:.4f}])"\n'
        elif i % 3:
            rows += f"{t:.2f},\"['hip', 'knee']\",\"[{q:.4f}, {u:.4f}]\",\"array('d', [{u:.4f}, {q:.4f}])\"\n"
        else:  # the same joints in another order
            rows += f"{t:.2f},\"['knee', 'hip']\",\"[{u:.4f}, {q:.4f}]\",\"array('d', [{q:.4f}, {u:.4f}])\"\n"
    found = read_text(tmp_path, "time,name,position,effort\n" + rows)
    arm = np.arange(N) % 3 != 2
    np.testing.assert_allclose(found["time"], T[arm])
    for name in ("hip", "knee"):
        np.testing.assert_allclose(found[f"position.{name}"], (Q if name == "hip" else U)[arm])
        np.testing.assert_allclose(found[f"effort.{name}"], (U if name == "hip" else Q)[arm])
    np.testing.assert_allclose(found["time.finger"], T[~arm])
    np.testing.assert_allclose(found["effort.finger"], U[~arm])


def test_lists_without_names_are_numbered(tmp_path):
    rows = "".join(f'{t:.2f},"[{q:.4f}, {u:.4f}]"\n' for t, q, u in zip(T, Q, U, strict=True))
    found = read_text(tmp_path, "time,qpos\n" + rows)
    assert list(found.values) == ["time", "qpos.0", "qpos.1"]
    np.testing.assert_allclose(found["qpos.1"], U)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[1.0, 2.5]", [1.0, 2.5]),
        ("[1.0 2.5]", [1.0, 2.5]),
        ("(1; 2.5)", [1.0, 2.5]),
        ("array([1., 2.5], dtype=float32)", [1.0, 2.5]),
        ("['a', 'b c']", ["a", "b c"]),
        ("[]", []),
        ("a [Nm]", None),
        ("[[1, 2]]", None),
        ("word", None),
    ],
)
def test_a_list_in_a_cell(text, expected):
    found = parse_list(text)
    assert (None if found is None else list(found)) == expected


def test_messages_of_joint_states(tmp_path):
    stamps = [f"{1_700_000_000_000_000_000 + round(1e9 * t)}" for t in T]
    content = (
        "%time,field.header.seq,field.name0,field.name1,field.position0,field.position1,field.effort0,field.effort1\n"
    )
    content += table(stamps, [str(i) for i in range(N)], ["hip"] * N, ["knee"] * N, Q, U, U, Q)
    found = read_text(tmp_path, content)
    np.testing.assert_allclose(found["field.position.knee"], U)
    np.testing.assert_allclose(found["field.effort.hip"], U)
    # ros2 topic echo --csv writes no header.
    rest = [f"{round(1e9 * t)}" for t in T]
    echoed = table(["1700000000"] * N, rest, [""] * N, ["hip"] * N, ["knee"] * N, Q, U, U, Q, U, Q)
    found = read_text(tmp_path, echoed)
    np.testing.assert_allclose(found["header.stamp"] - 1.7e9, T, atol=1e-6)
    np.testing.assert_allclose(found["position.knee"], U)
    np.testing.assert_allclose(found["velocity.knee"], Q)
    np.testing.assert_allclose(found["effort.hip"], U)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("0.14,0.2", "line 16 has 2 fields, expected 3"),
        ("0.14,0.2,0.3,0.4", "line 16 has 4 fields, expected 3"),
        ("0.14,\0\0\0,0.1", "line 16 holds NUL bytes"),
    ],
)
def test_a_damaged_row_is_left_out_and_told(tmp_path, row, said):
    rows = table(T, Q, U).splitlines()
    rows[14] = row
    path = tmp_path / "log.csv"
    path.write_text("t,q,u\n" + "\n".join(rows) + "\n", encoding="utf-8")
    with pytest.warns(DamagedRowsWarning, match=rf"log\.csv: excluded 1 row that is damaged: {said}; every other"):
        found = readers.read(path)
    assert len(found["t"]) == N - 1
    np.testing.assert_allclose(found["u"], np.delete(U, 14))
    assert said in str(found)


def test_many_damaged_rows_are_refused_and_columns_may_end_early(tmp_path):
    rows = table(T, Q, U).splitlines()
    bad = [row.rpartition(",")[0] if i % 5 == 3 else row for i, row in enumerate(rows)]
    with pytest.raises(RecordingError, match="line 5 has 2 fields, expected 3"):
        read_text(tmp_path, "t,q,u\n" + "\n".join(bad) + "\n")
    early = [row.rpartition(",")[0] if i >= 20 else row for i, row in enumerate(rows)]
    found = read_text(tmp_path, "t,q,u\n" + "\n".join(early) + "\n")
    assert found.damaged == ""
    assert np.isfinite(found["u"]).sum() == 20
    assert len(found["q"]) == N


def test_an_orientation_in_a_storage_file(tmp_path):
    rows = "".join(f"{t:.2f}\t{q:.4f},0.1,0.2,{u:.4f}\t1,0,0,0\n" for t, q, u in zip(T, Q, U, strict=True))
    head = "DataRate=100.000000\nDataType=Quaternion\nversion=3\nendheader\ntime\tthigh\tshank\n"
    found = read_text(tmp_path, head + rows, "imu.sto")
    assert list(found.values)[:5] == ["time", "thigh.w", "thigh.x", "thigh.y", "thigh.z"]
    np.testing.assert_allclose(found["thigh.z"], U)
    assert found.facts["DataRate"] == "100.000000 Hz"


def test_merged_cells_of_a_workbook(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    sheet = book.active
    for row in (["Knee test"], ["Sampling rate", "100 Hz"], [], ["Time", "Hip", None, "Knee", None]):
        sheet.append(row)
    sheet.append([None, "Angle", "Torque", "Angle", "Torque"])
    sheet.append(["s", "deg", "Nm", "deg", "Nm"])
    for row in zip(T, Q, U, Q, U, strict=True):
        sheet.append([float(x) for x in row])
    for cells in ("A4:A5", "B4:C4", "D4:E4"):
        sheet.merge_cells(cells)
    book.save(tmp_path / "a.xlsx")
    found = read_columns(tmp_path / "a.xlsx")
    assert list(found.values) == ["Time", "Hip.Angle", "Hip.Torque", "Knee.Angle", "Knee.Torque"]
    assert list(found.units.values()) == ["s", "deg", "N*m", "deg", "N*m"]
    assert found.facts == {"Sampling rate": "100 Hz"}


def trials(n=2):
    return [
        {"name": f"swing_{k}", "fs": 100, "data": {"t": T.tolist(), "q": (k * Q).tolist()}} for k in range(1, n + 1)
    ]


@pytest.mark.parametrize(
    ("content", "names", "units"),
    [
        ([{"t": t, "q": q, "mode": "run"} for t, q in zip(T, Q, strict=True)], ["t", "q"], {}),
        ({"units": {"t": "s", "q": "deg"}, "t": T.tolist(), "q": Q.tolist()}, ["t", "q"], {"t": "s", "q": "deg"}),
        (
            {
                "signals": [
                    {"name": "t", "unit": "s", "data": T.tolist()},
                    {"name": "q", "unit": "°", "data": Q.tolist()},
                ]
            },
            ["signals.t", "signals.q"],
            {"signals.t": "s", "signals.q": "deg"},
        ),
        ({"t": {"data": T.tolist(), "unit": "s"}, "q": Q.tolist()}, ["t", "q"], {"t": "s"}),
        ({"columns": ["t", "q"], "index": list(range(N)), "data": np.c_[T, Q].tolist()}, ["t", "q"], {}),
        ({"t": {str(i): t for i, t in enumerate(T)}, "q": {str(i): q for i, q in enumerate(Q)}}, ["t", "q"], {}),
    ],
)
def test_tables_in_json(tmp_path, content, names, units):
    found = read_text(tmp_path, json.dumps(content), "a.json")
    assert list(found.values) == names
    assert dict(found.units) == units
    np.testing.assert_allclose(found[names[1]], Q)
    assert found.recordings == ()


@pytest.mark.parametrize("how", ["arrays", "records"])
def test_trials_in_json_are_recordings(tmp_path, how):
    content = {"device": {"name": "bench"}, "trials": trials()}
    if how == "records":
        for trial in content["trials"]:
            trial["data"] = [{"t": t, "q": q} for t, q in zip(trial["data"]["t"], trial["data"]["q"], strict=True)]
    found = read_text(tmp_path, json.dumps(content), "a.json")
    assert found.recordings == ("trials.swing_1", "trials.swing_2")
    np.testing.assert_allclose(found["trials.swing_2.data.q"], 2 * Q)
    assert found.facts["device.name"] == "bench"


def test_a_person_in_json_is_not_shown(tmp_path):
    content = {
        "subject": {"name": "Anna Muster"},
        "trials": [{**trial, "name": f"Anna {k}"} for k, trial in enumerate(trials())],
    }
    for trial, name in zip(content["trials"], ("Anna Muster", "Bea Beispiel"), strict=True):
        trial["name"] = name
    found = read_text(tmp_path, json.dumps(content), "a.json")
    assert found.recordings == ("trials.1", "trials.2")
    assert "Muster" not in str(found.facts)
    assert [field.kind for field in found.personal] == ["name"] * 3


def test_a_json_value_on_each_line(tmp_path):
    lines = [
        {"header": {"stamp": {"sec": 5, "nanosec": round(1e9 * t)}}, "name": names, "position": positions}
        for i, (t, q, u) in enumerate(zip(T, Q, U, strict=True))
        for names, positions in [((["hip", "knee"], [q, u]) if i % 2 else (["finger"], [7.0]))]
    ]
    content = "".join(json.dumps(line) + "\n" for line in lines)
    for name in ("a.jsonl", "a.ndjson", "a.json"):
        found = read_text(tmp_path, content, name)
        np.testing.assert_allclose(found["header.stamp"], 5.0 + T[1::2])
        np.testing.assert_allclose(found["header.stamp.finger"], 5.0 + T[::2])
        np.testing.assert_allclose(found["position.knee"], U[1::2])
        assert len(found["position.finger"]) == N // 2
