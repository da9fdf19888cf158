"""XDF files that are only appended to: the format's own reader takes them, wherever their writer was killed."""

import logging
import os

import numpy as np
import pytest
import pyxdf

from pellucid._errors import PellucidError
from pellucid.files.readers import xdf
from pellucid.files.xdf_writer import XdfWriter, chunks, scan_xdf, seal_xdf
from pellucid.live import recorder as unfinished_files
from pellucid.live.recorder import seal_unfinished


def write(path, seal=True):
    """Write a file with a stream of numbers, one of floats, and one of texts."""
    writer = XdfWriter(path)
    writer.add_stream(
        1, "robot", "Robot", [("position", "rad"), ("torque <x> & y", "N*m")], description={"note": "a < b & c"}
    )
    writer.add_stream(2, "emg", "EMG", [("biceps", "V")], rate=100.0, format="float32")
    writer.add_stream(3, "events", "Markers", [("event", "")], format="string")
    for k in range(4):
        time = 100.0 + k + np.arange(5) / 10.0
        writer.write_samples(1, time, np.column_stack([time, -time]))
        writer.write_samples(2, time, np.full((5, 1), 0.1 * k))
        writer.write_texts(3, [time[0]], [f'{{"kind": "cue", "word": "ü{k}"}}'])
    writer.write_clock_offset(1, 100.0, 0.0)
    if seal:
        writer.seal()
    else:
        writer.close()
    return path


def load(path):
    logger = logging.getLogger("pyxdf.pyxdf")
    before, logger.disabled = logger.disabled, True
    try:
        streams, _ = pyxdf.load_xdf(str(path), dejitter_timestamps=False)
    finally:
        logger.disabled = before
    return {stream["info"]["name"][0]: stream for stream in streams}


def test_the_formats_own_reader_gives_back_what_was_written(tmp_path):
    streams = load(write(tmp_path / "a.xdf"))
    time = np.concatenate([100.0 + k + np.arange(5) / 10.0 for k in range(4)])
    assert np.array_equal(streams["robot"]["time_stamps"], time)
    assert np.array_equal(streams["robot"]["time_series"], np.column_stack([time, -time]))
    assert streams["robot"]["info"]["desc"][0]["note"][0] == "a < b & c"
    assert streams["emg"]["time_series"].dtype == np.float32
    assert [row[0] for row in streams["events"]["time_series"]] == [
        f'{{"kind": "cue", "word": "ü{k}"}}' for k in range(4)
    ]
    assert streams["robot"]["footer"]["info"]["sample_count"] == ["20"]


def test_pellucid_reads_a_sealed_file_and_one_without_an_end(tmp_path):
    path = write(tmp_path / "a.xdf")
    columns = xdf.read(path)
    assert xdf.lost_end(path) == ""
    assert columns["robot.position"].tolist()[:2] == [100.0, 100.1]
    assert columns.units["robot.torque <x> & y"] == "N*m"
    write(tmp_path / "b.xdf", seal=False)
    assert xdf.lost_end(tmp_path / "b.xdf") == 'no end of the streams "robot", "emg", "events"'
    unended = xdf.read(tmp_path / "b.xdf")
    assert unended["robot.position"].tolist() == columns["robot.position"].tolist()
    assert seal_xdf(tmp_path / "b.xdf") == 0
    assert (tmp_path / "b.xdf").read_bytes() == (tmp_path / "a.xdf").read_bytes()


def test_a_file_cut_anywhere_can_be_sealed(tmp_path):
    whole = write(tmp_path / "whole.xdf", seal=False).read_bytes()
    heads = [chunk.end for chunk in chunks(whole)][3]  # behind the headers
    cut = tmp_path / "cut.xdf"
    before = 0
    for size in [*range(heads, len(whole), 41), len(whole)]:
        cut.write_bytes(whole[:size])
        count = scan_xdf(cut).streams[1].count
        assert count >= before
        before = count
        seal_xdf(cut)
        sealed = load(cut)
        assert len(sealed["robot"]["time_stamps"]) == count
        assert all(stream["footer"] for stream in sealed.values())
    assert before == 20


def test_sealing_twice_changes_nothing(tmp_path):
    path = write(tmp_path / "a.xdf")
    before = path.read_bytes()
    assert seal_xdf(path) == 0
    assert path.read_bytes() == before


def test_a_file_that_exists_or_is_none_is_refused(tmp_path):
    write(tmp_path / "a.xdf")
    with pytest.raises(FileExistsError):
        XdfWriter(tmp_path / "a.xdf")
    (tmp_path / "b.xdf").write_bytes(b"nothing")
    with pytest.raises(PellucidError, match=r"b\.xdf: found the first bytes"):
        seal_xdf(tmp_path / "b.xdf")


def test_the_next_start_of_a_session_seals_what_was_left(tmp_path, monkeypatch):
    monkeypatch.setattr(unfinished_files, "_wait_for_recorders", lambda paths: None)
    recordings, run = tmp_path / "recordings", tmp_path / "run"
    recordings.mkdir()
    run.mkdir()
    whole = write(recordings / "whole.xdf").read_bytes()
    cut = write(recordings / "cut.xdf", seal=False).read_bytes()[:-7]
    for path in (recordings / "cut.xdf", run / "session.xdf"):
        path.write_bytes(cut)
    write(run / "session_2.xdf")
    noted = [recordings / f"{name}.about.json" for name in ("cut", "whole", "never_begun")]
    for note in noted:
        note.write_text("{}")
    count = scan_xdf(recordings / "cut.xdf").streams[1].count
    # A recorder that still writes keeps its file.
    assert seal_unfinished(recordings, run) == []
    assert (run / "session.xdf").read_bytes() == cut
    for path in (*recordings.glob("*.xdf"), *run.glob("*.xdf")):
        os.utime(path, (path.stat().st_mtime - 10.0,) * 2)
    said = seal_unfinished(recordings, run)
    assert [sentence.partition(":")[0] for sentence in said] == [str(recordings / "cut.xdf"), str(run / "session.xdf")]
    for path in (recordings / "cut.xdf", run / "session.xdf"):
        assert xdf.lost_end(path) == ""
        assert len(load(path)["robot"]["time_stamps"]) == count
    assert (recordings / "whole.xdf").read_bytes() == whole
    assert [note.exists() for note in noted] == [False, False, True]
    assert sorted(path.name for path in run.iterdir()) == ["session.xdf", "session_2.xdf"]
    assert seal_unfinished(recordings, run) == []


def test_a_file_that_cannot_be_sealed_stays_as_it_is(tmp_path, monkeypatch):
    path = write(tmp_path / "a.xdf", seal=False)
    before = path.read_bytes()

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        seal_xdf(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.xdf"]
