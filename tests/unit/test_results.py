"""results.json."""

import json
import math

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.study.results import ResultRow, read_rows, write_rows


def row(name, value=1.0, command="identify", **more):
    return ResultRow(f"bench.{name}", value, "N*m", command, "fitted", **more)


def test_a_command_replaces_only_its_own_rows(tmp_path):
    path = tmp_path / "results.json"
    write_rows(path, "identify", [row("a", 1.0), row("b", 2.0)])
    write_rows(path, "assess", [row("c", 3.0, "assess")])
    write_rows(path, "identify", [row("a", 4.0, data_checksum="ab", note="again")])
    rows = {r.id: r for r in read_rows(path)}
    assert {name: r.value for name, r in rows.items()} == {"bench.c": 3.0, "bench.a": 4.0}
    assert rows["bench.a"].note == "again"
    figures = json.loads(path.read_text())["figures"]
    assert set(figures[0]) == {"id", "value", "unit", "command", "split", "data_checksum", "note"}


def test_what_is_not_finite_is_null_with_a_note(tmp_path):
    path = tmp_path / "results.json"
    write_rows(path, "identify", [row("a", math.nan), row("b", np.float32(np.inf), note="ill-posed"), row("c", None)])
    text = path.read_text()
    assert "NaN" not in text
    assert "Infinity" not in text
    a, b, c = read_rows(path)
    assert (a.value, a.note) == (None, "not finite: nan")
    assert (b.value, b.note) == (None, "ill-posed; not finite: inf")
    assert (c.value, c.note) == (None, "")


def test_numpy_scalars_are_numbers(tmp_path):
    path = tmp_path / "results.json"
    write_rows(path, "identify", [row("a", np.float64(0.1)), row("b", np.int64(3))])
    assert [r.value for r in read_rows(path)] == [0.1, 3.0]


def test_an_id_is_given_once(tmp_path):
    path = tmp_path / "results.json"
    with pytest.raises(RecordingError, match=r"the id bench.a occurs twice"):
        write_rows(path, "identify", [row("a"), row("a")])
    assert not path.exists()
    write_rows(path, "identify", [row("a")])
    with pytest.raises(RecordingError, match="in rows of identify and of assess"):
        write_rows(path, "assess", [row("a", command="assess")])
    assert len(read_rows(path)) == 1


def test_a_row_is_checked(tmp_path):
    with pytest.raises(RecordingError, match="found the split 'train', expected one of fitted, heldout, simulated"):
        ResultRow("a", 1.0, "1", "identify", "train")
    with pytest.raises(RecordingError, match=r"bench.a: found the value 'big', expected a number or None"):
        row("a", "big")
    with pytest.raises(RecordingError, match="found the unit '', expected"):
        ResultRow("a", 1.0, "", "identify", "fitted")
    with pytest.raises(RecordingError, match="found the command 'assess', expected 'identify'"):
        write_rows(tmp_path / "results.json", "identify", [row("a", command="assess")])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('{"figures": [{"id": "a", "val', "truncated or damaged"),
        ("[]", 'found no list "figures"'),
        ('{"figures": [{"id": "a"}]}', "figure 1 lacks command, split, unit, value"),
    ],
)
def test_half_written_results_are_told_and_kept(tmp_path, content, message):
    path = tmp_path / "results.json"
    path.write_text(content)
    with pytest.raises(RecordingError, match=message):
        read_rows(path)
    with pytest.raises(RecordingError, match=message):
        write_rows(path, "identify", [row("a")])
    assert path.read_text() == content
    with pytest.raises(RecordingError, match="no such file; the commands write it"):
        read_rows(tmp_path / "absent.json")
