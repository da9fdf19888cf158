"""The recorder writes every record, event and sample once, also when it is killed and started again."""

import json

import numpy as np
import pytest
import pyxdf

from pellucid.files.readers import xdf
from pellucid.live.clock_tracker import ClockTracker
from pellucid.live.recorder import Recorder
from pellucid.live.replay import read_session
from pellucid.live.setup import Condition, DeviceNumbers, EngineSetup, settings_text
from pellucid.live.shared_memory import Region
from pellucid.live.stream_ring import StreamRing

SETTINGS = settings_text(EngineSetup((Condition("free", worn=False),), DeviceNumbers("virtual-elbow")))


class Bench:
    """An engine that is played, and its recorder."""

    def __init__(self, folder):
        self.folder = folder
        self.region = Region.create(folder / "region", 1_000_000)
        self.ring = StreamRing.create(
            self.region.path, 0, name="emg", type="EMG", source="s", rate=1000.0, labels=["biceps"], units=["V"]
        )
        self.recorder = self.start()

    def start(self):
        return Recorder(self.region, self.folder / "session.xdf", SETTINGS)

    def now(self):
        return 1e-9 * (self.region.epoch_ns + self.region.record_count * self.region.period_ns)

    def play(self, count):
        """Play so many cycles of the engine and of the amplifier."""
        for _ in range(count):
            number = self.region.record_count + 1
            slot = self.region._records[(number - 1) % len(self.region._records)]
            slot["number"] = slot["number_again"] = slot["cycle"] = number
            slot["time"] = slot["deadline"] = self.region.epoch_ns + number * self.region.period_ns
            slot["value"], slot["valid"], slot["effort"] = 0.001 * number, 0b111111, -0.5
            self.region._header["records"] = number
            self.region._status["heartbeat"] = slot["time"]
        time = 1e-9 * self.region._records["time"][: self.region.record_count].astype(float)[-count:]
        self.ring.append(time, time, time[:, None])
        self.ring.tell(ClockTracker(1000.0).state, int(1e9 * time[-1]))

    def begin(self, name):
        about = self.folder / f"{name}.about.json"
        about.write_text(json.dumps({"protocol": "pointing"}))
        self.region.write_event(
            "record_begin", {"path": str(self.folder / f"{name}.xdf"), "about": str(about)}, self.now() + 0.0005
        )

    def end(self, name):
        self.region.write_event("record_end", {"path": str(self.folder / f"{name}.xdf")}, self.now() + 0.0005)


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


def load(path):
    return {s["info"]["name"][0]: s for s in pyxdf.load_xdf(str(path), dejitter_timestamps=False)[0]}


def trial_numbers(bench, name):
    stream = load(bench.folder / f"{name}.xdf")["robot"]
    return np.round(1e3 * (stream["time_stamps"] - 1e-9 * bench.region.epoch_ns)).astype(int).tolist()


def test_a_trial_holds_what_was_between_its_events(bench):
    bench.play(50)
    bench.recorder.step()
    bench.begin("a")
    bench.play(100)
    bench.region.write_event("cue", {"target": 0.7}, bench.now())
    bench.recorder.step()
    bench.end("a")
    bench.recorder.step()
    assert not (bench.folder / "a.about.json").exists() or bench.recorder.recording is not None
    bench.play(30)
    bench.recorder.step()
    assert bench.recorder.recording is None
    assert trial_numbers(bench, "a") == list(range(51, 151))
    streams = load(bench.folder / "a.xdf")
    assert len(streams["emg"]["time_stamps"]) == 100
    assert [json.loads(row[0]) for row in streams["events"]["time_series"]] == [{"kind": "cue", "target": 0.7}]
    assert streams["robot"]["info"]["desc"][0]["protocol"][0] == "pointing"
    columns = xdf.read(bench.folder / "a.xdf")
    assert columns["robot.torque"][0] == -0.5
    assert columns.units["robot.position"] == "rad"


@pytest.mark.parametrize("killed_after", [0, 1, 2, 3, 4])
def test_a_killed_recorder_goes_on_where_it_was(bench, killed_after):
    bench.begin("a")
    for i in range(6):
        bench.play(20)
        bench.region.write_event("tick", {"i": i}, bench.now())
        bench.recorder.step()
        if i == killed_after:
            bench.play(10)  # nobody records
            bench.recorder = bench.start()
    bench.end("a")
    bench.recorder.step()
    bench.play(5)
    bench.recorder.step()
    assert trial_numbers(bench, "a") == list(range(1, 131))
    streams = load(bench.folder / "a.xdf")
    assert [json.loads(row[0])["i"] for row in streams["events"]["time_series"]] == list(range(6))
    assert len(streams["emg"]["time_stamps"]) == 130
    bench.recorder.close()
    _, records = read_session(bench.folder / "session.xdf")
    assert records["number"].tolist() == list(range(1, 136))


def test_half_a_chunk_of_a_killed_recorder_is_removed(bench):
    bench.begin("a")
    bench.play(20)
    bench.recorder.step()
    path = bench.folder / "a.xdf"
    with path.open("ab") as file:
        file.write(b"\x08\xff\x00\x00\x00\x00\x00\x00\x00\x03\x00half")
    bench.recorder = bench.start()
    bench.play(20)
    bench.recorder.step()
    bench.recorder.close()
    assert trial_numbers(bench, "a") == list(range(1, 41))


def test_a_trial_that_is_whole_is_not_begun_again(bench):
    bench.begin("a")
    bench.play(20)
    bench.recorder.step()
    bench.end("a")
    bench.recorder.step()
    bench.play(5)
    bench.recorder.step()
    before = (bench.folder / "a.xdf").read_bytes()
    bench.recorder = bench.start()
    bench.play(5)
    bench.recorder.step()
    assert bench.recorder.recording is None
    assert (bench.folder / "a.xdf").read_bytes() == before


def test_the_next_trial_seals_one_that_was_left_open(bench):
    bench.begin("a")
    bench.play(20)
    bench.recorder.step()
    bench.begin("b")
    bench.play(20)
    bench.recorder.step()
    bench.recorder.close()
    assert trial_numbers(bench, "b") == list(range(21, 41))
    assert load(bench.folder / "a.xdf")["robot"]["footer"]


def test_the_session_has_every_number_that_a_replay_needs(bench):
    bench.play(30)
    bench.region._records["stamp_us"][:30] = np.arange(30)[:, None] + (1 << 50)
    bench.region._records["sequence"][:30] = 0xFFFFFFFE
    bench.region._records["token"][:30] = 0xDEADBEEF
    bench.recorder.step()
    _, records = read_session(bench.folder / "session.xdf")
    kept = bench.region._records[:30]
    for name in (
        "number",
        "now_us",
        "value",
        "stamp_us",
        "sequence",
        "valid",
        "flags",
        "law",
        "token",
        "effort",
        "time",
    ):
        assert np.array_equal(records[name], kept[name]), name
