"""EMG in files of acquisition programs: rate, names and units are those that the file states."""

import gzip
import json

import numpy as np
import pytest
from scipy.io import savemat
from test_emg_intake import RATE, bursts

import pellucid as pl
from pellucid._errors import RecordingError
from pellucid.files.readers import read_columns
from pellucid.start import init_from_files as front_door
from pellucid.start.given_files import read_given
from pellucid.start.propose_study import propose_study

MUSCLES = {"vastus_lateralis", "biceps_femoris", "tibialis_anterior"}
TITLES = ("EMG VL", "EMG BF", "EMG TA")


def labchart(path, t, x):
    first = 1.0 + len(t) * np.arange(3.0)[:, None]
    content = {
        "data": 1e3 * x.T.reshape(1, -1), "datastart": first, "dataend": first + len(t) - 1,
        "titles": np.array([f"{title}  " for title in TITLES]), "samplerate": np.full((3, 1), RATE),
        "unittext": np.array(["mV"]), "unittextmap": np.ones((3, 1)), "tickrate": RATE, "blocktimes": 739000.4,
    }  # fmt: skip
    savemat(path, content)


def spike2(path, t, x):
    channels = {
        f"walk_Ch{k + 1}": {
            "title": title, "comment": "", "interval": 1.0 / RATE, "scale": 1.0, "offset": 0.0, "units": "mV",
            "start": 0.5, "length": float(len(t)), "values": 1e3 * x[:, [k]],
        }
        for k, title in enumerate(TITLES)
    }  # fmt: skip
    savemat(path, channels)


def acqknowledge(path, t, x):
    names = {"labels": np.array([f"{title} " for title in TITLES]), "units": np.array(["mV"] * 3)}
    savemat(path, {"data": 1e3 * x, "isi": 1e3 / RATE, "isi_units": "ms", "start_sample": 0.0, **names})


def spike2_text(path, t, x):
    lines = ['"INFORMATION"', '"walk.smrx"', "", '"SUMMARY"', *(f'"{k}"\t"Waveform"' for k in (1, 2, 3))]
    for k, title in enumerate(TITLES):
        lines += ["", f'"CHANNEL"\t"{k + 1}"', '"Waveform"', '""', f'"{title}"', '"mV"', ""]
        lines += [f'"START"\t0.00000\t{1.0 / RATE:.6f}', *(f"{1e3 * v:.7g}" for v in x[:, k])]
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("write", "ending"), [(labchart, "mat"), (spike2, "mat"), (acqknowledge, "mat"), (spike2_text, "txt")]
)
def test_channels_of_acquisition_programs_have_rate_muscle_and_unit(tmp_path, write, ending):
    t, x = bursts(seconds=6.0)
    path = tmp_path / f"walk.{ending}"
    write(path, t, x)
    proposal = propose_study(read_given([path]), "s")
    roles = [r for layout in (proposal.main, *proposal.streams) for r in layout.channels]
    assert {(r.quantity, r.label, r.unit) for r in roles} == {("emg", muscle, "mV") for muscle in MUSCLES}
    assert proposal.rate == pytest.approx(RATE)


def test_a_title_of_spike2_may_have_a_comma(tmp_path):
    lines = ['"CHANNEL"\t"1"', '"Waveform"', '""', '"VL, right"', '"mV"', "", '"START"\t0.0\t0.001']
    (tmp_path / "walk.txt").write_text("\n".join([*lines, *(f"{0.5 * k}" for k in range(40))]) + "\n")
    found = read_columns(tmp_path / "walk.txt")
    assert found.values["VL, right [mV]"] == pytest.approx(0.5 * np.arange(40))


def test_blocks_of_labchart_are_recordings_of_their_own(tmp_path):
    _, x = bursts(seconds=6.0)
    flat = np.concatenate([x[:4000, 0], x[:4000, 1], x[4000:, 0], x[4000:, 1]])
    first = np.array([[1.0, 8001.0], [4001.0, 10001.0]])
    last = np.array([[4000.0, 10000.0], [8000.0, 12000.0]])
    rates = np.full((2, 2), RATE)
    content = {"data": flat[None], "datastart": first, "dataend": last, "samplerate": rates}
    savemat(tmp_path / "two.mat", content | {"titles": np.array(["VL", "BF"])})
    values = read_columns(tmp_path / "two.mat").values
    assert len(values["block_1.data.VL"]) == 4000
    assert values["block_2.data.BF"] == pytest.approx(x[4000:, 1])


