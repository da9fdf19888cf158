"""Studies side by side: one that fails stops no other, and a table over all shows what each found."""

import re
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from typer.testing import CliRunner

from pellucid.cli import app
from pellucid.study.procedures.run import Outcome, identify_several, table_of
from pellucid.study.results import read_rows
from pellucid.study.terminal import RemainingTime, _print_first_line, share_text
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study

PATIENCE_S = 60.0


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
        assert rows[f"{each.study}.headline.inertia"] == inertia.value
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


def test_the_status_is_that_of_one_study_where_figures_describe_nothing(monkeypatch, tmp_path):
    """`identify a` ended with status 1, and `identify a b` with 0."""
    outcome = Outcome("x/a", "a", "the fit failed", flaw="the fit failed: it explains nothing.")
    monkeypatch.setattr("pellucid.study.procedures.run.identify_several", lambda *_, **__: (outcome, outcome))
    made = CliRunner().invoke(app, ["identify", str(tmp_path / "a"), str(tmp_path / "b")])
    assert made.exit_code == 1
    assert "it explains nothing" in " ".join(made.stdout.split())


def test_a_table_over_none_has_no_columns_of_parameters():
    assert table_of([Outcome("x/y", failure="no")]) == (("study", "warnings"), [("y", "failed")])


def lines_told(capsys, count):
    """Wait until so many lines of progress were told; a busy machine may take its time."""
    said, until = "", time.monotonic() + PATIENCE_S
    while said.count("\n") < count:
        assert time.monotonic() < until, said
        time.sleep(0.02)
        said += capsys.readouterr().err
    return said[: said.rindex("\n")].splitlines()


def test_progress_without_a_terminal_goes_on_while_a_step_lasts(capsys, monkeypatch):
    monkeypatch.setattr("pellucid.study.terminal.FIRST_PROGRESS_S", 0.05)
    with _print_first_line() as tell:
        tell("fitting", 0.5)
        lines = lines_told(capsys, 3)
    assert len(lines) >= 3
    assert all(line.startswith("pellucid: 50 % fitting") for line in lines)
    assert lines[-1].endswith("s left")


def rest_after(elapsed, share):
    """Return a predicted rest, told at one step."""
    rest = RemainingTime()
    rest.step(elapsed, share)
    return rest


def test_the_time_that_remains_becomes_less_while_a_step_lasts():
    assert rest_after(100.0, 0.5).text(100.0) == "about 2 min left"
    rest = rest_after(100.0, 0.5)
    assert [rest.text(100.0 + waited) for waited in (40.0, 60.0)] == ["about 60 s left", "about 40 s left"]
    # Nothing of the prediction is left, and what was shown cannot grow.
    assert rest.text(250.0) == "longer than predicted"
    # A step that ends shortens the prediction below what was shown.
    rest.step(270.0, 0.9)
    assert rest.text(270.0) == "about 30 s left"


def seconds_shown(text):
    """Return the time that a text on the rest shows [s]."""
    number, unit = re.fullmatch("about ([0-9]+) (s|min) left", text).groups()
    return float(number) * (60.0 if unit == "min" else 1.0)


@pytest.mark.parametrize("seed", range(20))
def test_the_time_that_remains_never_grows(seed):
    """A new prediction was shown whenever a step lasted long: the rest went from 5 s to 4 minutes."""
    rng = np.random.default_rng([50, seed])
    times = np.cumsum(rng.lognormal(1.0, 1.2, 30))
    rest, shown = RemainingTime(), []
    for i, (began, ended) in enumerate(zip([0.0, *times], times, strict=False)):
        rest.step(began, i / len(times))
        shown += [rest.text(now) for now in np.arange(began, ended, 2.0)]
    seconds = [seconds_shown(text) for text in shown if text.startswith("about")]
    assert len(seconds) > 5
    assert seconds == sorted(seconds, reverse=True)


def test_no_share_is_undone():
    rest = RemainingTime()
    assert [rest.step(1.0, 0.5), rest.step(2.0, 0.3), rest.step(3.0, 0.6)] == [0.5, 0.5, 0.6]


def test_a_last_step_with_the_whole_share_is_told_while_it_lasts(capsys, monkeypatch):
    """Nothing was printed while a step lasted that was told with a share of one."""
    monkeypatch.setattr("pellucid.study.terminal.FIRST_PROGRESS_S", 0.05)
    with _print_first_line() as tell:
        tell("muscles together", 1.0)
        lines = lines_told(capsys, 2)
        tell("done", 1.0)
    assert all(line.startswith("pellucid: 99 % muscles together") for line in lines)


def test_a_decimal_is_told_where_a_percent_takes_longer_than_two_seconds():
    assert [share_text(0.5, 90.0), share_text(0.5, 200.0), share_text(1.0, 900.0)] == ["50 %", "50.0 %", "100 %"]
    assert share_text(0.0124, 10.0) == "1.2 %"


def test_before_a_prediction_the_time_so_far_is_told(capsys, monkeypatch):
    monkeypatch.setattr("pellucid.study.terminal.FIRST_PROGRESS_S", 0.05)
    with _print_first_line() as tell:
        tell("reading", 0.0)
        lines = lines_told(capsys, 1)
    assert re.fullmatch("pellucid: 0 % reading, [0-9]+ s so far", lines[0])


def test_what_is_soon_done_is_not_told(capsys):
    with _print_first_line() as tell:
        tell("reading", 0.0)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("elapsed", "share", "text"),
    [(10.0, 0.02, ""), (1.0, 0.5, ""), (10.0, 0.5, "about 10 s left"), (60.0, 0.1, "about 9 min left"), (9.0, 1.0, "")],
)
def test_the_time_that_remains_is_told_once_it_can_be_known(elapsed, share, text):
    assert rest_after(elapsed, share).text(elapsed) == text
