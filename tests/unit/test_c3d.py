"""C3D files: markers and analog channels with their own rates and units, what was lost, and a study made of them."""

from pathlib import Path

import ezc3d
import made_pointing
import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.files.readers.read import read_columns
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import assess

MUSCLES = ("biceps", "brachioradialis", "triceps_lateral", "triceps_long")


def write(path: Path, markers: dict, fs: float, analogs: dict, analog_fs: float, unit: str = "mm") -> Path:
    """Markers (n, 3) and analog channels (m,), m a multiple of n."""
    made = ezc3d.c3d()
    parameters = made["parameters"]
    parameters["POINT"]["RATE"]["value"] = [fs]
    parameters["POINT"]["LABELS"]["value"] = tuple(markers)
    parameters["POINT"]["UNITS"]["value"] = (unit,)
    points = np.ones((4, len(markers), len(next(iter(markers.values())))))
    for i, track in enumerate(markers.values()):
        points[:3, i] = track.T
    made["data"]["points"] = points
    parameters["ANALOG"]["RATE"]["value"] = [analog_fs]
    parameters["ANALOG"]["LABELS"]["value"] = tuple(analogs)
    parameters["ANALOG"]["UNITS"]["value"] = tuple("V" for _ in analogs)
    made["data"]["analogs"] = np.array(list(analogs.values()))[None]
    made.write(str(path))
    return path


def test_markers_and_channels_keep_their_rates_and_units(tmp_path):
    elbow = np.arange(60.0).reshape(20, 3) + 1.0
    wrist = elbow + 100.0
    wrist[5:8] = np.nan
    biceps = np.sin(np.arange(200.0))
    found = read_columns(write(tmp_path / "a.c3d", {"elbow": elbow, "wrist": wrist}, 100.0, {"biceps": biceps}, 1000.0))
    assert found.values["point.time"] == pytest.approx(np.arange(20) / 100.0)
    assert found.values["analog.time"] == pytest.approx(np.arange(200) / 1000.0)
    assert found.values["elbow_y"] == pytest.approx(elbow[:, 1])
    assert np.flatnonzero(np.isnan(found.values["wrist_z"])).tolist() == [5, 6, 7]
    assert found.values["biceps"] == pytest.approx(biceps, abs=1e-6)
    assert found.units == {**{f"{m}_{axis}": "mm" for m in ("elbow", "wrist") for axis in "xyz"}, "biceps": "V"}


def test_a_marker_in_the_origin_was_lost(tmp_path):
    track = np.ones((10, 3))
    track[4] = 0.0
    found = read_columns(write(tmp_path / "a.c3d", {"m": track}, 100.0, {"a": np.zeros(10)}, 100.0))
    assert np.flatnonzero(np.isnan(found.values["m_x"])).tolist() == [4]


