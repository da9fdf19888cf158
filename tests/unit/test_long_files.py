"""Files of hours: the core, NumPy and the reader that goes from field to field find the same bits; columns are kept."""

import os
from pathlib import Path

import numpy as np
import pytest

from pellucid import _core
from pellucid.files import kept_columns as keeping
from pellucid.files.readers import _number_blocks, csv
from pellucid.files.readers.read import read_columns

DRAWN = np.random.default_rng(7)
NUMBERS = [
    *(repr(x) for x in DRAWN.standard_normal(300).tolist()),
    "0.1",
    "5e-324",
    "1.7976931348623157e308",
    "-0.0",
    "1e22",
]
ROWS = "\n".join(f"{i * 0.001:.3f},{x},{DRAWN.normal():.4f}" for i, x in enumerate(NUMBERS)) + "\n"


@pytest.mark.parametrize(
    ("content", "plain"),
    [
        (f"t,q,i\n{ROWS}", True),
        (f"# a comment\nTitle\nt [s],q [deg],i\ns,deg,A\n{ROWS}", True),
        (ROWS, True),
        ("t,q,i\n" + ROWS.replace("\n", "\r\n"), True),
        ("t;q;i\n" + ROWS.replace(",", ";").replace(".", ","), True),
        ("t\tq\ti\n" + ROWS.replace(",", "\t"), True),
        ("t\tq\ti\n" + ROWS.replace(",", "\t") + "0.9\t1\t\n\t\t\n", True),  # a line of tabs alone is no row
        ("\ufefft,q,i\n" + ROWS, True),
        (f"t,q,i\n{ROWS}0.9,,NaN\n1.0,NA,null\n", True),
        (f"t,q,i\n\n{ROWS}\n", True),
        (f"t,q,i\n{ROWS}# a comment\n0.9,1,2\n", True),
        (f"t,q,i\n{ROWS}0.9,true,word\n", False),
        (f't,q,i\n{ROWS}"0.9","1","2"\n', False),
        ("t,q,i,\n" + ROWS.replace("\n", ",\n"), False),
        ("t q i\n" + ROWS.replace(",", "  "), True),
        ("t\u00b0,q,i\n" + ROWS, True),
    ],
)
def test_all_readers_find_the_same_bits(tmp_path, monkeypatch, content, plain):
    path = tmp_path / "a.csv"
    path.write_bytes(content.encode())
    read_plain, taken = csv._plain_columns, []

    def plain_columns(*arguments, **options):
        columns = read_plain(*arguments, **options)
        taken.append(columns is not None)
        return columns

    monkeypatch.setattr(csv, "_plain_columns", plain_columns)
    by_core = csv.read(path)
    monkeypatch.setattr(_core, "read_rows", lambda *_: None)
    by_numpy = csv.read(path)
    assert taken == [plain] * 2
    monkeypatch.setattr(csv, "_plain_columns", lambda *_, **__: None)
    by_field = csv.read(path)
    for found in (by_core, by_numpy):
        assert_same_bits(found, by_field)


def test_cells_have_the_bits_that_python_reads():
    texts = [
        "0", "-0", "+7", " 1.5", "2.5\t", ".5", "5.", "1e3", "1E-3", "1e+22", "1e23", "123456789012345678",
        "9007199254740993", "0.30000000000000004", "2.2250738585072011e-308", "1e400", "inf", "-Infinity",
        *(f"{x:.{k}f}" for k, x in enumerate(DRAWN.normal(scale=1e4, size=17))),
        *(f"{x:.{k}e}" for k, x in enumerate(DRAWN.normal(size=19))),
    ]  # fmt: skip
    column = np.empty(len(texts) + 1)
    assert _core.read_rows("\n".join(texts).encode(), [column], 1, ";", ".", ["nan"]) == len(column)
    np.testing.assert_array_equal(column[1:].view(np.int64), np.array([float(x) for x in texts]).view(np.int64))


