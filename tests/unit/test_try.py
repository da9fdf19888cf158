"""`try`: a log in, one page out, by the code of `init`, `check` and `identify`."""

import html
import json
import os
import re
import shutil
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import made_layouts
import numpy as np
import pytest
from typer.testing import CliRunner

import pellucid as pl
from pellucid._errors import StudyError, UnfitRecordingError
from pellucid.cli import app
from pellucid.start.assumptions import assumptions_of
from pellucid.start.given_files import read_given
from pellucid.start.propose_study import propose_study
from pellucid.study.answer import QUESTION_WORDS
from pellucid.study.pages.quantities import typeset_sentence
from pellucid.study.procedures.result import HeldOutEffort

FIRST_SCREEN_PX = 800
MAX_SECONDS = 15.0
"""Longest time of `try` on two quiet cores [s]."""

UNSTATED = "measured or simulated (not stated)"


def wall_clock(folder):
    return made_layouts.wall_clock(folder).files


def struct_file(folder):
    return made_layouts.struct_file(folder).files


def unit_row(folder):
    p = made_layouts.swing(20)
    path = folder / "logger.csv"
    body = "\n".join(f"{t:.3f};{q:.5f};{tau:.5f}" for t, q, tau in zip(p["t"], p["q"], p["tau"], strict=True))
    path.write_text(f"Time;knee angle;knee torque\ns;rad;Nm\n{body}\n")
    return (path,)


def two_joints(folder):
    parts = [made_layouts.swing(seed) for seed in (30, 31)]
    heads = ["time_s", "hip_angle_rad", "hip_torque_Nm", "knee_angle_rad", "knee_torque_Nm"]
    columns = [parts[0]["t"], *(p[key] for p in parts for key in ("q", "tau"))]
    path = folder / "legs.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(heads), comments="", fmt="%.7g")
    return (path,)


def run(*arguments):
    return CliRunner().invoke(app, ["try", *map(str, arguments)])


@pytest.fixture(scope="module")
def tried(tmp_path_factory):
    """Return what `try` did with a layout, once for all tests: its folder, its files and what it printed."""

    @cache
    def tried(make):
        folder = tmp_path_factory.mktemp(make.__name__)
        files = make(folder)
        done = run(*files, "--out", folder / "out")
        assert done.exit_code == 0, done.output
        return folder, files, done.output

    return tried


@pytest.mark.parametrize(
    "make", [unit_row, *(pytest.param(m, marks=pytest.mark.nightly) for m in (wall_clock, struct_file)), two_joints]
)
def test_a_log_gives_what_init_check_and_identify_give(tried, make):
    folder, files, said = tried(make)
    name = files[0].stem
    assert f"Page: {folder / 'out' / 'index.html'}" in said
    assert f"Next: pellucid init {name} --from {files[0]}" in said
    assert "assumed worn: no. " in said
    # The same figures as the three commands write.
    for command in (["init", folder / name, "--from", *files, "--yes"], ["identify", folder / name]):
        assert CliRunner().invoke(app, list(map(str, command))).exit_code == 0
    here, alone = (json.loads((where / "results.json").read_text())["figures"]
                   for where in (folder / "out" / name, folder / name))  # fmt: skip
    assert here == alone
    page = (folder / "out" / "index.html").read_text()
    for row in here:
        if found := re.fullmatch(rf"{name}\.(?:(\w+)\.)?headline\.heldout\.effort_error", row["id"]):
            assert f"{row['value']:.3g}"[:4] in page, found
    assert not (folder / "out" / name / "proposal").exists()
    # Nothing on the first screen told which columns were used for what.
    basis = html.unescape(page.partition("Columns used: ")[2].partition("</p>")[0])
    for line in re.findall(r"^  (\S.* -> .*)", said, re.MULTILINE):
        assert line.split(" -> ")[0] + " as " in basis


def test_the_temporary_folder_stays_and_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    done = run(*unit_row(tmp_path), "--answer", "worn=yes")
    page = Path(re.search(r"^Page: (.*)$", done.output, re.MULTILINE)[1])
    assert page.is_file()
    assert page.parent.parent == tmp_path
    assert "assumed worn" not in done.output
    assert "--answer worn=yes" in done.output


