"""XDF files: streams with their own rates and clocks, units, text, and what is no whole file."""

import struct

import numpy as np
import pytest
from scipy.io import savemat

import pellucid as pl
from pellucid._errors import RecordingError, TruncatedFileWarning
from pellucid.files.readers.read import read_columns
from pellucid.files.xdf_writer import chunks
from pellucid.study.procedures.registry import open_study


def chunk(tag: int, content: bytes) -> bytes:
    """One chunk as the format's specification lays it out: length of length, length, tag, content."""
    return struct.pack("<BIH", 4, len(content) + 2, tag) + content


def stream(number, name, fs, times, samples, labels, units, kind="float32", offset=0.0, end=True):
    """All chunks of a stream; its clock is `offset` behind the recorder's."""
    channels = "".join(
        f"<channel><label>{a}</label><unit>{b}</unit></channel>" for a, b in zip(labels, units, strict=True)
    )
    info = (
        f"<info><name>{name}</name><type>EMG</type><channel_count>{len(labels)}</channel_count>"
        f"<nominal_srate>{fs}</nominal_srate><channel_format>{kind}</channel_format>"
        f"<desc><channels>{channels}</channels></desc></info>"
    )
    head = struct.pack("<I", number)
    made = chunk(2, head + info.encode())
    for at in (times[0], times[-1]):
        made += chunk(4, head + struct.pack("<dd", at + offset, offset))
    body = struct.pack("<BI", 4, len(times))
    for t, row in zip(times, samples, strict=True):
        body += struct.pack("<Bd", 8, t)
        if kind == "string":
            body += struct.pack("<BI", 4, len(row)) + row.encode()
        else:
            body += struct.pack(f"<{len(row)}f", *row)
    made += chunk(3, head + body)
    footer = f"<info><first_timestamp>{times[0]}</first_timestamp><sample_count>{len(times)}</sample_count></info>"
    return made + (chunk(6, head + footer.encode()) if end else b"")


def write(path, *streams):
    path.write_bytes(
        b"XDF:" + chunk(1, b"<?xml version='1.0'?><info><version>1.0</version></info>") + b"".join(streams)
    )
    return path


def two(path, **options):
    """A robot at 100 Hz and an amplifier at 1 kHz whose clock is 2 s behind."""
    slow, fast = 50.0 + np.arange(200) / 100.0, 48.0 + np.arange(2000) / 1000.0
    moved, emg = np.column_stack([np.sin(slow), np.cos(slow)]), np.column_stack([np.sin(fast), np.cos(fast)])
    robot = stream(1, "robot", 100, slow, moved, ["angle", "current"], ["radians", "amperes"])
    made = stream(2, "amp", 1000, fast, emg, ["biceps", "triceps"], ["microvolts", ""], offset=2.0, **options)
    return write(path, robot, made), slow, fast, emg


def test_streams_come_on_one_clock_with_their_names_and_units(tmp_path):
    path, slow, fast, emg = two(tmp_path / "a.xdf")
    found = read_columns(path)
    assert list(found.values) == ["robot.time", "robot.angle", "robot.current", "amp.time", "amp.biceps", "amp.triceps"]
    assert found.values["robot.time"] == pytest.approx(slow - slow[0], abs=1e-6)
    # 48 s on a clock that is 2 s behind are the recorder's 50 s, at which the robot begins.
    assert found.values["amp.time"] == pytest.approx(fast - fast[0], abs=1e-6)
    assert found.values["amp.triceps"] == pytest.approx(emg[:, 1], abs=1e-6)
    assert found.units == {"robot.angle": "rad", "robot.current": "A", "amp.biceps": "uV"}


def test_a_stream_of_text_says_so(tmp_path):
    words = stream(1, "events", 0, np.array([1.0, 2.0]), ["go", "rest"], ["marker"], [""], kind="string")
    path, *_ = two(tmp_path / "a.xdf")
    path.write_bytes(path.read_bytes() + words.replace(struct.pack("<I", 1), struct.pack("<I", 3)))
    found = read_columns(path)
    with pytest.raises(RecordingError, match='the stream "events" holds text, expected numbers'):
        found.column("events.marker", "target")


