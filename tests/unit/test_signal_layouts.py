"""Logs in which names, units and rates stand beside the numbers: Simulink, dSPACE, HDF5, NumPy, demonstrations."""

import json
import sys

import h5py
import numpy as np
import pyarrow
import pytest
import scipy.io
from pyarrow import parquet

from pellucid._errors import RecordingError
from pellucid.files.readers import hdf5, mat, read_columns
from pellucid.files.readers._signals import LEFT_OUT_COLUMN

T = np.arange(60) / 100.0
Q = np.sin(3.0 * T)


def struct_array(entries):
    """A struct array of MATLAB, shape (1, n)."""
    made = np.zeros((1, len(entries)), dtype=[(name, object) for name in entries[0]])
    for k, entry in enumerate(entries):
        made[0, k] = tuple(entry.values())
    return made


def save_hdf5(path, variables):
    """Write variables as MATLAB's version 7.3 does: structs are groups, cells and struct arrays references."""

    def put(group, name, value):
        if isinstance(value, dict):
            inside = group.create_group(name)
            inside.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, item in value.items():
                put(inside, key, item)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            inside = group.create_group(name)
            inside.attrs["MATLAB_class"] = np.bytes_("struct")
            for key in value[0]:
                inside[key] = references([entry[key] for entry in value])
        elif isinstance(value, list):
            group[name] = references(value)
            group[name].attrs["MATLAB_class"] = np.bytes_("cell")
        elif isinstance(value, str):
            group[name] = np.array([[ord(sign)] for sign in value], np.uint16)
            group[name].attrs["MATLAB_class"] = np.bytes_("char")
        else:
            group[name] = np.atleast_2d(value).T
            group[name].attrs["MATLAB_class"] = np.bytes_("double")

    def references(items):
        made = []
        for item in items:
            name = f"r{len(file['#refs#'])}"
            put(file["#refs#"], name, item)
            made.append([file["#refs#"][name].ref])
        return np.array(made, dtype=h5py.ref_dtype)

    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, value in variables.items():
            put(file, name, value)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def capture(rasters):
    """A capture of ControlDesk: for each raster its times and (name, path, unit, samples) of each signal."""
    x = [{"Name": name, "Data": times, "Raster": name} for name, times, _ in rasters]
    y = [
        {"Name": name, "Path": path, "Unit": unit, "Raster": raster, "XIndex": float(i), "Data": samples}
        for i, (raster, _, signals) in enumerate(rasters, 1)
        for name, path, unit, samples in signals
    ]
    return x, y


@pytest.mark.parametrize("version", ["v5", "v7.3"])
def test_a_capture_of_dspace_has_its_own_names(tmp_path, version):
    fast = np.arange(240) / 400.0
    x, y = capture(
        [
            ("HostService", T, [("theta", "Model Root/plant", "rad", Q), ("Out1", "Model Root/drive", "A", 2.0 * Q)]),
            ("Periodic 1", fast, [("Out1", "Model Root/a", "Nm", fast), ("Out1", "Model Root/b", "", 2.0 * fast)]),
        ]
    )
    for path, rasters in ((tmp_path / "rec_001.mat", x), (tmp_path / "one.mat", x[:1])):
        kept = [entry for entry in y if len(rasters) > 1 or entry["Raster"] == "HostService"]
        if version == "v5":
            row = [{**entry, "Data": entry["Data"][None]} for entry in kept]
            made = struct_array([{"X": struct_array(rasters), "Y": struct_array(row)}])
            scipy.io.savemat(path, {"rec_7": made}, do_compression=True)
        else:
            save_hdf5(path, {"rec_7": {"X": rasters, "Y": kept}})
    one = read_columns(tmp_path / "one.mat")
    assert list(one) == ["time", "theta", "Out1"]
    assert one.units == {"time": "s", "theta": "rad", "Out1": "A"}
    assert one["theta"].tolist() == Q.tolist()
    several = read_columns(tmp_path / "rec_001.mat")
    assert list(several) == [
        "HostService.time", "HostService.theta", "HostService.Out1",
        "Periodic 1.time", "Periodic 1.a.Out1", "Periodic 1.b.Out1",
    ]  # fmt: skip
    assert several["Periodic 1.b.Out1"].tolist() == (2.0 * fast).tolist()
    assert several.units["Periodic 1.a.Out1"] == "N*m"