def test_what_is_no_c3d_file_is_refused(tmp_path):
    (tmp_path / "a.c3d").write_bytes(b"time,angle\n0,1\n")
    with pytest.raises(RecordingError, match=r"a\.c3d: not readable as a C3D file"):
        read_columns(tmp_path / "a.c3d")
    whole = write(tmp_path / "b.c3d", {"m": np.ones((50, 3))}, 100.0, {"a": np.zeros(50)}, 100.0).read_bytes()
    for kept in (1, 300, 600, len(whole) // 2, len(whole) - 600):
        (tmp_path / "c.c3d").write_bytes(whole[:kept])
        with pytest.raises(RecordingError, match=r"c\.c3d: not readable as a C3D file"):
            read_columns(tmp_path / "c.c3d")


def test_a_long_file_that_is_cut_is_refused(tmp_path):
    """The header of a long file does not state its frames; its parameters do."""
    path = write(tmp_path / "a.c3d", {"m": np.ones((400, 3))}, 100.0, {"a": np.ones(4000)}, 1000.0)
    content = ezc3d.c3d(str(path))
    for name, frame in (("ACTUAL_START_FIELD", 1), ("ACTUAL_END_FIELD", 400)):
        content.add_parameter("TRIAL", name, [frame, 0])
    content.write(str(path))
    whole = bytearray(path.read_bytes())
    whole[8:10] = b"\xff\xff"
    path.write_bytes(whole)
    assert len(read_columns(path)["a"]) == 4000
    path.write_bytes(whole[: int(0.7 * len(whole))])
    with pytest.raises(RecordingError, match="as its header says: it is truncated"):
        read_columns(path)


def test_two_channels_of_one_name_are_refused(tmp_path):
    path = write(tmp_path / "a.c3d", {"m": np.ones((10, 3))}, 100.0, {"m_x": np.zeros(10)}, 100.0)
    with pytest.raises(RecordingError, match='two channels named "m_x"'):
        read_columns(path)


def test_what_a_model_computed_has_no_unit_of_lengths(tmp_path):
    """Some programs leave out the groups that state its units."""
    tracks = {"RKNE": np.ones((10, 3)), "RKneeAngles": np.ones((10, 3)), "LHipMoment": np.ones((10, 3))}
    found = read_columns(write(tmp_path / "a.c3d", tracks, 100.0, {"a": np.zeros(10)}, 100.0))
    assert {name.partition("_")[0] for name in found.units} == {"RKNE", "a"}


def test_channels_of_one_name_are_numbered(tmp_path):
    path = write(tmp_path / "a.c3d", {"m": np.ones((10, 3))}, 100.0, {"EMG": np.zeros(20), "emg": np.ones(20)}, 200.0)
    path.write_bytes(path.read_bytes().replace(b"emg", b"EMG"))
    found = read_columns(path)
    assert found["EMG_2"].tolist() == [1.0] * 20
    assert found.units["EMG_2"] == "V"


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A lab's study: one C3D file a recording, with markers and EMG in it, and nothing else."""
    folder = tmp_path_factory.mktemp("lab")
    lines = [
        'name = "lab"', "[rig]", 'motion = "rotary"', "[participants.P1]", "[participants.P2]", "[participants.P3]",
        "[channels]", 'time = { column = "point.time", unit = "s" }', "[streams.emg.channels]",
        'time = { column = "analog.time", unit = "s" }',
        *(f'emg.{m} = {{ column = "{m}", unit = "V" }}' for m in MUSCLES),
        "[optical]", 'time = { column = "point.time", unit = "s" }', 'unit = "mm"', 'markers = ["elbow", "wrist"]',
        "down = [0, 0, -1]", "[assessment]", 'control = "Ctrl"', 'segment = ["elbow", "wrist"]',
        'agonists = ["biceps", "brachioradialis"]', 'antagonists = ["triceps_lateral", "triceps_long"]',
    ]  # fmt: skip
    for i, person in enumerate(("P1", "P2", "P3")):
        for condition in ("Ctrl", "PCFr"):
            rng = np.random.default_rng([4, i, len(condition)])
            time, angle, _, truth = made_pointing.angle_and_target(rng, 100.0, condition, 1.0 + 0.1 * i, 1)
            activity = made_pointing.emg(rng, 1000.0, truth, len(time) / 100.0 + 1e-9, condition)
            elbow = np.array([100.0, 50.0, 1000.0]) + 0.1 * rng.standard_normal((len(time), 3))
            wrist = elbow + 250.0 * np.c_[np.sin(angle), 0.0 * angle, -np.cos(angle)]
            name = f"{person}_{condition}"
            analogs = dict(zip(MUSCLES, activity.T, strict=True))
            write(folder / f"{name}.c3d", {"elbow": elbow, "wrist": wrist}, 100.0, analogs, 1000.0)
            lines += [
                "[[recordings]]", f'name = "{name}"', f'file = "{name}.c3d"', f'optical = "{name}.c3d"',
                f'streams = {{ emg = "{name}.c3d" }}', f'participant = "{person}"', f'condition = "{condition}"',
            ]  # fmt: skip
    (folder / "study.toml").write_text("\n".join(lines), encoding="utf-8")
    return folder


def test_a_study_of_c3d_files_alone_is_assessed(lab):
    found = assess(open_study(lab))
    assert found.movements == 3 * 2 * 10
    change = {row.id: row.value for row in found.rows}
    assert change["lab.transparency.duration.pcfr"] == pytest.approx(20.0, abs=4.0)
    assert change["lab.assess.sensitivity.6hz.emgacc.pcfr"] == pytest.approx(40.0, abs=6.0)


def test_units_that_contradict_the_file_are_refused(lab, tmp_path):
    text = (lab / "study.toml").read_text(encoding="utf-8").replace('file = "', f'file = "{lab}/')
    text = text.replace('optical = "', f'optical = "{lab}/').replace('emg = "P', f'emg = "{lab}/P')
    for wrong, said in (
        (text.replace('unit = "mm"', 'unit = "m"'), 'marker elbow: study.toml says m, the file itself "mm"'),
        (
            text.replace('"biceps", unit = "V"', '"biceps", unit = "mV"'),
            'emg.biceps: study.toml says mV, the file itself "V"',
        ),
    ):
        (tmp_path / "study.toml").write_text(wrong, encoding="utf-8")
        with pytest.raises(RecordingError, match=said):
            open_study(tmp_path, allow_outside=True).recordings()


def test_groups_of_computed_values_keep_their_own_units(tmp_path):
    """Angles, moments and powers of a model stand among the markers, in units of their own."""
    labels = {"knee": "mm", "RKneeAngles": "deg", "RKneeMoment": "N*mm", "RKneePower": "W", "RKneeForce": "N"}
    content = ezc3d.c3d()
    parameters = content["parameters"]
    parameters["POINT"]["UNITS"]["value"] = ("mm",)
    parameters["POINT"]["RATE"]["value"] = (100.0,)
    parameters["POINT"]["LABELS"]["value"] = tuple(labels)
    groups = {"ANGLE": ("RKneeAngles", "deg"), "MOMENT": ("RKneeMoment", "Nmm"), "POWER": ("RKneePower", "W")}
    for group, (label, unit) in (groups | {"FORCE": ("RKneeForce", "N")}).items():
        content.add_parameter("POINT", f"{group}S", [label])
        content.add_parameter("POINT", f"{group}_UNITS", [unit])
    content["data"]["points"] = np.ones((4, len(labels), 30))
    path = tmp_path / "model.c3d"
    content.write(str(path))
    found = read_columns(path)
    assert {label: found.units[f"{label}_x"] for label in labels} == labels
