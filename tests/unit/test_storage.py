"""OpenSim's storage files, streams of a recording, and a time that is only a rate."""

import numpy as np
import pytest

import pellucid
from pellucid._errors import RecordingError, StudyError
from pellucid.files.readers import read_columns

STORAGE = """Coordinates
version=1
nRows=3
nColumns=3
inDegrees={degrees}

endheader
time\tknee_angle_r\tankle_angle_r
0.00\t-10.0\t5.0
0.01\t-20.0\t5.5
0.02\t-30.0\t6.0
"""

STUDY = """
name = "walk"
[rig]
motion = "rotary"
[channels]
time = { column = "time", unit = "s" }
angle.knee = { column = "knee_angle_r", unit = "deg" }
[streams.emg.channels]
time = { rate = "1000 Hz" }
emg.soleus = { column = "SOL", unit = "mV" }
[emg_torque]
joints = ["knee"]
[[recordings]]
name = "one"
file = "walk.mot"
streams = { emg = "emg.csv" }
window = ["0.01 s", "1 s"]
"""


@pytest.fixture
def study(tmp_path):
    def make(*changes, degrees="yes"):
        storage, text = STORAGE.format(degrees=degrees), STUDY
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "study.toml").write_text(text, encoding="utf-8")
        (tmp_path / "walk.mot").write_text(storage, encoding="utf-8")
        (tmp_path / "emg.csv").write_text("SOL\n1\n2\n3\n4\n", encoding="utf-8")
        return pellucid.open(tmp_path)

    return make


def test_a_storage_file_in_degrees_is_radians_inside(study):
    recording = study().recording("one")
    assert np.allclose(recording["angle.knee"], np.deg2rad([-20.0, -30.0]))
    assert recording.channels["angle.knee"].unit == "rad"


def test_a_stream_is_whole_and_on_its_own_clock(study):
    emg = study().recording("one").stream("emg")
    assert emg.name == "one.emg"
    assert np.allclose(emg.time, [0.0, 0.001, 0.002, 0.003])
    assert np.allclose(emg["emg.soleus"], [1e-3, 2e-3, 3e-3, 4e-3])
    assert emg.fs == pytest.approx(1000.0)


def test_a_stream_that_is_not_there_lists_those_that_are(study):
    with pytest.raises(RecordingError, match=r"walk.mot \(recording one\): no stream imu; study.toml gives it emg"):
        study().recording("one").stream("imu")


def test_degrees_that_the_header_calls_radians_are_refused(study):
    with pytest.raises(RecordingError, match=r"walk.mot: channel angle.knee: study.toml says deg, .* header says rad"):
        study(degrees="no").recordings()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            STORAGE.format(degrees="yes").rsplit("\n", 2)[0] + "\n",
            "header says nRows=3, found 2; the file is truncated",
        ),
        (STORAGE.format(degrees="yes")[:-5], "line 11 has 2 fields, expected 3; it is the last line"),
        (STORAGE.format(degrees="yes").replace("endheader", ""), "no line endheader"),
        (STORAGE.format(degrees="yes").replace("-20.0", "x"), "text where numbers are expected"),
        (STORAGE.format(degrees="yes").split("time")[0], "nothing after endheader"),
    ],
)
def test_a_damaged_storage_file(tmp_path, text, said):
    (tmp_path / "a.sto").write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=said):
        read_columns(tmp_path / "a.sto")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'streams = { emg = "emg.csv" }',
            'streams = { imu = "emg.csv" }',
            r'found the stream "imu", expected one of \[str',
        ),
        ('time = { rate = "1000 Hz" }\n', "", "no channel time found"),
        ('{ rate = "1000 Hz" }', '{ rate = "1000 Hz", column = "t" }', "replaces the column"),
        ('[emg_torque]\njoints = ["knee"]', "", r"\[rig.drive\] no such table found"),
        (
            'joints = ["knee"]',
            'joints = ["knee"]\n[hinge]\njump = "20 deg"\n[coupling]',
            "tables hinge, coupling, expected",
        ),
        ('joints = ["knee"]', 'joints = ["knee"]\n[transfer_function]\npoles = 1\nzeros = 1', "fewer zeros than poles"),
    ],
)
def test_a_wrong_study_file(study, old, new, said):
    with pytest.raises(StudyError, match=said):
        study((old, new))


def test_a_dat_file_is_read_as_what_it_is(tmp_path):
    """OpenSim's header or plain columns: the content says, not the ending."""
    from pellucid.files.readers import read_columns

    (tmp_path / "storage.dat").write_text(
        "Made by hand\n\nendheader\ntime_s\tforce_N\n0.0\t1.5\n0.1\t2.5\n", encoding="utf-8"
    )
    (tmp_path / "plain.dat").write_text("time_s force_N\n0.0 1.5\n0.1 2.5\n", encoding="utf-8")
    for name in ("storage.dat", "plain.dat"):
        columns = read_columns(tmp_path / name)
        assert np.array_equal(columns.values["force_N"], [1.5, 2.5])


@pytest.mark.parametrize(("said", "accepted"), [(4, True), (2, True), (5, False)])
def test_a_real_time_writer_may_count_one_row_too_many_or_too_few(tmp_path, said, accepted):
    text = "rtosim output \n" + STORAGE.format(degrees="yes").replace("nRows=3", f"nRows={said}")
    (tmp_path / "a.sto").write_text(text, encoding="utf-8")
    if accepted:
        assert len(read_columns(tmp_path / "a.sto")["time"]) == 3
    else:
        with pytest.raises(RecordingError, match="header says nRows=5, found 3"):
            read_columns(tmp_path / "a.sto")