def test_figures_that_scale_with_a_default_say_that_it_is_not_confirmed(tmp_path):
    """The prediction within 20 % does not depend on the scale; 48 N*m of the drive stood there as 100 N*m."""
    p = made_layouts.swing(20)
    path = tmp_path / "log.csv"
    table = np.column_stack([p["t"], p["q"], p["tau"]])
    np.savetxt(path, table, delimiter=",", header="time [s],angle [rad],actuator_torque", comments="", fmt="%.6g")
    done = run(path, "-q", "--out", tmp_path / "open")
    said = done.output
    assert done.exit_code == 0
    assert "Yes (scale not confirmed). The" in said
    # Sentences ran beyond the terminal; a line with a command stays whole.
    long = [line for line in said.splitlines() if len(line) > 80 and not line.startswith("Page: ")]
    assert [line for line in long if "pellucid try" not in line and "pellucid init" not in line] == []
    scale = "no file states the scale of the parameters; assumed: effort column = torque in N·m."
    assert scale in " ".join(said.split())
    step = f"Confirm or correct the scale (effort column): pellucid try {path} --answer 'effort=torque in N*m'\n"
    assert step in said  # it ends with the command, so that it can be copied
    first = following_of(tmp_path / "open" / "index.html")[0]
    assert html.unescape(first) == step.strip()
    assert "Yes (scale not confirmed)" in first_screen(tmp_path / "open" / "index.html")
    said = run(path, "-q", "--answer", "effort=torque in N*m").output
    assert "Yes. The" in said


def test_a_step_that_confirms_a_scale_says_how_the_numbers_were_read(tmp_path):
    """Counts of 0.00269 A were read as such, while the step asked to confirm a "current in A"."""
    p = made_layouts.swing(20)
    heads = "Realtime Tick,Present Position,Present Velocity,Present Current,Goal Position"
    columns = [
        np.round(1e3 * p["t"]), np.round(4096 * p["q"] / (2 * np.pi)) + 2048,
        np.round(np.gradient(p["q"], p["t"]) * 30 / np.pi / 0.229), np.round(p["tau"] / 0.00269),
        np.round(4096 * p["q"] / (2 * np.pi)) + 2050,
    ]  # fmt: skip
    said = run(table_file(tmp_path, heads, columns), "-q").output
    step = next(line for line in said.splitlines() if line.startswith("Confirm or correct"))
    assert 'one count of "Present Current" is already read as 0.00269 A (Dynamixel X series' in step
    assert step.endswith("--answer 'effort=current in 0.00269 A'")


def test_a_motor_s_turns_become_the_joint_s(tmp_path):
    """A motor's position of 50 rad was modelled as a joint's, and the answer with its gear was refused."""
    p = made_layouts.swing(21)
    path = tmp_path / "log.csv"
    table = np.column_stack([p["t"], 40.0 * p["q"], p["tau"]])
    np.savetxt(path, table, delimiter=",", header="time [s],motor_pos_rad,torque [Nm]", comments="", fmt="%.6g")
    with pytest.raises(StudyError, match="gear_turns"):
        CliRunner().invoke(app, ["try", str(path), "-q"], catch_exceptions=False)
    turned = json.loads(run(path, "-q", "--answer", "gear_turns=40", "--json").output)
    table[:, 1] /= 40.0
    np.savetxt(path, table, delimiter=",", header="time [s],pos_rad,torque [Nm]", comments="", fmt="%.7g")
    plain = json.loads(run(path, "-q", "--json").output)
    inertia = [next(row["value"] for row in each["figures"] if row["id"].endswith("headline.inertia"))
               for each in (turned, plain)]  # fmt: skip
    assert inertia[0] == pytest.approx(inertia[1], rel=1e-3)


def table_file(folder, head, columns):
    path = folder / "log.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.7g")
    return path


def headline(*arguments):
    """Return the figures of the headline that `try` prints as JSON, by their last word."""
    figures = json.loads(run(*arguments, "-q", "--json").output)["figures"]
    return {row["id"].rpartition(".")[2]: row["value"] for row in figures if ".headline." in row["id"]}