@pytest.mark.parametrize("version", ["v5", "v7.3"])
def test_a_structure_with_time_of_simulink(tmp_path, version):
    both = np.column_stack([Q, T])
    signals = [
        {"values": Q[:, None], "dimensions": 1.0, "label": "theta [deg]", "blockName": "arm/Scope"},
        {"values": both, "dimensions": 2.0, "label": "tau [Nm]", "blockName": "arm/Scope"},
        {"values": both.T.reshape(2, 1, len(T)), "dimensions": 2.0, "label": "", "blockName": "arm/plant/Gain"},
    ]
    path = tmp_path / "a.mat"
    if version == "v5":
        scipy.io.savemat(path, {"ScopeData": {"time": T[:, None], "signals": struct_array(signals)}, "simout": both})
    else:
        save_hdf5(path, {"ScopeData": {"time": T[:, None], "signals": signals[:2]}, "simout": both})
    columns = read_columns(path)
    assert columns["ScopeData.time"].tolist() == T.tolist()
    assert columns["ScopeData.theta"].tolist() == Q.tolist()
    assert columns["ScopeData.tau.1"].tolist() == columns["simout.1"].tolist() == T.tolist()
    assert columns.units["ScopeData.tau.0"] == "N*m"
    if version == "v5":
        assert columns["ScopeData.Gain.0"].tolist() == Q.tolist()


def timeseries(name, samples, unit, *, even=False, in_info=False):
    """An object of the class timeseries, with the properties that MATLAB saves."""
    from matio.utils.matclass import MatlabOpaque

    nothing = np.zeros((0, 0))
    info = {"Units": "seconds", "Start_": np.array([[0.0]]), "Length_": np.array([[float(len(T))]])}
    info |= {"Increment_": np.array([[0.01 if even else np.nan]]), "Time_": T[:, None] if in_info else nothing}
    own = nothing if even or in_info else T[:, None]
    about = MatlabOpaque({"Units": unit}, "tsdata.datametadata")
    times = MatlabOpaque(info, "tsdata.timemetadata")
    return MatlabOpaque(
        {"Name": name, "Data_": samples, "Time_": own, "DataInfo": about, "TimeInfo": times}, "timeseries"
    )


@pytest.mark.slow
@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_timeseries_and_datasets_of_simulink(tmp_path, version, monkeypatch):
    matio = pytest.importorskip("matio")
    from matio.utils.matclass import MatlabOpaque

    elements = np.empty((2, 1), object)
    for k, options in enumerate(({"even": True}, {"in_info": True})):
        values = timeseries("", (k + 1.0) * Q[:, None], "rad", **options)
        elements[k, 0] = MatlabOpaque({"Name": f"signal {k}", "Values": values}, "Simulink.SimulationData.Signal")
    storage = MatlabOpaque({"Elements": elements}, "Simulink.SimulationData.Storage.RamDatasetStorage")
    dataset = MatlabOpaque({"Name": "logsout", "Storage_": storage}, "Simulink.SimulationData.Dataset")
    path, steps = tmp_path / "a.mat", np.arange(5.0)[:, None]
    log = {"logsout": dataset, "gains": steps}
    settings = MatlabOpaque({"Weights": np.ones((60, 1)), "Limits": steps}, "lab.Settings")
    variables = {"theta": timeseries("theta", Q[:, None], "deg"), "out": log, "tool": settings}
    matio.save_to_mat(str(path), variables, version=version)
    columns = read_columns(path)
    assert columns.recordings == ()
    assert not any(name.startswith("tool") for name in columns)
    assert columns["theta"].tolist() == columns["out.logsout.signal 0"].tolist() == Q.tolist()
    assert columns["out.logsout.signal 1"].tolist() == (2.0 * Q).tolist()
    assert columns["time"] == pytest.approx(T, abs=1e-12)
    assert columns.units["theta"] == "deg"
    assert columns.units["out.logsout.signal 1"] == "rad"
    monkeypatch.setitem(sys.modules, "matio", None)
    without = mat.read(path)
    assert without["out.gains"].tolist() == steps[:, 0].tolist()
    with pytest.raises(RecordingError, match=r'such as a timeseries, needs mat-io: pip install "mat-io>=1.0"'):
        without[mat.OBJECTS_COLUMN]


@pytest.mark.parametrize("version", ["v5", "v7.3"])
def test_names_beside_a_matrix_name_its_columns(tmp_path, version):
    log = {"joint_names": ["hip", "knee"], "q": np.column_stack([Q, T]), "tau": np.stack([T, Q]), "fs": 100.0}
    path = tmp_path / "a.mat"
    if version == "v5":
        names = np.array(["hip", "knee"], object)
        trials = struct_array([{"t": T[:n], "q": Q[:n]} for n in (40, 50)])
        scipy.io.savemat(path, {"log": {**log, "joint_names": names}, "trials": trials})
    else:
        save_hdf5(path, {"log": log, "trials": [{"t": T[:n], "q": Q[:n]} for n in (40, 50)]})
    columns = read_columns(path)
    assert columns["log.q.knee"].tolist() == columns["log.tau.hip"].tolist() == T.tolist()
    assert columns.facts["fs"] == "100"
    assert columns.recordings == ("trials.0", "trials.1")
    assert len(columns["trials.1.q"]) == 50


