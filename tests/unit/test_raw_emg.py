"""Raw EMG from and to MNE and BIDS."""

import csv
import json
import sys

import edfio
import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError, RecordingError

RATE = 2000.0


@pytest.fixture
def emg(rng):
    samples, bad = 1e-4 * rng.standard_normal((4001, 2)), frozenset({"soleus"})
    return pl.RawEmg(samples, RATE, ("soleus", "tibialis_anterior"), 60.0, bad)


def write(emg, folder, **options):
    return emg.to_bids(folder, subject="01", task="walking", reference="bipolar", placement="SENIAM", **options)


def test_what_was_written_for_bids_is_read_again(emg, tmp_path):
    path = write(emg, tmp_path, more={"Manufacturer": "Delsys"})
    assert path == tmp_path / "sub-01" / "emg" / "sub-01_task-walking_emg.bdf"
    again = pl.RawEmg.from_bids(path)
    assert (again.muscles, again.rate, again.mains, again.bad) == (emg.muscles, RATE, 60.0, emg.bad)
    assert again.samples.shape == emg.samples.shape
    # 24 bits over a range of less than a millivolt.
    assert np.abs(again.samples - emg.samples).max() < 1e-3 / 2**23
    # Another reader has the same samples, and zeros after the last one.
    other = edfio.read_bdf(path)
    assert other.signals[0].physical_dimension == "uV"
    assert other.signals[0].data[:4001] == pytest.approx(1e6 * emg.samples[:, 0], abs=1e-3)
    assert np.abs(other.signals[0].data[4001:]).max() < 1e-3
    assert len(other.signals[0].data) - 4001 < 0.01 * RATE + 1


def test_sidecars_have_what_bids_requires(emg, tmp_path):
    path = write(emg, tmp_path, more={"Manufacturer": "Delsys"})
    sidecar = json.loads(path.with_suffix(".json").read_text())
    required = ("EMGPlacementScheme", "EMGReference", "SamplingFrequency", "PowerLineFrequency", "SoftwareFilters")
    assert {*required, "TaskName"} <= set(sidecar)
    assert sidecar["EMGPlacementScheme"] == "Other"
    assert sidecar["EMGPlacementSchemeDescription"] == "SENIAM"
    assert sidecar["RecordingDuration"] == pytest.approx(4001 / RATE)
    assert sidecar["Manufacturer"] == "Delsys"
    with (path.parent / "sub-01_task-walking_channels.tsv").open() as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    assert list(rows[0])[:3] == ["name", "type", "units"]
    assert [(r["name"], r["type"], r["status"]) for r in rows] == [
        ("soleus", "EMG", "bad"),
        ("tibialis_anterio", "EMG", "good"),
    ]
    assert [r["target_muscle"] for r in rows] == list(emg.muscles)
    description = json.loads((tmp_path / "dataset_description.json").read_text())
    assert {"Name", "BIDSVersion"} <= set(description)


def test_channels_of_other_types_are_left_out_and_muscles_have_their_names(tmp_path):
    place = tmp_path / "sub-02" / "emg"
    place.mkdir(parents=True)
    path = place / "sub-02_task-jump_run-1_emg.edf"
    x = np.sin(np.arange(2000) / 30.0)
    edfio.Edf(
        [
            edfio.EdfSignal(x, 1000, label="EMG1", physical_dimension="mV", physical_range=(-2, 2)),
            edfio.EdfSignal(0.5 * x, 1000, label="TRIG", physical_dimension="mV", physical_range=(-2, 2)),
        ]
    ).write(path)
    assert pl.RawEmg.from_bids(path).muscles == ("EMG1", "TRIG")
    # Sidecars may stand in folders above.
    table = "name\ttype\tunits\ttarget_muscle\nEMG1\tEMG\tmV\tsoleus\nTRIG\tTRIG\tmV\tn/a\n"
    (tmp_path / "task-jump_channels.tsv").write_text(table)
    (tmp_path / "task-jump_emg.json").write_text('{"PowerLineFrequency": 50, "SamplingFrequency": 1000}')
    (tmp_path / "task-other_emg.json").write_text('{"PowerLineFrequency": 60}')
    (tmp_path / "dataset_description.json").write_text("{}")
    found = pl.RawEmg.from_bids(path)
    assert (found.muscles, found.mains) == (("soleus",), 50.0)
    assert found.samples[:, 0] == pytest.approx(1e-3 * x, abs=1e-7)
    path.with_suffix(".json").write_text('{"SamplingFrequency": 2000}')
    with pytest.raises(RecordingError, match=r"found a rate of 1000 Hz, expected 2000 Hz as in its emg\.json"):
        pl.RawEmg.from_bids(path)


def test_mne_has_the_same_channels(emg):
    mne = pytest.importorskip("mne")
    raw = emg.to_mne()
    assert (raw.ch_names, raw.get_channel_types()) == (list(emg.muscles), ["emg", "emg"])
    assert raw.get_data() == pytest.approx(emg.samples.T)
    again = pl.RawEmg.from_mne(raw)
    assert (again.muscles, again.rate, again.mains, again.bad) == (emg.muscles, RATE, 60.0, emg.bad)
    assert np.array_equal(again.samples, emg.samples)
    more = mne.io.RawArray(np.zeros((1, 4001)), mne.create_info(["angle"], RATE, "misc"), verbose="error")
    more.info["line_freq"] = 60.0
    with pytest.raises(RecordingError, match='found channels of the types misc, expected "emg"'):
        pl.RawEmg.from_mne(more)


def test_what_cannot_be_exchanged_is_refused(emg, tmp_path, monkeypatch):
    with pytest.raises(RecordingError, match=r"found list, expected an mne\.io\.Raw"):
        pl.RawEmg.from_mne([1.0])
    with pytest.raises(RecordingError, match="expected letters and digits alone"):
        emg.to_bids(tmp_path, subject="a_b", task="walking", reference="bipolar", placement="SENIAM")
    with pytest.raises(RecordingError, match=r"expected one that ends in _emg\.edf"):
        pl.RawEmg.from_bids(tmp_path / "walking.edf")
    with pytest.raises(RecordingError, match="missing samples"):
        write(pl.RawEmg(np.full((100, 1), np.nan), RATE, ("soleus",)), tmp_path)
    for samples, rate, muscles in (
        (np.zeros(5), RATE, ("a",)), (np.zeros((5, 2)), RATE, ("a", "a")), (np.zeros((5, 1)), 0.0, ("a",))
    ):  # fmt: skip
        with pytest.raises(RecordingError, match="RawEmg: found"):
            pl.RawEmg(samples, rate, muscles)
    monkeypatch.setitem(sys.modules, "mne", None)
    with pytest.raises(PellucidError, match="found no package mne"):
        emg.to_mne()