def test_what_is_no_file_of_streams_is_refused(tmp_path):
    (tmp_path / "a.xdf").write_bytes(b"time,angle\n0,1\n")
    with pytest.raises(RecordingError, match=r"a\.xdf: .*no header"):
        read_columns(tmp_path / "a.xdf")
    whole = two(tmp_path / "c.xdf")[0].read_bytes()
    for kept in (40, 700):
        (tmp_path / "d.xdf").write_bytes(whole[:kept])
        with pytest.raises(RecordingError, match=rf"d\.xdf: found no stream with samples before byte .* of {kept}"):
            read_columns(tmp_path / "d.xdf")
    t = np.arange(10) / 10.0
    one = stream(1, "amp", 10, t, t[:, None], ["a"], [""])
    with pytest.raises(RecordingError, match='two streams named "amp"'):
        read_columns(write(tmp_path / "e.xdf", one, one.replace(struct.pack("<I", 1), struct.pack("<I", 2))))
    damaged = one.replace(struct.pack("<BI", 4, 10), struct.pack("<BI", 7, 10), 1)
    with pytest.raises(RecordingError, match=r"g\.xdf: not readable as an XDF file, damaged: .*corruption"):
        read_columns(write(tmp_path / "g.xdf", damaged))
    lost = one.replace(b"<sample_count>10", b"<sample_count>12")
    with pytest.raises(RecordingError, match='"amp" has 10 samples, and its footer counts 12'):
        read_columns(write(tmp_path / "f.xdf", lost))


def test_lost_samples_stay_lost(tmp_path):
    """Samples arrive in blocks, each late by some milliseconds; 1,500 of 20,000 were lost in three gaps."""
    rng, true = np.random.default_rng(3), 100.0 + np.arange(20_000) / 1000.0
    late = np.repeat(np.abs(rng.normal(0.0, 0.004, 500)), 40)
    kept = np.delete(np.arange(20_000), np.r_[4500:5100, 10_000:10_800, 15_000:15_100])
    path = write(tmp_path / "a.xdf", stream(1, "amp", 1000, (true + late)[kept], true[kept, None], ["rf"], ["uV"]))
    found = read_columns(path)
    error = found["amp.time"] - (true[kept] - true[0])
    assert np.ptp(error) < 1.5e-3
    assert 1.0 / np.median(np.diff(found["amp.time"])) == pytest.approx(1000.0, rel=2e-4)
    assert np.flatnonzero(np.diff(found["amp.time"]) > 0.05).tolist() == [4499, 9399, 13_599]
    assert found.facts == {"amp.nominal_srate": "1000"}


def test_a_stream_that_was_found_again_is_one(tmp_path):
    t = 10.0 + np.arange(400) / 100.0
    late = t[250:] + 2.0
    parts = [stream(1, "amp", 100, t[:250], t[:250, None], ["rf"], ["uV"])]
    parts.append(stream(2, "amp", 100, late, t[250:, None], ["rf"], ["uV"]))
    found = read_columns(write(tmp_path / "a.xdf", *parts[::-1]))
    assert list(found) == ["amp.time", "amp.rf"]
    assert found["amp.rf"] == pytest.approx(t)
    assert found["amp.time"] == pytest.approx(np.concatenate([t[:250], late]) - t[0], abs=1e-6)
    # The device was started anew, and its clock with it.
    restarted = stream(2, "amp", 100, late - 5.0, t[250:, None], ["rf"], ["uV"], offset=5.0)
    found = read_columns(write(tmp_path / "b.xdf", parts[0], restarted))
    assert found["amp.time"] == pytest.approx(np.concatenate([t[:250], late]) - t[0], abs=1e-4)


