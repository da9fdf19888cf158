"""Commands that terminals and pages print: pasted into a shell, each of them runs."""

import html
import re
import shlex
import subprocess
from pathlib import Path

import fabricate
import made_pointing
import numpy as np
import pytest
from typer.testing import CliRunner

from pellucid import cli
from pellucid._printed_command import printed_command
from pellucid.study.drawn_report import ReportPlace
from pellucid.study.procedures.procedure import typed_commands

SOURCES = Path(__file__).parents[2] / "src" / "pellucid"


def pasted(command):
    """Run a command as a shell would split it; return what it printed."""
    output = ""
    for each in command.split(" && "):
        first, *words = shlex.split(each)
        if first != "pellucid":
            done = subprocess.run([first, *words], capture_output=True, text=True, timeout=300, check=False)
            assert done.returncode == 0, f"{each}\n{done.stdout}{done.stderr}"
            continue
        done = CliRunner().invoke(cli.app, words)
        # Where the data cannot answer, a command says so and ends with 1.
        assert done.exit_code == 0 or "cannot say" in done.output, f"{each}\n{done.output}{done.exception}"
        output += done.output
    return output


def told_in(output):
    """Return the command after "Next:" or "with:" in each line of what a terminal showed."""
    return [line[1] for line in re.finditer(r"(?:Next|with|use): ((?:pellucid|make) .*)$", output, re.MULTILINE)]


def told_on(page):
    """Return every command on a page: the text of each element of code that begins with pellucid."""
    found = re.findall(r"<code>(pellucid .*?)</code>", page.read_text(encoding="utf-8"))
    return list(dict.fromkeys(html.unescape(re.sub(r"<[^>]+>", "", each)) for each in found))


def run_all(commands):
    assert commands
    for command in commands:
        pasted(command)


@pytest.mark.parametrize("folder", ["servo", "my servo", "anna's $HOME", "-servo", "a;b", "ünder"])
def test_a_folder_is_one_word_of_the_shell(folder):
    first, name, *rest = shlex.split(printed_command("export", folder, "--participant", "Anna B"))
    assert (first, name, rest[1:]) == ("pellucid", "export", ["--participant", "Anna B"])
    assert rest[0] == (f"./{folder}" if folder.startswith("-") else folder)
    shown = subprocess.run(["sh", "-c", f"printf %s {shlex.quote(rest[0])}"], capture_output=True, check=True)
    assert shown.stdout.decode() == rest[0]


def test_several_commands_are_one_line():
    assert typed_commands(["identify", "assess"], "a b") == "pellucid identify 'a b' && pellucid assess 'a b'"
    # The hidden name of earlier versions was printed.
    assert typed_commands(["onset", "emg-force"], "a") == "pellucid emg onset a && pellucid emg force a"


def test_no_message_makes_its_own_command_of_a_folder():
    """A command with something filled in comes from `printed_command`, which quotes it."""
    own = re.compile(r"pellucid [a-z-]+ [^.\"'`\n]*\{(?!dataset\.name)")
    found = [
        f"{path.relative_to(SOURCES)}: {line.strip()}"
        for path in SOURCES.rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if own.search(line)
    ]
    assert not found


def test_what_a_joint_s_commands_and_pages_print_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_joint("one run.csv")
    write_joint("another.csv", seed=2)
    output = pasted(
        printed_command(
            "init", "my arm; 1", "--from", "one run.csv", "another.csv", "--yes", "--answer", "angle_zero=yes"
        )
    )
    assert told_on(next(Path("my arm; 1").glob("*/index.html"))) == ["pellucid check 'my arm; 1'"]
    names = []
    while "Report:" not in output:
        (following,) = told_in(output)
        names.append(shlex.split(following)[1])
        output = pasted(following)
    assert names == ["identify", "report"]
    commands = told_on(Path("my arm; 1/report/index.html"))
    assert commands == ["pellucid export 'my arm; 1'"]
    run_all(commands)


def test_what_pages_of_people_print_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made_pointing.study(tmp_path / "people of May", participants=3)
    refused = CliRunner().invoke(cli.app, ["report", "people of May"])
    assert refused.exit_code != 0
    run_all(told_in(str(refused.exception)))
    pasted(printed_command("report", "people of May"))
    commands = told_on(tmp_path / "people of May" / "report" / "index.html")
    assert {"pellucid assess 'people of May'", "pellucid check 'people of May'"} >= set(commands) != set()
    run_all(commands)


def test_a_page_does_not_ask_for_margins_that_are_stated(tmp_path, monkeypatch):
    """One person's session: nothing can be certified yet, and that is no lack of margins."""
    monkeypatch.chdir(tmp_path)
    made_pointing.study(
        tmp_path / "first", participants=1, more='[assessment.margins]\nduration_median = "15 %"\nvmax = "15 %"'
    )
    pasted("pellucid assess first && pellucid report first")
    page = (tmp_path / "first" / "report" / "index.html").read_text(encoding="utf-8")
    step, again = re.findall(r'<li class="step">(.*?)</li>', page, re.DOTALL)
    assert "with two or more participants" in step
    assert "assessment.margins" not in step
    assert "<code>pellucid assess first</code>" in again


def test_a_report_names_the_folder_as_it_is_given_now(tmp_path, monkeypatch):
    """A report that was drawn is not kept where its commands name the folder in another way."""
    monkeypatch.chdir(tmp_path)
    fit = fabricate.fit(samples=300, families=("symmetric",))
    study = fabricate.study(tmp_path / "bench of ours", fit)
    page = study.report_dir / "index.html"
    place, other = ReportPlace(study.folder), ReportPlace(Path("bench of ours"))
    page.parent.mkdir()
    page.write_text("drawn")
    place.note_drawn(page, ["Report"], study.files(), with_pdf=False)
    assert place.drawn_lines(with_pdf=False) == ("Report",)
    assert other.drawn_lines(with_pdf=False) == ()


def test_what_an_audit_s_page_prints_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_joint("one run.csv")
    pasted("pellucid audit 'one run.csv'")
    commands = told_on(tmp_path / "audit-page" / "index.html")
    assert commands == ["pellucid init my-study --from 'one run.csv'"]
    run_all([f"{command} --yes" for command in commands])


def write_joint(path, seed=1):
    t = np.arange(0.0, 20.0, 0.01)
    rng = np.random.default_rng(seed)
    q = 0.8 * np.sin(1.3 * t + seed) + 0.3 * np.sin(4.1 * t)
    v = np.gradient(q, t)
    tau = 0.05 * np.gradient(v, t) + np.sin(q) + 0.2 * v + 0.3 * np.tanh(v / 0.01)
    tau += 0.01 * rng.standard_normal(len(t))
    rows = (f"{a:.3f},{b:.6f},{c:.6f}" for a, b, c in zip(t, q, tau, strict=True))
    Path(path).write_text("\n".join(["time [s],q [rad],tau [N*m]", *rows]) + "\n")
