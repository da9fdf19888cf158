"""EDF and BDF files: names, units, rates, and what is no whole file."""

import edfio
import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.files.readers.read import read_columns

BICEPS = 500.0 * np.sin(np.arange(3000) / 40.0)


def write(path, *signals, made=edfio.Edf):
    made(signals).write(path)
    return path


def signal(samples, fs, name, made=edfio.EdfSignal, **options):
    return made(samples, fs, label=name, physical_dimension="uV", physical_range=(-1000.0, 1000.0), **options)


@pytest.mark.parametrize(
    ("ending", "file", "one", "bits"),
    [("edf", edfio.Edf, edfio.EdfSignal, 16), ("bdf", edfio.Bdf, edfio.BdfSignal, 24)],
)
def test_signals_of_one_rate_share_their_time(tmp_path, ending, file, one, bits):
    path = write(
        tmp_path / f"a.{ending}",
        signal(BICEPS, 1000, "biceps", one),
        signal(0.5 * BICEPS, 1000, "triceps", one),
        made=file,
    )
    found = read_columns(path)
    assert list(found.values) == ["time", "biceps", "triceps"]
    assert found.values["time"] == pytest.approx(np.arange(3000) / 1000.0)
    assert found.values["biceps"] == pytest.approx(BICEPS, abs=2000.0 / 2**bits)
    assert found.units == {"biceps": "uV", "triceps": "uV"}


def test_signals_of_several_rates_have_times_of_their_own(tmp_path):
    path = write(tmp_path / "a.edf", signal(BICEPS, 1000, "biceps"), signal(BICEPS[:300], 100, "angle"))
    found = read_columns(path)
    assert list(found.values) == ["biceps.time", "biceps", "angle.time", "angle"]
    assert found.values["angle.time"][-1] == pytest.approx(2.99)


def test_what_is_no_whole_file_is_refused(tmp_path):
    whole = write(tmp_path / "a.edf", signal(BICEPS, 1000, "biceps")).read_bytes()
    for kept in (6, 300, len(whole) - 2000, len(whole) - 2):
        (tmp_path / "b.edf").write_bytes(whole[:kept])
        with pytest.raises(RecordingError, match=r"b\.edf: not readable as EDF, truncated or damaged"):
            read_columns(tmp_path / "b.edf")
    twice = write(tmp_path / "c.edf", signal(BICEPS, 1000, "emg"), signal(BICEPS, 1000, "emg"))
    with pytest.raises(RecordingError, match='two signals named "emg"'):
        read_columns(twice)


def test_gaps_of_a_recording_stay_gaps(tmp_path):
    """Three records of 1 s; the last one began 2.5 s after the end of the one before."""
    path, go = tmp_path / "a.edf", edfio.EdfAnnotation(0.5, None, "go")
    signals = [signal(BICEPS, 1000, "biceps"), signal(BICEPS[:300], 100, "angle")]
    edfio.Edf(signals, annotations=[go], data_record_duration=1).write(path)
    content = path.read_bytes().replace(b"EDF+C", b"EDF+D")
    assert content.count(b"+2\x14\x14\0\0\0") == 1
    path.write_bytes(content.replace(b"+2\x14\x14\0\0\0", b"+4.5\x14\x14\0"))
    found = read_columns(path)
    assert found["biceps.time"] == pytest.approx(np.arange(3000) / 1000.0 + 2.5 * (np.arange(3000) >= 2000))
    assert found["angle.time"][199:201].tolist() == [1.99, 4.5]
    path.write_bytes(content.replace(b"+2\x14\x14\0\0\0", bytes(7)))
    with pytest.raises(RecordingError, match=r"a\.edf: "):
        read_columns(path)