def test_a_force_on_a_joint_that_turns_needs_its_lever(tmp_path):
    """1 N of a load cell counted as 1 N*m, with "Yes"."""
    p = made_layouts.swing(23)
    path = table_file(tmp_path, "time [s],knee_deg,loadcell_N", [p["t"], np.degrees(p["q"]), p["tau"] / 0.25])
    with pytest.raises(StudyError, match="lever_arm"):
        CliRunner().invoke(app, ["try", str(path), "-q"], catch_exceptions=False)
    by_force = headline(path, "--answer", "lever_arm=0.25 m")
    path = table_file(tmp_path, "time [s],knee_deg,torque_Nm", [p["t"], np.degrees(p["q"]), p["tau"]])
    assert by_force["inertia"] == pytest.approx(headline(path)["inertia"], rel=1e-3)


def test_degrees_in_a_column_named_radians_are_asked_for(tmp_path):
    """A joint that went to and fro by 43 "rad" was said to turn on and on, and its gravity became a spring."""
    p = made_layouts.swing(24)
    path = table_file(tmp_path, "time [s],q_rad,tau_Nm", [p["t"], np.degrees(p["q"]), p["tau"]])
    proposal = propose_study(read_given([path]), "made")
    assert "position_unit" in [question.key for question in proposal.asked]
    assert run(path, "-q").exit_code != 0


def test_a_gear_in_a_comment_is_the_default_of_a_motor_s_turns(tmp_path):
    """The comment was not read, and the answer 9 was refused: the motor turned less than twice."""
    p = made_layouts.swing(25)
    head = "# AK80-9, gear_ratio: 9, torque_constant: 0.091 Nm/A (motor)\ntime [s],motor_pos_rad,motor_cur_A"
    path = table_file(tmp_path, head, [p["t"], 9.0 * p["q"], p["tau"] / (9.0 * 0.091)])
    proposal = propose_study(read_given([path]), "made")
    assert {question.key: question.default for question in proposal.asked}["gear_turns"] == "9"
    said = run(path, "-q").output
    assert "scale not confirmed" in said
    assert "--answer gear_turns=9" in " ".join(said.split())
    by_motor = headline(path, "--answer", "gear_turns=9")
    path = table_file(tmp_path, "time [s],q_rad,tau_Nm", [p["t"], p["q"], p["tau"]])
    assert by_motor["inertia"] == pytest.approx(headline(path)["inertia"], rel=1e-3)


def test_a_range_is_written_in_the_scale_of_its_unit(tmp_path):
    """position_min was 100 times too far out where the unit was a hundredth of a degree."""
    p = made_layouts.swing(26)
    path = table_file(tmp_path, "time [s],angle_0.01deg,tau_Nm", [p["t"], np.round(100 * np.degrees(p["q"])), p["tau"]])
    said = run(path, "-q", "--out", tmp_path / "out").output
    assert "deg" in said
    assert "position_min" not in (tmp_path / "out" / "log" / "study.toml").read_text()


def test_a_page_prints_answers_that_can_be_pasted():
    """The page lost the underscore of "counts_per_turn=4096"."""
    sentence = "Confirm or correct it: `--answer \"position_unit=rad\"`."
    assert typeset_sentence(sentence) == sentence


def test_a_jittering_clock_that_loses_rows_is_bridged_and_its_comments_are_read(tmp_path):
    """The log was refused with words on a study.toml that did not exist, and its encoder's bits were not read."""
    rng = np.random.default_rng(5)
    p = made_layouts.swing(22)
    steps = np.median(np.diff(p["t"]))
    time = 1e6 * (p["t"] + 0.03 * steps * rng.standard_normal(len(p["t"])))
    counts = np.floor(16384 * p["q"] / (2 * np.pi)) + 8000
    kept = rng.random(len(time)) > 0.01
    rows = np.column_stack([time, counts, 1000 * p["tau"] / 0.12])[kept]
    path = tmp_path / "log.csv"
    comments = "# torque constant 0.12 Nm/A\n# encoder AS5048, 14 bit absolute\ntimestamp_us,enc_counts,i_mA"
    np.savetxt(path, rows, delimiter=",", header=comments, comments="", fmt="%.0f")
    proposal = propose_study(read_given([path]), "made")
    assert proposal.drive_facts["torque_constant"].value == pytest.approx(0.12)
    (question,) = [q for q in proposal.asked if q.key == "counts_per_turn"]
    assert question.default == "16384"
    done = run(path, "-q")
    assert done.exit_code == 0, done.output
    done = run(path, "-q", "--answer", "counts_per_turn=16384")
    assert done.exit_code == 0, done.output


