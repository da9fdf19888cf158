"""Recordings made to harm: what crashes a library, unpacks without end, or points at another file."""

import gzip
import json
import os
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from pellucid import _given
from pellucid._errors import RecordingError
from pellucid.files.readers import _apart, _caps, read_columns

ROOT = Path(__file__).parents[2]

KILLER = '''"""A reader whose library dies."""

import os
import time

APART = ("numpy",)


def read(path):
    """Nothing: it dies, or never ends, as the file says."""
    if b"slow" in path.read_bytes():
        time.sleep(60.0)
    os.abort()
'''


def hdf5(path, **datasets):
    """Datasets of floats by what h5py takes for them."""
    with h5py.File(path, "w") as file:
        for name, options in datasets.items():
            file.create_dataset(name, dtype="f8", **options)
    return path


@pytest.fixture
def killer(monkeypatch):
    """A reader beside the package's own; whoever asks for it must start its process anew."""
    path = _apart.Path(_apart.__file__).with_name("_killer.py")
    path.write_text(KILLER)
    yield f"{_apart.__package__}._killer"
    path.unlink()


def test_a_library_that_crashes_takes_one_file_with_it(tmp_path, killer):
    path = tmp_path / "a.mat"
    path.write_bytes(b"x")
    with pytest.raises(RecordingError, match=r"a\.mat: not readable.*crashed on it \(status -6\)"):
        _apart.read_apart(killer, path)
    scipy.io.savemat(path, {"t": np.arange(9.0)})
    assert read_columns(path)["t"].tolist() == list(range(9))
    assert not list(tmp_path.glob("core*"))


def test_a_library_that_never_ends_is_ended(tmp_path, killer, monkeypatch):
    monkeypatch.setenv("PELLUCID_MOST_SECONDS", "0.2")
    path = tmp_path / "a.mat"
    path.write_bytes(b"slow")
    with pytest.raises(RecordingError, match=r"took more than 0\.2 s; to wait longer: PELLUCID_MOST_SECONDS"):
        _apart.read_apart(killer, path)


def test_what_is_read_apart_is_what_the_reader_reads(tmp_path):
    from pellucid.files.readers import mat

    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"t": np.arange(5.0), "log": {"q": np.eye(3), "n": 3}})
    here, apart = mat.read(path), read_columns(path)
    assert here.names == apart.names
    assert all((here[name] == apart[name]).all() for name in here.names)


def test_a_small_file_does_not_swell(tmp_path):
    path = hdf5(tmp_path / "a.mat", q={"shape": (530_000_000,), "chunks": (1_000_000,), "compression": 9})
    assert path.stat().st_size < 10_000
    with pytest.raises(RecordingError, match=r"5.3e\+08 numbers in \d+ bytes, .* at most 128 MB; .*MOST_BYTES"):
        read_columns(path)


