"""What a command is given is looked at before it works: a file for a folder, numbers that make no study."""

from importlib import import_module

import pytest
from typer.testing import CliRunner

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.cli import app

prediction, reproduction, demonstration, ranking = map(
    import_module,
    (f"pellucid_lab.{name}" for name in ("predict", "papers.reproduce", "demonstration.demo", "ranking.rank")),
)

ON_A_STUDY = (
    "check", "identify", "calibrate", "assess", "plan", "onset", "cocontraction", "synergies", "activations", "report",
    "export", "simulate", "predict",
)  # fmt: skip


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "swing.csv"
    path.write_text("t,q\n0,0\n")
    return path


@pytest.mark.parametrize("below", [False, True])
@pytest.mark.parametrize("command", ON_A_STUDY)
def test_a_file_where_a_folder_is_expected_is_named(command, below, file):
    given = file / "study" if below else file
    made = CliRunner().invoke(app, [command, str(given)])
    assert isinstance(made.exception, PellucidError)
    assert str(made.exception).startswith(f"{file}: found a file, expected ")


def test_a_study_file_is_not_its_folder(make_study):
    study = make_study()
    with pytest.raises(PellucidError, match=r"study\.toml: found a file, expected a study: the folder with a study"):
        pl.open(study.folder / "study.toml")


def nothing_works(monkeypatch, *places):
    def work(*arguments, **options):
        raise AssertionError("it began to work")

    for module, name in places:
        monkeypatch.setattr(module, name, work)


def test_a_folder_to_write_to_that_is_a_file_is_refused_before_any_work(make_study, file, monkeypatch):
    study = make_study()
    with pytest.raises(PellucidError, match="found a file, expected a folder to write to"):
        pl.open(study.folder, out=file)
    nothing_works(
        monkeypatch, (ranking, "shared_results"), (reproduction, "paper_named"), (demonstration, "_clear_folders")
    )
    for made in (ranking.rank, demonstration.demo, lambda out: reproduction.reproduce("hill", out)):
        with pytest.raises(PellucidError, match="found a file, expected a folder"):
            made(file)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"people": 3}, "found 3 people and 6 participants"),
        ({"people": 0, "participants": 0}, "found 0 people and 0 participants"),
        ({"robots": 0}, "found 0 robots"),
        ({"movements": 3}, "found 3 movements, expected an even number"),
        ({"seed": -1}, "found the seed -1"),
        ({"controllers": ["nothing"]}, 'found no controller "nothing"'),
        ({"load": (-1.0, 0.3)}, "found a load of -1 kg at 0.3 m, expected both above 0"),
        ({"held": (1.0, 0.3), "controllers": ["transparent", "fc"]}, 'found "fc", which carries no load, expected'),
        ({"support": 1.5}, "found a support of 1.5, expected a share above 0, up to 1"),
        ({"support": 0.5, "controllers": ["transparent"]}, 'found transparent with a support, expected "support"'),
    ],
)
def test_a_prediction_of_no_study_is_refused_before_any_work(tmp_path, monkeypatch, given, said):
    folder = tmp_path / "people"
    pl.init(folder, rig="elbow-participants")
    nothing_works(monkeypatch, (prediction, "predict_effects"))
    with pytest.raises(PellucidError, match=said):
        pl.predict(folder, **given)


def test_a_simulation_with_a_seed_below_zero_is_refused(tmp_path):
    pl.init(tmp_path / "joint", rig="bench-joint")
    with pytest.raises(PellucidError, match="found the seed -1, expected 0 or more"):
        pl.simulate(tmp_path / "joint", seed=-1)


@pytest.mark.parametrize("studies", [0, -3])
def test_an_assessment_that_plans_with_no_study_is_refused(make_study, studies):
    with pytest.raises(PellucidError, match=f"found {studies} studies"):
        pl.assess(make_study(), studies=studies)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["reproduce", "nothing"], "unknown paper 'nothing'; known: able"),
        (["audit", "nothing.csv"], "nothing.csv: no such file"),
        (["init", "new", "--dataset", "nothing"], 'no data set "nothing", expected one of emps'),
        (["init", "new", "--rig", "nothing"], "unknown rig 'nothing'; known: "),
        (["init", "new", "--session", "nothing"], "found the session 'nothing', expected one of elbow"),
        (["init", "new", "--rig", "able-elbow", "--dataset", "emps"], "exactly one of --from FILES, "),
        (["init", "new", "--from", "nothing.csv"], "nothing.csv: no such file, expected a recording or a folder"),
        (["compare", "nowhere", "nothing"], "nowhere/models"),
        (["paper", "nowhere"], "nowhere/study.toml: no such file"),
        (["live", "nowhere"], "nowhere/study.toml: no such file"),
        (["certificate", "nowhere"], "nowhere/study.toml: no such file"),
        (["emg-force", "nowhere"], "nowhere/study.toml: no such file"),
        (["export", "nowhere", "--out", "new"], "nowhere/study.toml: no such file"),
        (["rank", "--law", "nothing.py", "--out", "new"], "nothing.py"),
        (["incident", "nothing"], "nothing"),
    ],
)
def test_what_a_command_cannot_use_is_named_before_anything_is_written(arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = CliRunner().invoke(app, arguments)
    assert made.exit_code != 0
    assert said in str(made.exception)
    assert made.output == ""
    assert list(tmp_path.iterdir()) == []


def test_a_check_tells_each_recording_that_it_reads(make_study):
    study, heard = make_study(), []
    pl.check(study, on_progress=lambda text, share: heard.append((text, share)))
    names = [recording.name for recording in study.recordings()]
    assert [text.removeprefix("reading ") for text, _ in heard[1 : 1 + len(names)]] == names
    assert [share for _, share in heard] == sorted(share for _, share in heard)
