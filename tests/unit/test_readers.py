"""Files to columns, and recordings to files and back."""

import json
import os

import numpy as np
import pytest
import scipy.io

from pellucid._errors import RecordingError
from pellucid.files import Channel, channels_toml, write_csv, write_text_atomically
from pellucid.files.readers import read_columns
from pellucid.study.procedures.registry import open_study


def text(tmp_path, content, name="a.csv", encoding="utf-8"):
    path = tmp_path / name
    path.write_text(content, encoding=encoding)
    return read_columns(path)


@pytest.mark.parametrize(
    "content",
    [
        "t,q\n0,1\n1,2.5\n",
        "t;q\n0;1\n1;2,5\n",
        "t\tq\n0\t1\n1\t2.5\n",
        "t  q\n0  1\n1  2.5\n",
        "t,q,\n0,1,\n1,2.5,\n",
        "t [s],q [deg]\n0,1\n1,2.5\n",
        "t (s),q (°)\n0,1\n1,2.5\n",
        '"t","q"\n"0","1"\n"1","2.5"\n',
        "# logged on the bench\n# fs 1 Hz\nt,q\n0,1\n1,2.5\n",
        "# t, q\n0,1\n1,2.5\n",
        "My logger v2\nt,q\ns,deg\n0,1\n1,2.5\n",
        "\ufefft,q\r\n0,1\r\n1,2.5\r\n",
        "t,q\n\n0,1\n1,2.5\n\n",
    ],
)
def test_dialects_of_a_text_table(tmp_path, content):
    columns = text(tmp_path, content)
    assert columns.column("t", "time").tolist() == [0.0, 1.0]
    assert columns.column("q", "position").tolist() == [1.0, 2.5]


def test_a_header_from_another_century(tmp_path):
    columns = text(tmp_path, "t,winkel [°]\n0,1\n", encoding="latin-1")
    assert columns.column("winkel", "position").tolist() == [1.0]
    columns = text(tmp_path, "t,q\n0,1\n", encoding="utf-16")
    assert columns.column("q", "position").tolist() == [1.0]


@pytest.mark.parametrize("rows", [3, 400_000])
def test_settings_above_the_table_are_none_of_its_rows(tmp_path, rows):
    """A name and a value each, then an empty line, names and rows; in long files too, which another parser reads."""
    path = tmp_path / "pointing.csv"
    head = "Parameters :\nInstruction;3. balance\nBlock;1\nGain;1.000\n\nTime (s);dots;x (mm)\n"
    path.write_text(head + "".join(f"{0.01 * i:.2f};{i};{-0.5 * i}\n" for i in range(rows)), encoding="utf-8")
    found = read_columns(path)
    assert list(found.values) == ["Time (s)", "dots", "x (mm)"]
    assert len(found["x (mm)"]) == rows
    assert found["x (mm)"][-1] == -0.5 * (rows - 1)


def test_many_comments_leave_later_rows_in_their_lines(tmp_path):
    comments = "".join(f"# remark {i}{'-' * 200}\n" for i in range(500))
    rows = "".join(f"{i},{i / 8}\n" for i in range(40_000))
    found = text(tmp_path, f"{comments}t,q\n{rows}")
    assert found.names == ("t", "q")
    assert np.array_equal(found["q"], np.arange(40_000) / 8)


def test_columns_without_a_header_have_numbers(tmp_path):
    columns = text(tmp_path, "0,1.5\n1,2.5\n")
    assert columns.column(1, "position").tolist() == [1.5, 2.5]
    assert columns.column("0", "time").tolist() == [0.0, 1.0]
    with pytest.raises(RecordingError, match="channel position asks for column number 2, expected 0 to 1"):
        columns.column(2, "position")


def test_columns_named_on_a_line_each(tmp_path):
    head = "File Name: 1.log\nChannel 1: 'RF', 3 values, engineering units: mV\nChannel 2: 'FX', 1 values\n\n"
    # The last line ends the file, the one before lacks a slower channel's sample.
    columns = text(tmp_path, head + 4 * "0.5\t70.1\n" + "0.75\t\n\t\n")
    assert columns.column("RF", "emg.a").tolist() == [0.5, 0.5, 0.5, 0.5, 0.75]
    assert columns.column("FX", "angle.b")[:4].tolist() == [70.1, 70.1, 70.1, 70.1]
    assert np.isnan(columns.column("FX", "angle.b")[4])
    # Titles name nothing where they do not name every column.
    columns = text(tmp_path, head.replace("Channel 2", "Second") + 4 * "0.5\t70.1\n")
    assert columns.column(1, "angle.b").tolist() == [70.1, 70.1, 70.1, 70.1]