def test_json_has_columns_assumptions_and_figures(tmp_path):
    done = run(*unit_row(tmp_path), "--json", "-q")
    table = json.loads(done.output)
    assert {"column": "knee angle", "role": "position", "unit": "rad", "certain": True} in table["columns"]
    assert [each["joint"] for each in table["held_out"]] == ["knee"]
    (held,) = table["held_out"]
    assert held["error"] < 5.0 < held["constant_error"]
    figures = {row["id"]: row["value"] for row in table["figures"]}
    assert figures["logger.headline.gravity"] == pytest.approx(1.6, rel=0.05)
    assert figures["logger.headline.heldout.effort_error"] == pytest.approx(held["error"], rel=1e-9)
    assert {"subject", "taken", "why", "question"} == set(table["assumed"][0])


def test_a_log_without_effort_is_refused_in_one_sentence_and_a_page(tmp_path):
    p = made_layouts.swing(20)
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([p["t"], p["q"]]), delimiter=",", header="time_s,q_rad", comments="", fmt="%.6f")
    done = run(path, "--out", tmp_path / "out")
    assert isinstance(done.exception, UnfitRecordingError)
    said = str(done.exception)
    assert said.startswith("log.csv: no study was made: no effort was recorded: ")
    assert "\n" not in said
    page = tmp_path / "out" / "index.html"
    assert done.exception.__notes__ == [f"What was understood: {page}"]
    text = page.read_text()
    assert "No effort was recorded" in text
    assert "q_rad" in text
    shell = subprocess.run(
        [sys.executable, "-m", "pellucid", "init", "s", "--from", path, "--yes"],
        capture_output=True, text=True, cwd=tmp_path, env={**os.environ, "TMPDIR": str(tmp_path)},
    )  # fmt: skip
    assert shell.returncode == 1
    reason, where = shell.stderr.splitlines()[-2:]
    assert reason.startswith("pellucid: s: no study was made: no effort was recorded: ")
    assert Path(where.removeprefix("What was understood: ")).is_file()
    assert not (tmp_path / "s").exists()


def following_of(page):
    """Return the next steps of a page in plain text."""
    listed = page.read_text(encoding="utf-8").partition('id="next"')[2].partition("</div>")[0]
    return [re.sub(r"<[^>]+>", "", each).strip() for each in re.findall(r"<li class=\"step\">(.*?)</li>", listed)]


def test_a_refused_log_has_a_page_with_question_answer_reason_basis_and_next_step(tmp_path):
    """The page was a proposal without a next step."""
    p = made_layouts.swing(20)
    path = table_file(tmp_path, "time_s,q_rad", [p["t"], p["q"]])
    run(path, "--out", tmp_path / "out")
    page = tmp_path / "out" / "index.html"
    text = page.read_text(encoding="utf-8")
    assert "<p class=\"kicker\">Pellucid try</p>" in text
    assert "<h1>log</h1>" in text
    assert "Can a model be identified from these files?" in text
    assert '<span class="badge">No</span> No effort was recorded' in text
    assert "Based on 1 recording in 2 parts, measured or simulated (not stated)." in text
    record, repeat = following_of(page)
    assert record == "Record the effort too, or rename its column, as in &#34;torque [Nm]&#34;."
    assert repeat == f"Then repeat: pellucid try {path}."


def test_a_refusal_for_want_of_an_answer_says_how_to_give_it(tmp_path):
    p = made_layouts.swing(23)
    path = table_file(tmp_path, "time [s],knee_deg,loadcell_N", [p["t"], np.degrees(p["q"]), p["tau"] / 0.25])
    run(path, "--out", tmp_path / "out")
    (answer,) = following_of(tmp_path / "out" / "index.html")
    assert answer.startswith(f"Repeat the command with the correct value: pellucid try {path} --answer")
    assert "lever_arm=0.3 m" in answer
    done = run(path, "--answer", "colour=red", "--out", tmp_path / "unknown")
    assert done.exit_code != 0
    assert following_of(tmp_path / "unknown" / "index.html")


