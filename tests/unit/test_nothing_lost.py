"""What was found is not thrown away: an unwritable folder, a full disk, a damaged results.json, a kill."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

import pellucid as pl
from pellucid import _atomic
from pellucid.study.procedures import result as results
from pellucid.study.procedures.registry import open_study
from pellucid.study.results import read_rows


@pytest.fixture
def found(make_study):
    study = make_study()
    return study, pl.identify(study, families=["symmetric"], thorough=False)


@pytest.fixture
def full(monkeypatch):
    """A folder in which nothing can be written, as on a full disk or one that is read-only."""
    folders = []
    whole = tempfile.mkstemp

    def mkstemp(dir=None, **options):
        if any(Path(dir).is_relative_to(folder) for folder in folders):
            raise OSError(28, "No space left on device")
        return whole(dir=dir, **options)

    monkeypatch.setattr(tempfile, "mkstemp", mkstemp)
    return folders.append


def test_what_was_found_is_written_elsewhere_and_said(found, full, tmp_path, monkeypatch):
    study, result = found
    elsewhere = tmp_path / "here"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    full(study.folder)
    saved, said = result.save_somewhere(study)
    assert saved.made.parent == elsewhere
    assert "No space left on device" in said
    assert str(saved.made) in said
    assert len(read_rows(saved.results_path)) == len(result.rows)
    assert json.loads((saved.models_dir / "joint.json").read_text())["family"] == "symmetric"
    assert not study.models_dir.exists() or not list(study.models_dir.iterdir())


def test_a_damaged_results_file_throws_nothing_away(found, tmp_path, monkeypatch):
    study, result = found
    monkeypatch.chdir(tmp_path)
    study.results_path.write_text('{"figures": [{"id": "a"')
    saved, said = result.save_somewhere(study)
    assert "truncated or damaged" in said
    assert saved.made != study.folder
    assert study.results_path.read_text() == '{"figures": [{"id": "a"'


def test_where_nothing_can_be_written_the_figures_are_printed(found, full, capsys, monkeypatch):
    from pellucid import cli

    study, result = found
    monkeypatch.setattr(results, "mkdtemp", lambda **options: (_ for _ in ()).throw(OSError(28, "No space left")))
    full(study.folder)
    with pytest.raises(SystemExit):
        cli._run_and_save(study, "identify", False, lambda study, tell: result)
    told = capsys.readouterr()
    assert len(json.loads(told.out)["figures"]) == len(result.rows)
    assert "No space left" in told.err


def test_a_report_is_drawn_where_there_is_room(found, full, tmp_path, monkeypatch):
    study, result = found
    full(study.folder)
    monkeypatch.chdir(tmp_path)
    page = pl.report(study, result)
    assert page.parent != study.report_dir
    assert page.is_file()


def test_a_folder_that_may_not_be_written_is_left_alone(found, tmp_path):
    study, result = found
    before = sorted(study.folder.rglob("*"))
    elsewhere = open_study(study.folder, out=tmp_path / "out")
    result.save(elsewhere)
    assert pl.report(elsewhere) == tmp_path / "out" / "report" / "index.html"
    assert pl.export(elsewhere) == tmp_path / "out" / "controller"
    assert {r.command for r in read_rows(tmp_path / "out" / "results.json")} == {"identify"}
    assert sorted(study.folder.rglob("*")) == before


def test_what_a_killed_command_left_is_taken_away_later(tmp_path, monkeypatch):
    code = (
        "import os, sys; from pellucid._atomic import atomically\n"
        "with atomically(sys.argv[1]) as file:\n    file.write(b'half'); file.flush(); os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "joint.json")], check=False)
    (left,) = tmp_path.iterdir()
    with _atomic.atomically(tmp_path / "other.json") as file:
        file.write(b"{}")
        _atomic.remove_leftovers(tmp_path)  # it is too young to be nobody's
        assert left.exists()
        monkeypatch.setattr(_atomic, "MIN_LEFTOVER_AGE_S", -1.0)
        _atomic.remove_leftovers(tmp_path)  # one of a process that lives stays
    assert [path.name for path in tmp_path.iterdir()] == ["other.json"]


def test_a_simulation_that_is_killed_leaves_the_study_as_it_was(tmp_path):
    folder = tmp_path / "joint"
    pl.init(folder, rig="bench-joint")
    rig = folder / "lab" / "rig.toml"
    rig.write_text(rig.read_text().replace("duration = 20.0", "duration = 3.0"))
    pl.simulate(folder, seed=1)
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file() and p.name[0] != "."}
    code = "import sys, pellucid as pl; pl.simulate(sys.argv[1], seed=2)"
    run = subprocess.Popen([sys.executable, "-c", code, str(folder)])
    while run.poll() is None and not list(folder.glob(".unfinished/recordings/*")):
        time.sleep(0.002)
    assert run.poll() is None
    os.kill(run.pid, 9)
    run.wait()
    assert {
        p: p.read_bytes() for p in folder.rglob("*") if p.is_file() and ".unfinished" not in str(p) and p.name[0] != "."
    } == before
    pl.simulate(folder, seed=2)
    assert not (folder / ".unfinished").exists()
    assert any(p.read_bytes() != content for p, content in before.items())