def test_a_packed_text_does_not_swell(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(gzip.compress(b'{"q": [1' + 130_000_000 * b" " + b"]}"))
    assert path.stat().st_size < 200_000
    with pytest.raises(RecordingError, match=r"found \d+ bytes that unpack to more, .* at most 128 MB .*MOST_BYTES"):
        read_columns(path)


def test_a_piece_may_not_be_larger_than_the_whole(tmp_path):
    path = hdf5(
        tmp_path / "a.mat",
        q={"shape": (3,), "maxshape": (None,), "chunks": (50_000_000,), "compression": 9},
    )
    with pytest.raises(RecordingError, match="expected at most 128 MB"):
        read_columns(path)


def test_an_older_file_does_not_swell_either(tmp_path):
    # A variable of 4e8 bytes of zeros, packed twice into almost nothing by hand: SciPy would write it, but not hold it.
    def element(kind, content):
        return np.array([kind, len(content)], "<u4").tobytes() + content + b"\0" * (-len(content) % 8)

    n = 50_000_000
    head = (
        element(6, np.array([6, 0], "<u4").tobytes()) + element(5, np.array([1, n], "<i4").tobytes()) + element(1, b"q")
    )
    numbers = np.array([9, 8 * n], "<u4").tobytes()
    packer = zlib.compressobj(9)
    packed = packer.compress(np.array([14, len(head) + len(numbers) + 8 * n], "<u4").tobytes() + head + numbers)
    packed += b"".join(packer.compress(bytes(8_000_000)) for _ in range(n // 1_000_000)) + packer.flush()
    path = tmp_path / "a.mat"
    start = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(start + np.array([15, len(packed)], "<u4").tobytes() + packed)
    with pytest.raises(RecordingError, match=r"a\.mat: found more than \d+ MB to unpack.*PELLUCID_MOST_BYTES"):
        read_columns(path)


@pytest.mark.parametrize("how", ["external", "virtual", "link"])
def test_a_file_shows_nothing_of_another(tmp_path, how):
    secret = hdf5(tmp_path / "secret.h5", q={"data": np.full(100, 42.0)})
    path = tmp_path / "a.mat"
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(100.0)
        if how == "external":
            file.create_dataset("q", (100,), "f8", external=[(str(secret), 0, h5py.h5f.UNLIMITED)])
        elif how == "virtual":
            layout = h5py.VirtualLayout((100,), "f8")
            layout[:] = h5py.VirtualSource(secret, "q", shape=(100,))
            file.create_virtual_dataset("q", layout)
        else:
            file["q"] = h5py.ExternalLink(str(secret), "q")
    if how == "link":
        assert read_columns(path).names == ("t",)
    else:
        with pytest.raises(RecordingError, match=r"a\.mat: found that q is stored in another file"):
            read_columns(path)


@pytest.mark.parametrize("ending", ["csv", "json", "mat"])
def test_columns_are_counted(tmp_path, ending):
    names, path = [f"c{i}" for i in range(20_000)], tmp_path / f"a.{ending}"
    if ending == "csv":
        path.write_text("\n".join([",".join(names), *[",".join("1" * len(names))] * 3]))
    elif ending == "json":
        path.write_text(json.dumps([{name: 1.0} for name in names]))
    else:
        scipy.io.savemat(path, {name: 1.0 for name in names[:6000]})
    with pytest.raises(RecordingError, match=r"\d+ columns or more, expected at most 5000; .*PELLUCID_MOST_COLUMNS"):
        read_columns(path)


def test_a_cap_can_be_raised(tmp_path, monkeypatch):
    path = tmp_path / "a.json"
    path.write_text(json.dumps({f"c{i}": [1.0] for i in range(6000)}))
    monkeypatch.setenv("PELLUCID_MOST_COLUMNS", "7000")
    assert len(read_columns(path).names) == 6000
    monkeypatch.setenv("PELLUCID_MOST_COLUMNS", "many")
    with pytest.raises(RecordingError, match='PELLUCID_MOST_COLUMNS: found "many", expected a number'):
        read_columns(path)


def test_the_page_says_the_caps():
    page = (ROOT / "docs" / "design" / "untrusted-files.md").read_text(encoding="utf-8")
    for said in (
        f"columns of a recording | {_caps.DEFAULT_MAX_COLUMNS:,} |",
        f"bytes of a recording | {_caps.DEFAULT_MAX_FILE_BYTES:.0e} |".replace("e+0", "e"),
        f"unpacked: {1e-6 * _caps.DEFAULT_MAX_UNPACKED_BYTES:.0f} MB, "
        f"or so many times the file's own size | {_caps.MAX_UNPACKED_SIZE_RATIO:.0f} |",
        f"one for each {1e-6 * _caps.MIN_READING_SPEED:.0f} MB | {_caps.BASE_READING_TIME_S:.0f} |",
        f"a model of muscles | {_given.MAX_FILE_BYTES:.0e} |".replace("e+0", "e"),
    ):
        assert said in page, said


def test_a_file_larger_than_any_recording_is_not_opened(tmp_path):
    path = tmp_path / "a.csv"
    path.touch()
    os.truncate(path, int(_caps.DEFAULT_MAX_FILE_BYTES) + 1)
    with pytest.raises(RecordingError, match=r"a\.csv: found 4000000001 bytes, expected at most 4e\+09"):
        read_columns(path)


@pytest.mark.parametrize(
    "text",
    ['{"t": [1, 1' + "0" * 400 + "]}", '{"t": ' + "9" * 5000 + "}", "[" * 100_000, '{"a":' * 900 + "[1]" + "}" * 900],
)
def test_numbers_and_trees_of_any_size(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    try:
        found = read_columns(path).values
    except RecordingError:
        found = {}
    assert all(column.dtype == np.float64 for column in found.values())


def test_nothing_is_imported_from_where_the_user_stands(tmp_path, monkeypatch):
    for module in ("numpy", "json", "scipy", "ezc3d"):
        (tmp_path / f"{module}.py").write_text("open('was_imported', 'w')\n")
    scipy.io.savemat(tmp_path / "a.mat", {"t": np.arange(9.0)})
    monkeypatch.chdir(tmp_path)
    if os.getpid() in _apart._running:
        _apart._end(_apart._running[os.getpid()])
    assert len(read_columns("a.mat")["t"]) == 9
    assert not (tmp_path / "was_imported").exists()


def test_a_line_of_commas_is_not_divided(tmp_path):
    for name, between in (("a.csv", ","), ("a.txt", " "), ("a.sto", "\t")):
        path = tmp_path / name
        path.write_text(("endheader\n" if name == "a.sto" else "") + f"1{between}" * 2_000_000 + "\n")
        with pytest.raises(RecordingError, match="columns or more, expected at most 5000"):
            read_columns(path)