@pytest.mark.parametrize("value", [0.0, -0.0, 0.25])
def test_a_constant_effort_is_named_and_not_missing(tmp_path, value):
    """It was said that no column holds a torque."""
    p = made_layouts.swing(20)
    path = table_file(tmp_path, "time [s],q [rad],knee torque [Nm]", [p["t"], p["q"], np.full(len(p["q"]), value)])
    done = run(path, "--out", tmp_path / "out")
    told = f'the effort was not measured: "knee torque [Nm]" ({value:zg} in every row) never changes'
    assert told in str(done.exception)
    first = following_of(tmp_path / "out" / "index.html")[0]
    assert first == "Record again with the sensor or the drive connected."


@pytest.mark.parametrize(
    ("head", "said"),
    [("# simulated with MuJoCo\n", "simulated"), ("# not simulated\n", UNSTATED), ("", UNSTATED)],
)
def test_a_log_is_called_simulated_where_it_says_so_and_measured_nowhere(tmp_path, head, said):
    """A simulated log was called measured, and its two parts were two recordings."""
    p = made_layouts.swing(20)
    path = table_file(tmp_path, f"{head}time [s],q [rad],torque [Nm]", [p["t"], p["q"], p["tau"]])
    printed = run(path, "-q", "--out", tmp_path / "out").output
    basis = f"Based on 1 recording in 2 parts, {said}; numbers are of held-out data: 1 of 2 parts."
    assert basis in " ".join(printed.split())
    assert basis in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert ("simulated = true" in (tmp_path / "out" / "log" / "study.toml").read_text()) == (said == "simulated")


def test_files_without_a_table_are_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing here\n")
    done = run(tmp_path / "notes.txt")
    assert "found no table of numbers in 1 file: notes.txt" in str(done.exception)
    done = run(tmp_path / "gone.csv")
    assert "gone.csv: no such file, expected a recording" in str(done.exception)
    done = run(*unit_row(tmp_path), "--answer", "worn")
    assert 'try: found --answer "worn", expected KEY=VALUE' in str(done.exception)
    done = run(*unit_row(tmp_path), "--answer", "colour=red", "--out", tmp_path / "out")
    assert "found an answer to colour, expected answers to worn, angle_zero alone" in str(done.exception)
    assert done.exception.__notes__ == [f"What was understood: {tmp_path / 'out' / 'index.html'}"]
    assert "knee torque" in (tmp_path / "out" / "index.html").read_text()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").write_text("")
    done = run(*unit_row(tmp_path), "--out", tmp_path / "full")
    assert "expected a new or empty folder" in str(done.exception)


def test_a_model_that_fails_ends_with_status_1_and_one_sentence(tmp_path):
    # The effort of a spring that somebody turns has nothing of a joint's inertia.
    p = made_layouts.swing(20)
    tau = 0.3 * np.random.default_rng(3).standard_normal(len(p["q"]))
    path = tmp_path / "log.csv"
    table = np.column_stack([p["t"], p["q"], tau])
    np.savetxt(path, table, delimiter=",", header="time [s],q [rad],tau [Nm]", comments="", fmt="%.6f")
    shell = subprocess.run(
        [sys.executable, "-m", "pellucid", "try", path, "--out", tmp_path / "out", "-q"], capture_output=True, text=True
    )
    assert shell.returncode == 1
    (said,) = shell.stderr.splitlines()
    assert said.startswith("pellucid: cannot say: the fit failed: ")
    assert (tmp_path / "out" / "index.html").is_file()


def test_every_default_and_every_guessed_line_is_an_assumption(tmp_path):
    layout = made_layouts.commanded_motor(tmp_path)
    proposal = propose_study(read_given(layout.files), "made")
    text = """\
# Lines marked GUESS are not decided by the files; lines marked
# angle_zero: GUESS, not asked: Does the joint hang at 0? Taken: not certain.
[rig]
motion = "rotary"  # GUESS
[channels]
time = { rate = "100 Hz" }  # GUESS: no file states a rate
position.knee = { column = "q", unit = "deg" }  # GUESS: its name says position
torque = { column = "tau", unit = "N*m" }  # the file states it
# GUESS: the spectrum falls to its floor at 4.3 Hz; above it,
#   quanta outweigh motion (the page shows the spectrum).
lowpass = "4.3 Hz"
order = 4
"""
    found = assumptions_of(proposal, text)
    asked = [each for each in found if each.is_question]
    assert [each.subject for each in asked] == [q.key for q in (*proposal.asked, *proposal.marked)]
    assert [(each.subject, each.taken) for each in found if not each.is_question] == [
        ("motion", "rotary"),
        ("time", "100 Hz"),
        ("position.knee", '"q" [deg]'),
        ("lowpass", "4.3 Hz"),
    ]
    assert found[-1].sentence == (
        "lowpass: 4.3 Hz. The spectrum falls to its floor at 4.3 Hz; above it, quanta outweigh motion."
    )


