"""A card is used for what it was made from: what has changed since is said, and nothing is written over unasked."""

import json
import shutil
from dataclasses import replace

import pytest
from typer.testing import CliRunner

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.cli import app
from pellucid.controllers.commissioning import Answers
from pellucid.controllers.export.controller_values import joint_values
from pellucid.controllers.study.commission import state_answers
from pellucid.models.card import CardParameter, ModelCard, read_card, write_card
from pellucid.study.procedures.registry import asked, open_study
from pellucid.study.procedures.result import Result
from pellucid.study.results import ResultRow, require_own_page, write_rows
from pellucid_lab.ranking.rank import rank

STALE = r"joint\.json: found an outdated card: {} changed since it was made; identify again: pellucid identify "


@pytest.fixture
def study(make_study):
    """A joint that was identified."""
    made = make_study()
    pl.identify(made, families=["symmetric"], thorough=False).save(made)
    return made


def edit(study, old, new):
    path = study.folder / "study.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return open_study(study.folder)


def refused(study, what):
    with pytest.raises(PellucidError, match=STALE.format(what)):
        joint_values(study)
    assert joint_values(replace(study, accept_stale=True)).numbers


def test_a_card_of_the_study_as_it_is_is_used(study):
    assert joint_values(open_study(study.folder)).numbers
    card = read_card(study.models_dir / "joint.json")
    assert card.made_from["procedure"] == "joint"
    assert "recordings/sweep.csv" in card.made_from


def test_what_commissioning_writes_leaves_results_up_to_date(study):
    """Identification reads no instruments, and a comment is no setting."""
    (procedure,) = asked(study)
    state_answers(study.folder / "study.toml", Answers(0.014, 1e-4, (5.0, -1.0, 4.0, -2.0, 3.0, -3.0), 300, 10))
    commissioned = open_study(study.folder)
    assert commissioned.rig.instruments.start_up_answer == pytest.approx(0.014)
    assert Result.kept(commissioned, procedure) is not None
    assert pl.report(commissioned, only_kept=True).is_file()
    changed = edit(study, 'torque_constant = "2 N*m/A"', 'torque_constant = "4 N*m/A"')
    assert Result.kept(changed, procedure) is None


def test_a_changed_machine_makes_a_card_stale(study):
    changed = edit(study, 'torque_constant = "2 N*m/A"', 'torque_constant = "4 N*m/A"')
    refused(changed, r"study\.toml \[rig\]")
    run = CliRunner().invoke(app, ["export", str(study.folder)])
    assert run.exit_code != 0
    assert "identify again" in str(run.exception)
    assert not (study.folder / "controller").exists()
    with pytest.raises(PellucidError, match="found an outdated card"):
        pl.compare(study.folder, study.folder)
    card = study.models_dir / "joint.json"
    assert pl.compare(card, card).rows  # a card that is named is a record


def test_changed_recordings_make_a_card_stale(study):
    path = study.folder / "recordings" / "sweep.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join(lines[:-1]) + "\n", encoding="utf-8")
    refused(study, r"recordings/sweep\.csv")  # though the study was opened before
    path.unlink()
    with pytest.raises(PellucidError, match="no such file"):
        joint_values(open_study(study.folder))


def test_words_and_limits_make_no_card_stale(study):
    edit(study, 'name = "bench"', '# a comment\nname = "bench"\nnotes = ["A remark."]')
    limited = edit(study, "[channels]", '[rig.limits]\neffort = "4 N*m"\n\n[channels]')
    assert joint_values(limited).numbers["effort_limit"] == 4.0


def test_a_card_of_another_study_is_told(study, tmp_path, make_study):
    other = shutil.copytree(study.folder, tmp_path / "other")
    path = other / "study.toml"
    path.write_text(path.read_text().replace('name = "bench"', 'name = "other"'))
    assert joint_values(open_study(other)).numbers  # a copy of all that it was made from, under another name
    lines = (other / "recordings" / "sweep.csv").read_text().splitlines()
    (other / "recordings" / "sweep.csv").write_text("\n".join(lines[:-1]) + "\n")
    with pytest.raises(PellucidError, match="found an outdated card of the study bench: recordings"):
        joint_values(open_study(other))


def test_an_old_card_is_used_unless_its_recordings_are_others_and_said(study):
    path = study.models_dir / "joint.json"
    old = replace(read_card(path), made_from={})
    write_card(path, old)
    values = joint_values(study)
    assert any("joint.json does not state its sources" in note for note in values.notes)
    write_card(path, replace(old, checksums={name: "0" * 64 for name in old.checksums}))
    with pytest.raises(PellucidError, match="found an outdated card: its recordings"):
        joint_values(study)
    write_card(path, replace(old, made_from={"procedure": "nothing"}))
    with pytest.raises(PellucidError, match='unknown procedure "nothing"'):
        joint_values(study)


