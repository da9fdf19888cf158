"""EMG in the files that laboratories have: every clock is read, muscles are named, EMG alone becomes a study."""

import json

import numpy as np
import pytest
from test_emg_findings import walking

import pellucid as pl
from pellucid._errors import UnfitRecordingError
from pellucid.files.log import log_of
from pellucid.files.muscle_names import find_muscle
from pellucid.files.name_evidence import read_name, words_of
from pellucid.files.raw_emg import RawEmg
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


def rng_walk(n, seed=2):
    """Return the steps of three slow walks, (n, 3)."""
    return 0.01 * np.random.default_rng(seed).standard_normal((n, 3)) + 0.01


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
        ("R Gastrocnemius Medial Head: EMG 4 [V]", "gastrocnemius_medialis_right"),
        ("EMG RectFemL", "rectus_femoris_left"),
        ("RT MED. HAM., uV", "semitendinosus_right"),
        ("Left Hamstrings [mV]", "hamstrings_left"),
        ("Gastrocnemio laterale dx [uV]", "gastrocnemius_lateralis_right"),
        ("Tibiale anteriore sx [uV]", "tibialis_anterior_left"),
    ],
)
def test_labels_of_vendors_name_muscle_and_side(label, muscle):
    assert read_name(label).muscle == muscle
    assert read_name(label).quantity == "emg"


def test_a_full_name_is_surer_than_two_letters():
    sure = [find_muscle(words_of(name)).confidence for name in ("soleus_left", "tib ant", "VLO", "TA")]
    assert sure == sorted(sure, reverse=True)
    assert sure[0] == 1.0


@pytest.mark.parametrize(
    ("labels", "muscle", "is_asked"),
    [
        (("VL", "GM", "TA"), "gastrocnemius_medialis", True),
        (("VL", "GM", "GL"), "gastrocnemius_medialis", False),
        (("VL", "BICEPS", "TA"), "biceps_femoris", False),
        (("BRACHIALIS", "BICEPS", "TRICEPS"), "biceps", False),
        (("TRICEPS", "BICEPS", "DELTOID"), "biceps", False),
        (("SOL", "BICEPS", "BRACHIALIS"), "biceps", True),
    ],
)
def test_a_label_of_several_muscles_is_settled_by_the_others_or_asked_for(tmp_path, labels, muscle, is_asked):
    t, x = bursts(seconds=6.0)
    path = written(tmp_path / "walk.csv", ["time_s", *(f"{label}_mV" for label in labels)], [t, *(1e3 * x.T)])
    proposal = propose_study(read_given([path]), "s")
    column = f"{labels[1]}_mV"
    role = next(r for r in proposal.main.channels if r.column == column)
    assert role.label == muscle
    assert f"confidence of {0.3 if is_asked else 0.5}" in role.why
    assert ("muscles" in {q.key for q in proposal.asked}) == is_asked
    if is_asked:
        said = {"muscles": f"{column} = gluteus medius"}
        made = front_door.init_from_files(tmp_path / "study", [path], answers=said)
        assert "emg.gluteus_medius" in made.text


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


def test_envelopes_of_too_few_muscles_are_refused_in_their_own_words(tmp_path):
    t, _ = bursts(seconds=6.0, channels=2)
    envelopes = np.abs(np.sin(2.0 * t))[::10, None] * (1.0, 0.8)
    path = written(tmp_path / "walk.csv", ["time_s", "VL_percent", "BF_percent"], [t[::10], *(90.0 * envelopes.T)])
    with pytest.raises(UnfitRecordingError, match="the envelopes of 2 muscles, expected raw EMG"):
        front_door.init_from_files(tmp_path / "study", [path])


def test_a_maximal_contraction_is_a_maximum_only(tmp_path):
    t, x = bursts()
    names = ["time_s", "VL_mV", "RF_mV", "BF_mV"]
    files = [written(tmp_path / f"{n}.csv", names, [t, *(1e3 * x.T)]) for n in ("mvc_VL", "walk1", "walk2")]
    proposal = propose_study(read_given(files), "s")
    assert {r.name: r.protocol == "mvc" for r in proposal.recordings} == {
        "mvc_VL": True, "walk1": False, "walk2": False,
    }  # fmt: skip
    assert next(r for r in proposal.recordings if r.name == "mvc_VL").use == "fit"