@pytest.mark.parametrize(
    "cell", ["1,5", "1_000", "0x10", "1 2", "--1", ".", "1e", "e5", "word", '"1"', "1\0", "#1", "1d5"]
)
def test_what_is_no_number_is_left_to_other_readers(cell):
    assert _core.read_rows(f"1\n{cell}\n".encode(), [np.empty(3)], 0, ";", ".", [""]) is None
    assert _core.read_rows(f"1;2\n3;{cell}\n".encode(), [np.empty(3), np.empty(3)], 0, ";", ".", [""]) is None


def test_rows_of_another_width_and_too_many_rows_are_refused():
    columns = [np.empty(2), np.empty(2)]
    for text in (b"1;2\n3\n", b"1;2\n3;4;5\n", b"1;2;\n"):
        assert _core.read_rows(text, columns, 0, ";", ".", [""]) is None
    assert _core.read_rows(b"1;2\r\n \r\n3;\n", columns, 0, ";", ".", [""]) == 2
    np.testing.assert_array_equal(columns, [[1.0, 3.0], [2.0, np.nan]])
    assert _core.read_rows(b"1,5;2\n", columns, 0, ";", ",", [""]) == 1
    assert columns[0][0] == 1.5
    with pytest.raises(ValueError, match="columns: found room for 2 rows, expected more"):
        _core.read_rows(b"1;2\n3;4\n", columns, 1, ";", ".", [""])
    with pytest.raises(ValueError, match="one character for delimiter and decimal"):
        _core.read_rows(b"1;2\n", columns, 0, ";;", ".", [""])
    for other in (np.empty(2, np.float32), np.empty(4)[::2], [0.0, 0.0]):
        with pytest.raises(TypeError):
            _core.read_rows(b"1\n", [other], 0, ";", ".", [""])


def assert_same_bits(found, expected):
    """Compare the names, numbers and texts of columns."""
    assert found.names == expected.names
    for name in expected.names:
        a, b = found.values[name], expected.values[name]
        if isinstance(b, str):
            assert a == b
        else:
            np.testing.assert_array_equal(a.view(np.int64)[~np.isnan(b)], b.view(np.int64)[~np.isnan(b)])
            np.testing.assert_array_equal(np.isnan(a), np.isnan(b))


LABELLED = "t;q;i;when;phase\n" + "".join(
    f"{row.replace('.', ',')};12:00:{i % 60:02d};{'' if i % 3 else 'swing'}\n"
    for i, row in enumerate(ROWS.replace(",", ";").splitlines())
)
"""A table with stamps of a wall clock and labels."""


@pytest.mark.parametrize("content", [f"t,q,i\n{ROWS * 40}", LABELLED, f"t,q,i\n{ROWS}# a comment\n0.9,,2\n"])
def test_blocks_of_any_size_are_the_same(tmp_path, monkeypatch, content):
    path = tmp_path / "a.csv"
    path.write_text(content)
    whole = csv.read(path)
    monkeypatch.setattr(_number_blocks, "BLOCK_BYTES", 700)
    assert_same_bits(csv.read(path), whole)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_are_whole_in_every_block(tmp_path, monkeypatch, end):
    content = "".join(f"{'x' * (i % 40)}{end}" for i in range(400)).encode() + b"last"
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    monkeypatch.setattr(_number_blocks, "BLOCK_BYTES", 64)
    with path.open("rb") as file:
        blocks = list(_number_blocks.line_blocks(file))
        assert b"".join(_number_blocks.line_blocks(file, len(content) - 4)) == content[:-4]
    assert b"".join(blocks) == content
    assert [line for block in blocks for line in block.splitlines()] == content.splitlines()


@pytest.fixture
def long_file(tmp_path, monkeypatch):
    monkeypatch.setattr(keeping, "MIN_FILE_BYTES", 1)
    path = tmp_path / "a.csv"
    path.write_text("t,q,i,label\n" + ROWS.replace("\n", ",x\n"))
    return path


def counted(monkeypatch):
    opened: list[Path] = []
    monkeypatch.setattr(keeping, "read_columns", lambda path: opened.append(path) or read_columns(path))
    return opened


