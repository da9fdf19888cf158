"""A virtual wearer's streams: EMG follows the excitations, and what is sent over the layer is on the disk."""

import os
import signal
import time

import numpy as np
import pytest

from pellucid.files.readers import xdf
from pellucid.live.engine import LiveEngine
from pellucid.live.stream_ring import StreamRing
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.live import virtual_elbow
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.virtual_streams import EmgSource, MuscleChannel

RATE = 2048.0


def source(seed=1):
    channels = [MuscleChannel("biceps", 1.0, 9e-4), MuscleChannel("triceps", -0.5, 8e-4)]
    return EmgSource(channels, RATE, elbow_participants(able_elbow()).constants.emg.model_dump(), seed)


def test_each_channel_follows_its_own_group():
    n = round(4.0 * RATE)
    time_s = np.arange(n) / RATE
    flexor, extensor = np.where(time_s < 2.0, 0.5, 0.0), np.where(time_s < 2.0, 0.0, 0.4)
    emg = source().samples(0, time_s, flexor, extensor)
    first, second = emg[: n // 2].std(axis=0), emg[n // 2 :].std(axis=0)
    assert first[0] == pytest.approx(0.5 * 9e-4, rel=0.15)
    assert second[1] == pytest.approx(0.5 * 0.4 * 8e-4, rel=0.15)
    assert second[0] < 0.1 * first[0]
    assert first[1] < 0.2 * second[1]


def test_chunks_join_without_a_seam():
    time_s = np.arange(1000) / RATE
    half = np.full(1000, 0.5)
    whole, parts = source(), source()
    muscles = whole.samples(0, time_s, half, half)
    joined = [parts.samples(i, time_s[i : i + 100], half[i : i + 100], half[i : i + 100]) for i in range(0, 1000, 100)]
    assert np.abs(np.concatenate(joined) - muscles).max() < 2e-5  # the amplifier's noise alone


def test_a_ring_gives_what_was_written_and_counts_what_was_overwritten(tmp_path):
    ring = StreamRing.create(
        tmp_path / "region", 0, name="emg", type="EMG", source="s", rate=10.0, labels=["a", "b"], units=["V", "V"]
    )
    (again,) = StreamRing.all_of(tmp_path / "region")
    for first in range(0, 3 * ring.capacity, 64):
        moments = np.arange(first, first + 64) / 10.0
        ring.append(moments, moments - 5.0, np.column_stack([moments, -moments]))
        if first == 64:
            samples = again.read_since(0)
            assert (samples.cursor, samples.lost) == (128, 0)
            assert np.array_equal(samples.values[:, 1], -samples.time)
            assert np.array_equal(samples.device_time, samples.time - 5.0)
    samples = again.read_since(128)
    assert samples.lost + len(samples.time) == 3 * ring.capacity - 128
    assert samples.time[-1] == (3 * ring.capacity - 1) / 10.0
    assert (again.labels, again.units, again.nominal_rate) == (["a", "b"], ["V", "V"], 10.0)


@pytest.mark.nightly
@pytest.mark.real_time
def test_what_is_sent_over_the_layer_is_on_the_disk_also_when_its_source_was_started_again(tmp_path):
    pytest.importorskip("pylsl", reason="not installed: pylsl")

    def rest(seconds):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            engine.beat()
            time.sleep(0.05)

    with LiveEngine.start(virtual_elbow(conditions=("Ctrl",)), tmp_path, ordinary=True) as engine:
        until = time.monotonic() + 120.0
        while not (len(engine.streams) == 3 and all(ring.count for ring in engine.streams)):
            assert time.monotonic() < until
            rest(0.2)
        engine.begin_recording(tmp_path / "a.xdf")
        rest(2.0)
        engine.end_recording(timeout=30.0)
        os.kill(engine.processes["streams"], signal.SIGKILL)
        before = engine.emg.count
        rest(0.5)
        engine.restart_streams()
        while engine.emg.count < before + 100 and time.monotonic() < until:
            rest(0.2)
        assert engine.emg.count >= before + 100
        assert len(engine.streams) == 3
    columns = xdf.read(tmp_path / "a.xdf")
    for name, rate in (("emg", RATE), ("markers", 100.0), ("encoder", 500.0)):
        moments = columns[f"{name}.time"]
        assert len(moments) == round((moments[-1] - moments[0]) * rate) + 1
        assert moments[-1] - moments[0] > 1.8