def test_streams_of_one_name_are_told_by_their_type(tmp_path):
    t = np.arange(40) / 10.0
    emg = stream(1, "Trigno", 10, t, t[:, None], ["rf"], ["uV"])
    acceleration = stream(2, "Trigno", 10, t, 2.0 * t[:, None], ["rf"], ["g"]).replace(b"<type>EMG", b"<type>ACC")
    found = read_columns(write(tmp_path / "a.xdf", emg, acceleration))
    assert list(found) == ["Trigno_EMG.time", "Trigno_EMG.rf", "Trigno_ACC.time", "Trigno_ACC.rf"]
    assert found["Trigno_ACC.rf"] == pytest.approx(2.0 * t)


def test_a_file_without_an_end_is_read_to_its_last_whole_chunk(tmp_path):
    path, slow, _, emg = two(tmp_path / "b.xdf", end=False)
    with pytest.warns(TruncatedFileWarning, match=r'b\.xdf: .* no end of the stream "amp"; everything before'):
        found = pl.read(path)
    assert found["amp.triceps"] == pytest.approx(emg[:, 1], abs=1e-6)
    whole = two(tmp_path / "c.xdf")[0].read_bytes()
    samples = [chunk.end for chunk in chunks(whole) if chunk.tag == 3]
    for kept in range(samples[0], len(whole), 997):
        (tmp_path / "d.xdf").write_bytes(whole[:kept])
        found = read_columns(tmp_path / "d.xdf")
        assert found["robot.angle"] == pytest.approx(np.sin(slow), abs=1e-6)
        assert ("amp.biceps" in found) == (kept >= samples[1])
        assert found.lost
        assert f"truncated, found {found.lost}" in str(found)
    # A power cut leaves zeros behind what was written.
    (tmp_path / "d.xdf").write_bytes(whole[: samples[1]] + bytes(5000))
    assert "5000 bytes of an incomplete chunk" in read_columns(tmp_path / "d.xdf").lost
    (verdict,) = [v for v in pl.audit(tmp_path / "d.xdf").verdicts if "5000 bytes" in str(v.sentences)]
    assert verdict.level == "note"


def test_other_formats_that_are_cut_give_data_with_a_warning_or_an_error(tmp_path):
    """A text table loses half a row; the others are refused."""
    path = tmp_path / "a.csv"
    path.write_text("t [s],q [rad]\n" + "".join(f"{0.01 * i:.2f},{0.1 * i:.3f}\n" for i in range(40)) + "0.40,4.")
    with pytest.warns(TruncatedFileWarning, match=r'a\.csv: .* an incomplete last row, "0\.40,4\."'):
        assert len(pl.read(path)["q"]) == 40
    written = {".npz": lambda path, x: np.savez(path, t=x, q=x), ".npy": lambda path, x: np.save(path, x)}
    written[".mat"] = lambda path, x: savemat(path, {"t": x, "q": x})
    for ending, write_file in written.items():
        path = tmp_path / f"a{ending}"
        write_file(path, np.arange(3000.0) / 7.0)
        whole = path.read_bytes()
        for share in (0.3, 0.6, 0.95):
            path.write_bytes(whole[: int(share * len(whole))])
            with pytest.raises(RecordingError, match=path.name):
                pl.read(path)


def test_one_file_is_a_recording_and_its_stream(tmp_path):
    _, slow, _, emg = two(tmp_path / "a.xdf")
    (tmp_path / "study.toml").write_text(
        """
name = "streams"
[rig]
joint = "elbow"
motion = "rotary"
lifts = "flexion"
[rig.drive]
kind = "current"
[channels]
current = { column = "robot.current", unit = "A" }
time = { column = "robot.time", unit = "s" }
position = { column = "robot.angle", unit = "rad" }
[streams.emg.channels]
time = { column = "amp.time", unit = "s" }
emg.biceps = { column = "amp.biceps", unit = "uV" }
[[recordings]]
name = "a"
file = "a.xdf"
streams = { emg = "a.xdf" }
""",
        encoding="utf-8",
    )
    (recording,) = open_study(tmp_path).recordings()
    assert recording.channels["position"].samples == pytest.approx(np.sin(slow), abs=1e-6)
    assert recording.streams["emg"].channels["emg.biceps"].samples == pytest.approx(1e-6 * emg[:, 0], abs=1e-12)
