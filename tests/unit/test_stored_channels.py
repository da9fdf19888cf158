"""Recordings beyond a size have their samples in a temporary file, and stay what they were."""

import pickle
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pellucid.files import kept_columns, stored_channels
from pellucid.files.optical import OpticalRecording
from pellucid.files.readers.read import read_columns
from pellucid.files.recording import Channel, Recording
from pellucid.files.stored_channels import ChannelStore, StoredChannel, rows_of
from pellucid.study.procedures.registry import open_study

COUNT = 5000

STUDY = """
name = "kept"
[rig]
motion = "rotary"
drive = { kind = "torque" }
[channels]
time = { column = "t", unit = "s" }
emg.biceps = { column = "c", unit = "V", scale = 1.5e-7 }
position = { column = "q", unit = "deg", sign = -1 }
torque = { column = "q", unit = "N*m" }
motor_position = { column = "k", unit = "rad", wrap_bits = 8 }
[[recordings]]
name = "a"
file = "recordings/a.csv"
use = "fit"
[processing]
cut = "none"
"""


def recording(name: str, *, seed: int = 0, stream: bool = True) -> Recording:
    rng = np.random.default_rng(seed)
    channels = {n: Channel(n, rng.normal(size=COUNT), "rad", n) for n in ("time", "position")}
    markers = {"wrist": rng.normal(size=(COUNT, 3))}
    optical = OpticalRecording(Path("m.csv"), "", rng.normal(size=COUNT), markers, np.array([0.0, 0.0, -1.0]))
    streams = {"emg": recording(f"{name}.emg", seed=seed + 1, stream=False)} if stream else {}
    return Recording(name, Path("a.csv"), "", "fit", channels, streams=streams, optical=optical)


@pytest.fixture
def store(monkeypatch) -> ChannelStore:
    monkeypatch.setattr(stored_channels, "MAX_HELD_BYTES", 0)
    return ChannelStore()


def test_a_small_study_stays_in_memory():
    whole = recording("a")
    assert ChannelStore().keep(whole)[0] is whole


def test_stored_samples_are_those_that_were_given(store):
    whole = recording("a")
    (kept,) = store.keep(whole)
    (other,) = store.keep(recording("b", seed=7))
    assert isinstance(kept.channels["position"], StoredChannel)
    assert len(kept) == COUNT
    for one, each in ((whole, kept), (whole.streams["emg"], kept.streams["emg"])):
        for name in one.channels:
            assert np.array_equal(each[name], one[name])
            assert not each[name].flags.writeable
        assert np.array_equal(each.optical.markers["wrist"], one.optical.markers["wrist"])
    assert np.array_equal(other["position"], recording("b", seed=7)["position"])


def test_versions_share_what_is_stored(store):
    apart = recording("a", stream=False)
    joined = replace(apart, channels={**apart.channels, "more": Channel("more", np.ones(COUNT), "1", "more")})
    both = store.keep(apart, joined)
    assert both[0].channels["position"] is both[1].channels["position"]
    assert both[0].optical is both[1].optical
    stored = store._end
    assert store.keep(apart, apart)[0] is not apart
    assert store._end - stored == 8 * COUNT * (2 + 3)  # two channels, and three axes of a marker
    assert len({id(each) for each in store.keep(apart, apart)}) == 1


def test_a_changed_copy_and_another_process_have_plain_channels(store):
    whole = recording("a", stream=False)
    (kept,) = store.keep(whole)
    assert type(replace(kept.channels["position"], name="q")) is Channel
    sent = pickle.loads(pickle.dumps((kept.channels["position"], kept.optical.markers)))
    assert type(sent[0]) is Channel
    assert np.array_equal(sent[0].samples, whole["position"])
    assert np.array_equal(sent[1]["wrist"], whole.optical.markers["wrist"])


def test_recordings_stay_in_memory_if_no_temporary_file_can_be_written(store, monkeypatch):
    def refuse():
        raise OSError("no space")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    whole = recording("a")
    assert store.keep(whole)[0] is whole
    arrays = {"x": np.ones(3)}
    assert store.store_all(arrays) is arrays


def test_many_arrays_are_held_at_once_by_one_file_descriptor(store):
    arrays = store.store_all({str(i): np.full(8, float(i)) for i in range(400)})
    first = len(list(Path("/proc/self/fd").iterdir()))
    held = [arrays[str(i)] for i in range(400)]
    assert len(list(Path("/proc/self/fd").iterdir())) == first
    assert [x[0] for x in held] == list(range(400))
    rows = np.array([[0, 3], [7, 7]])
    assert rows_of(arrays, "5", rows).tolist() == [[5.0, 5.0], [5.0, 5.0]]
    assert rows_of({"x": np.arange(8.0)}, "x", rows).tolist() == [[0.0, 3.0], [7.0, 7.0]]
    assert len(list(Path("/proc/self/fd").iterdir())) == first


def test_channels_of_a_kept_file_are_read_from_it_again(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_columns, "MIN_FILE_BYTES", 1)
    monkeypatch.setattr(stored_channels, "MAX_HELD_BYTES", 0)
    (tmp_path / "recordings").mkdir()
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    rng = np.random.default_rng(3)
    counts, angle = rng.integers(-2000, 2000, COUNT), np.cumsum(rng.normal(size=COUNT))
    rows = zip(range(COUNT), counts.tolist(), angle.tolist(), (np.arange(COUNT) % 256).tolist(), strict=True)
    text = "".join(f"{i / 1000:.3f},{c},{q!r},{k}\n" for i, c, q, k in rows)
    (tmp_path / "recordings" / "a.csv").write_text("t,c,q,k\n" + text, encoding="utf-8")
    study = open_study(tmp_path)
    (recording,) = study.recordings()
    store = study.kept.store
    assert store._end == 8 * COUNT  # what follows from its neighbours is written
    first, (alone,) = recording.channels["emg.biceps"], [read_columns(tmp_path / "recordings" / "a.csv")]
    np.testing.assert_array_equal(first.samples, 1.5e-7 * alone["c"])
    np.testing.assert_array_equal(first.within(slice(20, 90, 3)).samples, 1.5e-7 * alone["c"][20:90:3])
    np.testing.assert_array_equal(recording["position"], -np.deg2rad(alone["q"]))
    assert np.all(np.diff(recording["motor_position"]) > 0.0)
    assert not first.samples.flags.writeable
    assert type(replace(first, name="emg.triceps")) is Channel
    assert type(pickle.loads(pickle.dumps(first))) is Channel