def test_openhdemg_packs_a_grid_and_the_force_beside_it(tmp_path):
    t, x = bursts(seconds=6.0, channels=4)

    def frame(samples):
        return json.dumps({"columns": [*range(samples.shape[1])], "index": [*range(len(t))], "data": samples.tolist()})

    force = 30.0 * np.clip(np.sin(t), 0.0, 1.0)[:, None]
    content = {"SOURCE": '"OTB"', "RAW_SIGNAL": frame(1e6 * x), "REF_SIGNAL": frame(force), "FSAMP": f"{RATE}"}
    (tmp_path / "hdemg_trial.json").write_bytes(gzip.compress(json.dumps(content).encode()))
    found = read_columns(tmp_path / "hdemg_trial.json")
    assert found.values["EMG.electrode 4"] == pytest.approx(1e6 * x[:, 3])
    made = front_door.init_from_files(tmp_path / "study", [tmp_path / "hdemg_trial.json"])
    recording = pl.open(made.folder).recordings()[0]
    assert recording.fs == pytest.approx(RATE)
    assert sum(name.startswith("emg.") for name in recording.channels) == 4


def test_opensignals_rows_end_with_a_delimiter_and_sensors_tell_the_quantity(tmp_path):
    _, x = bursts(channels=2)
    facts = {
        "20:16": {
            "sensor": ["EMG", "EMG"], "column": ["nSeq", "DI", "CH1", "CH2"], "label": ["CH1", "CH2"],
            "sampling rate": 1000, "resolution": [16, 16], "channels": [1, 2],
        }
    }  # fmt: skip
    lines = ["# OpenSignals Text File Format. Version 1", f"# {json.dumps(facts)}", "# EndOfHeader"]
    lines += [f"{i}\t0\t{a}\t{b}\t" for i, (a, b) in enumerate(np.round(2e7 * x + 32768).astype(int).tolist())]
    (tmp_path / "raw.txt").write_text("\n".join(lines) + "\n")
    found = read_columns(tmp_path / "raw.txt")
    assert {"EMG CH1", "EMG CH2"} <= set(found.values)
    held = {v.channel: v.holds for v in pl.audit([tmp_path / "raw.txt"]).verdicts}
    assert held["EMG CH1"] == "emg"
    assert propose_study(read_given([tmp_path / "raw.txt"]), "s").rate == pytest.approx(1000.0)


def test_markers_beside_emg_are_no_angles(tmp_path):
    t, x = bursts(seconds=6.0)
    lines = ["Devices", f"{RATE:g}", ",,Trigno - Voltage,,", "Frame,Sub Frame,R_VL,R_BF,R_TA", ",,V,V,V"]
    lines += [f"{i // 10 + 1},{i % 10}," + ",".join(f"{v:.7g}" for v in row) for i, row in enumerate(x.tolist())]
    lines += ["", "Trajectories", f"{RATE / 10:g}", ",,walker:RKNE,,", "Frame,Sub Frame,X,Y,Z", ",,mm,mm,mm"]
    swing = np.sin(5.7 * t[::10])
    lines += [f"{i + 1},0,{400 * s:.3f},{100 + 9 * s:.3f},{500 + 40 * s * s:.3f}" for i, s in enumerate(swing.tolist())]
    (tmp_path / "walk.csv").write_text("\n".join(lines) + "\n")
    made = front_door.init_from_files(tmp_path / "study", [tmp_path / "walk.csv"])
    assert not [f for f in made.faults if f.severity == "refuse"]
    assert "vastus_lateralis_right" in made.text
    assert "RKNE_x" not in made.text.split("[onset]")[0].replace("# ", "")


def test_a_sylk_sheet_is_refused_with_what_to_export(tmp_path):
    (tmp_path / "walk.slk").write_text('ID;PWXL;N;E\nC;Y1;X1;K"time,s"\nE\n')
    with pytest.raises(RecordingError, match="a sheet in SYLK, as MyoResearch writes it"):
        read_columns(tmp_path / "walk.slk")
