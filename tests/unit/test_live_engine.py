"""The engine as it runs: armed, stopped, killed and started again, and computed again from what was recorded.

Every run is of a second or two in real time, at an ordinary priority. On a busy machine a cycle may come so late that
the supervisor stops the law, as it should; then the test arms again, or is run again (see real_time.py).
"""

import gc
import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.session_state import SESSION_STATES
from pellucid.controllers.supervised import body_of
from pellucid.files.readers import xdf
from pellucid.live.engine import LiveEngine, engine_program
from pellucid.live.replay import read_session, replay_session
from pellucid.live.setup import Condition, DeviceNumbers, EngineSetup, settings_text
from pellucid.live.shared_memory import Region, remove_dead_regions
from pellucid.live.stream_ring import StreamRing
from pellucid.live.udp import UdpBoard, pack_reading, unpack_asked
from pellucid_lab.live import virtual_elbow, virtual_knee

PATIENCE_S = 30.0

CODES = {state.name: code for code, state in enumerate(SESSION_STATES)}


def carried(max_age=0.05, max_repeats=2):
    """A law that carries some of the elbow robot's weight; a gap of 50 ms stops it, so that a busy machine need not."""
    numbers = LAWS["joint"].defaults | {
        "inertia": 0.05, "gravity_sine": 1.8, "velocity_width": 0.1, "friction_share": 0.5, "coulomb_positive": 0.2,
        "coulomb_negative": 0.2, "effort_limit": 5.0, "rate_limit": 100.0, "velocity_limit": 8.0, "position_min": -0.5,
        "position_max": 2.6, "stop_margin": 0.1, "max_age": max_age, "max_repeats": max_repeats,
        "period": 0.001,
    }  # fmt: skip
    law = ControlLaw("joint", numbers)
    return pl.supervised(law, body=dict.fromkeys(body_of(law), 0.0), start_up=False)


@pytest.fixture(scope="module")
def elbow():
    setup = virtual_elbow(conditions=("Ctrl", "unpowered"))
    return replace(
        setup, conditions=(*setup.conditions, Condition("carried", carried()), Condition("again", carried()))
    )


def wait_until(engine, holds, patience=PATIENCE_S):
    until = time.monotonic() + patience
    while not holds():
        assert time.monotonic() < until, f"waited too long: {engine.status()}"
        engine.beat()
        time.sleep(0.01)


def rest(engine, seconds):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        engine.beat()
        time.sleep(0.02)


def run_law(engine, condition="carried"):
    engine.set_condition(condition)
    wait_until(engine, lambda: engine.status().condition == condition)
    until = time.monotonic() + PATIENCE_S
    while not engine.status().state.in_force:
        assert time.monotonic() < until
        if engine.status().state.needs_reset:
            engine.reset()
        elif engine.status().state.name == "disarmed":
            engine.arm()
        rest(engine, 0.1)


@pytest.mark.real_time
def test_a_session_is_recorded_and_computed_again(elbow, tmp_path):
    with LiveEngine.start(elbow, tmp_path, streams=False, ordinary=True) as engine:
        assert engine.status().state.name == "disarmed"
        assert not engine.health().fifo
        assert "not asked for" in engine.health().why_not
        trial = tmp_path / "trials" / "one.xdf"
        engine.begin_recording(trial, {"protocol": "pointing"})
        run_law(engine)
        engine.set_target(1.4)
        engine.mark("cue", {"target": 1.4})
        rest(engine, 1.5)
        engine.set_estimate(1.25, 0.5)
        rest(engine, 0.1)
        samples = engine.read_since(0)
        assert engine.end_recording(timeout=PATIENCE_S) == trial
        engine.stop()
        wait_until(engine, lambda: engine.status().state.needs_reset)
        assert engine.status().fault != "none"
        run_law(engine)
        engine.disarm()
        wait_until(engine, lambda: engine.status().state.name == "disarmed")
        assert ("stopped" in [name for _, name in engine.health().faults]) or engine.health().faults
        region = engine.region.path
    assert not region.exists()
    assert np.abs(samples.channels["limb"][-1] - 1.4) < 0.1
    assert np.abs(samples.channels["torque"]).max() > 0.5
    assert set(np.diff(engine_times(samples)).round(6)) >= {0.001}
    columns = xdf.read(trial)
    assert columns["robot.target"][-1] == 1.4
    assert np.isnan(columns["robot.torque_estimate"][0])
    assert columns["robot.torque_estimate"][-1] == 1.25
    assert samples.channels["estimate_high"][-1] == 1.75
    found = replay_session(tmp_path / "session.xdf")
    assert found.compared > 1000
    assert found.is_equal
    assert (found.gaps, found.unknown) == (0, 0)