def test_text_is_parsed_once(tmp_path, long_file, monkeypatch):
    opened = counted(monkeypatch)
    first = keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)
    again = keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)
    assert len(opened) == 1
    assert again.names == first.names == ("t", "q", "i", "label")
    assert again.values["label"] == first.values["label"]
    np.testing.assert_array_equal(again["q"], read_columns(long_file)["q"])
    keeping.kept_columns(tmp_path / "kept", long_file, "1" * 64)
    assert len(opened) == 2


def test_kept_numbers_have_the_same_bits_in_the_shortest_type(tmp_path, long_file):
    rows = [
        (i, i - 2**15, 2**31 - 1 - i, i + 2**31, i if i else "-0", i if i < 150 else "", 0.5 * i) for i in range(200)
    ]
    kinds = dict(zip("abcdefg", ("<i2", "<i2", "<i4", "<f8", "<f8", "<f8", "<f8"), strict=True))
    long_file.write_text("\n".join([",".join(kinds), *(",".join(map(str, row)) for row in rows), ""]))
    keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)
    found = keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)
    assert {name: entry[3] for name, entry in found.values._entries.items()} == kinds
    for name in kinds:
        assert found[name].dtype == float
        np.testing.assert_array_equal(found[name].view(np.int64), read_columns(long_file)[name].view(np.int64))


def test_what_is_damaged_is_read_again_from_its_file(tmp_path, long_file):
    keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)
    (kept,) = (tmp_path / "kept").iterdir()
    content = bytearray(kept.read_bytes())
    content[-4000] ^= 1
    kept.write_bytes(content)
    found = keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)
    for name in "tqi":
        np.testing.assert_array_equal(found[name], read_columns(long_file)[name])
    kept.write_bytes(content[:100])
    np.testing.assert_array_equal(
        keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)["q"], read_columns(long_file)["q"]
    )


def test_what_somebody_else_kept_is_read_from_the_file_itself(tmp_path, long_file, monkeypatch):
    theirs = long_file.with_name("theirs.csv")
    theirs.write_text(long_file.read_text().replace("0.003,-", "0.003,-1"))
    monkeypatch.setenv("PELLUCID_SETTINGS", str(tmp_path / "theirs"))
    keeping.kept_columns(tmp_path / "kept", theirs, "0" * 64)
    keeping.kept_columns(tmp_path / "kept", theirs, "1" * 64)
    monkeypatch.setenv("PELLUCID_SETTINGS", str(tmp_path / "mine"))
    found = keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)
    np.testing.assert_array_equal(found["q"], read_columns(long_file)["q"])
    # Nor is what this user kept of one file believed of another.
    one, other = (next((tmp_path / "kept").glob(f"{digest * 32}*")) for digest in "01")
    other.write_bytes(one.read_bytes())
    found = keeping.kept_columns(tmp_path / "kept", theirs, "1" * 64)
    np.testing.assert_array_equal(found["q"], read_columns(theirs)["q"])


def test_a_folder_that_cannot_be_written_keeps_nothing(tmp_path, long_file, monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(keeping, "atomically", refuse)
    found = keeping.kept_columns(tmp_path / "kept", long_file, "0" * 64)
    np.testing.assert_array_equal(found["q"], read_columns(long_file)["q"])


def test_what_was_used_longest_ago_is_forgotten_first(tmp_path, long_file, monkeypatch):
    for i, digest in enumerate("012"):
        keeping.kept_columns(tmp_path / "kept", long_file, digest * 64)
        kept = next((tmp_path / "kept").glob(f"{digest * 32}*"))
        os.utime(kept, (i, i))
    monkeypatch.setattr(keeping, "MAX_KEPT_BYTES", 3 * kept.stat().st_size + 10)
    keeping.kept_columns(tmp_path / "kept", long_file, "3" * 64)
    assert sorted(path.name[0] for path in (tmp_path / "kept").iterdir()) == ["1", "2", "3"]
