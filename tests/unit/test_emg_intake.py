"""EMG in the files that laboratories have: every clock is read, muscles are named, EMG alone becomes a study."""

import numpy as np
import pytest

from pellucid.files.muscle_names import find_muscle
from pellucid.files.name_evidence import read_name, words_of
from pellucid.files.readers import read_columns
from pellucid.start import init_from_files as front_door
from pellucid.start.given_files import read_given
from pellucid.start.propose_study import propose_study

RATE = 1000.0


def bursts(seconds=4.0, channels=3, seed=0, rate=RATE):
    """Return times, (n,) [s], and EMG, (n, channels) [V], of muscles that work by turns."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    phase = t[:, None] / 1.1 - np.arange(channels) / channels
    size = 2e-6 + 1e-4 * (np.sin(2 * np.pi * phase) > 0.5)
    return t, size * rng.standard_normal((len(t), channels))


def written(path, names, columns):
    """Write columns, some of which may end earlier, as text."""
    rows = max(map(len, columns))
    lines = [",".join(names)]
    lines += [",".join(f"{c[i]:.7g}" if i < len(c) else "" for c in columns) for i in range(rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def proposed_channels(path):
    """Return the quantity, label and unit of every channel of what is proposed for a file, and the proposal."""
    proposal = propose_study(read_given([path]), "s")
    roles = [r for layout in (proposal.main, *proposal.streams) for r in layout.channels]
    return {(r.quantity, r.label, r.unit) for r in roles}, proposal


@pytest.mark.parametrize(
    ("label", "muscle"),
    [
        ("RT VLO, uV", "vastus_lateralis_right"),
        ("LT BICEPS FEM.,uV", "biceps_femoris_left"),
        ("BICEPS FEM.", "biceps_femoris"),
        ("BICEPS BR.", "biceps"),
        ("R GLUTEUS MED.", "gluteus_medius_right"),
        ("L_TA", "tibialis_anterior_left"),
        ("LT MED. GASTRO, uV", "gastrocnemius_medialis_left"),
        ("RVL", "vastus_lateralis_right"),
        ("RT UPPER TRAP., uV", "trapezius_upper_right"),
        ("VL - electrode 1 [uV]", "vastus_lateralis"),
    ],
)
def test_labels_of_vendors_name_muscle_and_side(label, muscle):
    assert read_name(label).muscle == muscle
    assert read_name(label).quantity == "emg"


def test_a_full_name_is_surer_than_two_letters():
    sure = [find_muscle(words_of(name)).confidence for name in ("soleus_left", "tib ant", "VLO", "TA")]
    assert sure == sorted(sure, reverse=True)
    assert sure[0] == 1.0


@pytest.mark.parametrize("name", ["reset", "rst", "res", "pl", "tp", "torque", "stroke", "robot_arm", "time"])
def test_other_words_name_no_muscle(name):
    assert read_name(name).muscle is None


def test_two_clocks_of_different_length_are_one_recording(tmp_path):
    t, x = bursts()
    names = ["X [s]", "VL: EMG 1 [V]", "X [s]", "BF: EMG 2 [V]"]
    path = written(tmp_path / "two.csv", names, [t, x[:, 0], t[:3900], x[:3900, 1]])
    values = read_columns(path).values
    assert np.isnan(values["BF: EMG 2 [V]"][3900:]).all()
    assert len(values["BF: EMG 2 [V]"]) == 4000
    channels, proposal = proposed_channels(path)
    assert channels == {("emg", "vastus_lateralis", "V"), ("emg", "biceps_femoris", "V")}
    assert proposal.rate == pytest.approx(RATE)


def test_accelerometers_beside_emg_are_no_recordings_of_their_own(tmp_path):
    t, x = bursts(channels=4)
    slow = np.arange(300) / 74.0
    names, columns = [], []
    for k, side in enumerate(("L VL", "L TA", "R VL", "R TA")):
        names += ["X[s]", f"{side}: EMG {k + 1}[V]"]
        columns += [t, x[:, k]]
        for axis in "XYZ":
            n = 300 - 10 * (k == 2)
            names += ["X[s]", f"{side}: ACC.{axis}[g]"]
            columns += [slow[:n], 0.577 + 0.1 * np.random.default_rng(k).standard_normal(n)]
    channels, proposal = proposed_channels(written(tmp_path / "acc.csv", names, columns))
    assert len(proposal.recordings) == 1
    assert {label for _, label, _ in channels} == {
        f"{muscle}_{side}" for muscle in ("vastus_lateralis", "tibialis_anterior") for side in ("left", "right")
    }


def test_emg_alone_is_a_study_of_muscles(tmp_path):
    t, x = bursts(seconds=6.0)
    path = written(tmp_path / "walk.csv", ["time_s", "VL_mV", "RF_mV", "BF_mV"], [t, *(1e3 * x.T)])
    made = front_door.init_from_files(tmp_path / "study", [path])
    assert not [f for f in made.faults if f.severity == "refuse"]
    assert "[onset]" in made.text
    assert "[synergies]" in made.text
    assert "[emg_torque]" not in made.text


def test_a_maximal_contraction_is_a_maximum_only(tmp_path):
    t, x = bursts()
    names = ["time_s", "VL_mV", "RF_mV", "BF_mV"]
    files = [written(tmp_path / f"{n}.csv", names, [t, *(1e3 * x.T)]) for n in ("mvc_VL", "walk1", "walk2")]
    proposal = propose_study(read_given(files), "s")
    assert {r.name: r.protocol == "mvc" for r in proposal.recordings} == {
        "mvc_VL": True, "walk1": False, "walk2": False,
    }  # fmt: skip
    assert next(r for r in proposal.recordings if r.name == "mvc_VL").use == "fit"


def test_edf_of_two_rates_keeps_both(tmp_path):
    edfio = pytest.importorskip("edfio")
    t, x = bursts()
    angle = 30.0 * np.sin(2 * np.pi * t[::10])
    signals = [
        *(
            edfio.EdfSignal(1e6 * x[:, k], RATE, label=label, physical_dimension="uV", physical_range=(-2000, 2000))
            for k, label in enumerate(("RT VLO", "BICEPS FEM."))
        ),
        edfio.EdfSignal(angle, 100, label="knee_angle", physical_dimension="deg", physical_range=(-180, 180)),
    ]
    edfio.Edf(signals).write(tmp_path / "two.edf")
    channels, _ = proposed_channels(tmp_path / "two.edf")
    assert ("emg", "vastus_lateralis_right", "uV") in channels
    assert ("emg", "biceps_femoris", "uV") in channels
    assert ("angle", "knee", "deg") in channels


@pytest.mark.parametrize("unit", [["mm"], []])
def test_markers_of_a_capture_are_no_torque_and_emg_has_its_own_rate(tmp_path, unit):
    ezc3d = pytest.importorskip("ezc3d")
    t, x = bursts()
    capture, frames = ezc3d.c3d(), len(t) // 10
    capture["parameters"]["POINT"]["RATE"]["value"] = [RATE / 10]
    capture["parameters"]["POINT"]["LABELS"]["value"] = ["RKNE"]
    capture["parameters"]["POINT"]["UNITS"]["value"] = unit
    points = np.ones((4, 1, frames))
    points[:3, 0] = 500.0 + 300.0 * np.sin(np.arange(frames) / 15.0 + np.arange(3)[:, None])
    capture["data"]["points"] = points
    capture["parameters"]["ANALOG"]["RATE"]["value"] = [RATE]
    capture["parameters"]["ANALOG"]["LABELS"]["value"] = ["EMG1.VL", "EMG2.RF", "Fz1"]
    capture["parameters"]["ANALOG"]["UNITS"]["value"] = ["V", "V", "V"]
    capture["data"]["analogs"] = np.vstack([x[:, 0], x[:, 1], np.sin(t)])[None]
    capture.write(str(tmp_path / "gait.c3d"))
    channels, proposal = proposed_channels(tmp_path / "gait.c3d")
    assert {c[:2] for c in channels} == {("emg", "vastus_lateralis"), ("emg", "rectus_femoris")}
    assert proposal.rate == pytest.approx(RATE)


def test_an_export_of_otbiolab_has_the_names_of_its_columns(tmp_path):
    from scipy.io import savemat

    t, x = bursts()
    labels = np.array(["VL - electrode 1 [uV]", "TA - electrode 2 [uV]", "knee angle [deg]"], dtype=object)
    data = np.empty((1, 1), dtype=object)
    data[0, 0] = np.column_stack([1e6 * x[:, :2], 20.0 * np.sin(t)])
    savemat(tmp_path / "otb.mat", {"Data": data, "Description": labels, "SamplingFrequency": RATE})
    channels, proposal = proposed_channels(tmp_path / "otb.mat")
    assert ("emg", "vastus_lateralis", "uV") in channels
    assert ("emg", "tibialis_anterior", "uV") in channels
    assert proposal.rate == pytest.approx(RATE)