def test_missing_samples_and_words(tmp_path):
    columns = text(tmp_path, "t,q,on\n0,,true\n1,NaN,false\n2,3,true\n3,NA,false\n")
    assert np.isnan(columns.column("q", "position")).tolist() == [True, True, False, True]
    assert columns.column("on", "enabled").tolist() == [1.0, 0.0, 1.0, 0.0]


def test_text_in_a_column_matters_only_to_who_asks_for_it(tmp_path):
    columns = text(tmp_path, "t,q,phase\n0,1,rest\n1,2x,move\n")
    assert columns.column("t", "time").tolist() == [0.0, 1.0]
    with pytest.raises(RecordingError, match=r'a.csv: channel position, column "q": line 3 holds the text "2x"'):
        columns.column("q", "position")
    assert columns.column(0, "time").tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "the file is empty"),
        ("t,q\n", "found no row of numbers"),
        ("# only\n# comments\n", "found no row of data"),
        ("t,q\n0,1\n1\n2,2\n", "line 3 has 1 fields, expected 2"),
        ("t,q\n0,1\n1\n2,3\n", "line 3 has 1 fields, expected 2"),
        ("t,q,u\n0,1\n1,2\n", "the header names 3 columns, the rows hold 2"),
    ],
)
def test_a_broken_text_table(tmp_path, content, message):
    with pytest.raises(RecordingError, match=message):
        text(tmp_path, content)


def test_an_absent_column_names_those_present_and_the_nearest(tmp_path):
    columns = text(tmp_path, "t,Q_elbow,i_motor\n0,1,2\n")
    with pytest.raises(RecordingError) as error:
        columns.column("i_moter", "current")
    assert str(error.value) == (
        'a.csv: channel current expects a column "i_moter", found t, Q_elbow, i_motor; the nearest is "i_motor"'
    )
    with pytest.raises(RecordingError, match='nearest is "Q_elbow"'):
        columns.column("q_elbow", "position")


def test_json_structures(tmp_path):
    content = {
        "vin": 7.4,
        "motor": "xl",
        "entries": [{"q": 1, "on": True, "who": "a"}, {"q": None, "on": False}, {"q": 3.5, "on": True}],
        "log": {"t": [0, 1, 2], "xyz": [[1, 2], [3, 4], [5, 6]]},
    }
    columns = text(tmp_path, json.dumps(content), "a.json")
    assert columns.column("vin", "supply").tolist() == [7.4]
    np.testing.assert_array_equal(columns.column("entries.q", "position"), [1.0, np.nan, 3.5])
    assert columns.column("entries.on", "enabled").tolist() == [1.0, 0.0, 1.0]
    assert columns.column("log.xyz.1", "x").tolist() == [2.0, 4.0, 6.0]
    with pytest.raises(RecordingError, match=r'expects a column "entries.position", found vin, entries.q'):
        columns.column("entries.position", "position")


def test_mat_variables_and_structs(tmp_path):
    path = tmp_path / "a.mat"
    log = {"q": np.array([[1.0], [2.0], [3.0]]), "note": "bench", "deep": {"u": np.array([1, 2, 255], dtype=np.uint8)}}
    scipy.io.savemat(path, {"t": np.arange(3)[None, :], "log": log, "both": np.eye(3)})
    columns = read_columns(path)
    assert columns.column("t", "time").tolist() == [0.0, 1.0, 2.0]
    assert columns.column("log.q", "position").tolist() == [1.0, 2.0, 3.0]
    # Unsigned bytes would wrap around on the first subtraction.
    assert (columns.column("log.deep.u", "pulse") - 3.0).tolist() == [-2.0, -1.0, 252.0]
    assert columns.column("both.2", "x").tolist() == [0.0, 0.0, 1.0]
    with pytest.raises(RecordingError, match=r'a.mat: channel position expects a column "log.qm", found t, log.q'):
        columns.column("log.qm", "position")