def test_the_baseline_is_the_best_constant_effort():
    measured = np.array([1.0, 2.0, 3.0])
    held = HeldOutEffort("", "N*m", np.arange(3.0), measured, np.array([1.0, 2.0, 4.0]))
    assert held.error == pytest.approx(100.0 / np.sqrt(14.0))
    assert held.constant_error == pytest.approx(100.0 * np.sqrt(2.0 / 14.0))
    assert np.isnan(HeldOutEffort("", "N*m", np.arange(2.0), np.zeros(2), np.ones(2)).error)


def first_screen(page):
    """Return the text that a browser of 1100 by 800 pixels shows of a page before anything is scrolled."""
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium") or pytest.skip("no browser: chromium is not installed")
    script = """most => {
      const found = [];
      const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
      while (walk.nextNode()) {
        const range = document.createRange();
        range.selectNodeContents(walk.currentNode);
        const box = range.getBoundingClientRect();
        if (box.height > 0 && box.bottom <= most && box.right <= 1100) found.push(walk.currentNode.textContent.trim());
      }
      return found.join(" ").replace(/\\\\s+/g, " ");
    }"""
    with playwright.sync_playwright() as browsers:
        browser = browsers.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        opened = browser.new_page(viewport={"width": 1100, "height": FIRST_SCREEN_PX})
        opened.goto(page.as_uri())
        text = opened.evaluate(script, FIRST_SCREEN_PX)
        browser.close()
    return text


def require_first_screen(page, table):
    """Require that the first screen names joints, parameters with intervals, errors on held-out data, assumptions."""
    text = first_screen(page)
    assert "held-out data" in text
    for held in table["held_out"]:
        assert held["joint"] in text
    assert re.search(r"\d to −?\d|± \d", text), text
    assert "Assumed" in text
    for each in table["assumed"][:4]:
        assert QUESTION_WORDS.get(each["subject"], each["subject"])[:30] in text, each


@pytest.mark.parametrize(("make", "joints"), [(unit_row, ["knee"]), (two_joints, ["hip", "knee"])])
def test_the_first_screen_has_the_answer(tried, make, joints):
    folder, _, said = tried(make)
    subjects = re.findall(r"^ *assumed (.+?): ", said, re.MULTILINE)
    assert {"worn", "lowpass"} <= set(subjects)
    table = {"held_out": [{"joint": each} for each in joints], "assumed": [{"subject": each} for each in subjects]}
    require_first_screen(folder / "out" / "index.html", table)


def test_several_joints_are_told_that_a_urdf_gives_one_model(tmp_path):
    (file,) = two_joints(tmp_path)
    done = run(file, "--out", tmp_path / "out", "-q")
    wanted = f"pellucid try {file} --urdf ROBOT.urdf"
    assert wanted in " ".join(done.output.split())
    page = tmp_path / "out" / "index.html"
    assert "--urdf ROBOT.urdf" in first_screen(page)
    # The assumptions take no table beside that of the joints.
    text = page.read_text(encoding="utf-8")
    assumed = text.partition('id="assumed-first"')[2].partition("</section>")[0]
    assert "<table" not in assumed
    assert "worn: no" in assumed


def test_a_single_joint_needs_no_urdf(tmp_path):
    done = run(*unit_row(tmp_path), "--out", tmp_path / "out", "-q")
    assert "--urdf" not in done.output