def held(seconds=8.0, muscle=0, level=3.0, seed=4):
    """Return EMG, (n, 3) [V], in which one muscle holds a level over that of `bursts` for half of the time."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    size = np.full((len(t), 3), 5e-6)
    size[(t > 0.25 * seconds) & (t < 0.75 * seconds), muscle] = 1e-4 * level
    return t, size * rng.standard_normal(size.shape)


def proposed_protocols(tmp_path, recordings):
    names = ["time_s", "VL_mV", "RF_mV", "BF_mV"]
    files = [written(tmp_path / f"rec_{i}.csv", names, [t, *(1e3 * x.T)]) for i, (t, x) in enumerate(recordings)]
    return [r.protocol == "mvc" for r in propose_study(read_given(files), "s").recordings]


def test_held_contractions_above_all_movement_are_maximal_by_their_shape(tmp_path):
    walks = [bursts(seconds=8.0, seed=k) for k in range(2)]
    assert proposed_protocols(tmp_path, [*walks, held(), held(muscle=2)]) == [False, False, True, True]


def test_weak_contractions_and_contractions_alone_are_no_maxima(tmp_path):
    assert proposed_protocols(tmp_path, [bursts(seconds=8.0), held(level=0.5)]) == [False, False]
    assert proposed_protocols(tmp_path, [held(level=x) for x in (0.5, 1.0, 2.0)]) == [False] * 3


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


def test_letters_that_mean_other_things_name_muscles_beside_emg(tmp_path):
    t, x = bursts(channels=3)
    path = written(tmp_path / "short.csv", ["time_s", "LVL_mV", "RST_mV", "LES_mV"], [t, *(1e3 * x.T)])
    channels, _ = proposed_channels(path)
    assert {label for _, label, _ in channels} == {
        "vastus_lateralis_left", "semitendinosus_right", "erector_spinae_left",
    }  # fmt: skip
    envelopes = np.clip(np.cumsum(rng_walk(len(t)), axis=0), 0.0, None)
    names = ["time_s", "LVL [%]", "RRF [%]", "RST [%]"]
    path = written(tmp_path / "relative.csv", names, [t, *(envelopes / envelopes.max(axis=0)).T])
    channels, _ = proposed_channels(path)
    assert ("emg", "semitendinosus_right", "%") in channels
    capture = written(tmp_path / "volts.csv", ["time [s]", "LVL [V]", "RRF [V]", "RST [V]"], [t, *x.T])
    log = log_of(read_columns(capture))
    assert [c.quantity.kind for c in log.channels] == ["time", "emg", "emg", "emg"]
    assert read_name("RST").muscle is None


def test_a_muscle_at_the_end_of_a_label_is_no_unit():
    found = read_name("EMG LBF")
    assert (found.muscle, found.unit, found.quantity) == ("biceps_femoris_left", None, "emg")
    assert read_name("force LBF").unit == "lbf"


def test_acknowledges_names_stand_in_lines_above_also_with_a_surplus_delimiter(tmp_path):
    t, x = bursts(channels=2)
    lines = ["trial.acq", "1 msec/sample", "2 channels", "Vastus Lateralis", "mV", "Soleus", "mV", "sec,CH1,CH2,"]
    lines.append(f",{len(t)},{len(t)},")
    lines += [f"{a:.4f},{1e3 * b:.6g},{1e3 * c:.6g}," for a, (b, c) in zip(t, x, strict=True)]
    lines[50] = f"{t[41]:.4f},,{1e3 * x[41, 1]:.6g},"  # a lost sample counts, too
    (tmp_path / "trial.txt").write_text("\n".join(lines) + "\n")
    found = read_columns(tmp_path / "trial.txt")
    assert list(found.values) == ["sec", "Vastus Lateralis", "Soleus"]
    assert found.units["Soleus"] == "mV"
    assert len(found["sec"]) == len(t)


def test_acknowledges_units_of_percent_are_no_comments(tmp_path):
    t, x = bursts(channels=2)
    share = 90.0 * np.abs(x) / np.abs(x).max(axis=0)
    lines = ["trial.acq", "1 msec/sample", "2 channels", "Vastus Lateralis", "%", "Soleus", "%", "sec,CH1,CH2,"]
    lines.append(f",{len(t)},{len(t)},")
    lines += [f"{a:.4f},{b:.6g},{c:.6g}," for a, (b, c) in zip(t, share, strict=True)]
    (tmp_path / "trial.txt").write_text("\n".join(lines) + "\n")
    found = read_columns(tmp_path / "trial.txt")
    assert found.units["Vastus Lateralis"] == "%"
    assert found.units["Soleus"] == "%"
    assert len(found.values["Soleus"]) == len(t)


def test_a_description_in_json_names_the_columns(tmp_path):
    _, x = bursts(channels=2)
    said = {"00:07": {"column": ["nSeq", "EMG_VL", "EMG_TA"], "sampling rate": 1000, "units": ["mV", "mV"]}}
    lines = ["# OpenSignals Text File Format", f"# {json.dumps(said)}", "# EndOfHeader"]
    lines += [f"{i}\t{1e3 * a:.6g}\t{1e3 * b:.6g}" for i, (a, b) in enumerate(x)]
    (tmp_path / "signals.txt").write_text("\n".join(lines) + "\n")
    channels, proposal = proposed_channels(tmp_path / "signals.txt")
    assert channels == {("emg", "vastus_lateralis", "mV"), ("emg", "tibialis_anterior", "mV")}
    assert proposal.rate == pytest.approx(1000.0)


def test_a_row_of_units_of_the_channels_alone_moves_no_name(tmp_path):
    t, x = bursts(channels=2)
    lines = ["SAMPLE_RATE\t1000", "CHANNEL_NAMES\tVL_R\tTA_R", "UNITS\tmV\tmV", "SAMPLE\tTIME\tVL_R\tTA_R"]
    rows = enumerate(zip(t, x, strict=True), 1)
    lines += [f"{i}\t{a:.4f}\t{1e3 * b:.6g}\t{1e3 * c:.6g}" for i, (a, (b, c)) in rows]
    (tmp_path / "analog.tsv").write_text("\n".join(lines) + "\n")
    found = read_columns(tmp_path / "analog.tsv")
    assert list(found.values) == ["SAMPLE", "TIME", "VL_R", "TA_R"]
    assert found.units["VL_R"] == "mV"


def test_bids_says_which_muscle_a_channel_is_of(tmp_path):
    _, x = bursts(seconds=6.0, channels=3)
    path = RawEmg(x, RATE, ("soleus_right", "Right Biceps Femoris", "x")).to_bids(
        tmp_path / "set", subject="01", task="walking", reference="bipolar", placement="SENIAM"
    )
    channels, _ = proposed_channels(path)
    labels = {label for _, label, _ in channels}
    assert {"soleus_right", "biceps_femoris_right"} <= labels


def test_the_rate_that_a_file_states_is_that_of_an_audit(tmp_path):
    from scipy.io import savemat

    _, x = bursts(channels=3)
    x[:, 1] = 5e-8 * np.random.default_rng(0).standard_normal(len(x))
    own = {"data": 1e3 * x, "labels": np.array(["VL", "RF", "BF"], object), "fs": RATE, "unit": "mV"}
    savemat(tmp_path / "struct.mat", {"emg": own})
    found = pl.audit(tmp_path / "struct.mat")
    assert [v.verdict for v in found.verdicts if v.channel.endswith(".RF")] == ["dead"]
    assert not [v for v in found.verdicts if v.verdict == "no time base"]


def test_a_rate_other_than_the_nominal_one_is_a_finding(tmp_path):
    t, x = bursts(channels=2)
    lines = ["Sampling rate: 1000 Hz", "time [s],VL [mV],TA [mV]"]
    lines += [f"{1.1 * a:.5f},{1e3 * b:.6g},{1e3 * c:.6g}" for a, (b, c) in zip(t, x, strict=True)]
    (tmp_path / "slow.csv").write_text("\n".join(lines) + "\n")
    (clock,) = [v for v in pl.audit(tmp_path / "slow.csv").verdicts if v.channel == "time [s]"]
    assert "909.09 Hz, where the file states 1000 Hz" in clock.sentences[0]


def test_exchanged_channels_of_one_of_several_files_have_the_same_finding_in_audit_and_check(tmp_path):
    t = np.arange(12000) / RATE
    names = ["time_s", "VL_mV", "RF_mV", "BF_mV", "TA_mV"]
    first, second = (1e3 * walking(seed, pace=pace) for seed, pace in ((1, 1.1), (2, 1.2)))
    files = [
        written(tmp_path / "walk1.csv", names, [t, *first.T]),
        written(tmp_path / "walk2.csv", names, [t, *second[:, [1, 0, 2, 3]].T]),
    ]
    audited = {
        (name, v.channel) for v in pl.audit(files).verdicts for name, f in v.findings if f.kind == "exchanged"
    }
    assert audited == {("walk2.csv", "VL_mV"), ("walk2.csv", "RF_mV")}
    made = front_door.init_from_files(tmp_path / "study", files)
    checked = {(f.file, f.channel) for f in made.faults if f.kind == "exchanged"}
    assert checked == {("walk2.csv", "emg.vastus_lateralis"), ("walk2.csv", "emg.rectus_femoris")}


def test_check_examines_the_emg_of_recordings_that_it_excludes(tmp_path):
    t, whole = np.arange(12000) / RATE, walking(1)
    spoilt = whole.copy()
    spoilt[4000:4900, 0] = spoilt[4000, 0]
    spoilt[:, 2] += 2e-4 * np.sin(2 * np.pi * 50.0 * t)
    names = ["time_s", "VL_mV", "RF_mV", "BF_mV", "TA_mV"]
    files = [written(tmp_path / f"walk{k}.csv", names, [t, *(1e3 * x.T)]) for k, x in enumerate((whole, spoilt))]
    made = front_door.init_from_files(tmp_path / "study", files)
    own = {(f.kind, f.channel) for f in made.faults if f.file == "walk1.csv"}
    assert ("dropout", "emg.vastus_lateralis") in own
    assert ("mains_hum", "emg.biceps_femoris") in own
    assert not [f for f in made.faults if f.severity == "refuse"]


def test_a_refusal_carries_every_fault(tmp_path):
    t, x = bursts(seconds=10.0)
    x[:, 2] = 5e-8 * np.random.default_rng(1).standard_normal(len(t))
    x[2000:2400, 0] = 0.0
    path = written(tmp_path / "walk.csv", ["time_s", "VL_mV", "RF_mV", "BF_mV"], [t, *(1e3 * x.T)])
    with pytest.raises(UnfitRecordingError) as raised:
        front_door.init_from_files(tmp_path / "study", [path])
    assert {(f.channel, f.kind) for f in raised.value.faults} >= {
        ("emg.vastus_lateralis", "dropout"), ("emg.biceps_femoris", "detached_electrode"),
    }  # fmt: skip


def test_labcharts_ranges_state_units(tmp_path):
    t, x = bursts(channels=2)
    lines = ["Interval=\t0.001 s", "ChannelTitle=\tVL\tTA", "Range=\t10.000 mV\t5.000 mV"]
    lines += [f"{a:.4f}\t{1e3 * b:.6g}\t{1e3 * c:.6g}" for a, (b, c) in zip(t, x, strict=True)]
    (tmp_path / "chart.txt").write_text("\n".join(lines) + "\n")
    assert read_columns(tmp_path / "chart.txt").units["TA"] == "mV"


def test_one_unit_of_all_signals_is_none_of_frames_and_times(tmp_path):
    t, x = bursts(channels=2)
    lines = ["Measure unit:\tmV", "Frequency:\t1000 Hz", "Frame\tTime\tVL\tTA"]
    lines += [f"{i}\t{a:.4f}\t{1e3 * b:.6g}\t{1e3 * c:.6g}" for i, (a, (b, c)) in enumerate(zip(t, x, strict=True))]
    (tmp_path / "bts.txt").write_text("\n".join(lines) + "\n")
    assert dict(read_columns(tmp_path / "bts.txt").units) == {"VL": "mV", "TA": "mV"}


def test_a_name_that_a_format_cut_off_is_still_the_muscles():
    assert read_name("Gastrocnemius Me").muscle == "gastrocnemius_medialis"
    assert read_name("Right Vastus Lat").muscle == "vastus_lateralis_right"