def engine_times(samples):
    """Deadlines of samples [s]."""
    return samples.time - samples.channels["lateness"]


@pytest.mark.real_time
def test_an_engine_that_was_killed_begins_disarmed_and_loses_no_record(elbow, tmp_path):
    with LiveEngine.start(elbow, tmp_path, streams=False, recorder=False, ordinary=True) as engine:
        run_law(engine)
        os.kill(engine.processes["engine"], signal.SIGKILL)
        wait_until(engine, lambda: not engine.alive["engine"])
        count = engine.region.record_count
        assert engine.status().state.name == "ended"
        engine.restart_engine()
        rest(engine, 0.2)
        _, records, lost = engine.region.records_since(0)
        assert lost == 0
        assert np.all(np.diff(records["number"].astype(np.int64)) == 1)
        assert records["state"][count:].max() == CODES["disarmed"]
        assert not engine.status().enable
        run_law(engine)


@pytest.mark.real_time
def test_a_law_stops_when_its_session_is_silent(elbow, tmp_path):
    with LiveEngine.start(elbow, tmp_path, streams=False, recorder=False, ordinary=True) as engine:
        run_law(engine)
        before = engine.region.record_count
        last = 1e-9 * int(engine.region.last_command()["heartbeat"])
        time.sleep(1.6)
        _, records, _ = engine.region.records_since(before)
        stopped = np.flatnonzero(np.isin(records["state"], [CODES["stopped"], CODES["faulted"]]))
        assert len(stopped)
        assert 1e-9 * records["time"][stopped[0]] - last < 1.3
        assert engine.status().fault != "none"
        run_law(engine)


SESSION_PROGRAM = """
import json, sys, time
from pathlib import Path
from pellucid_lab.live import virtual_elbow
from pellucid.live.engine import LiveEngine
folder = Path(sys.argv[1])
engine = LiveEngine.start(virtual_elbow(conditions=("Ctrl", "unpowered")), folder, ordinary=True)
engine.begin_recording(folder / "trial.xdf", {})
engine.beat()
until = time.monotonic() + 30.0
while not (folder / "trial.xdf").exists() and time.monotonic() < until:
    engine.beat()
    time.sleep(0.02)
print(json.dumps({"region": str(engine.region.path), "processes": engine.processes}), flush=True)
while True:
    engine.beat()
    time.sleep(0.1)
"""


