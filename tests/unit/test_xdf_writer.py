"""XDF files that are only appended to: the format's own reader takes them, wherever their writer was killed."""

import logging

import numpy as np
import pytest
import pyxdf

from pellucid._errors import PellucidError
from pellucid.recordings.readers import xdf
from pellucid.recordings.xdf_writer import XdfWriter, chunks, scan_xdf, seal_xdf


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
        writer.write_boundary()
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


def test_pellucid_reads_a_sealed_file_and_refuses_one_without_an_end(tmp_path):
    columns = xdf.read(write(tmp_path / "a.xdf"))
    assert columns["robot.position"].tolist()[:2] == [100.0, 100.1]
    assert columns.units["robot.torque <x> & y"] == "N*m"
    write(tmp_path / "b.xdf", seal=False)
    with pytest.raises(PellucidError, match="has no end"):
        xdf.read(tmp_path / "b.xdf")
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