def test_a_motion_capture_of_two_rates(tmp_path):
    """Qualisys names the struct as the file, lists labels beside each array, and states two rates."""
    markers, muscles = np.array(["RKNE", "RANK"], object), np.array(["EMG 1", "EMG 2", "Fz"], object)
    tracks = np.zeros((2, 4, 60))
    tracks[1, 2] = Q
    emg = np.vstack([np.zeros((2, 600)), np.arange(600.0)])
    labelled = {"Count": 2.0, "Labels": markers, "Data": tracks}
    analog = {"Labels": muscles, "Frequency": 1000.0, "Data": emg}
    trial = {"File": "x", "FrameRate": 100.0, "Trajectories": {"Labeled": labelled}, "Analog": analog}
    scipy.io.savemat(tmp_path / "trial 0001.mat", {"trial_0001": trial})
    columns = read_columns(tmp_path / "trial 0001.mat")
    assert columns["Trajectories.Labeled.Data.RANK.2"].tolist() == Q.tolist()
    assert columns["Analog.Data.Fz"].tolist() == emg[2].tolist()
    assert columns["time"] == pytest.approx(T)
    assert columns["Analog.time"] == pytest.approx(np.arange(600) / 1000.0)
    assert not {"fs", "Frequency"} & set(columns.facts)


def test_cells_that_refer_to_each_other_are_refused(tmp_path):
    path = save_hdf5(tmp_path / "a.mat", {"q": Q, "deep": [1.0]})
    with h5py.File(path, "r+") as file:
        cell = file["#refs#"].create_dataset("loop", (1, 1), h5py.ref_dtype)
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
        cell[0, 0] = cell.ref
        file["deep"][0, 0] = cell.ref
    with pytest.raises(RecordingError, match=r"a\.mat: .* at most 100000 values, 40 deep"):
        read_columns(path)


@pytest.mark.parametrize("channels_first", [True, False])
def test_attributes_of_hdf5_name_the_columns_of_one_matrix(tmp_path, channels_first):
    table = np.stack([Q, T, 0.0 * T + 23.5])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("recording/data", data=table if channels_first else table.T)
        data.attrs["channels"] = ["torque", "angle", "temperature"]
        data.attrs["units"] = ["Nm", "rad", "degC"]
        file["recording"].attrs["fs"] = 100.0
    columns = read_columns(tmp_path / "a.h5")
    assert list(columns) == ["recording.data.torque", "recording.data.angle", "recording.data.temperature"]
    assert columns["recording.data.angle"].tolist() == T.tolist()
    assert list(columns.units.values()) == ["N*m", "rad", "degC"]
    assert columns.facts == {"fs": "100"}


