"""A report whose inputs did not change is not drawn again; whatever changed, it is."""

import shutil
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from pellucid.cli import app
from pellucid.files.kept_columns import FILE_ENDING
from pellucid.study.drawn_report import KEPT_COLUMNS_ENDING, ReportPlace
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import identify
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """A virtual joint that was identified and whose report was drawn by the command."""
    study = write_study(tmp_path_factory.mktemp("joint") / "study", bench_joint(), name="virtual", seed=1)
    identify(study, families=["symmetric"], thorough=False).save(study)
    done = CliRunner().invoke(app, ["report", str(study.folder)])
    assert done.exit_code == 0, done.output
    return study.folder


@pytest.fixture
def folder(reported, tmp_path):
    """A copy, noted as drawn there: a page names its folder in commands, so that a copied page alone is drawn again."""
    copy = shutil.copytree(reported, tmp_path / "study")
    assert told_of(copy) == ()
    ReportPlace(copy).note_drawn(copy / "report" / "index.html", ["Report"], open_study(copy).files(), with_pdf=False)
    return copy


def told_of(folder):
    return ReportPlace(folder).drawn_lines(with_pdf=False)


def test_nothing_changed_and_the_page_is_not_drawn_again(folder, monkeypatch):
    page = folder / "report" / "index.html"
    before = page.read_bytes()
    assert told_of(folder) == ("Report",)
    monkeypatch.setattr("pellucid.study.procedures.run.write_report", None)  # whoever called it would fail
    monkeypatch.setattr("pellucid.study.procedures.registry.open_study", None)
    done = CliRunner().invoke(app, ["report", str(folder)])
    assert done.exit_code == 0, done.output
    assert done.output == "Report\n"
    assert page.read_bytes() == before


def changed_study(folder):
    path = folder / "study.toml"
    path.write_text(path.read_text(encoding="utf-8") + "\n# a remark\n", encoding="utf-8")


def changed_figure(folder):
    path = next((folder / "report").glob("*.svg"))
    path.write_text("<svg/>", encoding="utf-8")


def lost_page(folder):
    (folder / "report" / "index.html").unlink()


def changed_result(folder):
    path = folder / "results.json"
    path.write_bytes(path.read_bytes() + b"\n")


def new_card(folder):
    (folder / "models" / "other.json").write_text("{}", encoding="utf-8")


def changed_recording(folder):
    path = next((folder / "recordings").iterdir())
    path.write_bytes(path.read_bytes() + b"\n")


def damaged_note(folder):
    (folder / "kept" / "report.json").write_text("{", encoding="utf-8")


@pytest.mark.parametrize(
    "change", [changed_study, changed_recording, changed_figure, lost_page, changed_result, new_card, damaged_note]
)
def test_whatever_changed_it_is_drawn_again(folder, change):
    change(folder)
    assert told_of(folder) == ()


def test_figures_as_pdf_are_drawn_when_they_are_asked_for(folder):
    assert ReportPlace(folder).drawn_lines(with_pdf=True) == ()


def test_with_a_recording_elsewhere_it_is_always_drawn(folder, tmp_path):
    """Nobody would see that a pattern finds a new file elsewhere; and reading there must be allowed each time."""
    elsewhere = tmp_path / "elsewhere.csv"
    elsewhere.write_text("t", encoding="utf-8")
    place = ReportPlace(folder, allow_outside=True)
    place.note_drawn(folder / "report" / "index.html", ["Report"], [elsewhere], with_pdf=False)
    assert place.drawn_lines(with_pdf=False) == ()
    place.note_drawn(folder / "report" / "index.html", ["Report"], [], with_pdf=False)
    assert place.drawn_lines(with_pdf=False)


def test_kept_columns_are_told_by_their_own_ending():
    assert KEPT_COLUMNS_ENDING == FILE_ENDING


def test_a_report_that_is_not_drawn_again_needs_no_numpy():
    code = "import sys, pellucid.study.drawn_report; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize(("before", "after"), [((), ()), ((), ("-q",)), (("--quiet",), ()), ((), ("-v",))])
def test_the_command_alone_prints_an_up_to_date_report_without_typer(folder, before, after):
    code = (
        "import sys; from pellucid.__main__ import main; main(); "
        "print([name for name in ('typer', 'pydantic', 'numpy') if name in sys.modules])"
    )
    command = [sys.executable, "-c", code, *before, "report", str(folder), *after]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "Report\n[]\n"


def test_the_command_draws_a_report_that_changed(folder):
    changed_figure(folder)
    again = subprocess.run(
        [sys.executable, "-m", "pellucid", "report", str(folder), "-q"], capture_output=True, text=True, check=True
    )
    assert "Report: " in again.stdout