def is_running(process):
    """Whether a process lives; one that has ended and that nobody has waited for does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.nightly
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_every_process_ends_by_itself_after_its_session_was_killed(tmp_path):
    words = [sys.executable, "-c", SESSION_PROGRAM, str(tmp_path)]
    session = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert session.stdout is not None
    said = json.loads(session.stdout.readline())
    assert set(said["processes"]) >= {"engine", "recorder"}
    assert all(map(is_running, said["processes"].values()))
    session.kill()
    session.wait()
    session.stdout.close()
    until = time.monotonic() + PATIENCE_S
    while any(map(is_running, said["processes"].values())) and time.monotonic() < until:
        time.sleep(0.1)
    left = [name for name, process in said["processes"].items() if is_running(process)]
    for name in left:
        os.kill(said["processes"][name], signal.SIGKILL)
    assert left == []
    region = Path(said["region"])
    assert not list(region.parent.glob(f"{region.name}*"))
    assert not (tmp_path / "trial.about.json").exists()  # the recorder has ended the file
    assert len(xdf.read(tmp_path / "trial.xdf")["robot.position"]) > 100


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    "killed",
    [
        "session",
        *(pytest.param(k, marks=pytest.mark.nightly) for k in ("recorder session", "engine session")),
        "engine recorder session",
    ],
)
def test_the_next_session_removes_the_memory_of_one_that_was_killed(elbow, tmp_path, killed):
    words = [sys.executable, "-c", SESSION_PROGRAM, str(tmp_path / "first")]
    (tmp_path / "first").mkdir()
    session = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert session.stdout is not None
    said = json.loads(session.stdout.readline())
    region = Path(said["region"])
    ring = StreamRing.create(region, 7, name="emg", type="EMG", source="", rate=2048.0, labels=["a"], units=["V"])
    with LiveEngine.start(elbow, tmp_path / "beside", streams=False, recorder=False, ordinary=True):
        assert region.exists()  # of a session that lives
        assert ring.path.exists()
    for name in killed.split():
        os.kill(session.pid if name == "session" else said["processes"][name], signal.SIGKILL)
    session.wait()
    session.stdout.close()
    until = time.monotonic() + PATIENCE_S
    while any(map(is_running, said["processes"].values())) and time.monotonic() < until:
        time.sleep(0.1)
    with LiveEngine.start(elbow, tmp_path / "next", streams=False, recorder=False, ordinary=True) as engine:
        assert not list(region.parent.glob(f"{region.name}*"))
        assert engine.region.path.exists()


def test_memory_that_is_being_made_or_of_another_program_is_left(tmp_path):
    for name in ("pellucid-x", "other.live"):
        (tmp_path / name).write_text("of another program")
    newborn = tmp_path / "pellucid-new.live"
    newborn.touch()
    old = tmp_path / "pellucid-old.live"
    old.touch()
    os.utime(old, (0, 0))
    alone = tmp_path / "pellucid-gone.live.0.stream"
    alone.write_bytes(b"a ring without its region")
    region = Region.create(tmp_path / "pellucid-held.live", 1_000_000)
    assert set(remove_dead_regions(tmp_path)) == {old, tmp_path / "pellucid-gone.live"}
    assert {path.name for path in tmp_path.iterdir()} == {
        "pellucid-x", "other.live", "pellucid-new.live", "pellucid-held.live",
    }  # fmt: skip
    del region
    gc.collect()
    assert remove_dead_regions(tmp_path) == [tmp_path / "pellucid-held.live"]


def test_memory_that_is_missing_is_said_before_anything_begins(tmp_path, monkeypatch):
    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", fail)
    with pytest.raises(PellucidError, match=r"found no room for \d+ MB of shared memory \(No space left on device\)"):
        Region.create(tmp_path / "region", 1_000_000)
    assert not list(tmp_path.iterdir())


@pytest.fixture
def open_umask():
    """Let new files be read by everybody, unless whoever makes them says otherwise."""
    before = os.umask(0)
    yield
    os.umask(before)


def test_no_other_user_can_read_what_a_session_writes(elbow, tmp_path, open_umask):
    streams = importlib.util.find_spec("pylsl") is not None
    with LiveEngine.start(elbow, tmp_path, streams=streams, ordinary=True) as engine:
        engine.begin_recording(tmp_path / "trial.xdf", {})
        wait_until(engine, lambda: (tmp_path / "trial.xdf").exists() and (not streams or len(engine.streams) == 3))
        memory = list(engine.region.path.parent.glob(f"{engine.region.path.name}*"))
        assert len(memory) == 1 + len(engine.streams)
        files = [path for path in tmp_path.rglob("*") if path.is_file()]
        assert {"engine.txt", "engine.log", "recorder.log", "session.xdf", "trial.xdf", "trial.about.json"} <= {
            path.name for path in files
        }
        modes = {path.name: path.stat().st_mode & 0o777 for path in (*memory, *files)}
    assert set(modes.values()) == {0o600}, modes


@pytest.mark.real_time
def test_a_second_session_in_a_folder_leaves_the_first_ones_file(elbow, tmp_path):
    for _ in range(2):
        with LiveEngine.start(elbow, tmp_path, streams=False, ordinary=True) as engine:
            run_law(engine)
            rest(engine, 0.2)
    for name in ("session.xdf", "session_2.xdf"):
        found = replay_session(tmp_path / name)
        assert found.is_equal
        assert (found.gaps, found.unknown) == (0, 0)


@pytest.mark.real_time
def test_conditions_change_by_way_of_no_effort(elbow, tmp_path):
    with LiveEngine.start(elbow, tmp_path, streams=False, recorder=False, ordinary=True) as engine:
        run_law(engine)
        engine.set_condition("again")
        wait_until(engine, lambda: engine.status().condition == "again")
        _, records, _ = engine.region.records_since(0)
        change = np.flatnonzero(np.diff(records["law"].astype(int)) > 0)[-1]
        assert records["effort"][change] == 0.0
        with pytest.raises(PellucidError, match='found "FC", expected one of Ctrl, unpowered, carried, again'):
            engine.set_condition("FC")
        engine.set_condition("Ctrl")
        with pytest.raises(PellucidError, match='found the parameter "offset", expected none, since it runs no law'):
            engine.set_torque(1.0)


@pytest.mark.real_time
def test_the_knees_slider_is_the_law_s_torque(tmp_path):
    knee = virtual_knee(conditions=("zero", "torque"))
    watched = knee.conditions[1].law
    assert watched is not None
    assert watched.supervision["drive_tolerance"] > 0.5 * 15.0 + 1.0  # and the friction of its drive
    assert watched.supervision["drive_inertia"] > 0.0  # without it a healthy swing is an alarm
    law = replace(watched, law=watched.law.changed(max_age=0.05))
    knee = replace(knee, conditions=(knee.conditions[0], Condition("torque", law)))
    with LiveEngine.start(knee, tmp_path, streams=False, recorder=False, ordinary=True) as engine:
        run_law(engine, "torque")
        engine.set_torque(2.0)
        engine.set_target(0.9)
        rest(engine, 0.6)
        _, records, _ = engine.region.records_since(0)
        running = records[records["state"] == CODES["running"]]
        if engine.status().state.name == "running":
            assert running["effort"][-1] == pytest.approx(2.0, abs=1e-9)
        rate = np.abs(np.diff(running["effort"])).max()
        assert rate <= law.values["rate_limit"] * law.values["period"] * (1.0 + 1e-9)


@pytest.mark.real_time
def test_a_board_in_python_is_heard_and_asked(tmp_path):
    port = 35871 + os.getpid() % 2000
    setup = EngineSetup(
        (Condition("carried", carried(max_age=0.5, max_repeats=300)),), DeviceNumbers("udp", f"127.0.0.1:{port}")
    )
    with LiveEngine.start(setup, tmp_path, streams=False, ordinary=True) as engine:
        board = UdpBoard(("127.0.0.1", port))
        begun = time.monotonic()
        while (now := time.monotonic() - begun) < 1.5:
            board.send(round(1e6 * now) + 7_000_000_000, position=0.8 + 0.1 * np.sin(2.0 * now), drive=0.0)
            board.receive()
            engine.beat()
            if engine.status().state.name == "disarmed" and now > 0.2:
                engine.region.command(run=1)
            time.sleep(0.001)
        asked = {one.beat: one.effort for one in board.asked}
        board.close()
    assert len(asked) > 200
    assert max(map(abs, asked.values())) > 0.5
    found = replay_session(tmp_path / "session.xdf")
    assert found.is_equal
    _, records = read_session(tmp_path / "session.xdf")
    known = dict(zip(records["beat"].tolist(), records["effort"].tolist(), strict=True))
    assert all(known[beat] == effort for beat, effort in asked.items())


def test_a_damaged_datagram_is_nothing():
    data = pack_reading(1, 5, {"position": 0.5})
    assert len(data) == 80
    assert unpack_asked(data) is None
    assert unpack_asked(b"short") is None


def test_numbers_that_make_no_sense_are_refused_with_their_place(tmp_path, elbow):
    broken = replace(elbow, conditions=(Condition("carried", carried().changed(moving_speed=-1.0)),))
    with pytest.raises(
        PellucidError, match="condition carried: found numbers of its law or supervisor outside their bounds"
    ):
        LiveEngine.start(broken, tmp_path / "a", streams=False, recorder=False, ordinary=True)
    nobody = replace(elbow, device=DeviceNumbers("toaster"))
    with pytest.raises(PellucidError, match='found "toaster", expected virtual-elbow'):
        LiveEngine.start(nobody, tmp_path / "b", streams=False, recorder=False, ordinary=True)
    text = settings_text(elbow).replace("period_ns 1000000", "period_ns 5")
    (tmp_path / "c.txt").write_text(text)
    said = subprocess.run([engine_program(), tmp_path / "c.txt", tmp_path / "none"], capture_output=True, text=True)
    assert said.returncode == 2
    assert "c.txt:2" in said.stderr


def test_what_a_setup_must_be_is_said():
    with pytest.raises(PellucidError, match="without spaces"):
        Condition("a b")
    with pytest.raises(PellucidError, match="each name once"):
        EngineSetup((Condition("a"), Condition("a")), DeviceNumbers("udp"))
    with pytest.raises(PellucidError, match="period"):
        EngineSetup((Condition("a"),), DeviceNumbers("udp"), period=1.0)
    with pytest.raises(PellucidError, match='found "x", expected zero or torque'):
        virtual_knee(conditions=("x",))
    with pytest.raises(PellucidError, match="found 99"):
        virtual_elbow(conditions=("Ctrl",), person=99)