@pytest.fixture(scope="module")
def given_layouts(data_folder, tmp_path_factory):
    """Folders of the given layouts, written by the program that knows them."""
    program = data_folder.parent / "cases" / "layouts" / "make_layouts.py"
    if not program.is_file():
        pytest.skip("the given layouts are not on this machine")
    folder = tmp_path_factory.mktemp("layouts")
    done = subprocess.run(
        [sys.executable, program.name, folder, "--set", "given"], cwd=program.parent, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return sorted(path.parent for path in folder.glob("*/truth.json"))


@pytest.mark.nightly
@pytest.mark.slow
def test_every_given_layout_is_tried(given_layouts, tmp_path):
    late, wrong = [], []
    for folder in given_layouts:
        truth = json.loads((folder / "truth.json").read_text())
        options = [each.replace("{folder}", str(folder)) for each in truth.get("options", [])]
        out = tmp_path / folder.name
        command = [sys.executable, "-m", "pellucid", "try", *(folder / f for f in truth["files"]), *options]
        before, began = os.times(), time.perf_counter()
        done = subprocess.run([*command, "--out", out, "--json", "-q"], capture_output=True, text=True)
        # Time of the processor does not depend on what else the machine does.
        spent = min(time.perf_counter() - began, sum(os.times()[2:4]) - sum(before[2:4]))
        late += [f"{folder.name}: {spent:.1f} s"] if spent > MAX_SECONDS else []
        if truth["outcome"] == "refused" and done.returncode not in (1, 2):
            wrong.append(f"{folder.name}: status {done.returncode}, expected a refusal")
        elif done.returncode == 0:
            require_first_screen(out / "index.html", json.loads(done.stdout))
        elif done.returncode not in (1, 2) or not done.stderr.startswith("pellucid: "):
            wrong.append(f"{folder.name}: status {done.returncode}: {done.stderr}")
    assert not late
    assert not wrong


def test_the_example_log_is_every_tenth_row_of_the_virtual_bench(tmp_path):
    bench = tmp_path / "bench"
    pl.init(bench, rig="bench-joint")
    pl.simulate(bench)
    for example, recording in (("first", "multisine"), ("second", "heldout_multisine")):
        log = pl.read(Path(__file__).parents[2] / "examples" / "elbow" / f"{example}.csv")
        made = pl.read(bench / "recordings" / f"{recording}.csv")
        # Gear ratio times torque constant, in N*m/A.
        columns = (made["time"], np.degrees(made["position"]), 28.0 * 0.060 * made["current"])
        for own, whole in zip(log.values.values(), columns, strict=True):
            assert own == pytest.approx(whole[::10], abs=0.02 * np.abs(whole).max())


def test_a_log_without_parameters_prints_no_empty_table(tmp_path):
    t = np.arange(2000) / 100.0
    rng = np.random.default_rng(2)
    rise = [np.abs(np.sin((2.0 + 0.4 * (k % 2)) * t + k)) * 0.5 + 0.02 * rng.random(len(t)) for k in range(4)]
    heads = ["time [s]", "emg_soleus", "emg_vastus_lateralis", "emg_rectus_femoris", "emg_biceps_femoris_long"]
    path = tmp_path / "envelopes.csv"
    np.savetxt(path, np.column_stack([t, *rise]), delimiter=",", header=",".join(heads), comments="", fmt="%.6f")
    done = run(path, "--out", tmp_path / "out")
    assert "synergies" in done.output
    assert "Parameter" not in done.output


@pytest.mark.parametrize("cell", ["inf", "-inf", "1e300"])
def test_a_cell_that_is_no_measurement_is_a_missing_one(tmp_path, capfd, cell):
    """One such cell ended in a fault of Pellucid's own, after warnings of NumPy."""
    time = 0.002 * np.arange(10001)
    angle = np.rad2deg(0.6 * np.sin(4.0 * time) + 0.3 * np.sin(1.3 * time))
    bend = np.gradient(np.gradient(np.deg2rad(angle), time), time)
    current = 0.015 * bend + 1.5 * np.sin(np.deg2rad(angle))
    rows = [f"{1e3 * t:.0f},{q:.4f},{i:.4f}" for t, q, i in zip(time, angle, current, strict=True)]
    rows[77] = rows[77].replace(rows[77].split(",")[1], cell)
    log = tmp_path / "log.csv"
    log.write_text("time_ms,wrist_angle_deg,motor_current_A\n" + "\n".join(rows) + "\n", encoding="utf-8")
    made = CliRunner().invoke(app, ["try", str(log)])
    assert made.exception is None or isinstance(made.exception, SystemExit)
    assert "fault of Pellucid" not in made.output
    assert "DLASCL" not in capfd.readouterr().out
