"""`pellucid repair`: a recording that ends badly becomes a whole file."""

import shutil
from collections import namedtuple

import numpy as np
import pytest
import pyxdf
from typer.testing import CliRunner

from pellucid._errors import RecordingError
from pellucid.cli import app
from pellucid.files.readers.xdf import lost_end
from pellucid.files.repair import repair
from pellucid.files.xdf_writer import XdfWriter


@pytest.fixture
def cut(tmp_path):
    path = tmp_path / "cut.xdf"
    writer = XdfWriter(path)
    writer.add_stream(1, "angle", "Angle", [("q", "rad")])
    for k in range(8):
        time = 0.5 * k + 0.01 * np.arange(50)
        writer.write_samples(1, time, np.sin(time)[:, None])
    data = path.read_bytes()
    writer.seal()
    writer.close()
    path.write_bytes(data[:-100])
    return path


def test_a_cut_file_is_mended_and_the_other_kept(cut, tmp_path):
    before = cut.read_bytes()
    done = repair(cut, tmp_path / "whole.xdf")
    assert "incomplete chunk" in done.lost
    assert done.removed > 0
    assert cut.read_bytes() == before
    (stream,), _ = pyxdf.load_xdf(str(done.path))
    assert len(stream["time_stamps"]) == 350
    assert stream["footer"]["info"]["sample_count"] == ["350"]
    assert lost_end(done.path) == ""
    assert repair(done.path).line().endswith("whole, nothing to repair")


def test_in_its_place(cut):
    run = CliRunner().invoke(app, ["repair", str(cut)])
    assert run.exit_code == 0
    assert lost_end(cut) == ""


def test_what_cannot_be_repaired_is_refused(cut, tmp_path, monkeypatch):
    with pytest.raises(RecordingError, match=r"a.csv: found the ending .csv, expected .xdf"):
        repair(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match="no such file"):
        repair(tmp_path / "none.xdf")
    with pytest.raises(RecordingError, match=r"found a file there, expected none"):
        repair(cut, cut)
    (tmp_path / "text.xdf").write_bytes(b"no recording")
    with pytest.raises(RecordingError, match="found no header of such a file"):
        repair(tmp_path / "text.xdf")
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(1, 1, 10))
    with pytest.raises(RecordingError, match="found 10 bytes free on its disk, expected at least"):
        repair(cut, tmp_path / "other.xdf")
