"""The command line: each command calls its function, prints what fits a terminal, and fails in one sentence."""

import json
import re
import shlex
import sys
from dataclasses import replace
from types import SimpleNamespace

import fabricate
import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

import pellucid
from pellucid import cli
from pellucid._errors import DatasetError
from pellucid.files.fault import Fault
from pellucid.joint.study.joint_result import complete_result
from pellucid.models.estimates import Verdict
from pellucid.study import terminal
from pellucid.study.answer import Answer, Step
from pellucid.study.procedures.command import HELP_GROUPS
from pellucid.study.procedures.print_result import print_result
from pellucid.study.procedures.procedure import procedure_commands, typed_command
from pellucid.study.procedures.result import FigureTable, Result

run = CliRunner().invoke


@pytest.fixture(scope="module")
def fit():
    return fabricate.fit(samples=300, families=("symmetric", "directional", "load", "stribeck", "combined"))


@pytest.fixture
def bench(fit, tmp_path, monkeypatch):
    """A study whose identification is known beforehand."""
    study = fabricate.study(tmp_path / "bench", fit)
    asked = []

    def identify(study, tell, *, families=None, thorough=True):
        asked.append(families)
        tell("halfway", 0.5)
        return complete_result(study, fit)

    monkeypatch.setattr("pellucid.joint.study.identify_joint.identify_joint", identify)
    return SimpleNamespace(folder=study.folder, asked=asked)