def test_arrays_of_more_than_two_dimensions_are_named_by_their_places(tmp_path):
    path = tmp_path / "a.mat"
    trials = np.arange(2 * 50 * 3, dtype=float).reshape(2, 50, 3)  # trials, samples, channels
    scipy.io.savemat(path, {"emg": trials, "log": {"marker": np.moveaxis(trials, 1, 2)}})
    columns = read_columns(path)
    np.testing.assert_array_equal(columns.column("emg.1.2", "emg.soleus"), trials[1, :, 2])
    np.testing.assert_array_equal(columns.column("log.marker.1.2", "emg.soleus"), trials[1, :, 2])
    with pytest.raises(RecordingError, match=r'expects a column "emg.2", found emg.0.0, emg.0.1'):
        columns.column("emg.2", "emg.soleus")


def test_a_truncated_mat_file(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"t": np.arange(1000.0), "q": np.arange(1000.0)})
    path.write_bytes(path.read_bytes()[:9000])
    with pytest.raises(RecordingError, match=r"a.mat: not readable as a MAT file, truncated or damaged"):
        read_columns(path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.json", '{"t": [0, 1', "a.json: not readable as JSON, truncated or damaged"),
        ("a.json", '{"who": "me"}', "found no numeric column"),
        ("a.xyz", "1", 'found the ending ".xyz", expected one of .asc, .bag, .bdf, .c3d, .csv'),
        ("a.csv", "\0\0\1", "found binary content, expected text"),
    ],
)
def test_other_broken_files(tmp_path, name, content, message):
    with pytest.raises(RecordingError, match=message):
        text(tmp_path, content, name)
    with pytest.raises(RecordingError, match="no such file"):
        read_columns(tmp_path / "absent.csv")


def test_what_is_written_reads_back_to_the_same_bits(tmp_path, rng):
    values = rng.standard_normal((3, 500)) * np.array([[1.0], [1e-300], [1e300]])
    values[1, 7] = np.nan
    channels = {
        "position": Channel("position", values[1], "rad", "position"),
        "time": Channel("time", np.arange(500) / 3.0, "s", "time"),
        "emg.biceps": Channel("emg.biceps", values[2], "V", "emg.biceps"),
    }
    path = write_csv(tmp_path / "recordings" / "a.csv", channels)
    columns = read_columns(path)
    for name, channel in channels.items():
        np.testing.assert_array_equal(columns.column(name, name), channel.samples)
    assert path.read_text().startswith("# units: time [s], position [rad], emg.biceps [V]\ntime,position,emg.biceps\n")
    (tmp_path / "study.toml").write_text(
        'name = "a"\n[rig]\nmotion = "rotary"\n[rig.drive]\nkind = "torque"\n'
        + channels_toml(channels)
        + '[[recordings]]\nname = "a"\nfile = "recordings/a.csv"\n'
    )
    recording = open_study(tmp_path).recording("a")
    assert {name: channel.unit for name, channel in recording.channels.items()} == {
        name: channel.unit for name, channel in channels.items()
    }
    np.testing.assert_array_equal(recording["emg.biceps"], values[2])


def test_writing_refuses_what_could_not_be_read(tmp_path):
    time = Channel("time", np.arange(3.0), "s", 0)
    with pytest.raises(RecordingError, match="found the channels q, expected time among them"):
        write_csv(tmp_path / "a.csv", {"q": time})
    with pytest.raises(RecordingError, match="found channels of different lengths"):
        write_csv(tmp_path / "a.csv", {"time": time, "q": Channel("q", np.arange(2.0), "rad", 1)})
    assert not list(tmp_path.iterdir())


def test_a_failed_write_leaves_the_file_as_it_was(tmp_path, monkeypatch):
    path = write_text_atomically(tmp_path / "a.txt", "whole")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_text_atomically(path, "half")
    assert path.read_text() == "whole"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t,q,i\n0,,1\n1,,\n2,3,\n", {"t": [0, 1, 2], "q": [np.nan, np.nan, 3], "i": [1, np.nan, np.nan]}),
        ("t,q,i\n0,1,\n1,2,\n", {"t": [0, 1], "q": [1, 2], "i": [np.nan, np.nan]}),
        ("t,q\n0,1,\n1,,\n", {"t": [0, 1], "q": [1, np.nan]}),
        ("t;q;i\n0,5;;\n1;;2,5\n", {"t": [0.5, 1], "q": [np.nan, np.nan], "i": [np.nan, 2.5]}),
        ("t,q\n,1\n1,NA\n", {"t": [np.nan, 1], "q": [1, np.nan]}),
    ],
)
def test_empty_cells_are_missing(tmp_path, text, expected):
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    values = read_columns(tmp_path / "a.csv").values
    assert list(values) == list(expected)
    for name, samples in expected.items():
        np.testing.assert_array_equal(values[name], samples)
