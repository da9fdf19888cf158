"""Studies side by side: one that fails stops no other, and a table over all shows what each found."""

import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from typer.testing import CliRunner

from pellucid.cli import app
from pellucid.lab.bench.rig import bench_joint
from pellucid.lab.study import write_study
from pellucid.procedures.several import Outcome, identify_several, table_of
from pellucid.studies.results import read_rows
from pellucid.terminal import _lines_at_intervals, _print_first_line


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    place, rig = tmp_path_factory.mktemp("several"), bench_joint().changed({"sampling.duration": 8.0})
    for i in (1, 2):
        write_study(place / f"s{i}", rig, name=f"bench{i}", seed=i, trials=rig.trials(i)[:1], threads=1)
    (place / "empty").mkdir()
    return [place / name for name in ("s1", "empty", "s2")]


def test_each_is_identified_and_saved_whatever_the_others_do(folders):
    heard = []
    with ThreadPoolExecutor(1) as executor:
        found = identify_several(
            folders, families=["symmetric"], executor=executor, on_progress=lambda text, share: heard.append(share)
        )
    assert [each.study for each in found] == ["bench1", "", "bench2"]
    assert "no such file" in found[1].failure
    assert heard[0] == 0.0
    assert heard[-1] == 1.0
    for folder, each in zip(folders, found, strict=True):
        if each.failure:
            continue
        rows = {row.id: row.value for row in read_rows(folder / "results.json")}
        inertia = next(p for p in each.parameters if p.name == "inertia")
        assert rows[f"{each.study}.symmetric.inertia"] == inertia.value
    heads, rows = table_of(found)
    assert heads[:3] == ("study", "warnings", "inertia [kg·m²]")
    assert [row[:2] for row in rows][1] == ("empty", "failed")
    assert rows[1][2] == "–"
    assert rows[0][2] != rows[2][2]
    assert "±" in rows[0][2]


def test_the_command_says_what_failed_and_ends_with_status_1(tmp_path):
    made = CliRunner().invoke(app, ["identify", str(tmp_path / "a"), str(tmp_path / "b")])
    assert made.exit_code == 1
    assert " ".join(made.stdout.split()).count("no such file") == 2  # progress, beside it, may tell a failure too


def test_a_table_over_none_has_no_columns_of_parameters():
    assert table_of([Outcome("x/y", failure="no")]) == (("study", "warnings"), [("y", "failed")])


def test_progress_where_there_is_no_terminal_is_a_line_now_and_then(capsys, monkeypatch):
    clock = iter([0.0, 1.0, 6.0, 6.0, 7.0, 12.0, 12.0, 30.0])
    monkeypatch.setattr("time.monotonic", lambda: next(clock))
    tell = _lines_at_intervals(5.0)
    for share in (0.1, 0.2, 0.3, 0.4, 1.0):
        tell("fitting", share)
    assert capsys.readouterr().err == "pellucid: 20 % fitting\npellucid: 40 % fitting\n"


def test_what_takes_long_is_told_before_anything_is_done(capsys):
    with _print_first_line(0.02) as tell:
        tell("fitting", 0.0)
        time.sleep(0.2)
    with _print_first_line(60.0) as tell:
        tell("reading", 0.0)
    assert capsys.readouterr().err == "pellucid: 0 % fitting\n"