def as_program(monkeypatch, capsys, *arguments):
    """Exit status, output and errors of ``pellucid ARGUMENTS``."""
    monkeypatch.setattr(sys, "argv", ["pellucid", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    out, err = capsys.readouterr()
    return stopped.value.code, out, err


def test_version():
    assert run(cli.app, ["--version"]).output == f"pellucid {pellucid.__version__}\n"


def test_help_names_every_command_on_one_line_each():
    text = run(cli.app, ["--help"]).output
    commands = ("init", "simulate", "check", "identify", "calibrate", "assess", "report", "compare", "demo")
    for command in (*commands, "reproduce", "export"):
        assert f"\n  {command} " in text
    commands = text[text.index(f"{HELP_GROUPS[0]}:") :]
    assert "..." not in commands
    assert [line[:-1] for line in commands.splitlines() if line.endswith(":")] == list(HELP_GROUPS)
    assert run(cli.app, ["-h"]).output == text


def every_command() -> list[tuple[str, object]]:
    """Return the commands, and those of groups, with what is typed before their arguments; aliases are left out."""
    made = typer.main.get_command(cli.app)
    groups = ("datasets", "emg")
    aliases = {command.name for command in procedure_commands() if len(command.words) > 1} | {"help"}
    listed = [(name, made.get_command(None, name)) for name in made.commands if name not in {*groups, *aliases}]
    inner = [(f"{group} {name}", found) for group in groups for name, found in made.commands[group].commands.items()]
    return listed + inner


@pytest.mark.parametrize(("name", "command"), every_command(), ids=[name for name, _ in every_command()])
def test_every_command_has_an_example_that_it_understands(name, command):
    line = command.epilog.splitlines()[0].removeprefix("Example: pellucid ")
    assert line.startswith(name)
    command.make_context(name, shlex.split(line)[len(name.split()) :])  # raises if an argument is not understood
    help_text = run(cli.app, [*name.split(), "-h"]).output
    assert max(len(row) for row in help_text.splitlines()) <= 80
    assert "Example: pellucid" in help_text


def test_notes_are_few_unless_they_are_asked_for(bench, monkeypatch):
    notes = [SimpleNamespace(severity="note", kind=f"kind {k}", channel="", message=f"note {k}.") for k in range(20)]
    monkeypatch.setattr("pellucid.study.procedures.run.check", lambda study, **_: notes)
    command = ["check", str(bench.folder)]
    usual, verbose, quiet = (run(cli.app, [*command, *asked]).output for asked in ([], ["-v"], ["-q"]))
    assert usual.count("note ") == 6
    assert "and 14 further notes, which -v prints" in usual
    assert verbose.count("note ") == 20
    assert "note " not in quiet
    assert "fit to be used by identify?\nYes. " in quiet


def test_check_prints_json(bench, monkeypatch):
    fault = Fault("refuse", "frozen", "bench.csv", "position", "40 frozen samples", "none", "bench.csv: frozen")
    monkeypatch.setattr("pellucid.study.procedures.run.check", lambda study, **_: [fault])
    result = run(cli.app, ["check", str(bench.folder), "--json"])
    assert result.exit_code == 1
    assert json.loads(result.stdout)["faults"][0]["found"] == "40 frozen samples"


def test_identify_prints_what_was_found(bench, fit):
    result = run(cli.app, ["identify", str(bench.folder)])
    assert result.exit_code == 0, result.output
    lines = result.output.splitlines()
    # Paths alone may be longer than a terminal.
    assert max(len(line) for line in lines if str(bench.folder) not in line) <= 80
    for p in fit.families[fit.best].estimate.parameters:
        assert p.name in result.output
    for family in fit.families:
        assert family in result.output
    assert "results.json" in result.output
    assert f"pellucid report {bench.folder}" in result.output
    assert (bench.folder / "models" / "joint.json").is_file()


def test_identify_exits_1_where_its_figures_describe_nothing(fit, tmp_path, monkeypatch, capsys):
    """ "The fit failed" stood there, and a script went on with status 0."""
    study = fabricate.study(tmp_path / "bench", fit)
    failed = replace(fit, verdicts=(Verdict("wrong", "The fit failed: it explains nothing. More words."),))
    monkeypatch.setattr(
        "pellucid.joint.study.identify_joint.identify_joint", lambda study, tell, **_: complete_result(study, failed)
    )
    status, out, err = as_program(monkeypatch, capsys, "identify", study.folder)
    assert status == 1
    assert "the fit failed: it explains nothing." in " ".join(err.split())
    assert "More words" not in err
    assert f"Next: pellucid check {study.folder}" in " ".join(out.split())
    assert "Cannot say. Correct this first: the fit failed: it explains nothing." in " ".join(out.split())
    assert (study.folder / "results.json").is_file()


def test_the_widest_table_fits_80_columns(bench, fit, monkeypatch):
    """The richest family, with the longest names and units."""
    widest = fabricate.fit(samples=300, motion="rotary", families=("combined",), seed=3)
    monkeypatch.setattr(
        "pellucid.joint.study.identify_joint.identify_joint",
        lambda study, *_, **__: complete_result(study, widest),
    )
    folder = fabricate.study(bench.folder.parent / "rotary", widest).folder
    result = run(cli.app, ["identify", str(folder)])
    assert result.exit_code == 0, result.output
    assert "stribeck_velocity" in result.output
    assert "…" not in result.output
    assert max(len(line) for line in result.output.splitlines() if str(folder) not in line) <= 80


def test_families_can_be_chosen(bench):
    run(cli.app, ["identify", str(bench.folder), "--family", "load", "--family", "symmetric"])
    run(cli.app, ["identify", str(bench.folder)])
    assert bench.asked == [["load", "symmetric"], None]


def test_identify_prints_json(bench, fit):
    result = run(cli.app, ["identify", str(bench.folder), "--json"])
    rows = {row["id"]: row for row in json.loads(result.stdout)["figures"]}
    assert rows["bench.symmetric.inertia"]["value"] == pytest.approx(fit.families["symmetric"]["inertia"].value)
    assert rows["bench.symmetric.inertia"]["unit"] == "kg"


@pytest.mark.slow
def test_report_says_where_it_is(bench):
    run(cli.app, ["identify", str(bench.folder)])
    result = run(cli.app, ["report", str(bench.folder)])
    assert result.exit_code == 0, result.output
    assert f"Report: {bench.folder / 'report' / 'index.html'}" in result.output
    assert (bench.folder / "report" / "index.html").is_file()
    assert len(bench.asked) == 1  # what was kept is drawn: nothing is identified again


@pytest.mark.slow
def test_report_reads_no_recording_of_what_is_kept(bench, monkeypatch):
    run(cli.app, ["identify", str(bench.folder)])

    def read(path):
        raise AssertionError(f"{path} is read again")

    with monkeypatch.context() as patch:
        patch.setattr("pellucid.files.readers.read_columns", read)
        assert run(cli.app, ["report", str(bench.folder)]).exit_code == 0
    recording = next((bench.folder / "recordings").iterdir())
    recording.write_text(recording.read_text() + "\n", encoding="utf-8")
    stale = run(cli.app, ["report", str(bench.folder)])
    assert stale.exit_code != 0
    assert (
        "found no up-to-date results (not run yet, or run by other versions of Pellucid or its libraries, with other "
        f"settings or on other recordings); compute them with: pellucid identify {bench.folder}"
    ) in str(stale.exception)
    assert len(bench.asked) == 1  # no longer fresh: it says what to do, and computes nothing


def _joined(text):
    return " ".join(text.split())


def test_check_exits_1_where_recordings_are_not_fit(bench, monkeypatch):
    assert run(cli.app, ["check", str(bench.folder)]).exit_code == 0
    fault = Fault("refuse", "frozen", "bench.csv", "position", "40 frozen samples", "none",
                  "bench.csv: channel position: found 40 frozen samples")  # fmt: skip
    address = "https://example.org/" + "x" * 90
    note = SimpleNamespace(severity="note", kind="jitter", channel="", message=f"bench.csv: jitter {address}")
    monkeypatch.setattr("pellucid.study.procedures.run.check", lambda study, **_: [note])
    result = run(cli.app, ["check", str(bench.folder)])
    assert result.exit_code == 0
    assert "jitter" in result.output
    assert address in "".join(line.strip() for line in result.output.splitlines())
    monkeypatch.setattr("pellucid.study.procedures.run.check", lambda study, **_: [note, fault])
    result = run(cli.app, ["check", str(bench.folder)])
    assert result.exit_code == 1
    assert "frozen" in result.output
    assert "No. 1 fault prevents their use: position of bench.csv (40 frozen samples)." in _joined(result.output)
    assert "Next: pellucid" not in result.output  # it would end with status 1


def test_check_says_first_what_is_not_as_what_is_to_be_fitted(bench, monkeypatch):
    note = SimpleNamespace(severity="note", kind="hum", channel="emg.a", message="walk.csv: hum")
    changed = SimpleNamespace(
        severity="warn",
        kind="changed_channel",
        channel="emg.soleus",
        file="walk.csv",
        message="walk.csv: a floor of 0.06",
    )
    monkeypatch.setattr("pellucid.study.procedures.run.check", lambda study, **_: [note, changed])
    result = run(cli.app, ["check", str(bench.folder)])
    assert result.exit_code == 0
    assert "All 2 recordings can be used; see the warnings on emg.soleus of walk.csv." in _joined(result.output)
    assert result.output.index("floor") < result.output.index("hum")


def test_compare_marks_what_changed(bench, monkeypatch):
    def row(name, a, b, p):
        return SimpleNamespace(
            name=name, unit="N*m*s/rad", a=a, b=b, standard_error=0.01, z=0.0, p_value=p, changed=p < 0.05
        )

    found = SimpleNamespace(
        family="symmetric",
        rows=(row("viscous", 0.2, 0.4, 1e-9), row("coulomb", 0.5, 0.5, 0.9)),
        answer=Answer("Did it change?", "yes", "it did", next=(Step("Compare again", line="pellucid compare A B"),)),
    )
    monkeypatch.setattr("pellucid.study.procedures.compare.compare", lambda a, b, **options: found)
    result = run(cli.app, ["compare", "A", "B"])
    assert result.exit_code == 0, result.output
    by_name = {line.split()[0]: line for line in result.output.splitlines() if line.strip()}
    assert "changed" in by_name["viscous"]
    assert "<0.001" in by_name["viscous"]
    assert "changed" not in by_name["coulomb"]
    # Neither a figure nor what it says is cut off in a narrow terminal.
    found.rows[0].name = "viscous_negative_of_a_joint"
    narrow = run(cli.app, ["compare", "A", "B"], env={"COLUMNS": "60"})
    assert max(map(len, narrow.output.splitlines())) <= 60
    assert "changed" in narrow.output
    assert "…" not in narrow.output


def test_identified_studies_compare(bench):
    run(cli.app, ["identify", str(bench.folder)])
    result = run(cli.app, ["compare", str(bench.folder), str(bench.folder)])
    assert result.exit_code == 0, result.output
    assert "No parameter changed" in result.output
    question, basis = result.output.splitlines()[0], " ".join(result.output.split())
    assert question == "Did the joint change from A to B?"
    assert "Based on 2 model cards; numbers are of what each model was fitted to." in basis


def test_demo_prints_its_story(tmp_path, monkeypatch):
    coverage = SimpleNamespace(colour="white", repetitions=200, lowest=94.5, textbook=94.0)
    page = tmp_path / "demo" / "index.html"
    made = SimpleNamespace(page=page, coverages=(coverage,), notes=("no network",))
    asked = []

    def demo(out, *, on_progress=None):
        asked.append(out)
        return made

    monkeypatch.setitem(sys.modules, "pellucid_lab.demonstration.demo", SimpleNamespace(demo=demo))
    answer = Answer("Does it predict?", "yes", "it errs by 3 %", next=(Step("Try your own", line="pellucid init DIR"),))
    story = SimpleNamespace(
        chapter_sentences=lambda made: [("Worn", "People wore it.")], demonstration_answer=lambda made: answer
    )
    monkeypatch.setitem(sys.modules, "pellucid_lab.demonstration.story", story)
    result = run(cli.app, ["demo", "--out", str(tmp_path / "demo")])
    assert result.exit_code == 0, result.output
    assert asked == [tmp_path / "demo"]
    assert result.output.splitlines()[:2] == ["Does it predict?", "Yes. It errs by 3 %."]
    for said in ("People wore it.", "94.5", "no network", str(page), "Try your own: pellucid init DIR."):
        assert said in result.output


def test_figures_are_whole_in_a_narrow_terminal(capsys):
    """Words make room for them."""
    long = "a method whose name in words is longer than any terminal of eighty columns has room for, and says so"
    table = FigureTable("Errors", ("Method", "RMSE (N*m)", "R2"), ((long, 3.604, 0.847), ("short", 12.35, 0.911)))
    found = Result(study="s", headline="h", tables=(table,), verdicts=(), rows=(), cards={}, checksums={})
    print_result(Console(highlight=False, width=80), found)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    for figure in ("3.60", "0.847", "12.3", "0.911"):
        assert any(figure in line for line in lines)


def test_init_needs_a_data_set(monkeypatch, capsys, tmp_path):
    code, out, err = as_program(monkeypatch, capsys, "init", tmp_path / "new")
    assert code == 2
    assert out == ""
    ways = "--from FILES, --dataset NAME, --rig NAME, --urdf FILE and --session NAME"
    assert err.startswith(f"pellucid: init needs exactly one of {ways}; datasets: ")
    code, _, err = as_program(monkeypatch, capsys, "init", tmp_path / "new", "--rig", "elbow")
    assert code == 2
    known = "able-arm, able-elbow, bench-joint, elbow-participants, elbow-people, knee-orthosis, knee-participants, "
    known += "knee-seated"
    assert f"unknown rig 'elbow'; known: {known}" in err
    assert not (tmp_path / "new").exists()


def test_init_says_what_comes_next(monkeypatch, fit, tmp_path):
    monkeypatch.setattr(
        "pellucid.study.datasets.init", lambda folder, dataset, progress: fabricate.study(folder, fit), raising=True
    )
    result = run(cli.app, ["init", str(tmp_path / "new"), "--dataset", "some"])
    assert result.exit_code == 0, result.output
    assert "2 recordings" in result.output
    assert f"pellucid check {tmp_path / 'new'}" in result.output


def test_datasets(monkeypatch, tmp_path):
    from pellucid.study import datasets

    def absent(name):
        raise DatasetError(f"{name}: not here")

    monkeypatch.setattr(datasets, "path", absent)
    result = run(cli.app, ["datasets", "list"])
    assert all(name in result.output for name in datasets.names())
    assert max(map(len, result.output.splitlines())) <= 80
    monkeypatch.setattr(datasets, "path", lambda name: tmp_path / name)
    assert run(cli.app, ["datasets", "path", "any"]).output == f"{tmp_path / 'any'}\n"
    monkeypatch.setattr(datasets, "fetch", lambda name, progress: tmp_path / name)
    assert run(cli.app, ["datasets", "fetch", "any"]).output == f"{tmp_path / 'any'}\n"


@pytest.mark.parametrize("command", ["check", "identify", "report"])
def test_a_folder_that_is_no_study_is_one_sentence(command, monkeypatch, capsys, tmp_path):
    code, out, err = as_program(monkeypatch, capsys, command, tmp_path / "nowhere")
    assert code == 2
    assert out == ""
    assert err.startswith("pellucid: ")
    assert "nowhere" in err
    assert "Traceback" not in err


def test_what_the_system_refuses_is_one_sentence(monkeypatch, capsys, bench):
    def refuse(study, **_):
        raise PermissionError(13, "Permission denied", "report/index.html")

    monkeypatch.setattr("pellucid.study.procedures.run.write_report", refuse)
    code, _, err = as_program(monkeypatch, capsys, "report", bench.folder)
    assert (code, err) == (2, "pellucid: Permission denied: report/index.html\n")


def test_progress_is_silent_where_nobody_watches(bench, monkeypatch, capsys):
    _, _, err = as_program(monkeypatch, capsys, "identify", bench.folder)
    assert err == ""


def test_progress_is_shown_on_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with terminal.show_progress() as tell:
        tell("fitting symmetric", 0.4)
    out, err = capsys.readouterr()
    assert out == ""
    assert "fitting symmetric" in err


def test_commands_on_emg_stand_together_and_keep_their_old_names():
    listed = run(cli.app, ["--help"]).output
    assert re.search(r"^  emg ", listed, re.MULTILINE)
    assert not re.search(r"^  (onset|cocontraction|emg-force|synergies) ", listed, re.MULTILINE)
    together = run(cli.app, ["emg", "--help"]).output
    for word, old in (("onset", "onset"), ("cocontraction", "cocontraction"), ("force", "emg-force"),
                      ("synergies", "synergies")):  # fmt: skip
        assert re.search(rf"^  {word} ", together, re.MULTILINE)
        both = [run(cli.app, [*way, "missing"]) for way in (["emg", word], [old])]
        assert str(both[0].exception) == str(both[1].exception)
        assert typed_command(old) == f"emg {word}"


def test_help_of_a_command_is_its_help():
    for words in (["identify"], ["datasets", "list"], ["emg", "force"]):
        asked = run(cli.app, ["help", *words])
        assert asked.exit_code == 0
        body = asked.output.partition("Options:")[2]
        assert body
        assert body == run(cli.app, [*words, "--help"]).output.partition("Options:")[2]
    assert run(cli.app, ["help", "nothing"]).exit_code == 2


@pytest.mark.parametrize("words", [["-q", "datasets", "list"], ["datasets", "list", "-q"]])
def test_quiet_and_verbose_stand_before_a_command_or_behind_it(words):
    assert run(cli.app, words).exit_code == 0
    assert terminal._is_quiet.get()
    run(cli.app, ["datasets", "list"])
    assert not terminal._is_quiet.get()