def test_what_was_saved_elsewhere_ends_with_status_1(study, tmp_path, monkeypatch):
    """So that identify && export does not export the older card."""
    monkeypatch.chdir(tmp_path)
    study.results_path.write_text("{", encoding="utf-8")
    run = CliRunner().invoke(app, ["identify", str(study.folder), "--family", "symmetric"])
    assert run.exit_code == 1
    assert "instead" in run.output
    assert "inertia" in run.output  # and it is printed all the same
    json_run = CliRunner().invoke(app, ["identify", str(study.folder), "--family", "symmetric", "--json"])
    assert json_run.exit_code == 1


def test_a_controllers_folder_is_its_own(study, tmp_path):
    folder = pl.export(study, out=tmp_path / "law")
    (folder / "main.c").write_text("int main(void) { return 0; }\n")
    assert pl.export(study, out=folder) == folder
    assert (folder / "main.c").is_file()
    owner = json.loads((folder / "pellucid.json").read_text())
    assert owner["controller"] == "compensation"
    other = replace(study, config=study.config.model_copy(update={"name": "other"}), accept_stale=True)
    with pytest.raises(
        PellucidError, match=r"law: found controller compensation, study bench, .*, expected .* study other"
    ):
        pl.export(other, out=folder)
    assert json.loads((folder / "pellucid.json").read_text()) == owner
    assert pl.export(other, out=folder, overwrite=True) == folder
    assert json.loads((folder / "pellucid.json").read_text())["study"] == "other"


def test_somebodys_own_files_are_not_replaced(study, tmp_path):
    folder = tmp_path / "firmware"
    folder.mkdir()
    (folder / "main.c").write_text("int main(void) { return 0; }\n")
    (folder / "README.md").write_text("My robot.\n")
    run = CliRunner().invoke(app, ["export", str(study.folder), "--out", str(folder)])
    assert isinstance(run.exception, PellucidError)
    assert "firmware: found README.md, " in str(run.exception)
    assert sorted(path.name for path in folder.iterdir()) == ["README.md", "main.c"]
    (folder / "README.md").unlink()
    assert pl.export(study, out=folder) == folder


def test_a_folder_to_write_to_holds_one_study(study, tmp_path):
    pl.identify(study, families=["symmetric"], thorough=False).save(open_study(study.folder, out=tmp_path / "out"))
    assert open_study(study.folder, out=tmp_path / "out")
    assert open_study(study.folder, out=study.folder)
    other = shutil.copytree(study.folder, tmp_path / "other")
    path = other / "study.toml"
    path.write_text(path.read_text().replace('name = "bench"', 'name = "other"'))
    with pytest.raises(PellucidError, match="out: found results of bench, expected those of other or none"):
        open_study(other, out=tmp_path / "out")
    with pytest.raises(PellucidError, match="bench: found another study"):
        open_study(other, out=study.folder)


def test_a_page_of_another_command_is_not_replaced(tmp_path):
    (tmp_path / "index.html").write_text("mine")
    with pytest.raises(
        PellucidError, match=r"found index\.html of something else, expected none, or that of an earlier"
    ):
        require_own_page(tmp_path, "rank")
    write_rows(tmp_path / "results.json", "assess", [ResultRow("a.b", 1.0, "1", "assess", "simulated")])
    with pytest.raises(PellucidError, match=r"found index\.html of assess"):
        require_own_page(tmp_path, "rank")
    with pytest.raises(PellucidError, match=r"found index\.html of assess"):
        pl.reproduce("hill", tmp_path)
    with pytest.raises(PellucidError, match=r"found index\.html of assess"):
        rank(tmp_path)
    write_rows(tmp_path / "results.json", "rank", [ResultRow("a.c", 1.0, "1", "rank", "simulated")])
    require_own_page(tmp_path, "rank")


def test_a_users_own_study_is_no_demos(study, tmp_path):
    """A folder of the same name as one of the demo's was removed with all that it held."""
    mine = shutil.copytree(study.folder, tmp_path / "lab" / "people")
    with pytest.raises(PellucidError, match="people: found something that no demo made"):
        pl.demo(tmp_path / "lab")
    assert (mine / "recordings" / "sweep.csv").is_file()
    assert not (tmp_path / "lab" / "demo.txt").exists()


def test_a_card_with_a_number_that_is_not_finite_is_refused_in_words(tmp_path):
    inertia = CardParameter("inertia", "kg*m^2", float("nan"), 0.1, (0.0, 1.0))
    card = ModelCard(
        study="bench", family="symmetric", method="ls", motion="rotary", effort_unit="N*m", lifts="flexion",
        parameters=(inertia,), covariance=(), known={}, velocity_range=4.0, drive={"gain": 2.0, "back_emf": 0.0},
        heldout_effort_error=None, processing="none", confidence=0.95, checksums={}, pellucid="0",
    )  # fmt: skip
    with pytest.raises(PellucidError, match=r"joint\.json: found a model with a number that is not finite"):
        write_card(tmp_path / "joint.json", card)
    assert not (tmp_path / "joint.json").exists()