def test_datasets_of_two_rates_have_times_of_their_own(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, rate in (("robot/q", 100.0), ("emg", 2000.0)):
            file[name] = np.column_stack([Q, Q])
            file[name].attrs["sampling_rate"] = rate
    columns = read_columns(tmp_path / "a.h5")
    assert columns["emg.time"] == pytest.approx(np.arange(60) / 2000.0)
    assert columns["robot.q.time"] == pytest.approx(T)
    assert not columns.facts


def demonstrations(path, count):
    with h5py.File(path, "w") as file:
        for k in range(count):
            demo = file.create_group(f"data/demo_{k}")
            demo["actions"], demo["obs/joint_pos"] = np.ones((60 + k, 2)), np.full((60 + k, 2), float(k))
            demo["obs/camera"] = np.zeros((60 + k, 20, 20, 3), np.uint8)
        file["data"].attrs["env_args"] = json.dumps({"env_kwargs": {"control_freq": 20}})
    return path


def test_demonstrations_are_recordings(tmp_path, monkeypatch):
    path = demonstrations(tmp_path / "a.hdf5", 12)
    columns = read_columns(path)
    assert columns.recordings == tuple(f"data.demo_{k}" for k in range(12))
    assert columns["data.demo_10.obs.joint_pos.1"].tolist() == [10.0] * 70
    assert columns.facts == {"fs": "20"}
    pictures = [name for name, x in columns.values.items() if isinstance(x, str)]
    assert pictures == ["data.demo_0.obs.camera"]
    monkeypatch.setenv("PELLUCID_MOST_COLUMNS", "23")
    columns = hdf5.read(path)
    assert columns.recordings == tuple(f"data.demo_{k}" for k in range(5))
    with pytest.raises(RecordingError, match="7 recordings at the file's end are excluded"):
        columns[LEFT_OUT_COLUMN]


def test_groups_of_one_form_and_other_lengths_are_recordings(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, n in (("walk", 60), ("stairs", 50)):
            file[f"{name}/time"], file[f"{name}/q"] = T[:n], Q[:n]
        file["settings/gains"] = np.ones(60)
    assert read_columns(tmp_path / "a.h5").recordings == ("stairs", "walk")


def test_texts_of_another_file_are_refused(tmp_path):
    (tmp_path / "secret").write_bytes(b"root:0:0" * 10)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["q"] = np.column_stack([Q, T])
        file.create_dataset("names", (2,), "S8", external=[(str(tmp_path / "secret"), 0, 16)])
    with pytest.raises(RecordingError, match=r"a\.h5: found that names is stored in another file"):
        read_columns(tmp_path / "a.h5")


def test_groups_of_joints_are_no_recordings(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for joint in ("joint1", "joint2"):
            file[f"{joint}/position"], file[f"{joint}/torque"] = Q, T
        file["time"] = T
    columns = read_columns(tmp_path / "a.h5")
    assert columns.recordings == ()
    assert columns["joint2.torque"].tolist() == T.tolist()


def test_arrays_of_numpy_are_named_by_texts_beside_them(tmp_path):
    names = np.array(["hip", "knee"])
    both = np.column_stack([Q, T])
    objects = np.array([{"a": 1}], dtype=object)
    np.savez(tmp_path / "a.npz", t=T, q=both, dq=both.T, joint_names=names, emg=np.ones((60, 3)), info=objects)
    columns = read_columns(tmp_path / "a.npz")
    assert columns["q.knee"].tolist() == columns["dq.knee"].tolist() == T.tolist()
    assert "emg.2" in columns
    with pytest.raises(RecordingError, match='column "info": contains Python objects, which could run a program'):
        columns["info"]


def test_lists_of_a_robot_are_named_and_episodes_are_recordings(tmp_path):
    """As LeRobot writes them: lists of floats, their names in meta/info.json, an index of the episode."""
    rows, names = 40, ["shoulder_pan.pos", "gripper.pos"]
    state = np.column_stack([np.arange(rows), -np.arange(rows)]).astype("f4")
    episode = np.repeat([3, 4], [15, 25])
    table = pyarrow.table(
        {
            "observation.state": pyarrow.array(state.tolist(), pyarrow.list_(pyarrow.float32())),
            "action": pyarrow.array([None, *state[1:].tolist()], pyarrow.list_(pyarrow.float32(), 2)),
            "timestamp": np.concatenate([np.arange(15), np.arange(25)]) / 30.0,
            "episode_index": episode,
            "ragged": [[1.0] * (1 + k % 2) for k in range(rows)],
            "force": pyarrow.array(np.ones((rows, 2)).tolist()),
        }
    )
    forces = table.schema.field("force").with_metadata({"names": '["fx", "fy"]', "units": "N"})
    table = table.cast(table.schema.set(table.schema.get_field_index("force"), forces))
    path = tmp_path / "data" / "chunk-000" / "file-000.parquet"
    path.parent.mkdir(parents=True)
    parquet.write_table(table, path)
    (tmp_path / "meta").mkdir()
    features = {"observation.state": {"names": names}, "action": {"names": {"motors": names}}}
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"fps": 30, "features": features}))
    columns = read_columns(path)
    assert columns.recordings == ("episode_3", "episode_4")
    assert columns["episode_4.observation.state.gripper.pos"].tolist() == (-np.arange(15.0, 40.0)).tolist()
    assert columns["episode_4.timestamp"][0] == 0.0
    action = columns["episode_3.action.shoulder_pan.pos"]
    assert np.isnan(action[0])
    assert action[1:].tolist() == np.arange(1.0, 15.0).tolist()
    assert columns.facts == {"fps": "30"}
    assert columns.units == {f"episode_{k}.force.{axis}": "N" for k in (3, 4) for axis in ("fx", "fy")}
    with pytest.raises(RecordingError, match="holds lists of 1 to 2 values, expected as many in each"):
        columns["ragged"]


def test_times_of_arrow_are_seconds(tmp_path):
    nanoseconds = 1_700_000_000_123_456_789 + 10_000_000 * np.arange(20)
    table = pyarrow.table(
        {
            "stamp": pyarrow.array(nanoseconds, pyarrow.timestamp("ns")),
            "elapsed": pyarrow.array(10_000_000 * np.arange(20), pyarrow.duration("ns")),
            "joint": [{"position": 1.0, "state": {"effort": 2.0}}] * 20,
        }
    )
    parquet.write_table(table, tmp_path / "a.parquet")
    columns = read_columns(tmp_path / "a.parquet")
    assert columns["elapsed"] == pytest.approx(np.arange(20) / 100.0, abs=1e-12)
    assert np.diff(columns["stamp"]) == pytest.approx(0.01, abs=1e-6)
    assert columns["joint.state.effort"].tolist() == [2.0] * 20
    assert columns.units == {"stamp": "s", "elapsed": "s"}
